#include "offline/build/bend_toes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "base/trig.h"
#include "offline/base/statistics.h"
#include "runtime/library/keytimes.h"

namespace stridewire {
namespace {

// Toes are bent by at most 60 degrees.
constexpr double kMaxBendRad = 1.05;
// If the height of a ball at an end of a movement differs from that of a resting ball by less than
// this, the foot counts as standing on level ground. At the ends of level steps, balls are up to
// 2 cm below and up to 6 cm above that height.
constexpr double kLevelM = 0.07;
// If the height of a toe tip relative to its ball differs by at least this between the stand pose
// and mid-stance, the sole is not flat in the stand pose, and only mid-stance counts.
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

bool HasSwing(MovementKind kind, std::span<const double> keytimes_s) {
  return keytimes_s.size() > ToeOffKeytime(kind) + 1;
}

LegPose LegOf(const Skeleton& skeleton, const LegRig& rig, ConstPoseSpan pose, Foot foot) {
  LegPose leg;
  EvaluateLeg(skeleton, rig, pose, foot, leg);
  return leg;
}

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

ToeBender::ToeBender(const RawLibrary& library)
    : skeleton_(library.skeleton), rig_(MakeLegRig(skeleton_, library.stand_pose, {})) {
  if (!rig_.is_usable) return;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    if (rig_.side(foot).has_toe_joint) feet_[Index(foot)] = MeasureFoot(library, foot);
  }
}

std::optional<ToeBender::RestingFoot> ToeBender::MeasureFoot(const RawLibrary& library,
                                                             Foot foot) const {
  std::vector<double> balls_m;
  std::vector<double> rises_m;
  for (const RawGroup& group : library.groups) {
    if (group.kind != StepKind(OtherFoot(foot)) || group.is_completed) continue;
    for (const RawExample& example : group.examples) {
      if (!HasSwing(group.kind, example.keytimes_s)) continue;
      const ConstPoseSpan pose =
          example.clip.frame(FrameAt(example, ToeOffKeytime(group.kind), 0.5));
      const LegPose leg = LegOf(skeleton_, rig_, pose, foot);
      balls_m.push_back(static_cast<double>(pose.root_position_m.y + leg.ball_m.y));
      rises_m.push_back(static_cast<double>(leg.toe_tip_m.y - leg.ball_m.y));
    }
  }
  if (rises_m.empty()) return std::nullopt;
  const double walk_m = Median(std::move(rises_m));
  const LegPose stand = LegOf(skeleton_, rig_, library.stand_pose, foot);
  const double stand_m = stand.toe_tip_m.y - stand.ball_m.y;
  const double rest_m =
      std::fabs(stand_m - walk_m) < kSameToesM ? std::min(walk_m, stand_m) : walk_m;
  return RestingFoot{Median(std::move(balls_m)), rest_m - kMaxToeSinkM};
}

double ToeBender::BallHeightAt(Foot foot, ConstPoseSpan end) const {
  const double level_m = feet_[Index(foot)]->ball_height_m;
  const double ball_m = end.root_position_m.y + LegOf(skeleton_, rig_, end, foot).ball_m.y;
  return std::fabs(ball_m - level_m) < kLevelM ? level_m : ball_m;
}

template <typename PoseAt, typename TimeAt>
void ToeBender::BendFrames(MovementKind kind, std::span<const double> keytimes_s, int count,
                           double margin_m, PoseAt pose_at, TimeAt time_at) const {
  if (count == 0 || !HasSwing(kind, keytimes_s)) return;
  const std::size_t toe_off = ToeOffKeytime(kind);
  const double from_s = keytimes_s[toe_off];
  const double over_s = keytimes_s[toe_off + 1] - from_s;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const std::optional<RestingFoot>& rest = feet_[Index(foot)];
    if (!rest) continue;
    const double before_m = BallHeightAt(foot, pose_at(0));
    const double after_m = BallHeightAt(foot, pose_at(count - 1));
    for (int i = 0; i < count; ++i) {
      const double swing = std::clamp((time_at(i) - from_s) / over_s, 0.0, 1.0);
      const double ball_m = before_m + swing * (after_m - before_m);
      RaiseToeTip(skeleton_, rig_, foot, ball_m + rest->tip_rise_m + margin_m, pose_at(i));
    }
  }
}

void ToeBender::Bend(MovementKind kind, RawExample& example) const {
  Clip& clip = example.clip;
  BendFrames(
      kind, example.keytimes_s, clip.frame_count(), 0.0, [&](int i) { return clip.frame(i); },
      [&](int i) {
        const auto frame = static_cast<std::size_t>(i);
        return example.frame_times_s.empty() ? i / clip.fps : example.frame_times_s[frame];
      });
}

void ToeBender::Bend(MovementKind kind, std::span<const int> cells, const GridLayout& layout,
                     double margin_m, GridExample& example) const {
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  const auto row_at = [&](std::size_t i) {
    return std::span(example.rows).subspan(i * row_floats, row_floats);
  };
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < example.rows.size() / row_floats; ++i) {
    poses.push_back(PoseOfRow(row_at(i), layout, skeleton_.joint_count()));
  }
  const TimeWarp warp(example.keytimes_s, cells);
  BendFrames(
      kind, example.keytimes_s, static_cast<int>(poses.size()), margin_m,
      [&](int i) { return PoseSpan(poses[static_cast<std::size_t>(i)]); },
      [&](int i) { return warp.TimeAt(i); });
  for (std::size_t i = 0; i < poses.size(); ++i) {
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      if (!feet_[Index(foot)]) continue;
      const auto toe = static_cast<std::size_t>(rig_.side(foot).chain.back());
      const Quat before = GridLayout::RotationOf(row_at(i).data(), toe);
      const Quat after = poses[i].rotations[toe];
      // Blending needs quaternions of the same sign as before.
      GridLayout::SetRotation(row_at(i).data(), toe, Dot(before, after) < 0.0f ? -after : after);
    }
  }
}

}  // namespace stridewire
