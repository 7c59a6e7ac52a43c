#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include "session.h"

namespace stridewire::client {

/// Carries a Session's bytes over TCP on a thread of its own. Every use of the session is under the
/// mutex; no system call that may wait is.
class NetworkThread {
 public:
  /// All three outlive this. `changed` is notified when the session may have changed.
  NetworkThread(std::mutex& mutex, std::condition_variable& changed, Session& session);
  ~NetworkThread();
  NetworkThread(const NetworkThread&) = delete;
  NetworkThread& operator=(const NetworkThread&) = delete;

  /// Where to connect from the next attempt on. The caller holds the mutex.
  void SetTarget(std::string host, std::uint16_t port);

  /// The session was given something to do. Any thread.
  void Wake();

  /// Seconds since this was made, on a clock that never goes back.
  [[nodiscard]] double Now() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stridewire::client
