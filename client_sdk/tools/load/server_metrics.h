#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "load_options.h"
#include "load_report.h"
#include "stridewire/base/error.h"

namespace stridewire::load {

/// Values from one read of the server's /metrics page.
struct ServerMetrics {
  /// Tick durations of all shards: upper bound in seconds -> cumulative count.
  std::map<double, double> tick_bins;
  double tick_max_s = 0.0;  ///< Longest tick since the server started.
  double tick_max_since_scrape_s = 0.0;
  double ticks_missed = 0.0;
  double avatars = 0.0;
};

/// Parses the Prometheus text format 0.0.4. Samples with the same name and different labels are
/// combined: maxima by their maximum, others by their sum. Fails with kMalformed (Error::index is
/// the line) or kNotFound (Error::where is the missing metric).
[[nodiscard]] Expected<ServerMetrics> ParseServerMetrics(std::string_view text);

/// Reads the page over HTTP. Blocks for at most `timeout_s` + 1 s. Fails with kIo, with the address
/// and the reason in Error::where, and with the errors of ParseServerMetrics.
[[nodiscard]] Expected<ServerMetrics> ScrapeServerMetrics(const Address& address, double timeout_s);

/// Computes the durations of the ticks between two reads. Quantiles are interpolated within bins,
/// as in Prometheus, and limited to the maximum. If another program has read the page between the
/// two reads, the maximum can be too small, because each read resets it.
[[nodiscard]] Quantiles TicksBetween(const ServerMetrics& before, const ServerMetrics& after);

}  // namespace stridewire::load
