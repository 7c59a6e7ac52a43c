#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/address.hpp>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "net/connection.h"
#include "session/session_directory.h"
#include "world/shard.h"

namespace stridewire::server {

/// Where clients come in: greets a connection, hears its Hello, finds or makes its session and
/// hands its transport to the session's shard. One thread's, and not a shard's: a flood of
/// connections costs no tick.
class Gate {
 public:
  /// Borrows everything. `adopt` takes an arrival to its shard.
  Gate(boost::asio::io_context& context, const Limits& limits, ThreadMetrics& metrics,
       SessionDirectory& directory, std::function<void(int, Shard::Arrival)> adopt);
  ~Gate();

  /// `remote`: who it is.
  void Accept(std::unique_ptr<Transport> transport, const boost::asio::ip::address& remote);

  /// Greets nobody any more.
  void Close();

 private:
  class Handshake;
  void OnHello(Handshake& handshake, const protocol::Hello& hello);
  void Forget(Handshake& handshake);

  boost::asio::io_context& context_;
  const Limits limits_;
  Limits handshake_limits_;
  ThreadMetrics& metrics_;
  SessionDirectory& directory_;
  std::function<void(int, Shard::Arrival)> adopt_;
  std::map<Handshake*, std::shared_ptr<Handshake>> handshakes_;
  std::map<std::string, int> address_counts_;
  bool is_closed_ = false;
};

}  // namespace stridewire::server
