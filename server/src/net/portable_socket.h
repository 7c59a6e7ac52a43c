#pragma once

#include <boost/asio/compose.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/websocket/teardown.hpp>
#include <optional>
#include <utility>

#include "net/transport.h"

namespace stridewire::server {

/// A TCP socket that counts every byte in Traffic. It can move to the io_context of another thread
/// while the object that uses it, such as a websocket::stream, stays unchanged.
class PortableSocket {
 public:
  using Socket = boost::asio::ip::tcp::socket;
  using executor_type = Socket::executor_type;  // NOLINT(readability-identifier-naming)

  explicit PortableSocket(Socket socket) : socket_(std::move(socket)) {
    // An error can be ignored, because the first use of the socket reports it as well.
    boost::system::error_code ignored;
    const auto local = socket_->local_endpoint(ignored);
    protocol_ = local.protocol();
  }
  PortableSocket(const PortableSocket&) = delete;
  PortableSocket& operator=(const PortableSocket&) = delete;
  ~PortableSocket();

  void Prepare(Traffic& traffic, std::size_t send_buffer_bytes);
  /// Writes as many bytes as the system accepts without blocking. Returns 0 if it accepts none or
  /// on an error; the next write reports the error.
  template <typename Buffers>
  [[nodiscard]] std::size_t WriteWhatFits(const Buffers& buffers) {
    boost::system::error_code ignored;
    const std::size_t bytes = socket_->write_some(buffers, ignored);
    if (bytes > 0) traffic_->Sent(bytes);
    return bytes;
  }
  [[nodiscard]] bool ShutDownSending();
  void Close();
  /// Removes the socket from its io_context. No operation may be pending. Afterwards only Attach
  /// may be called, on any thread.
  void Detach();
  [[nodiscard]] bool Attach(boost::asio::io_context& context);

  [[nodiscard]] Traffic& traffic() { return *traffic_; }

  // Required by Asio and Beast (AsyncReadStream, AsyncWriteStream).
  // NOLINTBEGIN(readability-identifier-naming)
  [[nodiscard]] executor_type get_executor() { return socket_->get_executor(); }

  template <typename Buffers, typename Token>
  auto async_read_some(const Buffers& buffers, Token&& token) {
    return Transfer<true>(buffers, std::forward<Token>(token));
  }
  template <typename Buffers, typename Token>
  auto async_write_some(const Buffers& buffers, Token&& token) {
    return Transfer<false>(buffers, std::forward<Token>(token));
  }
  // NOLINTEND(readability-identifier-naming)

 private:
  template <bool kIsRead, typename Buffers, typename Token>
  auto Transfer(const Buffers& buffers, Token&& token) {
    return boost::asio::async_compose<Token, void(boost::system::error_code, std::size_t)>(
        [this, buffers, is_begun = false](auto& self, boost::system::error_code error = {},
                                          std::size_t bytes = 0) mutable {
          if (!std::exchange(is_begun, true)) {
            if constexpr (kIsRead) {
              socket_->async_read_some(buffers, std::move(self));
            } else {
              socket_->async_write_some(buffers, std::move(self));
            }
            return;
          }
          if (bytes > 0) {
            if constexpr (kIsRead) {
              traffic_->Received(bytes);
            } else {
              traffic_->Sent(bytes);
            }
          }
          self.complete(error, bytes);
        },
        token, *socket_);
  }

  // Beast calls these to close a stream.
  friend void beast_close_socket(PortableSocket& socket) { socket.Close(); }
  friend void teardown(boost::beast::role_type role, PortableSocket& socket,
                       boost::system::error_code& error) {
    boost::beast::websocket::teardown(role, *socket.socket_, error);
  }
  template <typename Handler>
  friend void async_teardown(boost::beast::role_type role, PortableSocket& socket,
                             Handler&& handler) {
    boost::beast::websocket::async_teardown(role, *socket.socket_, std::forward<Handler>(handler));
  }

  std::optional<Socket> socket_;  // Empty between Detach and Attach.
  Socket::protocol_type protocol_ = Socket::protocol_type::v4();
  Socket::native_handle_type detached_ = -1;
  Traffic* traffic_ = nullptr;
};

}  // namespace stridewire::server
