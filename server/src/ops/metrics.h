#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ops/limits.h"

namespace stridewire::server {

/// A number one thread writes and any thread reads: no lock, not even a locked instruction.
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

/// Times in seconds, sorted into fixed bins. One writer, any reader.
class TimeHistogram {
 public:
  static constexpr std::array<double, 12> kUpperBoundsS = {
      0.000'1, 0.000'25, 0.000'5, 0.001, 0.002, 0.004, 0.008, 0.012, 0.016, 0.033, 0.1, 1.0};

  void Observe(double time_s);

  [[nodiscard]] std::uint64_t bin(std::size_t i) const { return bins_[i].value(); }
  [[nodiscard]] double sum_s() const { return 1e-9 * static_cast<double>(sum_ns_.value()); }
  [[nodiscard]] double max_s() const { return 1e-9 * static_cast<double>(max_ns_.value()); }
  /// Largest since this was last called.
  [[nodiscard]] double TakeRecentMax();

 private:
  std::array<Count, kUpperBoundsS.size() + 1> bins_;  // the last: above all bounds
  Count sum_ns_;
  Count max_ns_;
  std::atomic<std::uint64_t> recent_max_ns_{0};
};

/// What one thread (a shard, or the one that accepts connections) counts. It alone writes, and nothing another
/// thread writes shares a cache line with it, nor the one fetched along with that.
struct alignas(128) ThreadMetrics {
  Count avatars;
  Count regions;  ///< That sessions observe.
  Count sessions_attached;
  Count sessions_websocket;  ///< Of the attached ones.
  Count sessions_detached;
  Count ticks;
  Count ticks_missed;
  Count ticks_slipped;      ///< Missed so many at once that animation time was lost, too.
  Count cpu_ns;             ///< Processor time of the thread, ticks and sockets; of shards only.
  TimeHistogram tick;       ///< From draining requests to publishing batches.
  TimeHistogram tick_late;  ///< From when a tick was due to its start.
  Count poses_encoded;
  Count movements_encoded;
  Count poses_sent;
  Count batches_composed;  ///< Of rows, for one session.
  Count batches_sent;
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

/// All counts of a server and their text form.
class Metrics {
 public:
  /// One set a shard, and one for the thread that accepts connections.
  explicit Metrics(int shard_count);
  ~Metrics();
  Metrics(const Metrics&) = delete;
  Metrics& operator=(const Metrics&) = delete;

  [[nodiscard]] ThreadMetrics& shard(int index);
  [[nodiscard]] ThreadMetrics& ops();
  void set_world_count(std::uint64_t n) { worlds_.Set(n); }

  /// Sum over all threads of one number.
  [[nodiscard]] std::uint64_t Sum(Count ThreadMetrics::* number) const;
  [[nodiscard]] std::uint64_t Sum(Limit limit) const;

  /// Prometheus text exposition format 0.0.4. Starts a new "recent" maximum.
  [[nodiscard]] std::string Text();

 private:
  std::vector<std::unique_ptr<ThreadMetrics>> threads_;  // shards, then ops
  Count worlds_;
};

}  // namespace stridewire::server
