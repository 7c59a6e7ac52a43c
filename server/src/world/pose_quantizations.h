#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "stridewire/base/rotation_quantization.h"
#include "stridewire/protocol/compact_codecs.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire::server {

/// The compact pose formats of a library: how each joint is quantized, and the codecs for it.
struct PoseQuantizations {
  std::vector<RotationQuantization> joints;
  std::vector<std::uint16_t> reduced_joints;  ///< Joints of protocol::PoseDetail::kReduced.
  protocol::CompactCodecs codecs;
};

/// Chooses the formats for a library. Takes some milliseconds; called once per library.
[[nodiscard]] std::shared_ptr<const PoseQuantizations> MakePoseQuantizations(
    const MotionLibrary& library);

}  // namespace stridewire::server
