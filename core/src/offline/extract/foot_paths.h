#pragma once

#include <array>
#include <vector>

#include "offline/extract/body_tracks.h"

namespace stridewire {

/// A point is at rest if it is slower than this.
inline constexpr double kAtRestM_s = 0.3;

/// Smoothed paths of the ankle, the ball and the toe tip of one foot, in this order. All vectors
/// have one value per frame.
struct FootPaths {
  static constexpr std::size_t kPoints = 3;
  static constexpr std::size_t kAnkle = 0;
  static constexpr std::size_t kBall = 1;
  static constexpr std::size_t kToeTip = 2;

  std::array<std::vector<DVec3>, kPoints> position_m;
  std::array<std::vector<double>, kPoints> speed_m_s;
  /// Usual height of each point above the ball while all points are at rest. In individual stances,
  /// the heights differ from this by up to 5 cm.
  std::array<double, kPoints> flat_height_m{};
  /// Speed of the slowest of the three points.
  std::vector<double> slowest_m_s;

  [[nodiscard]] double Height(std::size_t point, int frame) const {
    return position_m[point][static_cast<std::size_t>(frame)].y;
  }
  [[nodiscard]] bool IsSlower(std::size_t point, int frame, double limit_m_s) const {
    return speed_m_s[point][static_cast<std::size_t>(frame)] <= limit_m_s;
  }
  /// Returns true if the ball is at one place in two frames: within 6 cm horizontally and 15 cm
  /// vertically.
  [[nodiscard]] bool OnOnePlace(int frame_a, int frame_b) const;
};

/// Smooths the paths of a foot over `smooth_s` and measures the heights of its points on the flat
/// foot.
[[nodiscard]] FootPaths MakeFootPaths(const BodyTracks::FootTrajectory& track, double fps,
                                      double smooth_s);

}  // namespace stridewire
