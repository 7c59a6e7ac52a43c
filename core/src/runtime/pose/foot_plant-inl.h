// Plants the feet of several avatars at once (see PlantFeet). A test compares the result with a
// scalar implementation in double precision, tests/support/reference_evaluation.cpp. Positions are
// relative to the base of each movement, so that single precision suffices.
#if defined(STRIDEWIRE_FOOT_PLANT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STRIDEWIRE_FOOT_PLANT_INL_H
#undef STRIDEWIRE_FOOT_PLANT_INL_H
#else
#define STRIDEWIRE_FOOT_PLANT_INL_H
#endif

#include "runtime/pose/plant_feet.h"
#include "runtime/pose/simd_math-inl.h"
#include "runtime/skeleton/foot_plant_constants.h"
#include "runtime/skeleton/leg_rig.h"

HWY_BEFORE_NAMESPACE();
namespace stridewire::kernels::HWY_NAMESPACE {
namespace {

HWY_INLINE Float EaseOut(Float s) {
  const Float r = Float(1.0f) - Clamp(s, Float(0.0f), Float(1.0f));
  return r * r * (Float(3.0f) - Float(2.0f) * r);
}
HWY_INLINE Float EaseOutSlope(Float s) {
  const Float in = Clamp(s, Float(0.0f), Float(1.0f));
  const Float r = Float(1.0f) - in;
  return in * r * r;
}
// Divides by a constant: multiplies by its reciprocal, which is computed in double precision.
HWY_INLINE Float DivideBy(Float x, double length) {
  return x * Float(static_cast<float>(1.0 / length));
}
HWY_INLINE Float SmoothMax(Float a, Float b, float soft_m) {
  const Float d = a - b;
  return Float(0.5f) * (a + b + Sqrt(d * d + Float(soft_m * soft_m)));
}

template <typename Number>
HWY_INLINE Number Constant(double value) {
  return Number(static_cast<float>(value));
}
HWY_INLINE Float OnePlusTwice(Float x) { return Float(1.0f) + x + x; }
template <typename T>
HWY_INLINE T AddBoth(T base, T a, T b) {
  return base + a + b;
}
#define STRIDEWIRE_INLINE HWY_INLINE
#include "runtime/pose/foot_correction-inl.h"
#undef STRIDEWIRE_INLINE

struct SoaTrajectory : TrajectoryOf<Float, SoaVec3> {
  SoaVec3 normals[2];
};

// Loads a trajectory in the layout of PackFootPlan.
HWY_INLINE SoaTrajectory LoadTrajectory(const float* plan) {
  SoaTrajectory t;
  const auto next = [&]() HWY_ATTR {
    const SoaQuat four = LoadQuat(plan);
    plan += 4 * kBlock;
    return four;
  };
  SoaQuat q = next();
  t.from = XyzOf(q), t.from_heading = q.w;
  q = next();
  t.to = XyzOf(q), t.to_heading = q.w;
  q = next();
  t.release_offset = XyzOf(q), t.release_turn = q.w;
  q = next();
  t.release_velocity = XyzOf(q), t.root_weight = q.w;
  q = next();
  t.land_offset = XyzOf(q), t.lift[1] = q.w;
  q = next();
  t.land_velocity = XyzOf(q), t.residual_turn = q.w;
  q = next();
  t.mid_swing_offset = XyzOf(q), t.residual_turn_s = q.w;
  q = next();
  t.height[0] = q.x, t.height[1] = q.y, t.height[2] = q.z, t.residual_over_s = q.w;
  q = next();
  t.turn[0] = q.x, t.turn[1] = q.y, t.turn[2] = q.z, t.release_s = q.w;
  q = next();
  t.normals[0] = XyzOf(q), t.land_s = q.w;
  q = next();
  t.normals[1] = XyzOf(q), t.lift[0] = q.w;
  q = next();
  t.residual_offset = XyzOf(q), t.lift[2] = q.w;
  q = next();
  t.residual_velocity = XyzOf(q), t.locks_height = q.w;
  q = next();
  t.root_shift = XyzOf(q), t.settle_lift = q.w;
  q = next();
  t.level[0] = q.x, t.level[1] = q.y, t.level[2] = q.z, t.level[3] = q.w;
  return t;
}

// The part of a movement's plan that is common to both feet, and the time to evaluate.
struct PlanCommon {
  RootResidualOf<Float, SoaVec3> root_residual;
  Float extra_turn, duration_s, start_offset_s, ease_out_s, keeps_above_ground, plant_fade_s;
  Float time_s;
  Float per_duration, per_ease_out;  // Reciprocals of duration_s and ease_out_s.

