#include "net/websocket_transport.h"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/beast/websocket.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "net/portable_socket.h"
#include "stridewire/base/version.h"

namespace stridewire::server {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

class WebSocketTransport final : public Transport {
 public:
  WebSocketTransport(PortableSocket::Socket socket, UpgradeRequest request)
      : stream_(std::move(socket)), request_(std::move(request)) {
    // Deflating does not shrink poses, and a small message could inflate without bound.
    websocket::permessage_deflate no_compression;
    no_compression.server_enable = false;
    stream_.set_option(no_compression);
    // Connection implements the timeouts.
    stream_.set_option(websocket::stream_base::timeout{websocket::stream_base::none(),
                                                       websocket::stream_base::none(), false});
    stream_.set_option(websocket::stream_base::decorator([](websocket::response_type& response) {
      response.set(beast::http::field::server, std::string("stridewired/") + kVersion);
    }));
    stream_.auto_fragment(false);
    stream_.binary(true);
    // No limit is needed here: pieces are not collected, and FrameReader limits every frame.
    stream_.read_message_max(0);
  }

  TransportKind kind() const override { return TransportKind::kWebSocket; }
  asio::any_io_executor executor() override { return stream_.get_executor(); }

  void Prepare(Traffic& traffic, std::size_t send_buffer_bytes) override {
    stream_.next_layer().Prepare(traffic, send_buffer_bytes);
  }

  void Receive(std::shared_ptr<User> user, std::span<std::byte> buffer) override {
    if (request_) {
      stream_.async_accept(*request_,
                           [this, user = std::move(user), buffer](const error_code& error) mutable {
                             request_.reset();
                             if (error) {
                               user->OnReceived(error, {});
                             } else {
                               Receive(std::move(user), buffer);
                             }
                           });
      return;
    }
    stream_.async_read_some(
        asio::buffer(buffer.data(), buffer.size()),
        asio::bind_cancellation_slot(
            stop_reading_.slot(),
            [this, user = std::move(user), buffer](const error_code& error, std::size_t bytes) {
              if (error == websocket::condition::protocol_violation) {
                stream_.next_layer().traffic().ProtocolError();
              }
              user->OnReceived(error, {.bytes = buffer.first(bytes),
                                       .ends_message = !error && stream_.is_message_done(),
                                       .is_text = !error && stream_.got_text()});
            }));
  }

  bool Send(std::shared_ptr<User> user, std::span<const SharedFrame> frames,
            std::size_t joined_frames) override {
    unsent_ = frames;
    joined_frames_ = joined_frames;
    Write(std::move(user));
    return false;
  }

  // Browsers slow down the timers of hidden pages, so such a page may send nothing for a minute.
  // The browser itself answers a ping, which proves that the page still exists.
  void KeepAlive(std::shared_ptr<User> user) override {
    if (request_ || is_pinging_) return;
    is_pinging_ = true;
    stream_.async_ping(
        {}, asio::bind_cancellation_slot(
                stop_pinging_.slot(),
                [this, user = std::move(user)](const error_code&) { is_pinging_ = false; }));
  }

  bool End(std::shared_ptr<User> user, CloseCode code) override {
    // The pending Receive reports the answer of the peer.
    stream_.async_close(websocket::close_reason(static_cast<std::uint16_t>(code)),
                        asio::bind_cancellation_slot(
                            stop_ending_.slot(), [user = std::move(user)](const error_code&) {}));
    return true;
  }

  void Close() override {
    stream_.next_layer().Close();
    // Closing the socket ends only operations that use it. If an invalid frame arrives while a
    // close frame is being sent, Beast's read and close operations wait for each other without
    // using the socket. Unless they are cancelled, they never release their `user`.
    for (auto* stop : {&stop_reading_, &stop_pinging_, &stop_ending_}) {
      stop->emit(asio::cancellation_type::terminal);
    }
  }
  void Detach() override { stream_.next_layer().Detach(); }
  bool Attach(asio::io_context& context) override { return stream_.next_layer().Attach(context); }

 private:
  void Write(std::shared_ptr<User> user) {
    const std::size_t count = unsent_.size() <= joined_frames_ ? unsent_.size() : 1;
    buffers_.clear();
    for (const SharedFrame& frame : unsent_.first(count)) {
      buffers_.emplace_back(frame->data(), frame->size());
    }
    unsent_ = unsent_.subspan(count);
    stream_.async_write(
        BufferList{buffers_.data(), buffers_.data() + buffers_.size()},
        [this, user = std::move(user)](const error_code& error, std::size_t) mutable {
          if (error || unsent_.empty()) {
            user->OnSent(error);
          } else {
            Write(std::move(user));
          }
        });
  }

  // These signals cancel pending operations. They are declared before the stream, so that they are
  // destroyed after it: operations that are pending when the stream is destroyed refer to them.
  asio::cancellation_signal stop_reading_;
  asio::cancellation_signal stop_pinging_;
  asio::cancellation_signal stop_ending_;
  websocket::stream<PortableSocket> stream_;
  std::optional<UpgradeRequest> request_;  // Set until the request has been answered.
  std::span<const SharedFrame> unsent_;
  std::size_t joined_frames_ = 0;  // Number of frames at the end of unsent_ that form one message.
  std::vector<asio::const_buffer> buffers_;  // The frames of the message that is being sent.
  bool is_pinging_ = false;
};

}  // namespace

std::unique_ptr<Transport> MakeWebSocketTransport(asio::ip::tcp::socket socket,
                                                  UpgradeRequest request) {
  return std::make_unique<WebSocketTransport>(std::move(socket), std::move(request));
}

}  // namespace stridewire::server
