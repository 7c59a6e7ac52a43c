#pragma once

#include <array>
#include <cstddef>

namespace stridewire::client {

/// Determines which server time to display, so that poses arrive just before they are displayed.
///
/// A message with server time s that arrives at local time l has the offset l - s. At local time l,
/// the display shows server time l - d. It is not ahead of the newest pose if d is at least the
/// offset of the next message plus the interval of the messages. The target of d is therefore
///
///   quantile(kQuantile, offsets of the last kWindowS) + (1 + kMargin) * interval
///
/// d approaches the target at a rate of at most kMaxRate, so the display runs at most 5 % faster or
/// slower than the server. It jumps only if the server's clock has changed, if all messages of the
/// last kResyncS arrived more than kSnapS too late, or if, for kResyncS, d has exceeded its target
/// by more than kMaxExcessS.
///
/// No delay can cover a stall of the link. The messages that arrive after a stall are therefore
/// ignored until they are on time again.
class PlayoutClock {
 public:
  static constexpr double kWindowS = 1.5;
  /// Maximum number of offsets in the window. If there are more ticks per second, the window is
  /// shorter.
  static constexpr std::size_t kMaxOffsets = 256;
  /// Fraction of the values of a normal distribution that are at most two standard deviations above
  /// the mean.
  static constexpr double kQuantile = 0.977;
  /// Maximum difference between the speeds of the display and of the server, as a fraction.
  static constexpr double kMaxRate = 0.05;
  /// Time constant with which the delay approaches its target if the difference is small.
  static constexpr double kDecayS = 0.25;
  /// Margin that is added to the delay, as a fraction of the interval between messages.
  static constexpr double kMargin = 0.25;
  /// Minimum delay relative to the first message, until kWindowS after that message. After this
  /// time, the window determines the delay.
  static constexpr double kFirstDelayS = 0.1;
  /// Minimum pause between messages that counts as a stall. It must also exceed three intervals.
  static constexpr double kStallS = 0.4;
  static constexpr double kResyncS = 1.0;
  /// If an offset is smaller than all others in the window by more than this, the server's clock
  /// has changed, or the local clock was stopped.
  static constexpr double kSnapS = 0.25;
  /// Maximum excess of d over its target. At kMaxRate, an excess takes 20 times its own duration to
  /// disappear, so the display jumps if the excess remains larger than this for kResyncS.
  static constexpr double kMaxExcessS = 0.5;

  /// Adds a message with poses of server time `server_s` that arrived at `local_s`. The stream has
  /// the interval `interval_s`. Local times never decrease. Returns true if the displayed time
  /// jumped.
  bool AddSample(double local_s, double server_s, double interval_s);

  /// Must be called when the connection is lost, which counts as a stall.
  void OnStall(double local_s);

  [[nodiscard]] bool ready() const { return ready_; }
  /// Returns the server time to display at `local_s`. Requires ready().
  [[nodiscard]] double DisplayTime(double local_s) const { return local_s - OffsetAt(local_s); }
  /// Returns the target of `d` minus its value at `local_s`. Requires ready().
  [[nodiscard]] double MissingDelay(double local_s) const { return target_s_ - OffsetAt(local_s); }
  [[nodiscard]] double interval_s() const { return interval_s_; }

  void Reset() { *this = PlayoutClock(); }

 private:
  struct Offset {
    double local_s = 0.0;
    double server_s = 0.0;
    double offset_s = 0.0;
  };

  [[nodiscard]] double OffsetAt(double local_s) const;
  void Start(double local_s, double offset_s);
  void Store(const Offset& offset);

  /// The last offsets, one per server time, because a tick may consist of several messages.
  std::array<Offset, kMaxOffsets> offsets_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  bool ready_ = false;
  bool stalled_ = false;
  double first_local_s_ = 0.0;
  double first_offset_s_ = 0.0;
  double smallest_s_ = 0.0;  ///< Smallest offset in the window.
  double stalled_since_s_ = 0.0;
  double last_on_time_s_ = 0.0;  ///< Local time of the last message that was not too late.
  /// Last local time at which `d` was at most kMaxExcessS above its target.
  double last_short_s_ = 0.0;
  double last_local_s_ = 0.0;
  double at_local_s_ = 0.0;  ///< Local time for which `offset_s_` is valid.
  double offset_s_ = 0.0;    ///< d
  double target_s_ = 0.0;
  double interval_s_ = 0.0;
};

}  // namespace stridewire::client