  HWY_INLINE Float OfDuration(Float x) const { return x * per_duration; }
  HWY_INLINE Float OfEaseOut(Float x) const { return x * per_ease_out; }
};

// Result of forward kinematics of a leg. Positions are relative to the root, in world axes.
struct SoaLeg {
  SoaVec3 positions[kMaxLegChain];
  SoaQuat rotations[kMaxLegChain];
  SoaVec3 ball;
};

HWY_INLINE SoaVec3 Broadcast(const float* v) { return {Float(v[0]), Float(v[1]), Float(v[2])}; }

// Calls `step` for the left and then for the right leg. Each step of a leg depends on the previous
// step of that leg. Because the steps of both legs alternate, the processor can work on one leg
// while it waits for results of the other.
template <typename Step>
HWY_INLINE void ForBothFeet(const LegRig& rig, const Step& step) {
  step(rig.bones[0], std::size_t{0});
  step(rig.bones[1], std::size_t{1});
}

// Maps indices in a leg's chain to indices in an array of rotations. The array contains either all
// joints of the skeleton, or only those in LegRig::joints.
using JointMap = std::size_t (LegRig::Bones::*)[kMaxLegChain];

HWY_INLINE void EvaluateLegs(const LegRig& rig, const float* rotations, SoaQuat root, SoaLeg* legs,
                             JointMap joints) {
  std::size_t longest = 0;
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    legs[f].positions[0] = {Float(0.0f), Float(0.0f), Float(0.0f)};
    legs[f].rotations[0] = root;
    longest = longest > bones.count ? longest : bones.count;
  });
  for (std::size_t i = 1; i < longest; ++i) {
    ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
      if (i >= bones.count) return;
      SoaLeg& leg = legs[f];
      leg.positions[i] =
          leg.positions[i - 1] + Rotate(leg.rotations[i - 1], Broadcast(bones.offsets_m[i]));
      leg.rotations[i] =
          Multiply(leg.rotations[i - 1], LoadQuat(rotations + (bones.*joints)[i] * 4 * kBlock));
    });
  }
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    const std::size_t last = bones.count - 1;
    legs[f].ball =
        legs[f].positions[last] + Rotate(legs[f].rotations[last], Broadcast(bones.ball_m));
  });
}

HWY_INLINE SoaVec3 ToeTipOf(const SoaLeg& leg, const LegRig::Bones& bones) {
  const std::size_t last = bones.count - 1;
  return leg.positions[last] + Rotate(leg.rotations[last], Broadcast(bones.toe_tip_m));
}

void ComputeFeet(const LegRig& rig, const float* rotations, std::size_t lanes,
                 const FeetPositions& feet) {
  for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(FloatTag())) {
    SoaLeg legs[2];
    EvaluateLegs(rig, rotations + lane, LoadQuat(rotations + lane), legs,
                 &LegRig::Bones::rig_joints);
    ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
      const auto put = [&](SoaVec3 v, float* to) HWY_ATTR {
        StoreLanes(v.x, to);
        StoreLanes(v.y, to + kBlock);
        StoreLanes(v.z, to + 2 * kBlock);
      };
      const std::size_t at = f * 3 * kBlock + lane;
      put(legs[f].ball, feet.balls_m + at);
      put(legs[f].positions[bones.ankle], feet.ankles_m + at);
      put(ToeTipOf(legs[f], bones), feet.toe_tips_m + at);
    });
  }
}

