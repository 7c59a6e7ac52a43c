#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/address.hpp>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "net/connection.h"
#include "session/arrival.h"
#include "session/session_directory.h"

namespace stridewire::server {

/// Receives Hello on new connections, finds or creates the session, and passes the transport to the
/// shard of the session. It runs on the main thread, so that a flood of connections does not delay
/// the ticks of shards. Not thread-safe.
class Handshakes {
 public:
  using Adopt = std::function<void(int shard, Arrival arrival)>;

  /// Borrows all references. `adopt` passes an arrival to its shard.
  Handshakes(boost::asio::io_context& context, const Limits& limits, ThreadMetrics& metrics,
             SessionDirectory& directory, Adopt adopt);
  ~Handshakes();

  /// Starts the handshake of a connection from the address `remote`. Closes the connection if a
  /// limit is reached.
  void Accept(std::unique_ptr<Transport> transport, const boost::asio::ip::address& remote);

  /// Ends all handshakes and accepts no more connections.
  void Close();

 private:
  class Handshake;
  void OnHello(Handshake& handshake, const protocol::Hello& hello);
  void Remove(Handshake& handshake);

  boost::asio::io_context& context_;
  const Limits limits_;
  Limits handshake_limits_;
  ThreadMetrics& metrics_;
  SessionDirectory& directory_;
  Adopt adopt_;
  std::map<Handshake*, std::shared_ptr<Handshake>> handshakes_;
  std::map<std::string, int> address_counts_;  // Number of handshakes per client address.
  bool is_closed_ = false;
};

}  // namespace stridewire::server
