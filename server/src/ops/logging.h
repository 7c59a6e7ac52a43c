#pragma once

#include <memory>
#include <string>

namespace spdlog::details {
class thread_pool;
}

namespace stridewire::server {

/// Sends the log to stderr, from a thread of its own, so that a slow terminal delays no tick; what
/// does not fit into its queue of 8192 lines pushes out the oldest. The end of this object writes
/// out what waits; nothing may log after it. One a process.
class Log {
 public:
  /// `level` as in the configuration.
  explicit Log(const std::string& level);
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;
  ~Log();

 private:
  std::shared_ptr<spdlog::details::thread_pool> writer_;
};

}  // namespace stridewire::server