struct SoaCorrection {
  SoaVec3 offset;
  Float swing;
  SoaQuat turn;  // Rotation of the foot in world axes.
  SoaVec3 root;  // Part of the correction that also moves the root.
};

HWY_INLINE SoaCorrection CorrectFoot(const PlanCommon& common, const SoaTrajectory& trajectory,
                                     SoaVec3 ball, Float heading, Float flatness) {
  const auto correction =
      CorrectTrajectory<Float, SoaVec3>(common, trajectory, ball, heading, flatness);
  const Float one = 1.0f;
  SoaVec3 tilt =
      trajectory.normals[0] * (one - correction.turned) + trajectory.normals[1] * correction.turned;
  tilt.x = tilt.x * correction.tilted;
  tilt.z = tilt.z * correction.tilted;
  const SoaVec3 normal = tilt * (one / Sqrt(Dot(tilt, tilt)));
  SoaCorrection c;
  c.offset = correction.offset;
  c.swing = correction.swing;
  c.turn = Multiply(Normalise({normal.z, Float(0.0f), -normal.x, one + normal.y}),
                    YawRotation(WrapAngle(correction.turn)));
  c.root = c.offset * trajectory.root_weight + correction.root_shift;
  return c;
}

// Returns the depth of a sole below the ground plane of a footprint, in metres. The depth fades to
// zero with increasing distance between the foot and the footprint.
HWY_INLINE Float DepthBelow(SoaVec3 print, SoaVec3 normal, const LegRig::Bones& bones,
                            const SoaLeg& leg, SoaVec3 ball, SoaQuat turn) {
  const Float dx = ball.x - print.x;
  const Float dz = ball.z - print.z;
  const Float away = Sqrt(dx * dx + dz * dz);
  const Float near = EaseOut(
      DivideBy(away - Float(static_cast<float>(kNearPrintM)), kFarFromPrintM - kNearPrintM));
  const Float per_rise = Float(1.0f) / normal.y;
  const auto depth_of = [&](SoaVec3 point, float rest_m) HWY_ATTR {
    const SoaVec3 at = ball + Rotate(turn, point - leg.ball);
    const Float ground =
        print.y - (normal.x * (at.x - print.x) + normal.z * (at.z - print.z)) * per_rise;
    return ground + Float(rest_m) * per_rise - at.y;
  };
  const SoaVec3 toe_tip = ToeTipOf(leg, bones);
  const SoaVec3 heel =
      leg.positions[bones.ankle] + Rotate(leg.rotations[bones.ankle], Broadcast(bones.heel_m));
  const Float depth =
      Max(Max(depth_of(leg.ball, bones.ball_height_m), depth_of(heel, bones.ball_height_m)),
          depth_of(toe_tip, bones.toe_height_m));
  return near * SmoothMax(Float(0.0f), depth, static_cast<float>(kSoftGroundM));
}

HWY_INLINE SoaQuat ShortestArc(SoaVec3 from, SoaVec3 to) {
  const Float scale = Sqrt(Dot(from, from) * Dot(to, to));
  const SoaVec3 axis = Cross(from, to);
  return Normalise({axis.x, axis.y, axis.z, scale + Dot(from, to)});
}

HWY_INLINE SoaVec3 KneeAxis(SoaVec3 thigh, SoaVec3 shank, SoaVec3 reference) {
  const Float scale = Sqrt(Dot(thigh, thigh) * Dot(shank, shank));
  const SoaVec3 plane = Cross(thigh, shank) * (Float(1.0f) / scale);
  const Float sine = Sqrt(Dot(plane, plane));
  const Float s =
      Clamp(DivideBy(Float(kBentSine) - sine, kBentSine - kStraightSine), Float(0.0f), Float(1.0f));
  const Mask is_backward = Dot(plane, reference) < Float(0.0f);
  const Float forward = Select(is_backward, Float(0.0f), Float(1.0f));
  const Float weight = Select(is_backward, Float(1.0f), s * s * (Float(3.0f) - Float(2.0f) * s));
  return plane * forward + reference * (Float(kReferenceWeight) * weight);
}

