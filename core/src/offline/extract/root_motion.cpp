#include "offline/extract/root_motion.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.h"
#include "offline/base/horizontal_distance.h"
#include "offline/base/statistics.h"

namespace stridewire {
namespace {

constexpr double kLevelPercentile = 3.0;
// The motion of each point of the feet has the weight exp(-height / kFadeM).
constexpr double kFadeM = 0.005;
// If all points of the feet are more than this above their resting heights, the figure is in the
// air.
constexpr double kAirM = 0.06;
// Slower motion of supporting feet is sliding, not motion of the ground.
constexpr double kSlideMin_m_s = 0.2;
// A figure walks on the spot if the ground below it moves by at least kTravelMinM. The other limits
// are fractions of the length of that path: the maximum extent of the pelvis's motion, the minimum
// fraction for which each foot is the supporting foot, and the minimum net displacement.
constexpr double kTravelMinM = 0.5;
constexpr double kPelvisShare = 0.25;
constexpr double kFootShareMin = 0.2;
constexpr double kOneWayMin = 0.5;

// The ankles, balls and toe tips of both feet: their paths, and their heights at rest.
struct SupportPoints {
  std::array<const std::vector<DVec3>*, 6> path;
  std::array<double, 6> rest_m;
};

SupportPoints FindSupportPoints(const BodyTracks& tracks) {
  SupportPoints points{};
  std::size_t p = 0;
  for (const BodyTracks::FootTrajectory& foot : tracks.feet) {
    for (const auto* path : {&foot.ankle_m, &foot.ball_m, &foot.toe_tip_m}) {
      std::vector<double> heights;
      heights.reserve(path->size());
      for (const DVec3& point : *path) heights.push_back(point.y);
      points.path[p] = path;
      points.rest_m[p] = Percentile(std::move(heights), kLevelPercentile);
      ++p;
    }
  }
  return points;
}

}  // namespace

GroundTravel MeasureGroundTravel(const BodyTracks& tracks) {
  GroundTravel travel;
  const std::size_t count = tracks.pelvis_m.size();
  travel.position_m.assign(count, DVec3(0.0));
  if (count == 0) return travel;
  const SupportPoints points = FindSupportPoints(tracks);
  double by_left_m = 0.0;
  DVec3 step(0.0);
  for (std::size_t i = 0; i + 1 < count; ++i) {
    DVec3 sum(0.0);
    double weights = 0.0;
    double left = 0.0;
    double lowest = kAirM;
    for (std::size_t p = 0; p < points.path.size(); ++p) {
      const DVec3& from = (*points.path[p])[i];
      const DVec3& to = (*points.path[p])[i + 1];
      const double height = std::max(0.0, 0.5 * (from.y + to.y) - points.rest_m[p]);
      lowest = std::min(lowest, height);
      const double weight = std::exp(-height / kFadeM);
      sum += weight * (to - from);
      weights += weight;
      if (p < points.path.size() / 2) left += weight;
    }
    if (lowest < kAirM) step = DVec3(sum.x / weights, 0.0, sum.z / weights);
    travel.position_m[i + 1] = travel.position_m[i] + step;
    const double length = glm::length(step);
    if (lowest < kAirM && length * tracks.fps > kSlideMin_m_s) {
      travel.length_m += length;
      by_left_m += length * left / weights;
    }
  }
  if (travel.length_m > 0.0) travel.left_share = by_left_m / travel.length_m;
  return travel;
}

bool WalksOnTheSpot(const BodyTracks& tracks, const GroundTravel& travel) {
  if (travel.length_m < kTravelMinM || travel.left_share < kFootShareMin ||
      travel.left_share > 1.0 - kFootShareMin) {
    return false;
  }
  // If a figure hangs or dances, its legs swing forward and backward by the same amount, so that
  // the displacements of its feet cancel out.
  DVec3 one_way(0.0);
  for (std::size_t i = 0; i + 1 < travel.position_m.size(); ++i) {
    one_way +=
        RotateYaw(-tracks.pelvis_yaw_rad[i], travel.position_m[i + 1] - travel.position_m[i]);
  }
  if (glm::length(one_way) < kOneWayMin * travel.length_m) return false;
  DVec3 low = tracks.pelvis_m.front();
  DVec3 high = low;
  for (const DVec3& pelvis : tracks.pelvis_m) {
    low = glm::min(low, pelvis);
    high = glm::max(high, pelvis);
  }
  return HorizontalDistance(low, high) < kPelvisShare * travel.length_m;
}

void AddRootMotion(const GroundTravel& travel, int first_frame, Clip& clip) {
  STRIDEWIRE_CHECK(first_frame >= 0 &&
                   first_frame + travel.position_m.size() == clip.root_positions_m.size());
  for (std::size_t i = 0; i < travel.position_m.size(); ++i) {
    clip.root_positions_m[static_cast<std::size_t>(first_frame) + i] -= Vec3(travel.position_m[i]);
  }
}

}  // namespace stridewire
