#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/limits.h"

namespace stridewire::server {

/// A counter that one thread writes and any thread reads, without locks or atomic read-modify-write
/// instructions.
class Count {
 public:
  void Add(std::uint64_t n = 1) {
    value_.store(value_.load(std::memory_order_relaxed) + n, std::memory_order_relaxed);
  }
  void Set(std::uint64_t n) { value_.store(n, std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t value() const { return value_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint64_t> value_{0};
};

/// Histogram of times in seconds with fixed bins. One thread calls Observe; any thread may call the
/// other functions.
class TimeHistogram {
 public:
  static constexpr std::array<double, 12> kUpperBoundsS = {
      0.000'1, 0.000'25, 0.000'5, 0.001, 0.002, 0.004, 0.008, 0.012, 0.016, 0.033, 0.1, 1.0};

  void Observe(double time_s);

  [[nodiscard]] std::uint64_t bin(std::size_t i) const { return bins_[i].value(); }
  [[nodiscard]] double sum_s() const { return 1e-9 * static_cast<double>(sum_ns_.value()); }
  [[nodiscard]] double max_s() const { return 1e-9 * static_cast<double>(max_ns_.value()); }
  /// Returns the largest time observed since the previous call, in seconds; 0 if there was none.
  [[nodiscard]] double TakeRecentMax();

 private:
  std::array<Count, kUpperBoundsS.size() + 1> bins_;  // The last bin counts times above all bounds.
  Count sum_ns_;
  Count max_ns_;
  std::atomic<std::uint64_t> recent_max_ns_{0};
};

/// Counters of one thread: a shard, or the main thread that accepts connections. Only this thread
/// writes them, except that Metrics::Text resets the recent maxima of histograms. They are aligned
/// to two cache lines, because processors prefetch lines in pairs. Data of other threads is thus
/// never in these lines.
struct alignas(128) ThreadMetrics {
  Count avatars;
  Count regions;  ///< Regions that sessions of this shard observe.
  Count sessions_attached;
  Count sessions_websocket;  ///< Attached sessions over WebSocket.
  Count sessions_detached;
  Count ticks;
  Count ticks_missed;
  Count ticks_slipped;      ///< Number of missed ticks that avatars did not catch up on.
  Count cpu_ns;             ///< CPU time of the thread in ns; shards only.
  TimeHistogram tick;       ///< Duration of a tick: executing commands to publishing batches.
  TimeHistogram tick_late;  ///< Delay between the due time and the start of a tick.
  Count poses_encoded;
  Count movements_encoded;
  Count poses_sent;
  Count batches_composed;  ///< Frames composed for sessions that observe only some avatars.
  Count batches_sent;
  Count websocket_messages_sent;
  Count batches_dropped;
  Count pose_errors;
  Count events_dropped;
  Count bytes_sent;
  Count bytes_received;
  Count messages_received;
  Count requests_accepted;
  Count requests_rejected;
  Count protocol_errors;
  Count connections_accepted;
  Count connections_closed;
  Count sessions_opened;
  Count sessions_resumed;
  Count sessions_ended;
  Count http_requests;
  Count origins_refused;
  std::array<Count, static_cast<std::size_t>(Limit::kCount)> limits;

  void Reached(Limit limit, std::uint64_t n = 1) { limits[static_cast<std::size_t>(limit)].Add(n); }
};

/// All counters of a server and their text form.
class Metrics {
 public:
  /// Creates one set of counters per shard and one for the main thread.
  explicit Metrics(int shard_count);
  ~Metrics();
  Metrics(const Metrics&) = delete;
  Metrics& operator=(const Metrics&) = delete;

  [[nodiscard]] ThreadMetrics& shard(int index);
  [[nodiscard]] ThreadMetrics& main();
  void set_world_count(std::uint64_t n) { worlds_.Set(n); }

  /// Returns the sum of one counter over all threads.
  [[nodiscard]] std::uint64_t Sum(Count ThreadMetrics::* number) const;
  [[nodiscard]] std::uint64_t Sum(Limit limit) const;

  /// Returns all metrics in the Prometheus text exposition format 0.0.4 and resets the recent
  /// maxima of the histograms.
  [[nodiscard]] std::string Text();

 private:
  // The shards' metrics, followed by those of the main thread.
  std::vector<std::unique_ptr<ThreadMetrics>> threads_;
  Count worlds_;
};

}  // namespace stridewire::server
