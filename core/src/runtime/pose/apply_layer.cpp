#include "runtime/pose/apply_layer.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.h"
#include "runtime/pose/pose_kernels.h"

namespace stridewire {
namespace {

// The four keys around a time and their Catmull-Rom weights. A clip that does not loop repeats its
// first and last key beyond its ends, so the motion slows down there.
struct KeyBlend {
  std::array<std::size_t, 4> frames;
  std::array<float, 4> weights;

  KeyBlend(const LayerClip& clip, double time_s) {
    const auto count = static_cast<double>(clip.frame_count());
    double position = std::isfinite(time_s) ? time_s * clip.fps : 0.0;
    if (clip.is_looping) {
      position -= std::floor(position / count) * count;
    } else {
      position = std::clamp(position, 0.0, count - 1.0);
    }
    // Rounding may make `position` equal to `count`.
    const auto key = std::min(std::floor(position), count - 1.0);
    const auto u = static_cast<float>(std::min(position - key, 1.0));
    for (int i = 0; i < 4; ++i) {
      double frame = key + i - 1.0;
      if (clip.is_looping) {
        frame -= std::floor(frame / count) * count;
      } else {
        frame = std::clamp(frame, 0.0, count - 1.0);
      }
      frames[static_cast<std::size_t>(i)] = static_cast<std::size_t>(frame);
    }
    const float u2 = u * u;
    const float u3 = u2 * u;
    weights = {0.5f * (-u + 2.0f * u2 - u3), 0.5f * (2.0f - 5.0f * u2 + 3.0f * u3),
               0.5f * (u + 4.0f * u2 - 3.0f * u3), 0.5f * (-u2 + u3)};
  }
};

}  // namespace

void ApplyLayer(const LayerClip& clip, double time_s, double weight, PoseSpan pose) {
  STRIDEWIRE_CHECK(clip.frame_count() > 0);
  const KeyBlend blend(clip, time_s);
  const std::size_t count = clip.joints.size();
  const auto key = [&](std::size_t k) { return &clip.rotations[blend.frames[k] * count * 4]; };
  kernels::BlendLayer({.keys = {key(0), key(1), key(2), key(3)},
                       .key_weights = blend.weights.data(),
                       .joints = clip.joints.data(),
                       .joint_weights = clip.weights.data(),
                       .joint_count = count,
                       .weight = static_cast<float>(weight)},
                      &pose.rotations[0].x);
}

}  // namespace stridewire
