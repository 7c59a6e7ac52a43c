#pragma once

#include <optional>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/protocol/frame.h"

namespace stridewire::protocol {

/// Cuts a stream of bytes into frames.
///
///   std::span<const std::byte> bytes = …;                  // as they came from the socket
///   for (;;) {
///     auto next = reader.Next(bytes);
///     if (!next) return Close(next.error());               // nothing after it can be trusted
///     if (!*next) break;                                   // all bytes taken, no frame complete
///     Handle(**next);
///   }
///
/// Holds at most one frame, and never more memory than twice what has arrived of it: an announced
/// length alone allocates nothing. Not thread-safe.
class FrameReader {
 public:
  /// `sender` is the peer: frames it may not send are errors.
  explicit FrameReader(Sender sender, const FrameLimits& limits = {});

  /// Takes bytes off the front of `bytes` up to the end of one frame. The view is valid until the
  /// next call and while the bytes given live (a frame that lies whole and aligned in them is not
  /// copied). Errors as ReadFrameHeader; after one every call gives the same error.
  [[nodiscard]] Expected<std::optional<FrameView>> Next(std::span<const std::byte>& bytes);

  /// Changes the caps from the next header on, e.g. after a handshake.
  void set_limits(const FrameLimits& limits) { limits_ = limits; }

  [[nodiscard]] std::size_t buffered_bytes() const { return buffer_.size(); }
  [[nodiscard]] std::size_t capacity_bytes() const { return buffer_.capacity(); }

 private:
  Sender sender_;
  FrameLimits limits_;
  std::vector<std::byte> buffer_;
  std::optional<FrameHeader> header_;  ///< Of the frame in `buffer_`, once its header is there.
  bool frame_given_ = false;           ///< The frame in `buffer_` was handed out.
  std::optional<Error> error_;
};

}  // namespace stridewire::protocol
