#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>

#include "ops/config.h"
#include "stridewire/base/error.h"

namespace stridewire::server {

/// Accepts TCP connections on one address. One thread's.
class Listener {
 public:
  using Socket = boost::asio::ip::tcp::socket;
  using OnSocket = std::function<void(Socket)>;

  explicit Listener(boost::asio::io_context& context);

  /// kIo: the address cannot be had; `name` ("listen") and the address are in `where`.
  [[nodiscard]] Status Open(const Endpoint& endpoint, const char* name);
  void Start(OnSocket on_socket);
  void Close();

  /// Where it really listens, with the port the system chose.
  [[nodiscard]] Endpoint endpoint() const;

 private:
  void Accept();

  boost::asio::io_context& context_;
  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::steady_timer pause_;
  OnSocket on_socket_;
};

}  // namespace stridewire::server
