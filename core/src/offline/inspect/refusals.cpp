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
    const DVec3 actual = RotateYaw(-record.base.heading_rad, landed - fixed);
    const double side_m = step.side_m.value_or(outward * actual.x);
    const double rise_m = input_.options.terrain != nullptr ? actual.y : step.height_m;
    const DVec3 requested(outward * side_m, rise_m, step.length_m);
    const DVec3 missed = actual - requested;
    const double turned = record.base.heading_rad - before.heading_rad;
    Refusal refusal{.request_id = id, .kind = "step"};
    refusal.requested = {{"length_m", step.length_m}, {"turn_rad", step.turn_rad}};
    refusal.actual = {{"length_m", actual.z}, {"turn_rad", turned}};
    if (step.side_m) {
      refusal.requested.emplace_back("side_m", *step.side_m);
      refusal.actual.emplace_back("side_m", outward * actual.x);
    }
    if (input_.options.terrain == nullptr) {
      refusal.requested.emplace_back("height_m", step.height_m);
      refusal.actual.emplace_back("height_m", actual.y);
    }
    refusal.missed_m = std::sqrt(missed.x * missed.x + missed.y * missed.y + missed.z * missed.z);
    const DVec3 path = fixed + RotateYaw(heading, requested) - start;
    refusal.missed_rad =
        std::max(std::fabs(turned - step.turn_rad),
                 refusal.missed_m > kMetM ? DirectionError(path, landed - start) : 0.0);
    const char* const foot = moving == Foot::kLeft ? "left" : "right";
    refusal.reason = Text("missed its request: the %s foot should land ", foot) +
                     AheadText(step.length_m) +
                     " the other foot, but the nearest step of the library lands " +
                     AheadText(actual.z) + " it, " + MissText(refusal);
    AddIfMissed(std::move(refusal));
  }

  void CheckFootprint(std::uint64_t id, const StepRequest& step, const MovementRecord& record,
                      const BaseFrame& before) {
    const Foot moving = MovingFoot(record.kind);
    const DVec3 landed = BallAt(record.end_s, moving);
    const DVec3 start = BallAt(record.start_s, moving);
    const DVec3 requested = step.at->position_m;
    const double heading = step.at->heading_rad.value_or(before.heading_rad);
    Refusal refusal{.request_id = id, .kind = "step"};
    refusal.requested = {
        {"at_x_m", requested.x}, {"at_z_m", requested.z}, {"heading_rad", heading}};
    refusal.actual = {
        {"at_x_m", landed.x}, {"at_z_m", landed.z}, {"heading_rad", record.base.heading_rad}};
    refusal.missed_m = Horizontal(landed - requested);
    refusal.missed_rad = std::max(
        std::fabs(WrapAngle(record.base.heading_rad - heading)),
        refusal.missed_m > kMetM ? DirectionError(requested - start, landed - start) : 0.0);
    refusal.reason = "missed its request: the foot should land at " + Place(requested) +
                     ", but the nearest step of the library lands at " + Place(landed) + ", " +
                     MissText(refusal);
    AddIfMissed(std::move(refusal));
  }

  void CheckJump(std::uint64_t id, const JumpRequest& jump, const MovementRecord& record,
                 const BaseFrame& before) {
    const DVec3 actual = RotateYaw(-before.heading_rad, record.base.position_m - before.position_m);
    const double turned = record.base.heading_rad - before.heading_rad;
    const DVec3 requested(0.0, input_.options.terrain != nullptr ? actual.y : jump.height_m,
                          jump.length_m);
    Refusal refusal{.request_id = id, .kind = "jump"};
    refusal.requested = {{"length_m", jump.length_m}, {"turn_rad", jump.turn_rad}};
    refusal.actual = {{"length_m", actual.z}, {"turn_rad", turned}};
    if (input_.options.terrain == nullptr) {
      refusal.requested.emplace_back("height_m", jump.height_m);
      refusal.actual.emplace_back("height_m", actual.y);
    }
    refusal.missed_m = std::hypot(Horizontal(actual - requested), actual.y - requested.y);
    refusal.missed_rad =
        std::max(std::fabs(turned - jump.turn_rad),
                 refusal.missed_m > kMetM ? DirectionError(requested, actual) : 0.0);
    refusal.reason =
        Text(
            "missed its request: the jump should be %.2f m long, but the nearest jump of "
            "the library is %.2f m long, ",
            jump.length_m, actual.z) +
        MissText(refusal);
    AddIfMissed(std::move(refusal));
  }

  void CheckStand(std::uint64_t id, const MovementRecord& record) {
    const Skeleton& skeleton = input_.library->skeleton();
    const double heading = record.base.heading_rad;
    const DVec3 requested = FootVector(skeleton, input_.library->stand_pose(), Foot::kLeft, 0.0);
    const DVec3 actual = FootVector(skeleton, PoseAt(record.end_s), Foot::kLeft, heading);
    Refusal refusal{.request_id = id, .kind = "stand"};
    refusal.requested = {{"left_ahead_m", requested.z}, {"left_aside_m", requested.x}};
    refusal.actual = {{"left_ahead_m", actual.z}, {"left_aside_m", actual.x}};
    refusal.missed_m = Horizontal(actual - requested);
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
    const auto* requested = std::get_if<WalkRequest>(&request->movement);
    if (requested == nullptr) return;
    Refusal refusal{.request_id = walk.request_id, .kind = "walk_to"};
    refusal.requested = {{"position_x_m", requested->position_m.x},
                         {"position_z_m", requested->position_m.z},
                         {"heading_rad", requested->heading_rad}};
    refusal.actual = {{"position_x_m", walk.base.position_m.x},
                      {"position_z_m", walk.base.position_m.z},
                      {"heading_rad", walk.base.heading_rad}};
    refusal.missed_m = Horizontal(walk.base.position_m - requested->position_m);
    refusal.missed_rad = std::fabs(WrapAngle(walk.base.heading_rad - requested->heading_rad));
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
      const DVec3& requested = step->at->position_m;
      refusal.requested = {{"at_x_m", requested.x}, {"at_z_m", requested.z}};
      refusal.actual = {{"at_x_m", nearest.position_m.x}, {"at_z_m", nearest.position_m.z}};
    } else {
      const StepMeasures& requested = skipped.missed.requested;
      const StepMeasures& actual = skipped.missed.reached;
      refusal.requested = {{"length_m", requested.length_m}, {"turn_rad", requested.turn_rad}};
      refusal.actual = {{"length_m", actual.length_m}, {"turn_rad", actual.turn_rad}};
      if (step != nullptr && step->side_m) {
        refusal.requested.emplace_back("side_m", requested.side_m);
        refusal.actual.emplace_back("side_m", actual.side_m);
      }
      if (input_.options.terrain == nullptr) {
        refusal.requested.emplace_back("height_m", requested.height_m);
        refusal.actual.emplace_back("height_m", actual.height_m);
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
