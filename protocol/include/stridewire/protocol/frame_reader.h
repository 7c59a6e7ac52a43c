#pragma once

#include <optional>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/protocol/frame.h"

namespace stridewire::protocol {

/// Splits a stream of bytes into frames.
///
///   std::span<const std::byte> bytes = ...;                // from the socket
///   for (;;) {
///     auto next = reader.Next(bytes);
///     if (!next) return Close(next.error());               // the rest of the stream is invalid
///     if (!*next) break;                                   // the next frame is incomplete
///     Handle(**next);
///   }
///
/// Buffers at most one frame. The buffer takes at most twice the number of received bytes of that
/// frame, or 4 KiB if that is more, so a header alone cannot make it allocate a large buffer. A
/// buffer of up to 1 MiB is kept for the following frames. Not thread-safe.
class FrameReader {
 public:
  /// `sender` is the side that sends the frames. Types that it may not send are errors.
  explicit FrameReader(Sender sender, const FrameLimits& limits = {});

  /// Consumes bytes from the front of `bytes` up to the end of one frame. Returns an empty optional
  /// if the frame is incomplete. The view is valid until the next call. It may refer to the memory
  /// of `bytes`, because frames that are complete and aligned there are not copied. Fails with the
  /// errors of ReadFrameHeader. After an error every call returns the same error.
  [[nodiscard]] Expected<std::optional<FrameView>> Next(std::span<const std::byte>& bytes);

  /// Sets the limits for all following frames, for example after the handshake.
  void set_limits(const FrameLimits& limits) { limits_ = limits; }

  [[nodiscard]] std::size_t buffered_bytes() const { return buffer_.size(); }
  [[nodiscard]] std::size_t capacity_bytes() const { return buffer_.capacity(); }

 private:
  Sender sender_;
  FrameLimits limits_;
  std::vector<std::byte> buffer_;
  std::optional<FrameHeader> header_;  ///< Header of the frame in `buffer_`.
  /// True if the frame in `buffer_` has been returned to the caller.
  bool frame_given_ = false;
  std::optional<Error> error_;
};

}  // namespace stridewire::protocol
