#include "base/logging.h"

#include <spdlog/async.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

namespace stridewire::server {

Log::Log(const std::string& level) {
  constexpr std::size_t kQueueLines = 8192;
  constexpr std::size_t kThreads = 1;
  writer_ = std::make_shared<spdlog::details::thread_pool>(kQueueLines, kThreads);
  auto logger = std::make_shared<spdlog::async_logger>(
      "stridewired", std::make_shared<spdlog::sinks::stderr_color_sink_mt>(), writer_,
      spdlog::async_overflow_policy::overrun_oldest);
  logger->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %v");
  logger->set_level(spdlog::level::from_str(level));
  spdlog::set_default_logger(std::move(logger));
}

Log::~Log() {
  // The writer thread must be joined before its sinks are destroyed. spdlog::shutdown() alone
  // destroys them in the other order and relies on reference counts inside its shared library,
  // which the thread sanitizer cannot see.
  writer_.reset();
  spdlog::shutdown();
}

}  // namespace stridewire::server
