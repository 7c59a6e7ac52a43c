#include "net/tcp_transport.h"

#include <algorithm>
#include <utility>

#include "net/portable_socket.h"

namespace stridewire::server {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;

class TcpTransport final : public Transport {
 public:
  explicit TcpTransport(PortableSocket::Socket socket) : socket_(std::move(socket)) {}

  TransportKind kind() const override { return TransportKind::kTcp; }
  asio::any_io_executor executor() override { return socket_.get_executor(); }

  void Prepare(Traffic& traffic, std::size_t send_buffer_bytes) override {
    socket_.Prepare(traffic, send_buffer_bytes);
  }

  void Receive(std::shared_ptr<User> user, std::span<std::byte> buffer) override {
    socket_.async_read_some(
        asio::buffer(buffer.data(), buffer.size()),
        [user = std::move(user), buffer](const error_code& error, std::size_t bytes) {
          user->OnReceived(error, {.bytes = buffer.first(bytes)});
        });
  }

  bool Send(std::shared_ptr<User> user, std::span<const SharedFrame> frames,
            std::size_t /*joined_frames*/) override {
    buffers_.clear();
    for (const SharedFrame& frame : frames) buffers_.emplace_back(frame->data(), frame->size());
    first_buffer_ = 0;
    // The system usually has room for all frames of a tick, so the first write is tried at once.
    // Waiting for the socket to become writable would add 10 % to the cost of a small frame.
    while (first_buffer_ < buffers_.size()) {
      const std::size_t bytes = socket_.WriteWhatFits(unsent());
      if (bytes == 0) {
        Write(std::move(user));
        return false;
      }
      Consume(bytes);
    }
    return true;
  }

  void KeepAlive(std::shared_ptr<User> /*user*/) override {}
  bool End(std::shared_ptr<User> /*user*/, CloseCode /*code*/) override {
    return socket_.ShutDownSending();
  }
  void Close() override { socket_.Close(); }
  void Detach() override { socket_.Detach(); }
  bool Attach(asio::io_context& context) override { return socket_.Attach(context); }

 private:
  [[nodiscard]] BufferList unsent() const {
    return {buffers_.data() + first_buffer_, buffers_.data() + buffers_.size()};
  }

  void Consume(std::size_t bytes) {
    while (bytes > 0) {
      asio::const_buffer& buffer = buffers_[first_buffer_];
      const std::size_t taken = std::min(bytes, buffer.size());
      buffer += taken;
      bytes -= taken;
      if (buffer.size() == 0) ++first_buffer_;
    }
  }

  void Write(std::shared_ptr<User> user) {
    socket_.async_write_some(unsent(), [this, user = std::move(user)](const error_code& error,
                                                                      std::size_t bytes) mutable {
      if (error) {
        user->OnSent(error);
        return;
      }
      Consume(bytes);
      if (first_buffer_ < buffers_.size()) {
        Write(std::move(user));
      } else {
        user->OnSent({});
      }
    });
  }

  PortableSocket socket_;
  std::vector<asio::const_buffer> buffers_;
  std::size_t first_buffer_ = 0;
};

}  // namespace

std::unique_ptr<Transport> MakeTcpTransport(asio::ip::tcp::socket socket) {
  return std::make_unique<TcpTransport>(std::move(socket));
}

}  // namespace stridewire::server
