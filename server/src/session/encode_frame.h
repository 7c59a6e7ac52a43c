#pragma once

#include <spdlog/spdlog.h>

#include <memory>
#include <type_traits>
#include <vector>

#include "net/shared_frame.h"
#include "stridewire/protocol/encoder.h"

namespace stridewire::server {

/// Encodes a message that the server has created. Encoding fails only if the server has a bug. In
/// this case, the function logs the error and returns null.
template <typename Message>
[[nodiscard]] SharedFrame EncodeFrame(protocol::Encoder& encoder, const Message& message) {
  auto frame = std::make_shared<std::vector<std::byte>>();
  const Status status = encoder.Encode(message, *frame);
  if (status) return frame;
  spdlog::error("cannot encode {}: {}",
                protocol::MessageTypeName(std::remove_cvref_t<Message>::kType),
                Describe(status.error()));
  return nullptr;
}

}  // namespace stridewire::server
