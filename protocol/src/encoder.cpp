#include "stridewire/protocol/encoder.h"

#include "codec_support.h"
#include "frame_builder.h"
#include "message_list.h"
#include "stridewire/protocol/check.h"

namespace stridewire::protocol {
namespace {

// After a message with more bytes than this, Encode frees the builder's buffer.
constexpr std::size_t kKeptBuilderBytes = std::size_t{1} << 20;

}  // namespace

struct Encoder::Impl {
  FrameLimits limits;
  FlatBufferBuilder builder;
};

Encoder::Encoder(const FrameLimits& limits) : impl_(std::make_unique<Impl>()) {
  impl_->limits = limits;
}
Encoder::~Encoder() = default;
Encoder::Encoder(Encoder&&) noexcept = default;
Encoder& Encoder::operator=(Encoder&&) noexcept = default;

template <typename M>
Status Encoder::Encode(const M& message, std::vector<std::byte>& frame) {
  if (Status status = Check(message); !status) return status;
  FlatBufferBuilder& builder = impl_->builder;
  builder.Clear();
  builder.Finish(Build(builder, message));
  const Status status = AppendFrame(builder, M::kType, impl_->limits, frame);
  if (builder.GetSize() > kKeptBuilderBytes) builder.Reset();
  return status;
}

#define STRIDEWIRE_INSTANTIATE(Struct, ...) \
  template Status Encoder::Encode(const Struct& message, std::vector<std::byte>& frame);
STRIDEWIRE_MESSAGES(STRIDEWIRE_INSTANTIATE)
#undef STRIDEWIRE_INSTANTIATE

Status Encoder::Encode(const Message& message, std::vector<std::byte>& frame) {
  return std::visit([&](const auto& alternative) { return Encode(alternative, frame); }, message);
}

}  // namespace stridewire::protocol
