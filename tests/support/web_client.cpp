#include "web_client.h"

#include <cstdio>
#include <cstdlib>

#include "stridewire/protocol/decode.h"

namespace stridewire {

namespace asio = boost::asio;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

WebClient::WebClient(std::uint16_t port, const Options& options) : stream_(context_) {
  asio::ip::tcp::socket& socket = stream_.next_layer();
  socket.open(asio::ip::tcp::v4());
  if (options.receive_buffer_bytes > 0) {
    socket.set_option(asio::socket_base::receive_buffer_size(options.receive_buffer_bytes));
  }
  socket.connect({asio::ip::address_v4::loopback(), port});
  // Offers compression, as browsers do.
  websocket::permessage_deflate compression;
  compression.client_enable = true;
  stream_.set_option(compression);
  stream_.set_option(websocket::stream_base::decorator([options](websocket::request_type& request) {
    if (!options.origin.empty()) {
      request.set(boost::beast::http::field::origin, options.origin);
    }
    if (!options.forwarded_for.empty()) {
      request.set("X-Forwarded-For", options.forwarded_for);
    }
  }));
  stream_.control_callback([this](websocket::frame_type type, boost::beast::string_view) {
    if (type == websocket::frame_type::pong) ++pongs_;
    if (type == websocket::frame_type::ping) ++pings_;
  });
  stream_.binary(true);
  stream_.read_message_max(0);
  websocket::response_type response;
  error_code error;
  const std::string host =
      options.host.empty() ? "127.0.0.1:" + std::to_string(port) : options.host;
  stream_.handshake(response, host, options.path, error);
  upgrade_status_ = response.result_int();
  extensions_ = std::string(response["Sec-WebSocket-Extensions"]);
  if (error) set_closed();
}

WebClient::~WebClient() = default;

void WebClient::SendBytes(std::span<const std::byte> bytes) { SendFragment(bytes, true); }

void WebClient::SendFragment(std::span<const std::byte> bytes, bool is_last) {
  // An error means that the server has closed. Data that has arrived can still be read.
  error_code ignored;
  stream_.write_some(is_last, asio::buffer(bytes.data(), bytes.size()), ignored);
}

void WebClient::SendText(const std::string& text) {
  error_code ignored;
  stream_.text(true);
  stream_.write(asio::buffer(text), ignored);
  stream_.binary(true);
}

void WebClient::Ping() {
  error_code ignored;
  stream_.ping({}, ignored);
}

void WebClient::SendRaw(std::span<const std::byte> bytes) {
  error_code ignored;
  asio::write(stream_.next_layer(), asio::buffer(bytes.data(), bytes.size()), ignored);
}

void WebClient::BeginRead() {
  if (is_reading_) return;
  is_reading_ = true;
  stream_.async_read(buffer_, [this](const error_code& error, std::size_t) {
    is_reading_ = false;
    has_message_ = !error;
    if (error) set_closed();
  });
}

std::optional<protocol::Message> WebClient::Receive(std::chrono::milliseconds patience) {
  if (unread_.empty() && !ReceiveMessage(patience)) return std::nullopt;
  protocol::FrameReader reader(protocol::Sender::kServer);
  const std::span<const std::byte> before = unread_;
  const auto next = reader.Next(unread_);
  if (!next || !next->has_value()) {
    std::fprintf(stderr, "the server sent a message that ends within a frame\n");
    std::abort();
  }
  const auto frame = before.first(before.size() - unread_.size());
  frame_.assign(frame.begin(), frame.end());
  // The message must refer to frame_, which stays valid until the next call.
  const protocol::FrameView view{
      (*next)->type, std::span<const std::byte>(frame_).subspan(protocol::kFrameHeaderBytes)};
  auto message = protocol::DecodeMessage(view);
  if (message) return *std::move(message);
  std::fprintf(stderr, "the server sent no message: %s\n", Describe(message.error()).c_str());
  std::abort();
}

bool WebClient::ReceiveMessage(std::chrono::milliseconds patience) {
  if (is_closed()) return false;
  const auto until = std::chrono::steady_clock::now() + patience;
  BeginRead();
  while (is_reading_ && std::chrono::steady_clock::now() < until) {
    context_.restart();
    context_.run_one_until(until);
  }
  if (!has_message_) return false;
  has_message_ = false;
  const auto* data = static_cast<const std::byte*>(buffer_.data().data());
  message_.assign(data, data + buffer_.size());
  buffer_.consume(buffer_.size());
  if (!stream_.got_binary()) {
    std::fprintf(stderr, "the server sent a text\n");
    std::abort();
  }
  unread_ = message_;
  if (!unread_.empty()) return true;
  std::fprintf(stderr, "the server sent an empty message\n");
  std::abort();
}

void WebClient::Abort() {
  error_code ignored;
  stream_.next_layer().set_option(asio::socket_base::linger(true, 0), ignored);
  stream_.next_layer().close(ignored);
  context_.restart();
  context_.run_for(kPatience);  // Pending operations end with an error.
  set_closed();
}

void WebClient::CloseWebSocket() {
  stream_.async_close(websocket::close_reason(websocket::close_code::normal),
                      [this](const error_code&) { set_closed(); });
  context_.restart();
  context_.run_for(kPatience);
}

}  // namespace stridewire
