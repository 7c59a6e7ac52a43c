#include "offline/extract/foot_paths.h"

#include <algorithm>
#include <cmath>

#include "offline/base/horizontal_distance.h"
#include "offline/base/statistics.h"

namespace stridewire {
namespace {

// If the foot is never flat, FlatHeight compares the points at this percentile of their heights.
constexpr double kLowPercentile = 3.0;
constexpr double kSamePlaceM = 0.06;
constexpr double kSamePlaceRiseM = 0.15;

double LowHeight(const std::vector<DVec3>& path) {
  std::vector<double> heights;
  heights.reserve(path.size());
  for (const DVec3& point : path) heights.push_back(point.y);
  return Percentile(std::move(heights), kLowPercentile);
}

// Returns the median height of a point above the ball over the frames in which all points rest.
double FlatHeight(const FootPaths& foot, std::size_t point) {
  std::vector<double> heights;
  for (std::size_t i = 0; i < foot.slowest_m_s.size(); ++i) {
    const bool flat = std::ranges::all_of(
        foot.speed_m_s, [&](const std::vector<double>& speed) { return speed[i] < kAtRestM_s; });
    if (!flat) continue;
    heights.push_back(foot.position_m[point][i].y - foot.position_m[FootPaths::kBall][i].y);
  }
  if (!heights.empty()) return Median(std::move(heights));
  return LowHeight(foot.position_m[point]) - LowHeight(foot.position_m[FootPaths::kBall]);
}

}  // namespace

bool FootPaths::OnOnePlace(int frame_a, int frame_b) const {
  const DVec3& a = position_m[kBall][static_cast<std::size_t>(frame_a)];
  const DVec3& b = position_m[kBall][static_cast<std::size_t>(frame_b)];
  return HorizontalDistance(a, b) < kSamePlaceM && std::fabs(a.y - b.y) < kSamePlaceRiseM;
}

FootPaths MakeFootPaths(const BodyTracks::FootTrajectory& track, double fps, double smooth_s) {
  FootPaths foot;
  const int window = static_cast<int>(std::lround(smooth_s * fps));
  const std::vector<DVec3>* const points[] = {&track.ankle_m, &track.ball_m, &track.toe_tip_m};
  for (std::size_t p = 0; p < FootPaths::kPoints; ++p) {
    foot.position_m[p] = SmoothPath(*points[p], window);
    foot.speed_m_s[p] = PathSpeed(foot.position_m[p], fps);
  }
  const std::size_t count = track.ball_m.size();
  foot.slowest_m_s.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    foot.slowest_m_s[i] =
        std::min({foot.speed_m_s[0][i], foot.speed_m_s[1][i], foot.speed_m_s[2][i]});
  }
  for (std::size_t p = 0; p < FootPaths::kPoints; ++p) foot.flat_height_m[p] = FlatHeight(foot, p);
  return foot;
}

}  // namespace stridewire
