#include "offline/inspect/refusals.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "offline/base/degrees.h"
#include "offline/base/text.h"
#include "runtime/plan/request_error.h"
#include "runtime/skeleton/foot_vector.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {
namespace {

// Directions of travel are compared only if the result is farther from the request than this.
constexpr double kMetM = 0.05;

double Horizontal(const DVec3& v) { return std::hypot(v.x, v.z); }

std::string Place(const DVec3& m) { return Text("(%.2f, %.2f, %.2f) m", m.x, m.y, m.z); }

// Returns "0.28 m ahead of" or "0.05 m behind".
std::string AheadText(double length_m) {
  return Text("%.2f m %s", std::fabs(length_m), length_m < -0.005 ? "behind" : "ahead of");
}

class RefusalFinder {
 public:
  RefusalFinder(const SynthesisInput& input, const Synthesis& synthesis)
      : input_(input), synthesis_(synthesis) {}

  std::vector<Refusal> Run() {
    BaseFrame before = input_.start;
    for (const MovementRecord& record : synthesis_.movements) {
      const auto request =
          std::ranges::find(input_.requests, record.request_id, &MovementRequest::id);
      if (request != input_.requests.end()) Check(*request, record, before);
      before = record.base;
    }
    for (const WalkRecord& walk : synthesis_.walks) AddWalk(walk);
    for (const SkippedRequest& skipped : synthesis_.skipped) {
      AddSkipped(skipped);
    }
    std::ranges::stable_sort(refusals_, {}, &Refusal::request_id);
    return std::move(refusals_);
  }

 private:
  void Check(const MovementRequest& request, const MovementRecord& record,
             const BaseFrame& before) {
    if (const auto* step = std::get_if<StepRequest>(&request.movement)) {
      if (!IsStep(record.kind)) return;
      step->at ? CheckFootprint(request.id, *step, record, before)
               : CheckStep(request.id, *step, record, before);
    } else if (const auto* jump = std::get_if<JumpRequest>(&request.movement)) {
      if (record.kind == MovementKind::kJump) CheckJump(request.id, *jump, record, before);
    } else if (std::holds_alternative<StandRequest>(request.movement)) {
      CheckStand(request.id, record);
    }
  }

  [[nodiscard]] ConstPoseSpan PoseAt(double time_s) const {
    const Clip& clip = synthesis_.clip;
    const int frame = static_cast<int>(std::floor(time_s * clip.fps + 1e-6));
    return clip.frame(std::clamp(frame, 0, clip.frame_count() - 1));
  }
  [[nodiscard]] DVec3 BallAt(double time_s, Foot foot) const {
    return DVec3(BallPosition(input_.library->skeleton(), PoseAt(time_s), foot));
  }

  void CheckStep(std::uint64_t id, const StepRequest& step, const MovementRecord& record,
                 const BaseFrame& before) {
    const Foot moving = MovingFoot(record.kind);
    const double outward = moving == Foot::kLeft ? 1.0 : -1.0;
    const DVec3 start = BallAt(record.start_s, moving);
    const DVec3 landed = BallAt(record.end_s, moving);
    const DVec3 fixed = BallAt(record.end_s, OtherFoot(moving));
    const double heading = before.heading_rad + step.turn_rad;
    const DVec3 got = RotateYaw(-record.base.heading_rad, landed - fixed);
    const double side_m = step.side_m.value_or(outward * got.x);
    const double rise_m = input_.options.terrain != nullptr ? got.y : step.height_m;
    const DVec3 asked(outward * side_m, rise_m, step.length_m);
    const DVec3 missed = got - asked;
    const double turned = record.base.heading_rad - before.heading_rad;
    Refusal refusal{.request_id = id, .kind = "step"};
    refusal.asked = {{"length_m", step.length_m}, {"turn_rad", step.turn_rad}};
    refusal.got = {{"length_m", got.z}, {"turn_rad", turned}};
    if (step.side_m) {
      refusal.asked.emplace_back("side_m", *step.side_m);
      refusal.got.emplace_back("side_m", outward * got.x);
    }
    if (input_.options.terrain == nullptr) {
      refusal.asked.emplace_back("height_m", step.height_m);
      refusal.got.emplace_back("height_m", got.y);
    }
    refusal.missed_m = std::sqrt(missed.x * missed.x + missed.y * missed.y + missed.z * missed.z);
    const DVec3 path = fixed + RotateYaw(heading, asked) - start;
    refusal.missed_rad =
        std::max(std::fabs(turned - step.turn_rad),
                 refusal.missed_m > kMetM ? DirectionError(path, landed - start) : 0.0);
    const char* const foot = moving == Foot::kLeft ? "left" : "right";
    refusal.reason = Text("missed its request: the %s foot should land ", foot) +
                     AheadText(step.length_m) +
                     " the other foot, but the nearest step of the library lands " +
                     AheadText(got.z) + " it, " + MissText(refusal);
    AddIfMissed(std::move(refusal));
  }

