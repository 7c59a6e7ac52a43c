// Functions of the C API for the lifecycle, the events and the statistics of a client.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client_handle.h"
#include "stridewire/protocol/check.h"

using stridewire::client::Change;
using stridewire::client::InRange;
using stridewire::client::NetworkThread;
using stridewire::client::Query;
using stridewire::client::Session;
using stridewire::client::SessionOptions;
namespace protocol = stridewire::protocol;

namespace {

constexpr std::size_t kMaxHostBytes = 255;

}  // namespace

extern "C" {

void stridewire_client_options_init(stridewire_client_options* options, size_t struct_bytes) {
  if (options == nullptr || struct_bytes != sizeof *options) return;
  const SessionOptions defaults;
  *options = stridewire_client_options{};
  options->struct_bytes = sizeof *options;
  options->abi_version = STRIDEWIRE_ABI_VERSION;
  options->max_events = static_cast<std::uint32_t>(defaults.max_events);
  options->max_commands = static_cast<std::uint32_t>(defaults.max_commands);
  options->pose_history = static_cast<std::uint32_t>(defaults.pose_history);
  options->max_command_bytes = defaults.max_command_bytes;
  options->max_pose_bytes = defaults.max_pose_bytes;
  options->render_delay_s = defaults.render_delay_s;
  options->connect_timeout_s = defaults.connect_timeout_s;
  options->ping_interval_s = defaults.ping_interval_s;
  options->client_name = "stridewire-client";
}

stridewire_status stridewire_client_create(const stridewire_client_options* options,
                                           stridewire_client** client) {
  if (client == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  *client = nullptr;
  stridewire_client_options o;
  if (options == nullptr) {
    stridewire_client_options_init(&o, sizeof o);
  } else {
    if (options->struct_bytes != sizeof o || options->abi_version != STRIDEWIRE_ABI_VERSION) {
      return STRIDEWIRE_VERSION_MISMATCH;
    }
    o = *options;
  }
  constexpr std::size_t kLeastBytes = std::size_t{64} << 10;
  if (!InRange<std::uint32_t>(o.max_events, 16, 1u << 24) ||
      !InRange<std::uint32_t>(o.max_commands, 1, 1u << 20) ||
      !InRange<std::uint32_t>(o.pose_history, 2, 4096) || o.max_command_bytes < kLeastBytes ||
      o.max_pose_bytes < kLeastBytes || std::isnan(o.render_delay_s) || o.render_delay_s > 10.0 ||
      !InRange(o.connect_timeout_s, 0.01, 600.0) || !InRange(o.ping_interval_s, 0.01, 600.0)) {
    return STRIDEWIRE_OUT_OF_RANGE;
  }
  try {
    SessionOptions s;
    // Checks the texts as the fields of a Hello message, because the server would reject invalid
    // ones later.
    protocol::Hello hello;
    hello.client_name = o.client_name != nullptr ? o.client_name : "";
    hello.auth_token = o.auth_token != nullptr ? o.auth_token : "";
    if (!protocol::Check(hello)) return STRIDEWIRE_INVALID_ARGUMENT;
    s.client_name = hello.client_name;
    s.auth_token = hello.auth_token;
    s.max_events = o.max_events;
    s.max_commands = o.max_commands;
    s.max_command_bytes = o.max_command_bytes;
    s.pose_history = o.pose_history;
    s.max_pose_bytes = o.max_pose_bytes;
    s.render_delay_s = o.render_delay_s;
    s.connect_timeout_s = o.connect_timeout_s;
    s.ping_interval_s = o.ping_interval_s;
    s.respawn = o.respawn != 0;
    constexpr std::size_t kMaxFolderBytes = 4096;
    s.library_folder = o.library_folder != nullptr ? o.library_folder : "";
    if (s.library_folder.size() > kMaxFolderBytes) return STRIDEWIRE_INVALID_ARGUMENT;
    s.seed = o.seed;
    if (s.seed == 0) {
      std::random_device device;
      s.seed = (std::uint64_t{device()} << 32) | device();
    }
    *client = new stridewire_client(s);
    return STRIDEWIRE_OK;
  } catch (const std::bad_alloc&) {
    return STRIDEWIRE_OUT_OF_MEMORY;
  } catch (const std::exception&) {
    // The system could not create another thread or file descriptor.
    return STRIDEWIRE_OUT_OF_MEMORY;
  }
}

void stridewire_client_destroy(stridewire_client* client) {
  if (client == nullptr) return;
  (void)stridewire_client_disconnect(client);
  {
    std::unique_lock lock(client->mutex);
    client->changed.wait_for(lock, std::chrono::duration<double>(2.0 * Session::kGoodbyeS),
                             [&] { return client->session.state() != Session::State::kClosing; });
  }
  delete client;
}

stridewire_status stridewire_client_connect(stridewire_client* client, const char* host,
                                            uint16_t port) {
  const stridewire_address address{host, port};
  return stridewire_client_connect_any(client, &address, 1);
}

stridewire_status stridewire_client_connect_any(stridewire_client* client,
                                                const stridewire_address* addresses, size_t count) {
  if (addresses == nullptr || count == 0 || count > STRIDEWIRE_MAX_ADDRESSES) {
    return STRIDEWIRE_INVALID_ARGUMENT;
  }
  for (const stridewire_address& address : std::span(addresses, count)) {
    if (address.host == nullptr || *address.host == '\0' ||
        std::strlen(address.host) > kMaxHostBytes || address.port == 0) {
      return STRIDEWIRE_INVALID_ARGUMENT;
    }
  }
  return Change(client, [&](Session& session) {
    std::vector<NetworkThread::Target> targets;
    std::vector<std::string> texts;
    for (const stridewire_address& address : std::span(addresses, count)) {
      targets.push_back({address.host, address.port});
      texts.push_back(targets.back().Text());
    }
    const stridewire_status status = session.Open(client->network.Now(), std::move(texts));
    if (status == STRIDEWIRE_OK) client->network.SetTargets(std::move(targets));
    return status;
  });
}

stridewire_status stridewire_client_disconnect(stridewire_client* client) {
  return Change(client, [&](Session& session) {
    session.Close(client->network.Now());
    return STRIDEWIRE_OK;
  });
}

stridewire_client_state stridewire_client_get_state(stridewire_client* client) {
  if (client == nullptr) return STRIDEWIRE_STATE_IDLE;
  const std::lock_guard lock(client->mutex);
  switch (client->session.state()) {
    case Session::State::kIdle:
    case Session::State::kClosing: return STRIDEWIRE_STATE_IDLE;
    case Session::State::kWaiting:
    case Session::State::kConnecting:
    case Session::State::kGreeting: return STRIDEWIRE_STATE_CONNECTING;
    case Session::State::kReady: return STRIDEWIRE_STATE_READY;
    case Session::State::kClosed: return STRIDEWIRE_STATE_CLOSED;
  }
  return STRIDEWIRE_STATE_IDLE;
}

stridewire_status stridewire_client_last_error(stridewire_client* client, char* text,
                                               size_t text_bytes) {
  if (text == nullptr && text_bytes > 0) return STRIDEWIRE_INVALID_ARGUMENT;
  return Query(client, [&](Session& session) {
    if (text_bytes > 0) {
      const std::string& last = session.last_text();
      const std::size_t length = std::min(last.size(), text_bytes - 1);
      std::memcpy(text, last.data(), length);
      text[length] = '\0';
    }
    return session.last_status();
  });
}

stridewire_status stridewire_client_ping(stridewire_client* client) {
  return Change(client, [&](Session& session) { return session.Ping(client->network.Now()); });
}

stridewire_status stridewire_client_poll_events(stridewire_client* client, stridewire_event* events,
                                                size_t capacity, size_t* count) {
  if (count == nullptr || (events == nullptr && capacity > 0)) return STRIDEWIRE_INVALID_ARGUMENT;
  *count = 0;
  return Query(client, [&](Session& session) {
    *count = session.events().Take(std::span(events, capacity));
    return STRIDEWIRE_OK;
  });
}

stridewire_status stridewire_client_wait_event(stridewire_client* client, double timeout_s) {
  if (client == nullptr || !InRange(timeout_s, 0.0, 3600.0)) return STRIDEWIRE_INVALID_ARGUMENT;
  std::unique_lock lock(client->mutex);
  const bool has_event =
      client->changed.wait_for(lock, std::chrono::duration<double>(timeout_s),
                               [&] { return !client->session.events().empty(); });
  return has_event ? STRIDEWIRE_OK : STRIDEWIRE_TIMEOUT;
}

stridewire_status stridewire_client_get_statistics(stridewire_client* client,
                                                   stridewire_statistics* statistics) {
  if (statistics == nullptr) return STRIDEWIRE_INVALID_ARGUMENT;
  return Query(client, [&](Session& session) {
    *statistics = session.Statistics();
    return STRIDEWIRE_OK;
  });
}

}  // extern "C"
