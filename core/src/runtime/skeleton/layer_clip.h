#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "stridewire/runtime/skeleton.h"

namespace stridewire {

inline constexpr int kMaxLayerClips = 64;  ///< Per library.
/// Maximum number of frames per clip: ten minutes at 30 frames per second.
inline constexpr int kMaxLayerFrames = 18'000;
inline constexpr std::size_t kMaxLayerNameBytes = 32;
inline constexpr double kMinLayerFps = 1.0;
inline constexpr double kMaxLayerFps = 240.0;

/// A clip for a part of the body, for example waving or carrying. It is played on top of movements
/// of the legs. Its mask has one weight per joint. Joints that are not listed have weight 0. Spans
/// point into the library's bytes.
struct LayerClip {
  std::string_view name;  ///< Satisfies IsLayerName().
  /// Source of the clip, for example "wave.bvh 1.00-2.50 s".
  std::string_view source;
  double fps = 0.0;  ///< Keys per second, kMinLayerFps to kMaxLayerFps.
  /// True for a loop, in which the first key follows the last; false if the clip is played once.
  bool is_looping = false;
  /// Indices of the joints that the clip animates, in increasing order. The root and the joints of
  /// the legs are not among them.
  std::span<const int> joints;
  std::span<const float> weights;    ///< [index in joints]: weights in (0, 1].
  std::span<const float> rotations;  ///< [frame][index in joints][x, y, z, w]: local rotations.

  [[nodiscard]] int frame_count() const {
    return static_cast<int>(rotations.size() / (4 * joints.size()));
  }
  /// Returns the duration of one loop, or the time from the first to the last key.
  [[nodiscard]] double duration_s() const {
    return (is_looping ? frame_count() : frame_count() - 1) / fps;
  }
};

/// Returns true if the name has 1 to kMaxLayerNameBytes characters from a-z, A-Z, 0-9, '_', '-' and
/// '.'.
[[nodiscard]] bool IsLayerName(std::string_view name);

/// Returns a flag per joint: true if layers must not affect it. These joints are the root, all
/// joints between the root and the balls of the feet, and all joints below a hip.
[[nodiscard]] std::vector<bool> JointsOfLegs(const Skeleton& skeleton);

}  // namespace stridewire
