#include "world/pose_codes.h"

#include <utility>

#include "stridewire/base/check.h"
#include "stridewire/runtime/pose_code.h"

namespace stridewire::server {

std::shared_ptr<const PoseCodes> MakePoseCodes(const MotionLibrary& library) {
  std::vector<RotationCode> joints = ChoosePoseCode(library).joints;
  std::vector<std::int16_t> parents;
  for (const Joint& joint : library.skeleton().joints) {
    parents.push_back(static_cast<std::int16_t>(joint.parent));
  }
  auto codec = protocol::CompactCodec::Make(joints, parents);
  STRIDEWIRE_CHECK(codec.has_value());  // what is chosen is within what can be told
  return std::make_shared<const PoseCodes>(std::move(joints), *std::move(codec));
}

}  // namespace stridewire::server
