#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "net/transport.h"
#include "stridewire/protocol/messages.h"
#include "world/shard_messages.h"

namespace stridewire::server {

/// A client that has sent Hello, on its way from the handshake to the shard of its session.
struct Arrival {
  SessionIdentity identity;
  bool is_resuming = false;
  std::unique_ptr<Transport> transport;  ///< Detached.
  protocol::Hello hello;
  std::vector<std::byte> received;  ///< Bytes that were received after Hello.
};

}  // namespace stridewire::server
