#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "session.h"

namespace stridewire::client {

/// Sends and receives the bytes of a Session over TCP on a separate thread. It holds the mutex
/// whenever it uses the session, and never during a blocking system call.
class NetworkThread {
 public:
  /// All arguments must outlive this object. `changed` is notified when the session may have
  /// changed.
  NetworkThread(std::mutex& mutex, std::condition_variable& changed, Session& session);
  ~NetworkThread();
  NetworkThread(const NetworkThread&) = delete;
  NetworkThread& operator=(const NetworkThread&) = delete;

  /// Address of a server.
  struct Target {
    std::string host;
    std::uint16_t port = 0;
    /// Returns "HOST:PORT", or "[HOST]:PORT" if the host is an IPv6 address.
    [[nodiscard]] std::string Text() const;
  };

  /// Sets the servers for the next attempts to connect. Session::address_index is an index in
  /// `targets`, which must not be empty. The caller must hold the mutex.
  void SetTargets(std::vector<Target> targets);

  /// Makes the thread process the session soon. May be called from any thread.
  void Wake();

  /// Returns the seconds since the construction, on a clock that never decreases.
  [[nodiscard]] double Now() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stridewire::client
