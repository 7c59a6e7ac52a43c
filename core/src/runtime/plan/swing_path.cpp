#include "runtime/plan/swing_path.h"

#include <algorithm>
#include <cmath>

#include "runtime/pose/plant_feet.h"

namespace stridewire {
namespace {

// In mid-swing, a foot stays at least kClearanceM above the highest ground within a horizontal
// distance of kPassingRadiusM, unless this requires a lift above kMaxLiftM.
constexpr double kClearanceM = 0.037;
constexpr double kPassingRadiusM = 0.02;
// The middle lift may be negative if the foot has to rise elsewhere in the swing. It lowers the
// foot by at most the larger of two values: the largest missing clearance, and kMiddleSinkPerClimb
// times the height difference between the footprints, and never by more than kMaxMiddleSinkM.
constexpr double kMiddleSinkPerClimb = 0.5;
constexpr double kMaxMiddleSinkM = 0.2;
// If a lift exceeds kNoticeableLiftM, ChooseSwing also tries to shift the middle of the swing
// forward or backward by up to kMaxAdvanceM. The cost of a swing is the sum of its peak, its
// steepness (metres per swing) times kSteepnessWeight, and the size of this shift times
// kAdvanceCost.
constexpr double kNoticeableLiftM = 0.01;
constexpr double kMaxAdvanceM = 0.12;
constexpr double kSteepnessWeight = 0.2;
constexpr double kAdvanceCost = 0.2;
// Shifts to try, as fractions of kMaxAdvanceM. Positive values shift the foot forward.
constexpr std::array<double, 12> kAdvances{-1.0 / 6, 1.0 / 6, -1.0 / 3, 1.0 / 3, -0.5, 0.5,
                                           -2.0 / 3, 2.0 / 3, -5.0 / 6, 5.0 / 6, -1.0, 1.0};

struct SwingLifts {
  std::array<double, 3> lift_m{};  // FootTrajectory::lift_m
  double cost_m = HUGE_VAL;
};

// Returns the cost of a swing in which the ball has the heights `heights_m`: its peak above the
// higher footprint, plus the maximum slope between neighbouring samples times kSteepnessWeight.
// `from_m` and `to_m` are the heights of the footprints.
double SwingCost(const SwingValues& heights_m, double from_m, double to_m) {
  double peak_m = std::max(from_m, to_m);
  double steepest_m = 0.0;
  double before_m = from_m;
  double before = 0.0;
  for (std::size_t s = 0; s <= kClearanceSamples.size(); ++s) {
    const bool is_last = s == kClearanceSamples.size();
    const double height_m = is_last ? to_m : heights_m[s];
    const double swing = is_last ? 1.0 : kClearanceSamples[s];
    peak_m = std::max(peak_m, height_m);
    steepest_m = std::max(steepest_m, std::fabs(height_m - before_m) / (swing - before));
    before_m = height_m;
    before = swing;
  }
  return peak_m - std::max(from_m, to_m) + kSteepnessWeight * steepest_m;
}

// Returns the lifts with the lowest cost that together raise the foot by at least
// `missing_clearance_m` at each sample of the swing. If this is impossible because lifts are
// limited to kMaxLiftM, they raise it as far as possible. A negative missing clearance is a height
// by which the foot may be lowered. `heights_m` are the heights of the ball without lifts, `from_m`
// and `to_m` those of the footprints.
SwingLifts LowestLifts(const SwingValues& missing_clearance_m, const SwingValues& heights_m,
                       double from_m, double to_m) {
  constexpr int kMiddleLifts = 24;
  std::array<SwingValues, 3> shares;
  for (std::size_t lift = 0; lift < shares.size(); ++lift) {
    std::ranges::transform(kClearanceSamples, shares[lift].begin(),
                           [lift](double swing) { return LiftShare(lift, swing); });
  }
  // The loop tries several middle lifts. For each of them, the first half of the swing determines
  // the smallest sufficient early lift, and the second half the smallest late lift. Both also raise
  // the middle of the swing. If the clearance there is then more than sufficient, a negative middle
  // lift compensates for that.
  const double most_missing_m = std::max(std::ranges::max(missing_clearance_m), 0.0);
  const double most_m = std::min(1.5 * most_missing_m, kMaxLiftM);
  const double climb_m = kMiddleSinkPerClimb * std::fabs(to_m - from_m);
  const double least_m =
      most_missing_m > 0.0 ? -std::min(std::max(most_missing_m, climb_m), kMaxMiddleSinkM) : 0.0;
  SwingLifts best;
  for (int i = 0; i <= kMiddleLifts; ++i) {
    const double fraction = static_cast<double>(i) / kMiddleLifts;
    SwingLifts lifts{.lift_m = {0.0, least_m + fraction * (most_m - least_m), 0.0}};
    for (std::size_t s = 0; s < kClearanceSamples.size(); ++s) {
      const std::size_t half = kClearanceSamples[s] < 0.5 ? kEarlyLift : kLateLift;
      const double missing_m =
          missing_clearance_m[s] - lifts.lift_m[kMiddleLift] * shares[kMiddleLift][s];
      lifts.lift_m[half] =
          std::max(lifts.lift_m[half], std::min(missing_m / shares[half][s], kMaxLiftM));
    }
    SwingValues lifted_m = heights_m;
    for (std::size_t s = 0; s < kClearanceSamples.size(); ++s) {
      for (std::size_t lift = 0; lift < shares.size(); ++lift) {
        lifted_m[s] += lifts.lift_m[lift] * shares[lift][s];
      }
    }
    lifts.cost_m = SwingCost(lifted_m, from_m, to_m);
    if (lifts.cost_m < best.cost_m) best = lifts;
  }
  return best;
}

// Returns the lifts that a foot needs to clear the ground if its path is shifted by
// `mid_swing_offset_m` (FootTrajectory::mid_swing_offset_m).
SwingLifts LiftsOver(const SwingSoles& soles, const FootTrajectory& trajectory,
                     const DVec3& mid_swing_offset_m, const Terrain& terrain) {
  SwingValues missing_clearance_m;
  missing_clearance_m.fill(-HUGE_VAL);
  for (std::size_t i = 0; i < kClearanceSamples.size(); ++i) {
    const double swing = kClearanceSamples[i];
    const double across = 4.0 * swing * (1.0 - swing);
    // The required clearance and radius decrease towards the footprints, because a footprint may be
    // close to a riser.
    const double away = LiftShare(kMiddleLift, swing);
    const double radius_m = kPassingRadiusM * (0.25 + 0.75 * away);
    for (const DVec3& point : soles.points_m[i]) {
      const DVec3 at = point + across * across * mid_swing_offset_m;
      const double ground_m = terrain.HighestWithin(at.x, at.z, radius_m);
      missing_clearance_m[i] =
          std::max(missing_clearance_m[i], ground_m + kClearanceM * away - at.y);
    }
  }
  return LowestLifts(missing_clearance_m, soles.balls_m, trajectory.from.position_m.y,
                     trajectory.to.position_m.y);
}

}  // namespace

SwingPath ChooseSwing(const SwingSoles& soles, const FootTrajectory& trajectory,
                      const Terrain& terrain) {
  DVec3 mid_swing_offset_m(0.0);
  const DVec3 way = trajectory.to.position_m - trajectory.from.position_m;
  const double length_m = std::sqrt(way.x * way.x + way.z * way.z);
  const auto lifts_with = [&](const DVec3& offset_m) {
    return LiftsOver(soles, trajectory, offset_m, terrain);
  };
  SwingLifts best = lifts_with(DVec3(0.0));
  if (std::ranges::max(best.lift_m) > kNoticeableLiftM && length_m > 2.0 * kMaxAdvanceM) {
    const DVec3 forward(way.x / length_m, 0.0, way.z / length_m);
    for (const double fraction : kAdvances) {
      const DVec3 advance_m = fraction * kMaxAdvanceM * forward;
      SwingLifts lifts = lifts_with(advance_m);
      lifts.cost_m += kAdvanceCost * std::fabs(fraction) * kMaxAdvanceM;
      if (lifts.cost_m >= best.cost_m) continue;
      best = lifts;
      mid_swing_offset_m = advance_m;
    }
  }
  return {best.lift_m, mid_swing_offset_m};
}

}  // namespace stridewire
