#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "runtime/skeleton/layer_clip.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

class MotionLibrary;

/// The layers one avatar plays. Weights ease in and out with a continuous derivative, also when a
/// request comes while one is on its way. Later layers lie over earlier ones. The first that is set
/// or restored allocates, unless there is room.
class LayerStack {
 public:
  static constexpr std::size_t kMaxLayers = 4;  ///< At a time, those that ease out included.

  /// A layer in play.
  struct Playing {
    int layer = 0;
    double time_s = 0.0;     ///< In its clip.
    double weight = 0.0;     ///< Now.
    double speed = 1.0;      ///< Now.
    bool is_ending = false;  ///< On its way out.
    // Weight and speed go from where they were to their targets over ease_s; what speed the weight
    // had when it set out runs off over slope_s.
    double from_weight = 0.0;
    double to_weight = 0.0;
    double from_speed = 1.0;
    double to_speed = 1.0;
    double slope = 0.0;  // weight a second
    double slope_s = 0.0;
    double elapsed_s = 0.0;
    double ease_s = 0.0;
    double blend_s = 0.0;  // as asked, for a clip that ends by itself
  };

  /// A layer that is on gets the new weight and speed; one that eases out comes back if it is a
  /// loop, and starts anew beside itself if it is played once. Ending what is not in play is no
  /// error. kNotFound: no such layer; kOutOfRange: a number not finite or out of its range;
  /// kLimitExceeded: kMaxLayers are in play. Nothing changes then.
  [[nodiscard]] Status Set(const MotionLibrary& library, const LayerRequest& request);

  /// Goes on by `dt_s`. Clips that are played once ease out towards their end.
  void Advance(const MotionLibrary& library, double dt_s);

  /// Applies all to a pose of the library's skeleton.
  void Apply(const MotionLibrary& library, PoseSpan pose) const;

  [[nodiscard]] std::span<const Playing> playing() const { return playing_; }
  /// For as many as there may be: nothing allocates after it.
  void Reserve() { playing_.reserve(kMaxLayers); }
  /// Ends all at once; the room stays.
  void Clear() { playing_.clear(); }
  [[nodiscard]] bool empty() const { return playing_.empty(); }

  /// Goes on from what another stack of the library had in play. kOutOfRange: what no stack has;
  /// nothing changes then.
  [[nodiscard]] Status Restore(const MotionLibrary& library, std::span<const Playing> playing);

 private:
  [[nodiscard]] Playing* Find(int layer, bool is_ending);

  std::vector<Playing> playing_;  // with room for all from the first on: most avatars have none
};

}  // namespace stridewire