  void CheckFootprint(std::uint64_t id, const StepRequest& step, const MovementRecord& record,
                      const BaseFrame& before) {
    const Foot moving = MovingFoot(record.kind);
    const DVec3 landed = BallAt(record.end_s, moving);
    const DVec3 start = BallAt(record.start_s, moving);
    const DVec3 asked = step.at->position_m;
    const double heading = step.at->heading_rad.value_or(before.heading_rad);
    Refusal refusal{.request_id = id, .kind = "step"};
    refusal.asked = {{"at_x_m", asked.x}, {"at_z_m", asked.z}, {"heading_rad", heading}};
    refusal.got = {
        {"at_x_m", landed.x}, {"at_z_m", landed.z}, {"heading_rad", record.base.heading_rad}};
    refusal.missed_m = Horizontal(landed - asked);
    refusal.missed_rad =
        std::max(std::fabs(WrapAngle(record.base.heading_rad - heading)),
                 refusal.missed_m > kMetM ? DirectionError(asked - start, landed - start) : 0.0);
    refusal.reason = "missed its request: the foot should land at " + Place(asked) +
                     ", but the nearest step of the library lands at " + Place(landed) + ", " +
                     MissText(refusal);
    AddIfMissed(std::move(refusal));
  }

  void CheckJump(std::uint64_t id, const JumpRequest& jump, const MovementRecord& record,
                 const BaseFrame& before) {
    const DVec3 got = RotateYaw(-before.heading_rad, record.base.position_m - before.position_m);
    const double turned = record.base.heading_rad - before.heading_rad;
    const DVec3 asked(0.0, input_.options.terrain != nullptr ? got.y : jump.height_m,
                      jump.length_m);
    Refusal refusal{.request_id = id, .kind = "jump"};
    refusal.asked = {{"length_m", jump.length_m}, {"turn_rad", jump.turn_rad}};
    refusal.got = {{"length_m", got.z}, {"turn_rad", turned}};
    if (input_.options.terrain == nullptr) {
      refusal.asked.emplace_back("height_m", jump.height_m);
      refusal.got.emplace_back("height_m", got.y);
    }
    refusal.missed_m = std::hypot(Horizontal(got - asked), got.y - asked.y);
    refusal.missed_rad = std::max(std::fabs(turned - jump.turn_rad),
                                  refusal.missed_m > kMetM ? DirectionError(asked, got) : 0.0);
    refusal.reason =
        Text(
            "missed its request: the jump should be %.2f m long, but the nearest jump of "
            "the library is %.2f m long, ",
            jump.length_m, got.z) +
        MissText(refusal);
    AddIfMissed(std::move(refusal));
  }

