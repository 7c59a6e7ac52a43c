#include "world/pose_quantizations.h"

#include <utility>

#include "base/check.h"
#include "runtime/library/pose_quantization.h"

namespace stridewire::server {

std::shared_ptr<const PoseCodes> MakePoseCodes(const MotionLibrary& library) {
  std::vector<RotationQuantization> joints = ChoosePoseQuantization(library).joints;
  std::vector<std::int16_t> parents;
  for (const Joint& joint : library.skeleton().joints) {
    parents.push_back(static_cast<std::int16_t>(joint.parent));
  }
  std::vector<std::uint16_t> fewer = ChooseReducedJoints(library);
  auto codecs = protocol::CompactCodecs::Make(joints, parents, fewer);
  STRIDEWIRE_CHECK(codecs.has_value());  // what is chosen is within what can be told
  return std::make_shared<const PoseCodes>(std::move(joints), std::move(fewer), *std::move(codecs));
}

}  // namespace stridewire::server
