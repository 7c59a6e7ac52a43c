#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stridewire/protocol/pose_codec.h"

namespace stridewire::load {

struct Quantiles {
  double p50 = 0.0;
  double p99 = 0.0;
  double max = 0.0;
};

/// What a run measured; its JSON is the contract of `stridewire-load --json`.
struct LoadReport {
  int avatars = 0;
  int worlds = 0;
  int observers = 0;
  int partial_observers = 0;
  int partial_avatars = 0;  ///< That each of these watches.
  protocol::PoseMode mode = protocol::PoseMode::kQuantised;
  std::uint64_t seed = 0;
  double seconds = 0.0;               ///< Of the measured window.
  std::uint64_t poses_received = 0;   ///< Of our avatars, at ticks of the window, by all observers.
  std::uint64_t poses_expected = 0;   ///< Avatars watched, of all observers, x ticks of the window.
  std::uint64_t poses_invalid = 0;    ///< Received, but failed a check.
  std::uint64_t bytes_received = 0;   ///< Frames of the window's batches, headers included.
  std::uint64_t batches_dropped = 0;  ///< By the server for slow observers, as it told them.
  std::optional<double> moving_share;  ///< Share of poses received that were not standing.
  std::optional<Quantiles> tick_ms;    ///< The server's own; empty without its metrics.
  std::optional<std::uint64_t> ticks_missed;
  std::optional<Quantiles> step_latency_ms;  ///< Empty if no step was measured.
  std::uint64_t steps_measured = 0;
  std::uint64_t requests_sent = 0;
  std::uint64_t requests_accepted = 0;
  std::uint64_t requests_rejected = 0;
  std::uint64_t reconnects = 0;
  int threads = 1;
  double own_cpu_s = 0.0;  ///< Processor time of this program over the window.
  Quantiles own_loop_late_ms;
  Quantiles own_send_late_ms;
  std::vector<std::string> errors;
  bool failed = false;  ///< Something went wrong that is not a matter of speed: exit code 1.
};

/// One line of JSON without a line end.
[[nodiscard]] std::string ToJson(const LoadReport& report);

/// Some lines for a person.
[[nodiscard]] std::string ToText(const LoadReport& report);

/// A number of the report by the path its JSON has, e.g. "tick_ms.p99"; `errors` is how many there
/// are. Empty if it could not be measured. The name must be one of ReportNumberNames.
[[nodiscard]] std::optional<double> ReportNumber(const LoadReport& report, std::string_view name);
[[nodiscard]] std::vector<std::string> ReportNumberNames();

}  // namespace stridewire::load
