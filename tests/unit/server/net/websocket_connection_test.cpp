#include <gtest/gtest.h>

#include <array>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <chrono>
#include <string>

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

// A connection over WebSocket, and its peer.
class WebSocketBatches : public testing::Test {
 protected:
  void SetUp() override {
    tcp::acceptor acceptor(context_, {asio::ip::address_v4::loopback(), 0});
    peer_.connect(acceptor.local_endpoint());
    connection_ = std::make_shared<Connection>(MakeWebSocketTransport(acceptor.accept(), Upgrade()),
                                               Limits{}, metrics_);
    connection_->Start(&handler_);
    std::string answer;
    Run([&] { return answer.ends_with("\r\n\r\n"); }, [&] { answer += Read(1); });
  }
  void TearDown() override {
    connection_->Close();
    context_.restart();
    context_.run_for(std::chrono::seconds(20));
  }

  // Runs the connection and `step` until `is_done`.
  template <typename IsDone, typename Step>
  void Run(const IsDone& is_done, const Step& step) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (!is_done() && std::chrono::steady_clock::now() < end) {
      context_.restart();
      context_.run_one_for(std::chrono::milliseconds(1));
      step();
    }
    ASSERT_TRUE(is_done());
  }
  std::string Read(std::size_t bytes) {
    if (peer_.available() < bytes) return {};
    std::string read(bytes, 0);
    asio::read(peer_, asio::buffer(read));
    return read;
  }
  // Returns the payload of the next message, which must have less than 126 bytes.
  std::string ReadMessage() {
    std::string header;
    Run([&] { return !header.empty(); }, [&] { header = Read(2); });
    std::string payload;
    Run([&] { return !payload.empty(); },
        [&] { payload = Read(static_cast<std::size_t>(header[1])); });
    return payload;
  }
  static SharedFrame Frame(char mark) {
    return std::make_shared<const std::vector<std::byte>>(16, static_cast<std::byte>(mark));
  }
  void Move(int shard, char mark, double wait_s) {
    EXPECT_EQ(connection_->SendMovements(1, shard, Frame(mark), wait_s), 0u);
  }
  static std::string Text(char mark) { return std::string(16, mark); }

  static constexpr double kForeverS = 3600.0;
  asio::io_context context_;
  tcp::socket peer_{context_};
  ThreadMetrics metrics_;
  std::shared_ptr<Connection> connection_;
  struct : ConnectionHandler {
    void OnMessage(protocol::Message&&) override {}
    void OnBadFrame(const Error&) override {}
    void OnClosed() override {}
  } handler_;
};

TEST_F(WebSocketBatches, LeaveTogetherWhenTheWaitEnds) {
  Move(0, 'a', kForeverS);
  Move(1, 'b', kForeverS);
  context_.restart();
  context_.run_for(std::chrono::milliseconds(50));
  EXPECT_EQ(peer_.available(), 0u);
  connection_->EndWait();
  EXPECT_EQ(ReadMessage(), Text('a') + Text('b'));
  connection_->EndWait();  // Nothing waits.
  Move(0, 'c', kForeverS);
  Move(1, 'd', 0.001);  // The earlier end applies.
  Move(0, 'e', kForeverS);
  EXPECT_EQ(ReadMessage(), Text('c') + Text('d') + Text('e'));
  EXPECT_EQ(metrics_.websocket_messages_sent.value(), 2u);
}

TEST_F(WebSocketBatches, LeaveWithControlMessages) {
  Move(0, 'a', kForeverS);
  connection_->SendControl(Frame('x'));
  connection_->SendControl(Frame('y'));
  Move(1, 'b', kForeverS);
  EXPECT_EQ(ReadMessage(), Text('x'));
  EXPECT_EQ(ReadMessage(), Text('y'));
  EXPECT_EQ(ReadMessage(), Text('a') + Text('b'));
}

TEST_F(WebSocketBatches, LeaveBeforeTheConnectionCloses) {
  Move(0, 'a', kForeverS);
  connection_->CloseGently();
  EXPECT_EQ(ReadMessage(), Text('a'));
}

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
