#include "offline/complete/compose_stand.h"

#include <algorithm>
#include <cmath>

#include "base/trig.h"
#include "offline/base/degrees.h"
#include "offline/base/text.h"
#include "offline/complete/upper_body_chains.h"
#include "runtime/skeleton/foot_vector.h"

namespace stridewire::complete {
namespace {

// Limits within which a captured pose is a stand: distances between the feet in each direction, the
// bend of each knee, and the difference between both bends. In captured stands, people bend their
// knees by up to 36 degrees, with a difference below 10 degrees. The limits are wider, because some
// captured characters crouch all the time.
constexpr double kMaxFeetAheadM = 0.12;
constexpr double kMaxFeetRiseM = 0.04;
constexpr double kMinFeetWidthM = 0.04;
constexpr double kMaxFeetWidthM = 0.5;
constexpr double kMaxKneeRad = 1.2;
constexpr double kMaxKneeDifferenceRad = 0.28;

// Properties of composed stands.
constexpr double kStandKneeRad = 0.2;  // Bend of the straighter knee.
constexpr double kMinStandWidthM = 0.16;
constexpr double kMaxStandWidthM = 0.24;
constexpr double kHipsAheadM = 0.03;  // The hips are this far ahead of the ankles.
// Generic time at which the sole of the fixed foot is flat, because the other foot swings past it.
constexpr double kFlatSoleTime = 1.3;

// Returns the bend of a knee, which is 0 if the leg is straight.
double KneeRad(const LegRig::Side& side, const LegPose& leg) {
  const auto at = [&](int joint) {
    return DVec3(leg.positions_m[static_cast<std::size_t>(joint)]);
  };
  const DVec3 thigh = at(side.knee) - at(side.hip);
  const DVec3 shank = at(side.ankle) - at(side.knee);
  return Acos(glm::dot(thigh, shank) / std::sqrt(glm::dot(thigh, thigh) * glm::dot(shank, shank)));
}

// Averages the postures of steps and, at times when soles are flat, the rotations of the ankles and
// the heights of the balls. Does not set StandParts::width_m.
class StandAverage {
 public:
  void AddPosture(const PostureSample& sample) {
    posture_count_ += 1.0;
    parts_.mean = posture_count_ == 1.0 ? sample : Blend(parts_.mean, sample, 1.0 / posture_count_);
  }

  void AddSole(Foot foot, const PostureSample& sample) {
    const auto f = static_cast<std::size_t>(foot);
    sole_count_[f] += 1.0;
    const double share = 1.0 / sole_count_[f];
    DQuat& ankle = parts_.ankles[f];
    ankle = sole_count_[f] == 1.0 ? sample.ankles[f] : Blend(ankle, sample.ankles[f], share);
    parts_.ball_y_m[f] += share * (sample.balls_m[f].y - parts_.ball_y_m[f]);
  }

  [[nodiscard]] bool has_sole(Foot foot) const {
    return sole_count_[static_cast<std::size_t>(foot)] > 0.0;
  }
  [[nodiscard]] const StandParts& parts() const { return parts_; }

 private:
  StandParts parts_;
  double posture_count_ = 0.0;
  std::array<double, 2> sole_count_{};  // [Foot]
};

bool IsCapturedStep(const RawGroup& group) { return IsStep(group.kind) && !group.is_completed; }

// Calls use(point, sample) for the postures of all steps of a group: at the start and the middle of
// each keytime interval, and at the end of the step. `point` is an index as in StrideModel::points.
template <class Use>
void ForEachSample(const Skeleton& skeleton, const RawGroup& group, const Use& use) {
  for (const RawExample& example : group.examples) {
    Clip clip = example.clip;
    MakeSignContinuous(clip);
    Pose pose(skeleton.joint_count());
    for (std::size_t p = 0; p < kPointCount; p += kPointsPerInterval / 2) {
      SampleClip(clip, TimeAtPoint(example.keytimes_s, p), pose);
      const double heading_rad = example.heading_change_rad * static_cast<double>(p) /
                                 static_cast<double>(kPointCount - 1);
      use(p, SampleOf(skeleton, pose, heading_rad));
    }
  }
}

}  // namespace

std::optional<std::string> WhyNoStand(const Skeleton& skeleton, const LegRig& rig,
                                      const Pose& pose) {
  const DVec3 apart = FootVector(skeleton, pose, Foot::kLeft, 0.0);
  if (std::fabs(apart.z) > kMaxFeetAheadM) {
    return Text("one foot is %.2f m ahead of the other", std::fabs(apart.z));
  }
  if (std::fabs(apart.y) > kMaxFeetRiseM) {
    return Text("one foot is %.2f m higher than the other", std::fabs(apart.y));
  }
  if (apart.x < kMinFeetWidthM || apart.x > kMaxFeetWidthM) {
    return Text("the feet are %.2f m apart sideways", apart.x);
  }
  std::array<double, 2> knees{};
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    LegPose leg;
    EvaluateLeg(skeleton, rig, pose, foot, leg);
    knees[static_cast<std::size_t>(foot)] = KneeRad(rig.side(foot), leg);
  }
  if (std::max(knees[0], knees[1]) > kMaxKneeRad) {
    return Text("a knee is bent by %.0f degrees", kDegreesPerRadian * std::max(knees[0], knees[1]));
  }
  if (std::fabs(knees[0] - knees[1]) > kMaxKneeDifferenceRad) {
    return Text("one knee is bent by %.0f degrees more than the other",
                kDegreesPerRadian * std::fabs(knees[0] - knees[1]));
  }
  return std::nullopt;
}

