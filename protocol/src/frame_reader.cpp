#include "stridewire/protocol/frame_reader.h"

#include <algorithm>

namespace stridewire::protocol {
namespace {

// A larger buffer is freed after its frame, because the next frame may be small.
constexpr std::size_t kKeptBytes = std::size_t{1} << 20;
constexpr std::size_t kFirstBytes = 4096;

bool IsAligned(const std::byte* bytes) {
  return reinterpret_cast<std::uintptr_t>(bytes) % kPayloadAlignment == 0;
}

}  // namespace

FrameReader::FrameReader(Sender sender, const FrameLimits& limits)
    : sender_(sender), limits_(limits) {}

Expected<std::optional<FrameView>> FrameReader::Next(std::span<const std::byte>& bytes) {
  if (error_) return std::unexpected(*error_);
  if (frame_given_) {
    frame_given_ = false;
    header_.reset();
    if (buffer_.capacity() > kKeptBytes) {
      std::vector<std::byte>().swap(buffer_);
    } else {
      buffer_.clear();
    }
  }

  if (buffer_.empty() && bytes.size() >= kFrameHeaderBytes && IsAligned(bytes.data())) {
    const auto header = ReadFrameHeader(bytes.first<kFrameHeaderBytes>(), sender_, limits_);
    if (!header) {
      error_ = header.error();
      return std::unexpected(*error_);
    }
    const std::size_t frame_bytes = kFrameHeaderBytes + header->payload_bytes;
    if (bytes.size() >= frame_bytes) {
      const FrameView view{header->type, bytes.subspan(kFrameHeaderBytes, header->payload_bytes)};
      bytes = bytes.subspan(frame_bytes);
      return view;
    }
  }

  // The buffer grows with the received bytes, not with the announced length: it doubles, up to the
  // end of the frame.
  const auto take = [&](std::size_t until) {
    const std::size_t count = std::min(until - buffer_.size(), bytes.size());
    const std::size_t needed = buffer_.size() + count;
    if (needed > buffer_.capacity()) {
      buffer_.reserve(std::max(needed, std::min(until, std::max(2 * buffer_.size(), kFirstBytes))));
    }
    buffer_.insert(buffer_.end(), bytes.begin(),
                   bytes.begin() + static_cast<std::ptrdiff_t>(count));
    bytes = bytes.subspan(count);
    return buffer_.size() == until;
  };
  if (!header_) {
    if (!take(kFrameHeaderBytes)) return std::nullopt;
    const auto header =
        ReadFrameHeader(std::span(buffer_).first<kFrameHeaderBytes>(), sender_, limits_);
    if (!header) {
      error_ = header.error();
      return std::unexpected(*error_);
    }
    header_ = *header;
  }
  if (!take(kFrameHeaderBytes + header_->payload_bytes)) return std::nullopt;
  frame_given_ = true;
  return FrameView{header_->type, std::span(buffer_).subspan(kFrameHeaderBytes)};
}

}  // namespace stridewire::protocol
