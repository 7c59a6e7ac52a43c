#include "net/portable_socket.h"

#include <unistd.h>

#include "base/check.h"

namespace stridewire::server {

namespace asio = boost::asio;
using boost::system::error_code;

PortableSocket::~PortableSocket() {
  if (detached_ >= 0) ::close(detached_);
}

void PortableSocket::Prepare(Traffic& traffic, std::size_t send_buffer_bytes) {
  traffic_ = &traffic;
  // Errors are ignored. If the socket is broken, its first read fails as well.
  error_code ignored;
  socket_->set_option(asio::ip::tcp::no_delay(true), ignored);
  socket_->non_blocking(true, ignored);  // Synchronous calls must not block the thread either.
  if (send_buffer_bytes > 0) {
    socket_->set_option(asio::socket_base::send_buffer_size(static_cast<int>(send_buffer_bytes)),
                        ignored);
  }
}

bool PortableSocket::ShutDownSending() {
  error_code error;
  socket_->shutdown(Socket::shutdown_send, error);
  return !error;
}

void PortableSocket::Close() {
  if (!socket_) return;
  error_code ignored;
  socket_->close(ignored);
}

void PortableSocket::Detach() {
  STRIDEWIRE_CHECK(socket_.has_value() && detached_ < 0);
  error_code ignored;
  detached_ = socket_->release(ignored);
  socket_.reset();
}

bool PortableSocket::Attach(asio::io_context& context) {
  STRIDEWIRE_CHECK(!socket_.has_value() && detached_ >= 0);
  socket_.emplace(context);
  error_code error;
  socket_->assign(protocol_, detached_, error);
  if (error) return false;  // The destructor closes the descriptor.
  detached_ = -1;
  return true;
}

}  // namespace stridewire::server
