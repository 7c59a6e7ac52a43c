#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <ostream>
#include <vector>

#include "stridewire/protocol/decode.h"
#include "stridewire/protocol/encoder.h"

namespace stridewire::protocol {

/// Returns the side that sends a type. Client messages have low numbers; Goodbye is sent by both.
inline Sender SenderOf(MessageType type) {
  return type <= MessageType::kGoodbye ? Sender::kClient : Sender::kServer;
}

inline std::vector<std::byte> EncodeOrFail(const Message& message) {
  std::vector<std::byte> frame;
  const Status status = Encoder().Encode(message, frame);
  if (!status) ADD_FAILURE() << Describe(status.error());
  return frame;
}

inline Expected<Message> Decode(std::span<const std::byte> frame, MessageType type) {
  auto view = ParseFrame(frame, SenderOf(type));
  if (!view) return std::unexpected(view.error());
  return DecodeMessage(*view);
}

template <typename T>
bool SameMessage(const T& a, const T& b) {
  return a == b;
}

inline bool SameMessage(const PoseBatch& a, const PoseBatch& b) {
  return a.info == b.info && std::ranges::equal(a.avatars, b.avatars) &&
         std::ranges::equal(a.flags, b.flags) && std::ranges::equal(a.poses, b.poses);
}

inline bool SameMessage(const Message& a, const Message& b) {
  return std::visit(
      []<typename A, typename B>(const A& x, const B& y) {
        if constexpr (std::is_same_v<A, B>) {
          return SameMessage(x, y);
        } else {
          return false;
        }
      },
      a, b);
}

inline MessageType TypeOf(const Message& message) {
  return std::visit([](const auto& m) { return m.kType; }, message);
}

}  // namespace stridewire::protocol
