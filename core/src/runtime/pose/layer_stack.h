#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "runtime/skeleton/layer_clip.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

class MotionLibrary;

/// The layers that one avatar plays. Weights ease in and out with continuous derivatives, even if a
/// request interrupts another one. With a blend time of 0, weights jump. Later layers are applied
/// on top of earlier ones. The first layer that is set or restored allocates, unless Reserve was
/// called.
class LayerStack {
 public:
  /// Maximum number of layers that play at the same time, including those that ease out.
  static constexpr std::size_t kMaxLayers = 4;

  /// A layer that is playing.
  struct Playing {
    int layer = 0;
    double time_s = 0.0;     ///< Time in the layer's clip.
    double weight = 0.0;     ///< Current weight.
    double speed = 1.0;      ///< Current speed.
    bool is_ending = false;  ///< True while the layer eases out.
    // Weight and speed ease from their old to their new values over ease_s. The slope that the
    // weight had at the start of the blend fades out over slope_s.
    double from_weight = 0.0;
    double to_weight = 0.0;
    double from_speed = 1.0;
    double to_speed = 1.0;
    double slope = 0.0;  // Slope of the weight per second at the start of the blend.
    double slope_s = 0.0;
    double elapsed_s = 0.0;
    double ease_s = 0.0;
    double blend_s = 0.0;  // Blend time as requested; used when a non-looping clip ends.
  };

  /// Starts, changes or ends a layer. If the layer is playing, it eases to the new weight and
  /// speed. If it is easing out, a looping layer eases in again, and any other layer is started a
  /// second time. Ending a layer that is not playing has no effect.
  ///
  /// Errors: kNotFound if there is no such layer. kOutOfRange if a number is not finite or out of
  /// range. kLimitExceeded if another layer would have to start while kMaxLayers are playing. On
  /// error, nothing changes.
  [[nodiscard]] Status Set(const MotionLibrary& library, const LayerRequest& request);

  /// Advances all layers by `dt_s`. Non-looping clips ease out before their end.
  void Advance(const MotionLibrary& library, double dt_s);

  /// Applies all layers to a pose of the library's skeleton.
  void Apply(const MotionLibrary& library, PoseSpan pose) const;

  [[nodiscard]] std::span<const Playing> playing() const { return playing_; }
  /// Allocates memory for kMaxLayers, so that later calls do not allocate.
  void Reserve() { playing_.reserve(kMaxLayers); }
  /// Ends all layers at once. Keeps the memory.
  void Clear() { playing_.clear(); }
  [[nodiscard]] bool empty() const { return playing_.empty(); }

  /// Replaces the layers with those of another stack of the same library. Fails with kOutOfRange
  /// and changes nothing if `playing` is invalid.
  [[nodiscard]] Status Restore(const MotionLibrary& library, std::span<const Playing> playing);

 private:
  [[nodiscard]] Playing* Find(int layer, bool is_ending);

  // Allocates memory for kMaxLayers when the first layer starts. Most avatars have no layers.
  std::vector<Playing> playing_;
};

}  // namespace stridewire
