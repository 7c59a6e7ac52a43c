#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/protocol/frame.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Encodes messages as frames. Reuses its memory for every message; use one encoder per connection
/// or thread. Not thread-safe.
///
/// `Encode` appends header and payload to `frame`, so that one write can send several frames. It
/// fails with the errors of Check (check.h), and with kLimitExceeded if the payload exceeds the
/// limit of its message type. On failure `frame` is unchanged.
class Encoder {
 public:
  explicit Encoder(const FrameLimits& limits = {});
  ~Encoder();
  Encoder(Encoder&&) noexcept;
  Encoder& operator=(Encoder&&) noexcept;

  /// `M` is one of the structs that Message can contain.
  template <typename M>
  [[nodiscard]] Status Encode(const M& message, std::vector<std::byte>& frame);
  [[nodiscard]] Status Encode(const Message& message, std::vector<std::byte>& frame);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stridewire::protocol
