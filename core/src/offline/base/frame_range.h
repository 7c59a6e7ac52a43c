#pragma once

namespace stridewire {

/// A range of frames of a capture. Includes `begin`, excludes `end`.
struct FrameRange {
  int begin = 0;
  int end = 0;

  [[nodiscard]] constexpr int size() const { return end - begin; }
  [[nodiscard]] constexpr bool Contains(const FrameRange& other) const {
    return begin <= other.begin && end >= other.end;
  }
  [[nodiscard]] constexpr bool Overlaps(const FrameRange& other) const {
    return begin < other.end && other.begin < end;
  }
  friend constexpr bool operator==(const FrameRange&, const FrameRange&) = default;
};

}  // namespace stridewire
