#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <utility>

#include "net/connection.h"
#include "session/encode_frame.h"
#include "session/session_host.h"
#include "world/shard_messages.h"

namespace stridewire::server {

/// A world that a session has joined.
struct Membership {
  std::shared_ptr<World> world;
  protocol::Role role = protocol::Role::kController;
  std::uint64_t dropped_batches = 0;
  std::uint64_t dropped_events = 0;
  std::uint64_t reported_drops = 0;  ///< Sum of the two drop counts when Lagging was last sent.
};

/// The state that the parts of a session share: Session, SessionCommands and SessionStream.
struct SessionContext {
  SessionHost& host;
  SessionIdentity identity;
  /// Connection of the client; null while the session waits for its client.
  std::shared_ptr<Connection> connection;
  std::map<WorldId, Membership> worlds;

  [[nodiscard]] Membership* FindWorld(WorldId world) {
    const auto it = worlds.find(world);
    return it == worlds.end() ? nullptr : &it->second;
  }
  /// Sends a control message, if the session has a connection.
  template <typename Message>
  void Send(const Message& message) {
    if (connection == nullptr) return;
    if (auto frame = EncodeFrame(host.encoder(), message)) {
      connection->SendControl(std::move(frame));
    }
  }
};

}  // namespace stridewire::server
