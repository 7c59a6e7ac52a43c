#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "stridewire/base/math.h"
#include "stridewire/runtime/pose.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

inline constexpr int kMaxLayerClips = 64;       ///< A library.
inline constexpr int kMaxLayerFrames = 18'000;  ///< A clip: ten minutes at 30 a second.
inline constexpr std::size_t kMaxLayerNameBytes = 32;
inline constexpr double kMinLayerFps = 1.0;
inline constexpr double kMaxLayerFps = 240.0;

/// A clip of a part of the body, played over whatever the legs do (waving, carrying). Its mask has
/// one weight a joint; joints that are not listed have weight 0. Spans point into the library's bytes.
struct LayerClip {
  std::string_view name;  ///< IsLayerName().
  /// Where it was taken from: "wave.bvh 1.00-2.50 s".
  std::string_view source;
  double fps = 0.0;                  ///< Keys a second, kMinLayerFps to kMaxLayerFps.
  bool is_looping = false;           ///< The first key follows the last; else it is played once.
  std::span<const int> joints;       ///< Rising; no root, no joint that legs hang on.
  std::span<const float> weights;    ///< [place in joints], in (0, 1].
  std::span<const float> rotations;  ///< [frame][place in joints][x, y, z, w], local.

  [[nodiscard]] int frame_count() const {
    return static_cast<int>(rotations.size() / (4 * joints.size()));
  }
  /// What a loop takes once round, else first key to last.
  [[nodiscard]] double duration_s() const {
    return (is_looping ? frame_count() : frame_count() - 1) / fps;
  }
};

/// 1 to kMaxLayerNameBytes of a-z, A-Z, 0-9, '_', '-', '.'.
[[nodiscard]] bool IsLayerName(std::string_view name);

/// [joint]: true for what layers must leave alone, the root and both legs: every joint from the root
/// down to a ball, and all that hangs on a hip.
[[nodiscard]] std::vector<bool> JointsOfLegs(const Skeleton& skeleton);

/// Turns the joints of `pose` towards the clip at `time_s`: r slerp(1, r^-1 c, weight * mask), the
/// short way round. The clip is C1 between its keys (Catmull-Rom). Time runs round in a loop and stops
/// at the ends of any other clip; `weight` in [0, 1]. Never allocates. Joints outside the mask keep
/// their bits.
void ApplyLayer(const LayerClip& clip, double time_s, double weight, PoseSpan pose);

}  // namespace stridewire
