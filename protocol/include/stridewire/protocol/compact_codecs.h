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

/// The codecs of one world's compact poses: one a level of detail, all by the same codes.
class CompactCodecs {
 public:
  /// None: a world whose poses are not compact.
  CompactCodecs() = default;

  /// `fewer_joints` as CheckFewerJoints takes them, or none: then there is no PoseDetail::kFewer. Errors as
  /// CompactCodec::Make.
  [[nodiscard]] static Expected<CompactCodecs> Make(std::span<const RotationQuantization> codes,
                                                    std::span<const std::int16_t> parents,
                                                    std::span<const std::uint16_t> fewer_joints);

  /// Null: poses of that mode are not compact, or not known here.
  [[nodiscard]] const CompactCodec* Find(PoseMode mode) const;

 private:
  std::array<std::optional<CompactCodec>, 3> by_detail_;
};

}  // namespace stridewire::protocol
