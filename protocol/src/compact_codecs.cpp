#include "stridewire/protocol/compact_codecs.h"

#include <utility>

namespace stridewire::protocol {

Expected<CompactCodecs> CompactCodecs::Make(std::span<const RotationQuantization> codes,
                                            std::span<const std::int16_t> parents,
                                            std::span<const std::uint16_t> reduced_joints) {
  constexpr std::array<std::uint16_t, 1> kRootOnly{0};
  const std::array<std::span<const std::uint16_t>, 3> included{{{}, reduced_joints, kRootOnly}};
  CompactCodecs codecs;
  for (std::size_t d = 0; d < included.size(); ++d) {
    if (static_cast<PoseDetail>(d) == PoseDetail::kReduced && reduced_joints.empty()) continue;
    auto codec = CompactCodec::Make(codes, parents, included[d]);
    if (!codec) return std::unexpected(codec.error());
    codecs.by_detail_[d] = *std::move(codec);
  }
  return codecs;
}

const CompactCodec* CompactCodecs::Find(PoseMode mode) const {
  if (!IsCompact(mode)) return nullptr;
  const auto& codec = by_detail_[static_cast<std::size_t>(DetailOf(mode))];
  return codec ? &*codec : nullptr;
}

}  // namespace stridewire::protocol
