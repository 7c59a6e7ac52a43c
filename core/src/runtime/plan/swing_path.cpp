#include "runtime/plan/swing_path.h"

#include <algorithm>
#include <cmath>

#include "runtime/pose/plant_feet.h"

namespace stridewire {
namespace {

// In mid-swing, a foot is at least kClearanceM above the highest ground within kPassingRadiusM,
// unless this would lift it by more than kMaxLiftM.
constexpr double kClearanceM = 0.037;
constexpr double kPassingRadiusM = 0.02;
// The middle of a swing is lowered by at most what the swing lacks elsewhere or, if that is more,
// this share of the difference in height between its footprints, but never by more than
// kMaxMiddleSinkM.
constexpr double kMiddleSinkPerClimb = 0.5;
constexpr double kMaxMiddleSinkM = 0.2;
// If the foot is lifted by more than kNoticeableLiftM, it may be up to kMaxAdvanceM ahead of its
// path or behind it. The cost of a swing is the sum of its peak, its steepness (metres per swing)
// times kSteepnessWeight, and its advance times kAdvanceCost.
constexpr double kNoticeableLiftM = 0.01;
constexpr double kMaxAdvanceM = 0.12;
constexpr double kSteepnessWeight = 0.2;
constexpr double kAdvanceCost = 0.2;
constexpr std::array<double, 12> kAdvances{-1.0 / 6, 1.0 / 6, -1.0 / 3, 1.0 / 3, -0.5, 0.5,
                                           -2.0 / 3, 2.0 / 3, -5.0 / 6, 5.0 / 6, -1.0, 1.0};

struct SwingLifts {
  std::array<double, 3> lift_m{};  // FootTrajectory::lift_m
  double cost_m = HUGE_VAL;
};

// Returns the cost of a swing with these heights: its peak above both footprints and its steepest
// part, from one footprint to the other.
double SwingCost(const SwingValues& heights_m, double from_m, double to_m) {
  double peak_m = std::max(from_m, to_m);
  double steepest_m = 0.0;
  double before_m = from_m;
  double before = 0.0;
  for (std::size_t s = 0; s <= kClearanceSamples.size(); ++s) {
    const bool is_last = s == kClearanceSamples.size();
    const double height_m = is_last ? to_m : heights_m[s];
    const double part = is_last ? 1.0 : kClearanceSamples[s];
    peak_m = std::max(peak_m, height_m);
    steepest_m = std::max(steepest_m, std::fabs(height_m - before_m) / (part - before));
    before_m = height_m;
    before = part;
  }
  return peak_m - std::max(from_m, to_m) + kSteepnessWeight * steepest_m;
}

// Returns the lifts with the lowest cost whose sum is at least `lacks_m` at each sample of the
// swing. No lift exceeds kMaxLiftM. `heights_m` are the heights of the foot without lifts. Where
// `lacks_m` is negative, the foot has more room than it needs.
SwingLifts LowestLifts(const SwingValues& lacks_m, const SwingValues& heights_m, double from_m,
                       double to_m) {
  constexpr int kMiddleLifts = 24;
  std::array<SwingValues, 3> shares;
  for (std::size_t lift = 0; lift < shares.size(); ++lift) {
    std::ranges::transform(kClearanceSamples, shares[lift].begin(),
                           [lift](double part) { return LiftShare(lift, part); });
  }
  // For each lift in the middle, the smallest early and late lifts follow from the two halves. The
  // lift in the middle may be negative: early and late lifts also raise the foot in the middle,
  // where it may have room.
  const double most_lacking_m = std::max(std::ranges::max(lacks_m), 0.0);
  const double most_m = std::min(1.5 * most_lacking_m, kMaxLiftM);
  const double climb_m = kMiddleSinkPerClimb * std::fabs(to_m - from_m);
  const double least_m =
      most_lacking_m > 0.0 ? -std::min(std::max(most_lacking_m, climb_m), kMaxMiddleSinkM) : 0.0;
  SwingLifts best;
  for (int i = 0; i <= kMiddleLifts; ++i) {
    const double part = static_cast<double>(i) / kMiddleLifts;
    SwingLifts lifts{.lift_m = {0.0, least_m + part * (most_m - least_m), 0.0}};
    for (std::size_t s = 0; s < kClearanceSamples.size(); ++s) {
      const std::size_t half = kClearanceSamples[s] < 0.5 ? 0 : 2;
      const double lacks = lacks_m[s] - lifts.lift_m[kMiddleLift] * shares[kMiddleLift][s];
      lifts.lift_m[half] =
          std::max(lifts.lift_m[half], std::min(lacks / shares[half][s], kMaxLiftM));
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

// Returns the lifts that a foot needs to clear the ground if `aside_m` is added to its path
// (FootTrajectory::aside_m).
SwingLifts LiftsOver(const SwingSoles& soles, const FootTrajectory& trajectory,
                     const DVec3& aside_m, const Terrain& terrain) {
  SwingValues lacks_m;
  lacks_m.fill(-HUGE_VAL);
  for (std::size_t i = 0; i < kClearanceSamples.size(); ++i) {
    const double part = kClearanceSamples[i];
    const double across = 4.0 * part * (1.0 - part);
    // Near its footprints, a foot may be close to a riser without touching it.
    const double away = LiftShare(kMiddleLift, part);
    const double radius_m = kPassingRadiusM * (0.25 + 0.75 * away);
    for (const DVec3& point : soles.points_m[i]) {
      const DVec3 at = point + across * across * aside_m;
      const double ground_m = terrain.HighestWithin(at.x, at.z, radius_m);
      lacks_m[i] = std::max(lacks_m[i], ground_m + kClearanceM * away - at.y);
    }
  }
  return LowestLifts(lacks_m, soles.balls_m, trajectory.from.position_m.y,
                     trajectory.to.position_m.y);
}

}  // namespace

SwingPath ChooseSwing(const SwingSoles& soles, const FootTrajectory& trajectory,
                      const Terrain& terrain) {
  DVec3 advance_m(0.0);
  const DVec3 way = trajectory.to.position_m - trajectory.from.position_m;
  const double length_m = std::sqrt(way.x * way.x + way.z * way.z);
  const auto lifts_with = [&](const DVec3& added_m) {
    return LiftsOver(soles, trajectory, added_m, terrain);
  };
  SwingLifts best = lifts_with(DVec3(0.0));
  if (std::ranges::max(best.lift_m) > kNoticeableLiftM && length_m > 2.0 * kMaxAdvanceM) {
    const DVec3 forward(way.x / length_m, 0.0, way.z / length_m);
    for (const double part : kAdvances) {
      const DVec3 advance = part * kMaxAdvanceM * forward;
      SwingLifts lifts = lifts_with(advance);
      lifts.cost_m += kAdvanceCost * std::fabs(part) * kMaxAdvanceM;
      if (lifts.cost_m >= best.cost_m) continue;
      best = lifts;
      advance_m = advance;
    }
  }
  return {best.lift_m, advance_m};
}

}  // namespace stridewire
