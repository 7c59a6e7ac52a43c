#include "offline/extract/bend_toes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "base/trig.h"
#include "offline/base/statistics.h"

namespace stridewire {
namespace {

// Toes are bent by at most 60 degrees.
constexpr double kMaxBendRad = 1.05;
// If the height of a ball at an end of the movement differs from `ball_height_m` by less than this,
// the foot counts as standing on level ground. At the ends of level steps, balls are up to 2 cm
// below and up to 6 cm above that height.
constexpr double kLevelM = 0.07;
// If the toe tips of the stand pose differ from those in mid-stance by at least this, the soles of
// the stand pose are not flat.
constexpr double kSameToesM = 0.02;
// Toes whose horizontal extent is shorter than this point straight up or down. They are not bent.
constexpr double kMinFlatM = 1e-3;

std::size_t Index(Foot foot) { return static_cast<std::size_t>(foot); }

// Returns the frame of an example at a fraction of the time between two keytimes.
int FrameAt(const RawExample& example, std::size_t keytime, double fraction) {
  const double from_s = example.keytimes_s[keytime];
  const double time_s = from_s + fraction * (example.keytimes_s[keytime + 1] - from_s);
  const int frame = static_cast<int>(std::lround(time_s * example.clip.fps));
  return std::clamp(frame, 0, example.clip.frame_count() - 1);
}

// Returns the index of the keytime at which feet leave the ground. They land at the next keytime.
std::size_t ToeOffKeytime(MovementKind kind) { return IsStep(kind) ? 1 : 2; }

class ToeBender {
 public:
  ToeBender(const LegRig& rig, const std::array<double, 2>& ball_height_m, RawLibrary& library)
      : rig_(rig), ball_height_m_(ball_height_m), library_(library) {
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) tip_rise_m_[Index(foot)] = TipRise(foot);
  }

  void Run() {
    for (RawGroup& group : library_.groups) {
      for (RawExample& example : group.examples) {
        for (const Foot foot : {Foot::kLeft, Foot::kRight}) Bend(group.kind, foot, example);
      }
    }
  }

 private:
  [[nodiscard]] LegPose LegOf(ConstPoseSpan pose, Foot foot) const {
    LegPose leg;
    EvaluateLeg(library_.skeleton, rig_, pose, foot, leg);
    return leg;
  }

  // Returns the minimum height of the toe tip relative to a resting ball: its resting height minus
  // kMaxToeSinkM. The resting height is the median over all steps in the middle of the other foot's
  // swing, or that in the stand pose if it is a little lower. Returns nullopt if the other foot
  // swings in no step.
  [[nodiscard]] std::optional<double> TipRise(Foot foot) const {
    std::vector<double> rises_m;
    for (const RawGroup& group : library_.groups) {
      if (group.kind != StepKind(OtherFoot(foot))) continue;
      for (const RawExample& example : group.examples) {
        const int frame = FrameAt(example, ToeOffKeytime(group.kind), 0.5);
        const LegPose leg = LegOf(example.clip.frame(frame), foot);
        rises_m.push_back(static_cast<double>(leg.toe_tip_m.y - leg.ball_m.y));
      }
    }
    if (rises_m.empty()) return std::nullopt;
    const double walk_m = Median(std::move(rises_m));
    const LegPose stand = LegOf(library_.stand_pose, foot);
    const double stand_m = stand.toe_tip_m.y - stand.ball_m.y;
    const double rest_m =
        std::fabs(stand_m - walk_m) < kSameToesM ? std::min(walk_m, stand_m) : walk_m;
    return rest_m - kMaxToeSinkM;
  }

  // Returns the height of the resting ball of a foot at an end of an example, whose pose is `end`.
  [[nodiscard]] double RestingHeight(Foot foot, ConstPoseSpan end) const {
    const double level_m = ball_height_m_[Index(foot)];
    const double ball_m = end.root_position_m.y + LegOf(end, foot).ball_m.y;
    return std::fabs(ball_m - level_m) < kLevelM ? level_m : ball_m;
  }

  void Bend(MovementKind kind, Foot foot, RawExample& example) const {
    if (!tip_rise_m_[Index(foot)]) return;
    Clip& clip = example.clip;
    const double before_m = RestingHeight(foot, clip.frame(0));
    const double after_m = RestingHeight(foot, clip.frame(clip.frame_count() - 1));
    const std::size_t toe_off = ToeOffKeytime(kind);
    const double from_s = example.keytimes_s[toe_off];
    const double over_s = example.keytimes_s[toe_off + 1] - from_s;
    for (int i = 0; i < clip.frame_count(); ++i) {
      const double swing = std::clamp((i / clip.fps - from_s) / over_s, 0.0, 1.0);
      const double ball_m = before_m + swing * (after_m - before_m);
      RaiseToeTip(library_.skeleton, rig_, foot, ball_m + *tip_rise_m_[Index(foot)], clip.frame(i));
    }
  }

  const LegRig& rig_;
  std::array<double, 2> ball_height_m_;
  RawLibrary& library_;
  std::array<std::optional<double>, 2> tip_rise_m_;  // [foot]
};

}  // namespace

void RaiseToeTip(const Skeleton& skeleton, const LegRig& rig, Foot foot, double height_m,
                 PoseSpan pose) {
  const LegRig::Side& side = rig.side(foot);
  if (!side.has_toe_joint) return;
  LegPose leg;
  EvaluateLeg(skeleton, rig, pose, foot, leg);
  const DVec3 toe(leg.toe_tip_m - leg.ball_m);
  const double rise_m = height_m - (pose.root_position_m.y + leg.ball_m.y);
  const double flat_m = std::hypot(toe.x, toe.z);
  const double length_m = std::hypot(flat_m, toe.y);
  if (toe.y >= rise_m || flat_m < kMinFlatM) return;
  const double raised_flat_m = std::sqrt(std::max(0.0, length_m * length_m - rise_m * rise_m));
  const double bend_rad =
      std::min(Atan2(rise_m, raised_flat_m) - Atan2(toe.y, flat_m), kMaxBendRad);
  // Positive rotations about this axis raise the toe tip.
  const DVec3 axis(-toe.z / flat_m, 0.0, toe.x / flat_m);
  const DQuat bend(Cos(0.5 * bend_rad), Sin(0.5 * bend_rad) * axis);
  const DQuat above(leg.world_rotations[static_cast<std::size_t>(side.ankle)]);
  Quat& rotation = pose.rotations[static_cast<std::size_t>(side.chain.back())];
  rotation = Normalise(Quat(glm::conjugate(above) * bend * above * DQuat(rotation)));
}

void BendToes(const LegRig& rig, const std::array<double, 2>& ball_height_m, RawLibrary& library) {
  if (rig.is_usable) ToeBender(rig, ball_height_m, library).Run();
}

}  // namespace stridewire
