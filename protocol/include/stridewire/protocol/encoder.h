#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Encodes messages as frames. Reuses its memory for every message; use one encoder per connection
/// or thread. Not thread-safe.
///
/// `Encode` appends header and payload to `frame`, so that one write can send several frames. It
/// fails with the errors of Check (check.h), and with kLimitExceeded if the payload exceeds the cap
/// of its message type. On failure `frame` is unchanged.
class Encoder {
 public:
  explicit Encoder(const FrameLimits& limits = {});
  ~Encoder();
  Encoder(Encoder&&) noexcept;
  Encoder& operator=(Encoder&&) noexcept;

  [[nodiscard]] Status Encode(const Hello& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const JoinWorld& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const LeaveWorld& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Spawn& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Remove& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Request& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const CancelQueue& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Observe& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const StopObserving& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Ping& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const InspectAvatar& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Goodbye& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Welcome& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const WorldInfo& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Reply& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const PoseBatch& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Events& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Lagging& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const ErrorNotice& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Pong& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const AvatarState& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const SetTerrain& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const SetLayers& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const SetPlanting& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const WorldTerrain& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const FetchLibrary& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Movements& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const LibraryPiece& m, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Message& m, std::vector<std::byte>& frame);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stridewire::protocol