// Normalizes a quaternion that differs from unit length only by rounding errors. For these, one
// Newton step is as accurate as a square root and a division.
HWY_INLINE SoaQuat Renormalize(SoaQuat q) { return q * (Float(1.5f) - Float(0.5f) * Dot(q, q)); }

// Target of a foot: positions of ankle and ball relative to the root, and the rotation of the ankle
// in world axes.
struct FootTarget {
  SoaVec3 ankle_m, ball_m;
  SoaQuat rotation;
};

// Vectors along the bones of a leg, in the blended pose and after inverse kinematics (`new_`).
struct SoaBones {
  SoaVec3 thigh, shank, new_thigh, new_shank;
};

// Computes the new thighs and shanks with which both legs reach their targets.
HWY_INLINE void BendLegs(const LegRig& rig, const SoaLeg* legs, const FootTarget* targets,
                         SoaBones* work) {
  SoaVec3 towards[2];
  Float distances[2];
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    const SoaVec3 reach = targets[f].ankle_m - legs[f].positions[bones.hip];
    distances[f] = Sqrt(Dot(reach, reach));
    const Mask is_away = distances[f] > Float(1e-6f);
    const Float per_distance = Float(1.0f) / Max(distances[f], Float(1e-6f));
    towards[f] = Select(is_away, reach * per_distance, {Float(0.0f), Float(-1.0f), Float(0.0f)});
  });
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    SoaBones& w = work[f];
    const float l1 = bones.thigh_m;
    const float l2 = bones.shank_m;
    const float shortest = (l1 > l2 ? l1 - l2 : l2 - l1) + 1e-3f * (l1 + l2);
    const Float d = Clamp(distances[f], Float(shortest), Float(kMaxLegExtension * (l1 + l2)));
    const Float a = (Float(l1 * l1 - l2 * l2) + d * d) / (d + d);
    const Float h = Sqrt(Max(Float(0.0f), Float(l1 * l1) - a * a));
    const SoaVec3 hinge = Rotate(legs[f].rotations[bones.hip], Broadcast(bones.hinge));
    SoaVec3 pole = Cross(towards[f], KneeAxis(w.thigh, w.shank, hinge));
    const Float pole_length = Sqrt(Dot(pole, pole));
    const Mask has_pole = pole_length > Float(1e-6f);
    pole = Select(has_pole, pole * (Float(1.0f) / Max(pole_length, Float(1e-6f))),
                  {Float(0.0f), Float(0.0f), Float(1.0f)});
    w.new_thigh = towards[f] * a + pole * h;
    w.new_shank = towards[f] * d - w.new_thigh;
  });
}

