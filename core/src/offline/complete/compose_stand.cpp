#include "offline/complete/compose_stand.h"

#include <algorithm>
#include <cmath>

#include "base/trig.h"
#include "offline/base/text.h"
#include "runtime/skeleton/foot_vector.h"

namespace stridewire::complete {
namespace {

// Limits of a stand. Captured stands have knees within 10 degrees of each other. People bend them
// by up to 36 degrees, but a figure that crouches all the time may stand so as well.
constexpr double kStandAheadM = 0.12;
constexpr double kStandRiseM = 0.04;
constexpr double kNarrowestM = 0.04;
constexpr double kWidestM = 0.5;
constexpr double kMaxKneeRad = 1.2;
constexpr double kMaxKneeDifferenceRad = 0.28;

constexpr double kStandKneeRad = 0.2;  // Bend of the straighter knee in a composed stand.
constexpr double kMinStandWidthM = 0.16;
constexpr double kMaxStandWidthM = 0.24;
constexpr double kHipsAheadM = 0.03;  // The hips are this far ahead of the ankles.
// Generic time at which the fixed foot is flat: the other foot swings past it.
constexpr double kFlat = 1.3;

double KneeRad(const LegRig::Side& side, const LegPose& leg) {
  const auto at = [&](int place) {
    return DVec3(leg.positions_m[static_cast<std::size_t>(place)]);
  };
  const DVec3 thigh = at(side.knee) - at(side.hip);
  const DVec3 shank = at(side.ankle) - at(side.knee);
  return Acos(glm::dot(thigh, shank) / std::sqrt(glm::dot(thigh, thigh) * glm::dot(shank, shank)));
}

}  // namespace

std::optional<std::string> WhyNoStand(const Skeleton& skeleton, const LegRig& rig,
                                      const Pose& pose) {
  const DVec3 apart = FootVector(skeleton, pose, Foot::kLeft, 0.0);
  if (std::fabs(apart.z) > kStandAheadM) {
    return Text("one foot is %.2f m ahead of the other", std::fabs(apart.z));
  }
  if (std::fabs(apart.y) > kStandRiseM) {
    return Text("one foot is %.2f m higher than the other", std::fabs(apart.y));
  }
  if (apart.x < kNarrowestM || apart.x > kWidestM) {
    return Text("the feet are %.2f m apart sideways", apart.x);
  }
  std::array<double, 2> knees{};
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    LegPose leg;
    EvaluateLeg(skeleton, rig, pose, foot, leg);
    knees[static_cast<std::size_t>(foot)] = KneeRad(rig.side(foot), leg);
  }
  constexpr double kDegrees = 57.29577951308232;
  if (std::max(knees[0], knees[1]) > kMaxKneeRad) {
    return Text("a knee is bent by %.0f degrees", kDegrees * std::max(knees[0], knees[1]));
  }
  if (std::fabs(knees[0] - knees[1]) > kMaxKneeDifferenceRad) {
    return Text("one knee is bent by %.0f degrees more than the other",
                kDegrees * std::fabs(knees[0] - knees[1]));
  }
  return std::nullopt;
}

StandParts PartsOf(const std::array<StrideModel, 2>& strides) {
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
    const PostureSample flat = strides[static_cast<std::size_t>(OtherFoot(foot))].At(kFlat);
    parts.ankles[f] = flat.ankles[f];
    parts.ball_y_m[f] = flat.balls_m[f].y;
  }
  parts.width_m = 0.5 * (strides[0].width_m + strides[1].width_m);
  return parts;
}

std::optional<StandParts> PartsOf(const RawLibrary& library) {
  StandParts parts;
  double count = 0.0;
  std::array<double, 2> soles{};
  const auto add_sole = [&](Foot foot, const PostureSample& sample) {
    const auto f = static_cast<std::size_t>(foot);
    soles[f] += 1.0;
    const double share = 1.0 / soles[f];
    parts.ankles[f] =
        soles[f] == 1.0 ? sample.ankles[f] : Blend(parts.ankles[f], sample.ankles[f], share);
    parts.ball_y_m[f] += share * (sample.balls_m[f].y - parts.ball_y_m[f]);
  };
  const auto visit = [&](const RawGroup& group, auto use) {
    for (const RawExample& example : group.examples) {
      Clip clip = example.clip;
      MakeSignContinuous(clip);
      Pose pose(library.skeleton.joint_count());
      for (std::size_t p = 0; p < kPointCount; p += kPointsPerInterval / 2) {
        SampleClip(clip, TimeAtPoint(example.keytimes_s, p), pose);
        const double heading = example.heading_change_rad * static_cast<double>(p) /
                               static_cast<double>(kPointCount - 1);
        use(MovingFoot(group.kind), p, SampleOf(library.skeleton, pose, heading));
      }
    }
  };
  for (const RawGroup& group : library.groups) {
    if (!IsStep(group.kind) || group.is_completed) continue;
    visit(group, [&](Foot moving, std::size_t p, const PostureSample& sample) {
      count += 1.0;
      parts.mean = count == 1.0 ? sample : Blend(parts.mean, sample, 1.0 / count);
      if (p == kPointsPerInterval * 3 / 2) add_sole(OtherFoot(moving), sample);
    });
  }
  if (count == 0.0) return std::nullopt;
  // If only one foot steps, it is seen flat only after its landing.
  for (const RawGroup& group : library.groups) {
    if (!IsStep(group.kind) || group.is_completed) continue;
    if (soles[static_cast<std::size_t>(MovingFoot(group.kind))] > 0.0) continue;
    visit(group, [&](Foot moving, std::size_t p, const PostureSample& sample) {
      if (p == kPointCount - 1) add_sole(moving, sample);
    });
  }
  if (soles[0] == 0.0 || soles[1] == 0.0) return std::nullopt;
  parts.width_m = 0.0;  // The smallest width of a stand.
  return parts;
}

Pose ComposeStand(const Skeleton& skeleton, const LegRig& rig, const StandParts& parts) {
  const double width_m = std::clamp(parts.width_m, kMinStandWidthM, kMaxStandWidthM);
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
    const DVec3 ball((foot == Foot::kLeft ? 0.5 : -0.5) * width_m, parts.ball_y_m[f], 0.0);
    ankles_m[f] = ball - sole;
    hips_m += 0.5 * DVec3(legs[f].positions_m[static_cast<std::size_t>(side.hip)]);
    middle_m += 0.5 * ankles_m[f];
  }
  DVec3 root(middle_m.x - hips_m.x, 0.0, middle_m.z + kHipsAheadM - hips_m.z);
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
