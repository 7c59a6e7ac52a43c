#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "latency_histogram.h"

namespace stridewire::load {

/// Measures the latency of steps, from the planned sending of the request to the arrival of the
/// first pose that shows the step. Each avatar has at most one probe at a time.
///
///   scheduled      sent           started (event, tick s)      first pose with tick >= s
///       |-----------|----------------------|-------------------------| that differs from the last
///       |<------------------------- latency ------------------------>|
///
/// Event and pose can arrive in either order. Avatars are indices 0 to n - 1. Not thread-safe.
class LatencyProbes {
 public:
  explicit LatencyProbes(std::size_t avatar_count) : probes_(avatar_count) {}

  /// Starts a probe. If the avatar already has an open probe, closes it and records the time until
  /// `now_ns` as its latency, so that a server that drops steps does not appear faster.
  void Schedule(std::size_t avatar, std::uint64_t request, std::int64_t scheduled_ns,
                std::int64_t now_ns);

  /// Must be called when the movement of a request has started at `tick`. Requests without a probe
  /// are ignored.
  void Started(std::size_t avatar, std::uint64_t request, std::uint64_t tick);

  /// Must be called when the server has rejected a request. Closes its probe without a measurement.
  void Rejected(std::size_t avatar, std::uint64_t request);

  /// Must be called when a pose has arrived. `changed` is true if it differs from the previous
  /// pose.
  void Pose(std::size_t avatar, std::uint64_t tick, std::int64_t arrived_ns, bool changed);

  /// Closes the probe of an avatar without a measurement, because its observer was dropped
  /// (--churn).
  void Abandon(std::size_t avatar);

  /// Discards all measurements. Open probes stay open.
  void StartCounting() { times_ = LatencyHistogram(); }

  /// Closes all open probes and records the time until `now_ns` as their latency. Returns the
  /// number of these probes.
  std::size_t Finish(std::int64_t now_ns);

  [[nodiscard]] std::size_t open_count() const { return open_count_; }
  [[nodiscard]] const LatencyHistogram& times() const { return times_; }

 private:
  struct Probe {
    std::uint64_t request = 0;  ///< Request that the probe measures. 0: the probe is closed.
    std::int64_t scheduled_ns = 0;
    std::uint64_t started_tick = 0;  ///< 0: unknown.
    // Ticks of the first and last changed pose that arrived before the `started` event.
    std::uint64_t first_tick = 0;
    std::int64_t first_ns = 0;
    std::uint64_t last_tick = 0;
    std::int64_t last_ns = 0;
  };

  void Close(Probe& probe, std::int64_t moved_ns);

  std::vector<Probe> probes_;
  LatencyHistogram times_;
  std::size_t open_count_ = 0;
};

}  // namespace stridewire::load