// Raises the heels of feet whose ankles would be flexed too far (kAnkleLimitRad): turns these feet
// about their balls. Toes keep their rotation in the world if they have a joint. `share` scales the
// turns. Returns true if any target has changed.
HWY_INLINE bool RaiseHeels(const LegRig& rig, const SoaBones* work, Float share,
                           FootTarget* targets, float* rotations, JointMap joints) {
  Float excess[2];
  SoaVec3 soles[2];
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    soles[f] = targets[f].ball_m - targets[f].ankle_m;
    excess[f] = Float(0.0f);
    if (bones.foot_m < kSmallestBoneM) return;  // The foot has no direction.
    const SoaVec3& shank = work[f].new_shank;
    const Float cosine = -Dot(soles[f], shank) / Sqrt(Dot(soles[f], soles[f]) * Dot(shank, shank));
    excess[f] = DivideBy(cosine - Float(bones.ankle_limit_cosine), bones.ankle_limit_sine);
  });
  if (!Any(excess[0] > Float(0.0f) || excess[1] > Float(0.0f))) return false;
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    const Mask is_flexed = excess[f] > Float(0.0f);
    const Float soft = Min(excess[f], Float(static_cast<float>(kAnkleSoftRad)));
    const Float grown = excess[f] - soft + DivideBy(soft * soft, 2.0 * kAnkleSoftRad);
    // Half the turn, which is used as an approximation of its tangent.
    const Float half = Float(static_cast<float>(0.5 * kHeelRise)) * grown * share;
    const SoaVec3& sole = soles[f];
    const Float per_flat =
        half / Max(Sqrt(sole.x * sole.x + sole.z * sole.z), Float(kSmallestBoneM));
    const SoaQuat turn =
        Normalise({sole.z * per_flat, Float(0.0f), -sole.x * per_flat, Float(1.0f)});
    FootTarget& target = targets[f];
    const SoaQuat before = target.rotation;
    target.ankle_m = Select(is_flexed, target.ball_m - Rotate(turn, sole), target.ankle_m);
    target.rotation = Select(is_flexed, Multiply(turn, before), before);
    if (!bones.has_toe_joint) return;
    float* toes = rotations + (bones.*joints)[bones.count - 1] * 4 * kBlock;
    const SoaQuat local = LoadQuat(toes);
    const SoaQuat world = Multiply(before, local);
    StoreQuat(Select(is_flexed, Renormalize(Multiply(Conjugate(target.rotation), world)), local),
              toes);
  });
  return true;
}

// Solves both legs for the given targets and stores the changed rotations: hips, knees, ankles and,
// if a heel rises, toes.
HWY_INLINE void SolveLegs(const LegRig& rig, const SoaLeg* legs, Float heel_share,
                          FootTarget* targets, float* rotations, JointMap joints) {
  SoaBones work[2];
  SoaQuat turn_thighs[2];
  SoaQuat turn_shanks[2];
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    const SoaLeg& leg = legs[f];
    work[f].thigh = leg.positions[bones.knee] - leg.positions[bones.hip];
    work[f].shank = leg.positions[bones.ankle] - leg.positions[bones.knee];
  });
  BendLegs(rig, legs, targets, work);
  if (RaiseHeels(rig, work, heel_share, targets, rotations, joints)) {
    BendLegs(rig, legs, targets, work);
  }
  ForBothFeet(rig, [&](const LegRig::Bones&, std::size_t f) HWY_ATTR {
    turn_thighs[f] = ShortestArc(work[f].thigh, work[f].new_thigh);
  });
  ForBothFeet(rig, [&](const LegRig::Bones&, std::size_t f) HWY_ATTR {
    turn_shanks[f] = Multiply(ShortestArc(Rotate(turn_thighs[f], work[f].shank), work[f].new_shank),
                              turn_thighs[f]);
  });
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    const SoaLeg& leg = legs[f];
    const auto store = [&](std::size_t place, SoaQuat before, SoaQuat rotation) HWY_ATTR {
      StoreQuat(Renormalize(Multiply(Conjugate(before), rotation)),
                rotations + (bones.*joints)[place] * 4 * kBlock);
    };
    store(bones.hip, leg.rotations[bones.hip - 1],
          Multiply(turn_thighs[f], leg.rotations[bones.hip]));
    store(bones.knee, Multiply(turn_thighs[f], leg.rotations[bones.knee - 1]),
          Multiply(turn_shanks[f], leg.rotations[bones.knee]));
    store(bones.ankle, Multiply(turn_shanks[f], leg.rotations[bones.ankle - 1]),
          targets[f].rotation);
  });
}

