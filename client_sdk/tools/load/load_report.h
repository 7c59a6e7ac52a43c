#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stridewire/protocol/pose_codec.h"

namespace stridewire::load {

/// Median, 99th percentile and maximum.
struct Quantiles {
  double p50 = 0.0;
  double p99 = 0.0;
  double max = 0.0;
};

/// Results of a run. `stridewire-load --json` prints them.
struct LoadReport {
  int avatars = 0;
  int worlds = 0;
  int observers = 0;
  int partial_observers = 0;
  int partial_avatars = 0;  ///< Avatars per partial observer.
  protocol::PoseMode mode = protocol::PoseMode::kQuantised;
  std::uint64_t seed = 0;
  double seconds = 0.0;              ///< Duration of the measurement.
  std::uint64_t poses_received = 0;  ///< Poses received at measured ticks, summed over observers.
  /// Expected poses: observed avatars times measured ticks, summed over all observers.
  std::uint64_t poses_expected = 0;
  std::uint64_t poses_invalid = 0;  ///< Received poses that failed a check.
  /// Total size of the frames of all measured batches, including headers.
  std::uint64_t bytes_received = 0;
  std::uint64_t batches_dropped = 0;  ///< Batches that the server dropped for slow observers.
  /// Fraction of the received poses in which the avatar did not stand.
  std::optional<double> moving_share;
  /// Durations of ticks from the server's metrics; empty without metrics.
  std::optional<Quantiles> tick_ms;
  std::optional<std::uint64_t> ticks_missed;
  std::optional<Quantiles> step_latency_ms;  ///< Latency of steps; empty if no step was measured.
  std::uint64_t steps_measured = 0;
  std::uint64_t requests_sent = 0;
  std::uint64_t requests_accepted = 0;
  std::uint64_t requests_rejected = 0;
  std::uint64_t reconnects = 0;
  int threads = 1;
  double own_cpu_s = 0.0;  ///< Processor time that this program used during the measurement.
  Quantiles own_loop_late_ms;
  Quantiles own_send_late_ms;
  std::vector<std::string> errors;
  bool failed = false;  ///< True if an error other than slowness occurred. The exit code is then 1.
};

/// Formats a report as JSON on one line, without a newline.
[[nodiscard]] std::string ToJson(const LoadReport& report);

/// Formats a report as readable text.
[[nodiscard]] std::string ToText(const LoadReport& report);

/// Returns a number of the report. `name` is its path in the JSON report, for example
/// "tick_ms.p99", and must be one of ReportNumberNames. The path "errors" yields the number of
/// errors. Returns nullopt if the number was not measured.
[[nodiscard]] std::optional<double> ReportNumber(const LoadReport& report, std::string_view name);
/// Returns the names of all numbers.
[[nodiscard]] std::vector<std::string> ReportNumberNames();

}  // namespace stridewire::load
