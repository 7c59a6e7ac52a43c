#pragma once

#include <array>
#include <cstdint>

namespace stridewire::client {

/// Maps local time to the server's clock.
///
/// A message stamped with server time s that arrives at local time l says that the offset l - s is
/// the clocks' difference plus its delay. Delay only adds, so the smallest offset of the last
/// kWindow_s is the best one; the map follows it at no more than kSlew, so that time shown neither
/// jumps nor runs backwards. Differences beyond kSnap_s are another clock, taken at once; so are
/// smaller offsets in the first kSettle_s.
class ClockMap {
 public:
  static constexpr int kBuckets = 8;
  static constexpr double kBucket_s = 0.5;
  static constexpr double kWindow_s = kBuckets * kBucket_s;
  static constexpr double kSlew = 0.02;  ///< Seconds a second.
  static constexpr double kSnap_s = 0.25;
  static constexpr double kSettle_s = 1.0;

  /// A message stamped `server_s` arrived at `local_s`. Local times do not go back.
  void AddSample(double local_s, double server_s);

  [[nodiscard]] bool ready() const { return ready_; }

  /// Server time at `local_s`; only when ready.
  [[nodiscard]] double ServerTime(double local_s) const;

  void Reset() { *this = ClockMap(); }

 private:
  struct Bucket {
    std::int64_t number = -1;
    double smallest_offset_s = 0.0;
  };

  /// The offset, slewed up to `local_s`.
  [[nodiscard]] double OffsetAt(double local_s) const;

  std::array<Bucket, kBuckets> buckets_;
  bool ready_ = false;
  double first_local_s_ = 0.0;
  double at_local_s_ = 0.0;  ///< When `offset_s_` held.
  double offset_s_ = 0.0;
  double wanted_offset_s_ = 0.0;  ///< Smallest in the window.
};

}  // namespace stridewire::client
