#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <new>

#include "network_thread.h"
#include "session.h"
#include "stridewire/client.h"

/// The handle of the C API: a session and the network thread that serves it. `mutex` protects both.
struct stridewire_client {
  explicit stridewire_client(const stridewire::client::SessionOptions& options)
      : session(options), network(mutex, changed, session) {}

  std::mutex mutex;
  std::condition_variable changed;  ///< Notified when events were queued or the state has changed.
  stridewire::client::Session session;
  stridewire::client::NetworkThread network;
};

namespace stridewire::client {

/// Checks that a number is in a range. Rejects NaN.
template <typename T>
bool InRange(T value, T least, T most) {
  return value >= least && value <= most;
}

/// Calls `call(session)` with the mutex held. Turns std::bad_alloc into OUT_OF_MEMORY, because no
/// exception may leave the C API.
template <typename Call>
stridewire_status Query(stridewire_client* client, const Call& call) {
  if (client == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  try {
    const std::lock_guard lock(client->mutex);
    return call(client->session);
  } catch (const std::bad_alloc&) {
    return STRIDEWIRE_OUT_OF_MEMORY;
  }
}

/// Same as Query, but then wakes the network thread, which sends what the call has queued.
template <typename Call>
stridewire_status Change(stridewire_client* client, const Call& call) {
  const stridewire_status status = Query(client, call);
  if (client != nullptr) client->network.Wake();
  return status;
}

/// Calls `call(session, id)`, where `id` receives the number of the command. Stores the number, or
/// 0 on failure, in `command` unless that is null.
template <typename Call>
stridewire_status Submit(stridewire_client* client, std::uint64_t* command, const Call& call) {
  return Change(client, [&](Session& session) {
    std::uint64_t id = 0;
    const stridewire_status status = call(session, id);
    if (command != nullptr) *command = id;
    return status;
  });
}

}  // namespace stridewire::client
