#pragma once

#include <spdlog/spdlog.h>

#include <memory>
#include <type_traits>
#include <vector>

#include "net/shared_frame.h"
#include "stridewire/protocol/encoder.h"

namespace stridewire::server {

/// Encodes a message of the server's own making, which cannot be wrong; null if it was all the
/// same, and then says so.
template <typename Message>
[[nodiscard]] SharedFrame EncodeFrame(protocol::Encoder& encoder, const Message& message) {
  auto frame = std::make_shared<std::vector<std::byte>>();
  const Status status = encoder.Encode(message, *frame);
  if (status) return frame;
  spdlog::error("a {} could not be encoded: {}",
                protocol::MessageTypeName(std::remove_cvref_t<Message>::kType),
                Describe(status.error()));
  return nullptr;
}

}  // namespace stridewire::server
