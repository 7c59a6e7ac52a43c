#include <gtest/gtest.h>

#include <array>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>

#include "net/connection.h"
#include "net/websocket_transport.h"
#include "stridewire/protocol/encoder.h"

namespace stridewire::server {
namespace {

namespace asio = boost::asio;
namespace http = boost::beast::http;
using asio::ip::tcp;

// A request to upgrade to WebSocket, as the HTTP server passes it on.
UpgradeRequest Upgrade() {
  UpgradeRequest request(http::verb::get, "/stream", 11);
  request.set(http::field::host, "localhost");
  request.set(http::field::upgrade, "websocket");
  request.set(http::field::connection, "upgrade");
  request.set(http::field::sec_websocket_version, "13");
  request.set(http::field::sec_websocket_key, "dGhlIHNhbXBsZSBub25jZQ==");
  return request;
}

// Appends a binary WebSocket message with a masking key of zeros.
void AppendMessage(std::span<const std::byte> payload, std::vector<std::byte>& bytes) {
  ASSERT_LT(payload.size(), 126u);
  bytes.push_back(std::byte{0x82});
  bytes.push_back(static_cast<std::byte>(0x80 | payload.size()));
  bytes.insert(bytes.end(), 4, std::byte{0});
  bytes.insert(bytes.end(), payload.begin(), payload.end());
}

class ClosingHandler : public ConnectionHandler {
 public:
  explicit ClosingHandler(Connection& connection) : connection_(connection) {}
  void OnMessage(protocol::Message&&) override {
    ++messages;
    connection_.CloseGently();
  }
  void OnBadFrame(const Error&) override { connection_.CloseGently(); }
  void OnClosed() override {}

  int messages = 0;

 private:
  Connection& connection_;
};

// Beast then suspends the read and the close at the same time.
TEST(WebSocketConnection, EndsIfAnInvalidFrameArrivesWhileClosing) {
  asio::io_context context;
  tcp::acceptor acceptor(context, {asio::ip::address_v4::loopback(), 0});
  tcp::socket peer(context);
  peer.connect(acceptor.local_endpoint());
  ThreadMetrics metrics;
  auto connection = std::make_shared<Connection>(
      MakeWebSocketTransport(acceptor.accept(), Upgrade()), Limits{}, metrics);

  std::vector<std::byte> goodbye;
  ASSERT_TRUE(protocol::Encoder().Encode(protocol::Goodbye{}, goodbye));
  std::vector<std::byte> sent;
  AppendMessage(goodbye, sent);
  sent.insert(sent.end(), 14, std::byte{0xff});  // A header with reserved bits.
  asio::write(peer, asio::buffer(sent));

  ClosingHandler handler(*connection);
  connection->Start(&handler);
  const std::weak_ptr<Connection> remaining = std::exchange(connection, nullptr);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!remaining.expired() && std::chrono::steady_clock::now() < end) {
    context.run_one_for(std::chrono::milliseconds(100));
  }
  EXPECT_EQ(handler.messages, 1);
  EXPECT_TRUE(remaining.expired());
}

}  // namespace
}  // namespace stridewire::server
