#pragma once

#include <memory>
#include <string>

namespace spdlog::details {
class thread_pool;
}

namespace stridewire::server {

/// Writes the log to stderr on a separate thread, so that a slow terminal does not delay ticks.
/// The queue has 8192 lines; if it is full, a new line replaces the oldest. The destructor writes
/// all queued lines, and nothing may be logged after it. Create one Log per process.
class Log {
 public:
  /// `level` is a value of the configuration key log_level.
  explicit Log(const std::string& level);
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;
  ~Log();

 private:
  std::shared_ptr<spdlog::details::thread_pool> writer_;
};

}  // namespace stridewire::server
