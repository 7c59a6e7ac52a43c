#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "latency_histogram.h"

namespace stridewire::load {

/// Measures how long steps take from their plan to the screen: one probe an avatar at a time, from
/// the time a step was to be sent to the arrival of the first pose that moves by it.
///
///   scheduled      sent           started (event, tick s)      first pose with tick >= s
///       |-----------|----------------------|-------------------------| that differs from the last
///       |<------------------------- latency ------------------------>|
///
/// The event tells when the movement began, the pose that it can be seen; either may arrive first.
/// Avatars are indices 0 to n - 1. Not thread-safe.
class LatencyProbes {
 public:
  explicit LatencyProbes(std::size_t avatar_count) : probes_(avatar_count) {}

  /// Starts a probe. One still open for that avatar is closed, and counts with the time it has
  /// waited by now: a server that never shows a step must not look faster for it.
  void Schedule(std::size_t avatar, std::uint64_t request, std::int64_t scheduled_ns,
                std::int64_t now_ns);

  /// The request's movement began at `tick`. Other requests of that avatar are ignored.
  void Started(std::size_t avatar, std::uint64_t request, std::uint64_t tick);

  /// The request will not be done: nothing to measure.
  void Rejected(std::size_t avatar, std::uint64_t request);

  /// A pose arrived at the observer that measures; `changed`: it differs from the one before.
  void Pose(std::size_t avatar, std::uint64_t tick, std::int64_t arrived_ns, bool changed);

  /// Nobody watches this avatar for a while, by our own doing: closes its probe uncounted.
  void Abandon(std::size_t avatar);

  /// Only what is scheduled from now on, or is open now, is counted.
  void StartCounting() { times_ = LatencyHistogram(); }

  /// Closes what has not moved; these count with the time they have waited. Returns how many.
  std::size_t Finish(std::int64_t now_ns);

  [[nodiscard]] std::size_t open_count() const { return open_count_; }
  [[nodiscard]] const LatencyHistogram& times() const { return times_; }

 private:
  struct Probe {
    std::uint64_t request = 0;  ///< 0: not open
    std::int64_t scheduled_ns = 0;
    std::uint64_t started_tick = 0;  ///< 0: not known yet
    // The first and the last change seen while the tick of its start was not known.
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
