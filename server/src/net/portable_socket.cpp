#include "net/portable_socket.h"

#include <unistd.h>

namespace stridewire::server {

namespace asio = boost::asio;
using boost::system::error_code;

PortableSocket::~PortableSocket() {
  if (detached_ >= 0) ::close(detached_);
}

void PortableSocket::Prepare(Traffic& traffic, std::size_t send_buffer_bytes) {
  traffic_ = &traffic;
  error_code ignored;  // a socket that fails here fails when it is read, too
  socket_->set_option(asio::ip::tcp::no_delay(true), ignored);
  socket_->non_blocking(true, ignored);  // what is not asynchronous, too
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
  error_code ignored;
  detached_ = socket_->release(ignored);
  socket_.reset();
}

bool PortableSocket::Attach(asio::io_context& context) {
  socket_.emplace(context);
  error_code error;
  socket_->assign(protocol_, detached_, error);
  if (error) return false;  // and ours to close
  detached_ = -1;
  return true;
}

}  // namespace stridewire::server