StandParts MeasureStandParts(const std::array<StrideModel, 2>& strides) {
  StandParts parts;
  parts.mean = strides[0].points.front();
  double count = 0.0;
  for (const StrideModel& stride : strides) {
    for (const PostureSample& point : stride.points) {
      count += 1.0;
      parts.mean = Blend(parts.mean, point, 1.0 / count);
    }
  }
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const auto f = static_cast<std::size_t>(foot);
    const PostureSample flat = strides[static_cast<std::size_t>(OtherFoot(foot))].At(kFlatSoleTime);
    parts.ankles[f] = flat.ankles[f];
    parts.ball_y_m[f] = flat.balls_m[f].y;
  }
  parts.width_m = 0.5 * (strides[0].width_m + strides[1].width_m);
  return parts;
}

std::optional<StandParts> MeasureStandParts(const RawLibrary& library) {
  StandAverage average;
  for (const RawGroup& group : library.groups) {
    if (!IsCapturedStep(group)) continue;
    const Foot fixed = OtherFoot(MovingFoot(group.kind));
    ForEachSample(library.skeleton, group, [&](std::size_t point, const PostureSample& sample) {
      average.AddPosture(sample);
      if (point == kPointsPerInterval * 3 / 2) average.AddSole(fixed, sample);
    });
  }
  // If the same foot moves in all steps, it is never the fixed foot. Its sole is then measured at
  // the end of the steps, after it has landed.
  for (const RawGroup& group : library.groups) {
    if (!IsCapturedStep(group) || average.has_sole(MovingFoot(group.kind))) continue;
    ForEachSample(library.skeleton, group, [&](std::size_t point, const PostureSample& sample) {
      if (point == kPointCount - 1) average.AddSole(MovingFoot(group.kind), sample);
    });
  }
  if (!average.has_sole(Foot::kLeft) || !average.has_sole(Foot::kRight)) return std::nullopt;
  StandParts parts = average.parts();
  const UpperBodyChains chains = FindUpperBodyChains(library.skeleton, parts.mean);
  parts.mean = LimitLean(library.skeleton, chains, parts.mean);
  return parts;
}

Pose ComposeStand(const Skeleton& skeleton, const LegRig& rig, const StandParts& parts) {
  const double width_m = std::clamp(parts.width_m, kMinStandWidthM, kMaxStandWidthM);
  // Places the feet, and the root between them.
  PostureSample mean = parts.mean;
  mean.root_m = DVec3(0.0);
  Pose pose = ToPose(mean);
  std::array<LegPose, 2> legs;
  std::array<DVec3, 2> ankles_m;
  DVec3 hips_m(0.0);
  DVec3 middle_m(0.0);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const auto f = static_cast<std::size_t>(foot);
    const LegRig::Side& side = rig.side(foot);
    EvaluateLeg(skeleton, rig, pose, foot, legs[f]);
    const auto ankle = static_cast<std::size_t>(side.ankle);
    const DVec3 sole = parts.ankles[f] * (glm::conjugate(DQuat(legs[f].world_rotations[ankle])) *
                                          DVec3(legs[f].ball_m - legs[f].positions_m[ankle]));
    const DVec3 ball(0.5 * SideSign(foot) * width_m, parts.ball_y_m[f], 0.0);
    ankles_m[f] = ball - sole;
    hips_m += 0.5 * DVec3(legs[f].positions_m[static_cast<std::size_t>(side.hip)]);
    middle_m += 0.5 * ankles_m[f];
  }
  DVec3 root(middle_m.x - hips_m.x, 0.0, middle_m.z + kHipsAheadM - hips_m.z);
  // Lowers the root until the straighter leg has the bend kStandKneeRad.
  root.y = HUGE_VAL;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const auto f = static_cast<std::size_t>(foot);
    const LegRig::Side& side = rig.side(foot);
    const double thigh = side.thigh_m;
    const double shank = side.shank_m;
    const double reach =
        std::sqrt(thigh * thigh + shank * shank + 2.0 * thigh * shank * Cos(kStandKneeRad));
    const DVec3 hip(legs[f].positions_m[static_cast<std::size_t>(side.hip)]);
    const double dx = root.x + hip.x - ankles_m[f].x;
    const double dz = root.z + hip.z - ankles_m[f].z;
    root.y = std::min(root.y, ankles_m[f].y - hip.y +
                                  std::sqrt(std::max(0.0, reach * reach - dx * dx - dz * dz)));
  }
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const auto f = static_cast<std::size_t>(foot);
    SolveLeg(rig, foot, legs[f], Vec3(ankles_m[f] - root), Quat(parts.ankles[f]), pose);
  }
  pose.root_position_m = Vec3(0.0f, static_cast<float>(root.y), 0.0f);
  return pose;
}

}  // namespace stridewire::complete
