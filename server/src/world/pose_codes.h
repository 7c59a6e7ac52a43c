#pragma once

#include <memory>
#include <vector>

#include "stridewire/base/rotation_code.h"
#include "stridewire/protocol/compact_codec.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire::server {

/// How the compact poses of a library's worlds are told.
struct PoseCodes {
  std::vector<RotationCode> joints;
  protocol::CompactCodec codec;
};

/// Milliseconds: once a library.
[[nodiscard]] std::shared_ptr<const PoseCodes> MakePoseCodes(const MotionLibrary& library);

}  // namespace stridewire::server
