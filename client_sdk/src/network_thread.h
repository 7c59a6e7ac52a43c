#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include "session.h"

namespace stridewire::client {

/// Sends and receives the bytes of a Session over TCP on a thread of its own. It holds the mutex
/// whenever it uses the session, and never during a blocking system call.
class NetworkThread {
 public:
  /// All arguments must outlive this object. `changed` is notified when the session may have
  /// changed.
  NetworkThread(std::mutex& mutex, std::condition_variable& changed, Session& session);
  ~NetworkThread();
  NetworkThread(const NetworkThread&) = delete;
  NetworkThread& operator=(const NetworkThread&) = delete;

  /// Sets the server for the next attempt to connect. The caller holds the mutex.
  void SetTarget(std::string host, std::uint16_t port);

  /// Makes the thread process the session soon. Callable from any thread.
  void Wake();

  /// Returns the seconds since the construction, on a clock that never decreases.
  [[nodiscard]] double Now() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stridewire::client