  void CheckStand(std::uint64_t id, const MovementRecord& record) {
    const Skeleton& skeleton = input_.library->skeleton();
    const double heading = record.base.heading_rad;
    const DVec3 asked = FootVector(skeleton, input_.library->stand_pose(), Foot::kLeft, 0.0);
    const DVec3 got = FootVector(skeleton, PoseAt(record.end_s), Foot::kLeft, heading);
    Refusal refusal{.request_id = id, .kind = "stand"};
    refusal.asked = {{"left_ahead_m", asked.z}, {"left_aside_m", asked.x}};
    refusal.got = {{"left_ahead_m", got.z}, {"left_aside_m", got.x}};
    refusal.missed_m = Horizontal(got - asked);
    refusal.reason = Text(
        "does not bring the feet together: they stay %.2f m from their positions in the stand "
        "pose, because the library has no step that brings them closer",
        refusal.missed_m);
    AddIfMissed(std::move(refusal));
  }

  void AddWalk(const WalkRecord& walk) {
    if (walk.arrived) return;
    const auto request = std::ranges::find(input_.requests, walk.request_id, &MovementRequest::id);
    if (request == input_.requests.end()) return;
    const auto* asked = std::get_if<WalkRequest>(&request->movement);
    if (asked == nullptr) return;
    Refusal refusal{.request_id = walk.request_id, .kind = "walk_to"};
    refusal.asked = {{"position_x_m", asked->position_m.x},
                     {"position_z_m", asked->position_m.z},
                     {"heading_rad", asked->heading_rad}};
    refusal.got = {{"position_x_m", walk.base.position_m.x},
                   {"position_z_m", walk.base.position_m.z},
                   {"heading_rad", walk.base.heading_rad}};
    refusal.missed_m = Horizontal(walk.base.position_m - asked->position_m);
    refusal.missed_rad = std::fabs(WrapAngle(walk.base.heading_rad - asked->heading_rad));
    refusal.reason = "did not arrive: " + walk.reason + "; the walk ends " + MissText(refusal);
    refusals_.push_back(std::move(refusal));
  }

  void AddSkipped(const SkippedRequest& skipped) {
    const auto request =
        std::ranges::find(input_.requests, skipped.request_id, &MovementRequest::id);
    if (request == input_.requests.end()) return;
    const auto* step = std::get_if<StepRequest>(&request->movement);
    const Footprint& nearest = skipped.missed.nearest;
    Refusal refusal{.request_id = skipped.request_id, .kind = step != nullptr ? "step" : "jump"};
    if (step != nullptr && step->at) {
      const DVec3& asked = step->at->position_m;
      refusal.asked = {{"at_x_m", asked.x}, {"at_z_m", asked.z}};
      refusal.got = {{"at_x_m", nearest.position_m.x}, {"at_z_m", nearest.position_m.z}};
    } else {
      const StepMeasures& asked = skipped.missed.requested;
      const StepMeasures& got = skipped.missed.reached;
      refusal.asked = {{"length_m", asked.length_m}, {"turn_rad", asked.turn_rad}};
      refusal.got = {{"length_m", got.length_m}, {"turn_rad", got.turn_rad}};
      if (step != nullptr && step->side_m) {
        refusal.asked.emplace_back("side_m", asked.side_m);
        refusal.got.emplace_back("side_m", got.side_m);
      }
      if (input_.options.terrain == nullptr) {
        refusal.asked.emplace_back("height_m", asked.height_m);
        refusal.got.emplace_back("height_m", got.height_m);
      }
    }
    refusal.missed_m = skipped.missed.distance_m;
    refusal.missed_rad = skipped.missed.turn_rad;
    refusal.reason = "was skipped: " + skipped.reason;
    refusals_.push_back(std::move(refusal));
  }

  static std::string MissText(const Refusal& refusal) {
    return Text("%.2f m and %.0f degrees off", refusal.missed_m,
                kDegreesPerRadian * refusal.missed_rad);
  }

  void AddIfMissed(Refusal refusal) {
    if (refusal.missed_m <= kMaxRequestErrorM && refusal.missed_rad <= kMaxRequestErrorRad) return;
    refusals_.push_back(std::move(refusal));
  }

  const SynthesisInput& input_;
  const Synthesis& synthesis_;
  std::vector<Refusal> refusals_;
};

}  // namespace

std::vector<Refusal> FindRefusals(const SynthesisInput& input, const Synthesis& synthesis) {
  return RefusalFinder(input, synthesis).Run();
}

}  // namespace stridewire
