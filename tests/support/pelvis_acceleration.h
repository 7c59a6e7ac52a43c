#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "stridewire/runtime/clip.h"

namespace stridewire {

/// Returns the magnitudes of the vertical acceleration of the pelvis in a clip with `fps` frames
/// per second, in m/s^2. Heights are averaged over five frames first, because captures are noisy.
/// Empty if the clip has fewer than seven frames.
inline std::vector<double> VerticalPelvisAccelerations(const Clip& clip, double fps) {
  constexpr std::size_t kAveragedFrames = 5;
  std::vector<double> heights_m;
  for (std::size_t f = 0; f + kAveragedFrames <= clip.root_positions_m.size(); ++f) {
    double sum_m = 0.0;
    for (std::size_t k = 0; k < kAveragedFrames; ++k) sum_m += clip.root_positions_m[f + k].y;
    heights_m.push_back(sum_m / static_cast<double>(kAveragedFrames));
  }
  std::vector<double> accelerations;
  for (std::size_t f = 1; f + 1 < heights_m.size(); ++f) {
    const double bend_m = heights_m[f - 1] - 2.0 * heights_m[f] + heights_m[f + 1];
    accelerations.push_back(std::fabs(bend_m) * fps * fps);
  }
  return accelerations;
}

}  // namespace stridewire
