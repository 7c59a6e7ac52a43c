#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "stridewire/base/rotation_quantization.h"
#include "stridewire/protocol/compact_codecs.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire::server {

/// How the compact poses of a library's worlds are told.
struct PoseCodes {
  std::vector<RotationQuantization> joints;
  std::vector<std::uint16_t> reduced_joints;  ///< Told at protocol::PoseDetail::kReduced.
  protocol::CompactCodecs codecs;
};

/// Milliseconds: once a library.
[[nodiscard]] std::shared_ptr<const PoseCodes> MakePoseCodes(const MotionLibrary& library);

}  // namespace stridewire::server
