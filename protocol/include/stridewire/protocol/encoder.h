#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Turns messages into frames. Keeps its memory from one message to the next: one a connection or
/// thread. Not thread-safe.
///
/// `Encode` appends header and payload to `frame`, so several frames may go out in one write. It
/// refuses what a peer would refuse, with the errors of Check (check.h) or kLimitExceeded for a
/// payload over its cap, and then leaves `frame` as it was.
class Encoder {
 public:
  explicit Encoder(const FrameLimits& limits = {});
  ~Encoder();
  Encoder(Encoder&&) noexcept;
  Encoder& operator=(Encoder&&) noexcept;

  [[nodiscard]] Status Encode(const Hello& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const JoinWorld& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const LeaveWorld& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Spawn& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Remove& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Request& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const CancelQueue& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Observe& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const StopObserving& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Ping& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Goodbye& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Welcome& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const WorldInfo& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Reply& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const PoseBatch& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Events& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Lagging& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const ErrorNotice& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Pong& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Message& message, std::vector<std::byte>& frame);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stridewire::protocol
