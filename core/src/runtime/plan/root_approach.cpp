#include "runtime/plan/root_approach.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/library/locomotion_profile.h"
#include "runtime/plan/transition_samples.h"

namespace stridewire {
namespace {

// Maximum acceleration of the root due to the blend from the previous pose. A blend that would take
// longer than its maximum duration exceeds it. At the start of the blend, the limit is lower if the
// movement itself accelerates the root in the same direction, but at least kLeastMaxMPerS2. It is
// higher if the movement accelerates the root in the opposite direction. In captures of starts and
// stops, the root accelerates by 4 to 4.6 m/s^2 in total.
constexpr double kMaxAccelerationMPerS2 = 2.5;
constexpr double kLeastMaxMPerS2 = 1.0;
constexpr double kMaxApproachS = 0.8;
// Vertical accelerations have a smaller weight, because climbing legs push the body up.
constexpr double kVerticalWeight = 0.4;
// On level ground, the longer blend of the root includes its height only if the root has to rise by
// more than this. Otherwise, only its horizontal position is blended for longer.
constexpr double kMaxLevelRiseM = 0.05;
// On terrain the blend is shorter, because a climbing or descending leg has less reach to spare.
constexpr double kMaxTerrainApproachS = 0.35;
// In strides, the blend is shorter as well. Otherwise, the pelvis would lag behind when it passes
// the standing foot, where each centimetre bends the knee by several degrees.
constexpr double kMaxStrideApproachS = 0.35;
constexpr double kApproachStepS = 0.02;
constexpr double kApproachToleranceS = 1e-7;

double HorizontalLength(const DVec3& v) { return std::sqrt(v.x * v.x + v.z * v.z); }

// Returns the larger of the horizontal and the weighted vertical part of an acceleration.
double WeightedLength(const DVec3& v) {
  return std::max(HorizontalLength(v), kVerticalWeight * std::fabs(v.y));
}

// Returns the shortest time in [least_s, most_s] in which the root can move from `offset_m` with
// velocity `offset_m_s` to rest at 0 within the limit on its acceleration
// (kMaxAccelerationMPerS2), or `most_s` if there is none. `own_m_s2` is the acceleration of the
// movement itself. Bisects the last step of the search, so that a rounding error does not change
// the result by a whole step.
double ApproachTime(const DVec3& offset_m, const DVec3& offset_m_s, const DVec3& own_m_s2,
                    double least_s, double most_s) {
  const auto exceeds = [&](double over_s) {
    // The acceleration on the cubic curve changes linearly from `at_start` to `at_end`.
    const DVec3 bend = 6.0 / (over_s * over_s) * offset_m;
    const DVec3 slope = 2.0 / over_s * offset_m_s;
    const DVec3 at_start = -bend - 2.0 * slope;
    const DVec3 at_end = bend + slope;
    const double size = WeightedLength(at_start);
    const double along = size > 0.0 ? glm::dot(own_m_s2, at_start) / size : 0.0;
    const double limit = std::max(kMaxAccelerationMPerS2 - along, kLeastMaxMPerS2);
    return size > limit || WeightedLength(at_end) > kMaxAccelerationMPerS2;
  };
  double too_short_s = least_s;
  if (!exceeds(too_short_s)) return least_s;
  double over_s = std::min(least_s + kApproachStepS, most_s);
  while (exceeds(over_s)) {
    if (over_s >= most_s) return most_s;
    too_short_s = over_s;
    over_s = std::min(over_s + kApproachStepS, most_s);
  }
  while (over_s - too_short_s > kApproachToleranceS) {
    const double middle_s = 0.5 * (too_short_s + over_s);
    (exceeds(middle_s) ? too_short_s : over_s) = middle_s;
  }
  return over_s;
}

// Returns true if the feet are apart in the walking direction at the start and end of a step. Uses
// the heading at the start for both, because movement records do not contain the heading change of
// the examples.
bool IsStride(const FootPlan& plan, double heading_rad) {
  const auto ahead_m = [&](const Footprint& left, const Footprint& right) {
    return std::fabs(RotateYaw(-heading_rad, left.position_m - right.position_m).z);
  };
  return std::min(ahead_m(plan.feet[0].from, plan.feet[1].from),
                  ahead_m(plan.feet[0].to, plan.feet[1].to)) > kFeetApartForwardM;
}

// Returns the horizontal acceleration of the root in a movement without its difference pose, as a
// mean over the first 80 % of the blend-in. Returns 0 except for steps on level ground, because
// other movements have no samples of the blend-in. `offset_m` and `offset_m_s` are the offset and
// the velocity that the difference pose adds to the root at the start. `above_feet` returns the
// position of the root relative to the standing feet in a sample.
template <typename AboveFeet>
DVec3 OwnAcceleration(const TransitionSamples& samples, const AboveFeet& above_feet,
                      const DVec3& offset_m, const DVec3& offset_m_s, double ease_out_s) {
  if (!samples.has_settle_samples()) return DVec3(0.0);
  const auto& parts = TransitionSamples::kSettleSamples;
  constexpr std::size_t kMiddle = 2;
  constexpr std::size_t kEnd = 6;
  static_assert(parts[kEnd] == 2.0 * parts[kMiddle]);
  const auto without_difference = [&](std::size_t k) {
    return above_feet(TransitionSamples::kSettle + k) - EaseOut(parts[k]) * offset_m -
           ease_out_s * EaseOutSlope(parts[k]) * offset_m_s;
  };
  const double step_s = parts[kMiddle] * ease_out_s;
  DVec3 own_m_s2 = (above_feet(samples.blended_start()) - 2.0 * without_difference(kMiddle) +
                    without_difference(kEnd)) /
                   (step_s * step_s);
  own_m_s2.y = 0.0;
  return own_m_s2;
}

}  // namespace

void PlanRootApproach(const FootPlanJob& job) {
  Movement& movement = job.movement;
  FootPlan& plan = movement.feet;
  if (!plan.is_active || job.library.group(movement.group).kind == MovementKind::kStand) return;
  const double start_s = movement.start_offset_s;
  const double ease_out_s = movement.ease_out_s;
  const TransitionSamples& samples = job.transition;
  const std::size_t eased = TransitionSamples::kStart;
  const std::size_t blended = samples.blended_start();
  const auto above_feet = [&](std::size_t i) {
    DVec3 root = samples.feet().Root(i);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      root -= plan.foot(foot).root_weight * samples.feet().Ball(i, foot);
    }
    return root;
  };
  // The approach includes the height if the root has to rise (on level ground, by more than
  // kMaxLevelRiseM). Otherwise, the legs of an avatar that has climbed or that rises from a crouch
  // would straighten within the short time in which the difference pose fades out.
  const double rise_m = above_feet(blended).y - above_feet(eased).y;
  const bool rises = rise_m > (plan.keeps_above_ground ? 0.0 : kMaxLevelRiseM);
  const auto offset_at = [&](std::size_t i) {
    DVec3 offset = above_feet(eased + i) - above_feet(blended + i);
    if (!rises) offset.y = 0.0;
    return offset;
  };
  const DVec3 offset_m = offset_at(0);
  DVec3 offset_m_s(0.0);
  if (movement.is_inertial) {
    const DVec3 next_m = offset_at(1);
    const double part = samples.start_step_s() / ease_out_s;
    offset_m_s = (next_m - EaseOut(part) * offset_m) / (ease_out_s * EaseOutSlope(part));
  }
  const DVec3 own_m_s2 = OwnAcceleration(samples, above_feet, offset_m, offset_m_s, ease_out_s);
  const double longest_s = plan.keeps_above_ground                     ? kMaxTerrainApproachS
                           : IsStride(plan, movement.base.heading_rad) ? kMaxStrideApproachS
                                                                       : kMaxApproachS;
  const double most_s = std::min(longest_s, movement.duration_s() - start_s);
  DVec3 residual_m = plan.root_residual_m;
  DVec3 residual_m_s = plan.root_residual_m_s;
  // The vertical component of the residual fades out over the fraction kRootRisePart of the
  // movement, so it is ignored here.
  residual_m.y = residual_m_s.y = 0.0;
  plan.root_approach = {.offset_m = offset_m,
                        .offset_m_s = offset_m_s,
                        .over_s = ApproachTime(offset_m + residual_m, offset_m_s + residual_m_s,
                                               own_m_s2, ease_out_s, std::max(ease_out_s, most_s))};
}

}  // namespace stridewire
