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

/// Approximate number of keys per second. It is adjusted so that a loop contains a whole number of
/// keys.
inline constexpr double kLayerKeysPerSecond = 30.0;
/// Maximum duration of the blend that closes a captured loop.
inline constexpr double kLoopBlendS = 0.4;

/// Returns the default mask of layers, one weight per joint: 0 for the root and the legs, 1 for the
/// upper body. Along the n joints of the trunk below arms and head, the weights rise evenly: k / (n
/// + 1) for the k-th joint. This distributes the lean of a clip over the spine.
[[nodiscard]] std::vector<float> UpperBodyMask(const Skeleton& skeleton);

/// Returns a mask with weight 1 for the named joints and all joints below them. Errors, with the
/// name in Error::where: kNotFound if the joint does not exist, kInvalidArgument for the root, a
/// joint of a leg, or a joint between the root and a leg.
[[nodiscard]] Expected<std::vector<float>> MaskOfJoints(const Skeleton& skeleton,
                                                        std::span<const std::string> names);

/// The part of a capture that becomes a layer, and how it is played.
struct LayerCut {
  std::string name;
  /// Start of the cut. nullopt: the first usable frame of the capture.
  std::optional<double> from_s;
  std::optional<double> to_s;  ///< End of the cut. nullopt: the end of the capture.
  bool is_looping = true;
};

/// Cuts a layer out of a capture. The mask is UpperBodyMask(). To close a loop, its end is blended
/// into its beginning. The blend lasts kLoopBlendS, or a quarter of the cut if that is shorter, and
/// shortens the loop by this time.
///
/// Errors, with details in Error::where: kShapeMismatch if the joints differ from the skeleton,
/// kOutOfRange for times outside the capture or a cut shorter than 0.1 s. Does not check the name;
/// StoreLayers does.
[[nodiscard]] Expected<RawLayer> CutLayer(const Capture& capture, const Skeleton& skeleton,
                                          const LayerCut& cut);

/// Layers in the form in which a library stores them: resampled to about kLayerKeysPerSecond, and
/// with only those joints whose weight in the mask is above 0.
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

/// Converts layers. Errors: kLimitExceeded if there are more than kMaxLayerClips layers. With the
/// layer in Error::where: kInvalidArgument for an invalid or duplicate name, and for a mask that is
/// empty or contains the root or a leg; kShapeMismatch if clip or mask has other joints than the
/// skeleton; kOutOfRange for a weight outside [0, 1] or a loop shorter than 0.1 s; kLimitExceeded
/// for a clip longer than ten minutes; and the errors of Clip::Validate.
[[nodiscard]] Expected<StoredLayers> StoreLayers(std::span<const RawLayer> layers,
                                                 const Skeleton& skeleton);

/// Returns a library with additional layers. They replace layers with the same name. Errors: those
/// of StoreLayers and WriteLibrary, and kLimitExceeded if the result would have more than
/// kMaxLayerClips layers.
[[nodiscard]] Expected<std::shared_ptr<const MotionLibrary>> AddLayers(
    const MotionLibrary& library, std::span<const RawLayer> layers);

}  // namespace stridewire
