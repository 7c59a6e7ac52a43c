#pragma once

#include <array>
#include <cstdint>

namespace stridewire::client {

/// Maps local time to server time.
///
/// If a message with server time s arrives at local time l, the offset l - s is the difference of
/// the clocks plus the delay of the message. Delays are never negative, so the smallest offset of
/// the last kWindowS is the best estimate. The map approaches it at a rate of at most kSlew, so
/// that the mapped time neither jumps nor runs backwards. It jumps in two cases only. In the first,
/// the estimate differs from the map by more than kSnapS, which means that the server's clock has
/// changed. In the second, a smaller offset arrives during the first kSettleS.
class ClockMap {
 public:
  static constexpr int kBuckets = 8;
  static constexpr double kBucketS = 0.5;
  static constexpr double kWindowS = kBuckets * kBucketS;
  /// Maximum rate of change of the offset, in seconds per second.
  static constexpr double kSlew = 0.02;
  static constexpr double kSnapS = 0.25;
  static constexpr double kSettleS = 1.0;

  /// Adds a message with server time `server_s` that arrived at `local_s`. Local times never
  /// decrease.
  void AddSample(double local_s, double server_s);

  [[nodiscard]] bool ready() const { return ready_; }

  /// Delay of the last message relative to the fastest message of the last kWindowS.
  [[nodiscard]] double last_lateness_s() const { return lateness_s_; }

  /// Returns the server time at `local_s`. Requires ready().
  [[nodiscard]] double ServerTime(double local_s) const;

  void Reset() { *this = ClockMap(); }

 private:
  struct Bucket {
    std::int64_t number = -1;
    double smallest_offset_s = 0.0;
  };

  /// Returns the offset at `local_s`, which moves from offset_s_ towards target_offset_s_.
  [[nodiscard]] double OffsetAt(double local_s) const;

  std::array<Bucket, kBuckets> buckets_;
  bool ready_ = false;
  double first_local_s_ = 0.0;
  double at_local_s_ = 0.0;  ///< Local time for which `offset_s_` is valid.
  double offset_s_ = 0.0;
  double target_offset_s_ = 0.0;  ///< Smallest offset in the window.
  double lateness_s_ = 0.0;
};

}  // namespace stridewire::client
