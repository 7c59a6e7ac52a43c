#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "load_options.h"
#include "load_report.h"
#include "stridewire/base/error.h"

namespace stridewire::load {

/// What a run needs of the server's /metrics: one scrape.
struct ServerMetrics {
  std::map<double, double> tick_bins;  ///< Upper bound in seconds -> cumulative count, all shards.
  double tick_max_s = 0.0;             ///< Since the server started.
  double tick_max_since_scrape_s = 0.0;
  double ticks_missed = 0.0;
  double avatars = 0.0;
};

/// Reads Prometheus text (0.0.4); samples of one name with different labels are added, of maxima the
/// largest is taken. kMalformed: a line it cannot read (index: the line); kNotFound: a metric that is
/// not there, `where` is its name.
[[nodiscard]] Expected<ServerMetrics> ParseServerMetrics(std::string_view text);

/// Asks the server; blocks for `timeout_s` at most. kIo: `where` tells whom and what the system said.
[[nodiscard]] Expected<ServerMetrics> ScrapeServerMetrics(const Address& address, double timeout_s);

/// Times of the ticks between two scrapes. Quantiles are interpolated within the server's bins (as
/// Prometheus does) and not above the maximum. The maximum is that since the earlier scrape, if
/// nobody else read the page meanwhile; otherwise at least that since they did.
[[nodiscard]] Quantiles TicksBetween(const ServerMetrics& before, const ServerMetrics& after);

}  // namespace stridewire::load
