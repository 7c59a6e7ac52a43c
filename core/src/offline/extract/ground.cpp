#include "offline/extract/ground.h"

#include <algorithm>
#include <cmath>

#include "offline/base/statistics.h"

namespace stridewire {
namespace {

constexpr double kFloorBandM = 0.06;  // Feet within this of the lowest ones stand on the floor.
constexpr double kFeetDifferMaxM = 0.03;
constexpr double kTiltMaxM = 0.015;
constexpr double kBallUsualM = 0.04;
constexpr double kBallPlausibleMinM = 0.01;
constexpr double kBallPlausibleMaxM = 0.09;

}  // namespace

double Ground::Below(Foot foot, double ball_height_in_capture_m) const {
  const double rise = ball_height_in_capture_m - floor_m - ball_height_m[static_cast<int>(foot)];
  return floor_m + (single_floor ? std::clamp(rise, -kTiltMaxM, kTiltMaxM) : rise);
}

Ground FindGround(const FootContacts& contacts) {
  Ground ground;
  ground.single_floor = contacts.single_floor;
  double resting[2] = {0.0, 0.0};
  bool found[2] = {false, false};
  for (int f = 0; f < 2; ++f) {
    std::vector<double> heights;
    for (const Contact& contact : contacts.feet[f]) heights.push_back(contact.ball_height_m);
    if (heights.empty()) continue;
    const double band = Percentile(heights, 5.0) + kFloorBandM;
    if (!contacts.single_floor) std::erase_if(heights, [&](double h) { return h > band; });
    resting[f] = Median(std::move(heights));
    found[f] = true;
  }
  if (!found[0] && !found[1]) return ground;
  ground.has_contacts = true;
  if (!found[0]) resting[0] = resting[1];
  if (!found[1]) resting[1] = resting[0];
  if (!contacts.single_floor && std::fabs(resting[0] - resting[1]) > kFeetDifferMaxM) {
    // The feet never stood on the same level, so their resting heights cannot be distinguished.
    resting[0] = resting[1] = std::min(resting[0], resting[1]);
  }
  const double mean = 0.5 * (resting[0] + resting[1]);
  if (mean < kBallPlausibleMinM || mean > kBallPlausibleMaxM) ground.floor_m = mean - kBallUsualM;
  for (int f = 0; f < 2; ++f) ground.ball_height_m[f] = resting[f] - ground.floor_m;
  return ground;
}

}  // namespace stridewire
