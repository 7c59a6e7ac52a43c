#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <optional>
#include <string>

#include "raw_client.h"

namespace stridewire {

/// RawClient over a WebSocket, with Beast. Each SendBytes sends one binary message. Received
/// messages must contain whole frames.
class WebClient : public RawClient {
 public:
  struct Options {
    std::string path = "/stream";
    std::string host;           ///< Header Host; empty: the address.
    std::string origin;         ///< Empty: no header, like a program that is not a browser.
    std::string forwarded_for;  ///< Header X-Forwarded-For; empty: no header.
    int receive_buffer_bytes = 0;
  };

  explicit WebClient(std::uint16_t port) : WebClient(port, Options{}) {}
  WebClient(std::uint16_t port, const Options& options);
  ~WebClient() override;

  /// Returns the HTTP status of the upgrade; 101 means success.
  [[nodiscard]] unsigned upgrade_status() const { return upgrade_status_; }
  [[nodiscard]] const std::string& extensions() const { return extensions_; }

  void SendBytes(std::span<const std::byte> bytes) override;
  void SendText(const std::string& text);
  /// Sends a fragment of a binary message.
  void SendFragment(std::span<const std::byte> bytes, bool is_last);
  void Ping();
  /// Sends bytes without WebSocket framing.
  void SendRaw(std::span<const std::byte> bytes);

  [[nodiscard]] std::optional<protocol::Message> Receive(
      std::chrono::milliseconds patience = kPatience) override;
  void Abort() override;
  /// Closes the WebSocket gracefully and waits for the end.
  void CloseWebSocket();

  /// Returns the close code of the server; 0 if it has not closed or sent no code.
  [[nodiscard]] unsigned close_code() const { return stream_.reason().code; }
  /// Returns the number of received pongs.
  [[nodiscard]] int pongs() const { return pongs_; }
  /// Returns the number of received pings. They are answered while Receive waits.
  [[nodiscard]] int pings() const { return pings_; }
  /// Returns the bytes of the last frame.
  [[nodiscard]] std::span<const std::byte> last_frame() const { return frame_; }
  /// Returns true if the next frame belongs to the same WebSocket message as the last frame.
  [[nodiscard]] bool is_within_message() const { return !unread_.empty(); }

 private:
  void BeginRead();
  /// Receives a WebSocket message into message_. Returns false if there is none.
  [[nodiscard]] bool ReceiveMessage(std::chrono::milliseconds patience);

  boost::asio::io_context context_;
  boost::beast::websocket::stream<boost::asio::ip::tcp::socket> stream_;
  boost::beast::flat_buffer buffer_;
  std::vector<std::byte> message_;
  std::span<const std::byte> unread_;  // The frames of message_ that Receive has not returned yet.
  std::vector<std::byte> frame_;
  bool is_reading_ = false;
  bool has_message_ = false;
  unsigned upgrade_status_ = 0;
  int pongs_ = 0;
  int pings_ = 0;
  std::string extensions_;
};

}  // namespace stridewire