// Returns by how much the root must be lowered for a leg to reach the target of its ankle, in
// metres (see kFreeExtension). `blended_m` is the distance from hip to ankle in the blended pose,
// and `reach` is the vector from the hip to the target.
HWY_INLINE Float LowerFor(float length_m, Float blended_m, SoaVec3 reach) {
  const auto part = [&](double fraction)
                        HWY_ATTR { return Float(static_cast<float>(fraction) * length_m); };
  const Float longest = Min(SmoothMax(blended_m, part(kEasyExtension), static_cast<float>(kSoftM)),
                            part(kLongestExtension));
  const Float free = Min(Max(blended_m, part(kFreeExtension)), longest - part(kLeastRoom));
  const Float flat_squared = reach.x * reach.x + reach.z * reach.z;
  const Float distance = Sqrt(flat_squared + reach.y * reach.y);
  const Float excess = Max(distance - free, Float(0.0f));
  const Float share = excess / (longest - free);
  const Float allowed = distance - excess + excess / Sqrt(Float(1.0f) + share * share);
  const Float deepest = part(0.5);
  const Float drop = Sqrt(Max(allowed * allowed - flat_squared, deepest * deepest));
  return Max(Float(0.0f), -reach.y - drop);
}

// Plants the feet of one vector of poses, starting at `lane`.
void PlantVector(const LegRig& rig, const PlantPosesJob& block, std::size_t lane, JointMap joints) {
  const DoubleTag d;
  const hn::Rebind<float, DoubleTag> floats;
  const std::size_t doubles = hn::Lanes(d);
  const std::size_t width = hn::Lanes(FloatTag());
  const float* plan = block.plan + lane;
  float* rotations = block.rotations + lane;
  PlanCommon common;
  {
    const float* at = plan + 2 * kPackedTrajectoryFloats * kBlock;
    SoaQuat q = LoadQuat(at);
    common.root_residual.offset = XyzOf(q), common.extra_turn = q.w;
    q = LoadQuat(at + 4 * kBlock);
    common.root_residual.velocity = XyzOf(q), common.duration_s = q.w;
    q = LoadQuat(at + 8 * kBlock);
    common.start_offset_s = q.x, common.ease_out_s = q.y, common.keeps_above_ground = q.z;
    common.plant_fade_s = q.w;
    q = LoadQuat(at + 12 * kBlock);
    common.root_residual.approach = XyzOf(q), common.root_residual.approach_over_s = q.w;
    common.root_residual.approach_velocity = LoadVec3(at + 16 * kBlock);
    common.per_duration = Float(1.0f) / common.duration_s;
    common.per_ease_out = Float(1.0f) / common.ease_out_s;
  }
  HWY_ALIGN float local_m[3 * kBlock];
  HWY_ALIGN float times_s[kBlock];
  for (std::size_t i = 0; i < width; i += doubles) {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto world = hn::PromoteTo(d, hn::LoadU(floats, block.root_m + c * kBlock + lane + i));
      const auto base = hn::LoadU(d, block.base_m + c * kBlock + lane + i);
      hn::StoreU(hn::DemoteTo(floats, hn::Sub(world, base)), floats, local_m + c * kBlock + i);
    }
    hn::StoreU(hn::DemoteTo(floats, hn::LoadU(d, block.time_s + lane + i)), floats, times_s + i);
  }
  const SoaVec3 root = LoadVec3(local_m);
  common.time_s = LoadLanes(times_s);

  const SoaQuat root_rotation = LoadQuat(rotations);
  SoaLeg legs[2];
  SoaCorrection corrections[2];
  SoaVec3 ankles[2];
  SoaVec3 balls[2];
  SoaVec3 shift = {Float(0.0f), Float(0.0f), Float(0.0f)};
  Float headings[2];
  Float flatnesses[2];
  EvaluateLegs(rig, rotations, root_rotation, legs, joints);
  const Mask is_settling = common.plant_fade_s > Float(0.0f);
  // Fraction to which the changes due to planting have faded in (FootPlan::plant_fade_s).
  const Float planted =
      Select(is_settling,
             Float(1.0f) - EaseOut((common.time_s - common.start_offset_s) /
                                   Select(is_settling, common.plant_fade_s, Float(1.0f))),
             Float(1.0f));
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    const SoaVec3 sole = legs[f].ball - legs[f].positions[bones.ankle];
    headings[f] = Atan2(sole.x, sole.z) - Float(bones.toe_out_rad);
    flatnesses[f] = bones.foot_m < kSmallestBoneM
                        ? Float(0.0f)
                        : DivideBy(Sqrt(sole.x * sole.x + sole.z * sole.z), bones.foot_m);
  });
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    const SoaLeg& leg = legs[f];
    const SoaTrajectory trajectory = LoadTrajectory(plan + f * kPackedTrajectoryFloats * kBlock);
    const SoaVec3 ball = root + leg.ball;
    SoaCorrection& c = corrections[f];
    c = CorrectFoot(common, trajectory, ball, headings[f], flatnesses[f]);
    const Mask keeps_above = common.keeps_above_ground > Float(0.0f);
    if (Any(keeps_above)) {
      const Float second =
          Float(1.0f) - EaseOut(DivideBy(c.swing - Float(static_cast<float>(kGroundBlendStart)),
                                         kGroundBlendLength));
      const SoaVec3 at = ball + c.offset;
      const Float lift =
          (Float(1.0f) - second) *
              DepthBelow(trajectory.from, trajectory.normals[0], bones, leg, at, c.turn) +
          second * DepthBelow(trajectory.to, trajectory.normals[1], bones, leg, at, c.turn);
      // The root follows this lift as it follows the other corrections of the foot, but only up to
      // kRootFollowsLiftM. Beyond that, the lift bends the leg. The fraction for each foot changes
      // gradually, because the feet exchange their roles from step to step.
      const Float entered = common.OfEaseOut(common.time_s - common.start_offset_s);
      const Float share =
          trajectory.root_weight +
          EaseOut(entered) * (Float(1.0f) - trajectory.root_weight - trajectory.root_weight);
      const Float lifted = Select(keeps_above, lift * planted, Float(0.0f));
      c.offset.y = c.offset.y + lifted;
      const Float followed = lifted / (Float(1.0f) + DivideBy(lifted, kRootFollowsLiftM));
      c.root.y = c.root.y + followed * share;
    }
    balls[f] = ball + c.offset;
    ankles[f] = balls[f] + Rotate(c.turn, leg.positions[bones.ankle] - leg.ball);
    shift = shift + c.root;
  });
  shift = AddRootResidual<Float>(shift, common, common.root_residual);
  const SoaQuat dip = LoadQuat(plan + (2 * kPackedTrajectoryFloats + 20) * kBlock);
  if (Any(dip.x > Float(0.0f))) {
    const Float depth = DipAt<Float>(common, {dip.x, dip.y, dip.z, dip.w});
    shift.y = shift.y - Select(dip.x > Float(0.0f), depth, Float(0.0f));
  }

  Float lowers[2];
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    const SoaVec3 hip = legs[f].positions[bones.hip];
    const SoaVec3 blended = legs[f].positions[bones.ankle] - hip;
    lowers[f] = LowerFor(bones.thigh_m + bones.shank_m, Sqrt(Dot(blended, blended)),
                         ankles[f] - (root + shift + hip));
  });
  const Float apart = lowers[0] - lowers[1];
  const Float overlap = Float(static_cast<float>(kLowerOverlap)) * lowers[0] * lowers[1];
  shift.y = shift.y - Float(0.5f) * (lowers[0] + lowers[1] + Sqrt(apart * apart + overlap));

  // The pose stores the root as floats in world space. The root is rounded first, so that the legs
  // are solved for the displayed root position.
  HWY_ALIGN float shifts_m[3 * kBlock];
  StoreLanes(shift.x, shifts_m);
  StoreLanes(shift.y, shifts_m + kBlock);
  StoreLanes(shift.z, shifts_m + 2 * kBlock);
  for (std::size_t i = 0; i < width; i += doubles) {
    for (std::size_t c = 0; c < 3; ++c) {
      float* root_m = block.root_m + c * kBlock + lane + i;
      const auto by = hn::PromoteTo(d, hn::LoadU(floats, shifts_m + c * kBlock + i));
      const auto shown =
          hn::DemoteTo(floats, hn::Add(hn::PromoteTo(d, hn::LoadU(floats, root_m)), by));
      hn::StoreU(shown, floats, root_m);
      const auto base = hn::LoadU(d, block.base_m + c * kBlock + lane + i);
      hn::StoreU(hn::DemoteTo(floats, hn::Sub(hn::PromoteTo(d, shown), base)), floats,
                 local_m + c * kBlock + i);
    }
  }
  const SoaVec3 moved = LoadVec3(local_m);
  FootTarget targets[2];
  ForBothFeet(rig, [&](const LegRig::Bones& bones, std::size_t f) HWY_ATTR {
    targets[f] = {ankles[f] - moved, balls[f] - moved,
                  Multiply(corrections[f].turn, legs[f].rotations[bones.ankle])};
  });
  SolveLegs(rig, legs, planted, targets, rotations, joints);
}

