#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "stridewire/base/error.h"
#include "stridewire/protocol/compact_codec.h"
#include "stridewire/protocol/pose_codec.h"

namespace stridewire::protocol {

/// The codecs for the compact poses of one world: one per PoseDetail, all with the same
/// quantization.
class CompactCodecs {
 public:
  /// No codecs.
  CompactCodecs() = default;

  /// Makes the codecs of a world. If `reduced_joints` is empty, there is no codec for
  /// PoseDetail::kReduced. Fails with the errors of CompactCodec::Make.
  [[nodiscard]] static Expected<CompactCodecs> Make(std::span<const RotationQuantization> codes,
                                                    std::span<const std::int16_t> parents,
                                                    std::span<const std::uint16_t> reduced_joints);

  /// Returns the codec of a mode, or null if there is none.
  [[nodiscard]] const CompactCodec* Find(PoseMode mode) const;

 private:
  std::array<std::optional<CompactCodec>, 3> by_detail_;
};

}  // namespace stridewire::protocol
