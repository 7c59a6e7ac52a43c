#include "world/pose_quantizations.h"

#include <utility>

#include "base/check.h"
#include "runtime/library/pose_quantization.h"

namespace stridewire::server {

std::shared_ptr<const PoseQuantizations> MakePoseQuantizations(const MotionLibrary& library) {
  std::vector<RotationQuantization> joints = ChoosePoseQuantization(library).joints;
  std::vector<std::int16_t> parents;
  for (const Joint& joint : library.skeleton().joints) {
    parents.push_back(static_cast<std::int16_t>(joint.parent));
  }
  std::vector<std::uint16_t> reduced = ChooseReducedJoints(library);
  auto codecs = protocol::CompactCodecs::Make(joints, parents, reduced);
  STRIDEWIRE_CHECK(codecs.has_value());  // The chosen quantizations are always valid.
  return std::make_shared<const PoseQuantizations>(std::move(joints), std::move(reduced),
                                                   *std::move(codecs));
}

}  // namespace stridewire::server
