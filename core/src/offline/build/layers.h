#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/skeleton/layer_clip.h"
#include "stridewire/base/error.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/raw_library.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

inline constexpr double kLayerKeysPerSecond =
    30.0;                                   ///< About: a loop holds a whole number of them.
inline constexpr double kLoopBlendS = 0.4;  ///< The most that goes into closing a captured loop.

/// The mask of layers that name no joints, one weight a joint: everything but the root and the legs.
/// Those of the k-th joint up the trunk, of n up to where arms or head branch off, are k / (n + 1), so
/// that a clip's lean is spread over the spine; beyond, 1.
[[nodiscard]] std::vector<float> UpperBodyMask(const Skeleton& skeleton);

/// Weight 1 for the joints named and all that hangs on them. kNotFound: no joint of that name;
/// kInvalidArgument: the root or a joint that legs hang on; `where` is the name.
[[nodiscard]] Expected<std::vector<float>> MaskOfJoints(const Skeleton& skeleton,
                                                        std::span<const std::string> names);

/// What of a capture becomes a layer, and how it is played.
struct LayerCut {
  std::string name;
  std::optional<double> from_s;  ///< Else the capture's first frame that is not artificial.
  std::optional<double> to_s;    ///< Else its end.
  bool is_looping = true;
};

/// Cuts a layer out of a capture. A loop is closed by easing from its last kLoopBlendS (a quarter of
/// it at most) into its first, and so is shorter by as much. The mask is UpperBodyMask().
/// kShapeMismatch: other joints than the skeleton's; kInvalidArgument: not a name for a layer;
/// kOutOfRange: times outside the capture, or less than 0.1 s. `where` says which and why.
[[nodiscard]] Expected<RawLayer> CutLayer(const Capture& capture, const Skeleton& skeleton,
                                          const LayerCut& cut);

/// Layers as a library has them: about kLayerKeysPerSecond, joints in the mask only.
class StoredLayers {
 public:
  [[nodiscard]] std::span<const LayerClip> views() const { return views_; }

 private:
  friend Expected<StoredLayers> StoreLayers(std::span<const RawLayer> layers,
                                            const Skeleton& skeleton);
  struct Content {
    std::string name;
    std::string source;
    std::vector<int> joints;
    std::vector<float> weights;
    std::vector<float> rotations;
  };
  std::vector<std::unique_ptr<Content>> contents_;
  std::vector<LayerClip> views_;
};

/// Errors name the layer in `where`: kInvalidArgument: its name, a mask that touches the root or a leg
/// or is empty, a name that stands twice; kShapeMismatch; kLimitExceeded.
[[nodiscard]] Expected<StoredLayers> StoreLayers(std::span<const RawLayer> layers,
                                                 const Skeleton& skeleton);

/// The library with layers added; those of the same name are replaced. Errors as StoreLayers.
[[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> AddLayers(
    const MotionLibrary& library, std::span<const RawLayer> layers);

}  // namespace stridewire