void PlantPoses(const LegRig& rig, const PlantPosesJob& block, std::size_t count) {
  for (std::size_t lane = 0; lane < count; lane += hn::Lanes(FloatTag())) {
    PlantVector(rig, block, lane, &LegRig::Bones::joints);
  }
}

// Broadcasts each of `count` numbers to all lanes of one vector.
HWY_INLINE void BroadcastAll(const float* from, std::size_t count, float* to) {
  const FloatTag d;
  for (std::size_t i = 0; i < count; ++i) hn::Store(hn::Set(d, from[i]), d, to + i * kBlock);
}

// Plants the feet of one pose. Evaluates the same pose in all lanes of a vector and uses the first
// lane.
void PlantPose(const LegRig& rig, const PlantPoseJob& job) {
  HWY_ALIGN float plan[kPackedPlanFloats * kBlock];
  HWY_ALIGN float rotations[LegRig::kMaxJointsOfLegs * 4 * kBlock];
  HWY_ALIGN double time_s[kBlock];
  HWY_ALIGN double base_m[3 * kBlock];
  HWY_ALIGN float root_m[3 * kBlock];
  BroadcastAll(job.plan, kPackedPlanFloats, plan);
  BroadcastAll(job.root_m, 3, root_m);
  for (const LegRig::Bones& bones : rig.bones) {
    for (std::size_t i = 0; i < bones.count; ++i) {
      BroadcastAll(job.rotations + 4 * bones.joints[i], 4,
                   rotations + bones.rig_joints[i] * 4 * kBlock);
    }
  }
  for (std::size_t i = 0; i < hn::Lanes(FloatTag()); ++i) {
    time_s[i] = job.time_s;
    for (std::size_t c = 0; c < 3; ++c) base_m[c * kBlock + i] = job.base_m[c];
  }
  PlantVector(rig, {plan, time_s, base_m, root_m, rotations}, 0, &LegRig::Bones::rig_joints);
  for (std::size_t c = 0; c < 3; ++c) job.root_m[c] = root_m[c * kBlock];
  for (const LegRig::Bones& bones : rig.bones) {
    for (const std::size_t place : {bones.hip, bones.knee, bones.ankle, bones.count - 1}) {
      for (std::size_t c = 0; c < 4; ++c) {
        job.rotations[4 * bones.joints[place] + c] =
            rotations[(bones.rig_joints[place] * 4 + c) * kBlock];
      }
    }
  }
}

}  // namespace
}  // namespace stridewire::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // STRIDEWIRE_FOOT_PLANT_INL_H
