#pragma once

#include <string>

namespace stridewire::server {

/// Sends the log to stderr, from a thread of its own, so that a slow terminal delays no tick; what
/// does not fit into its queue of 8192 lines pushes out the oldest. `level` as in the
/// configuration.
void StartLog(const std::string& level);

/// Writes out what waits.
void EndLog();

}  // namespace stridewire::server
