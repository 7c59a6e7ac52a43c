#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>

#include "base/config.h"
#include "stridewire/base/error.h"

namespace stridewire::server {

/// Accepts TCP connections on one address. Not thread-safe.
class Listener {
 public:
  using Socket = boost::asio::ip::tcp::socket;
  using OnSocket = std::function<void(Socket)>;

  explicit Listener(boost::asio::io_context& context);

  /// Binds the address. On failure returns kIo; `where` contains `name`, such as "listen", and the
  /// address.
  [[nodiscard]] Status Open(const Endpoint& endpoint, const char* name);
  void Start(OnSocket on_socket);
  void Close();

  /// Returns the bound address, with the actual port if the system chose it.
  [[nodiscard]] Endpoint endpoint() const;

 private:
  void Accept();

  boost::asio::io_context& context_;
  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::steady_timer pause_;
  OnSocket on_socket_;
};

}  // namespace stridewire::server
