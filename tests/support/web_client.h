#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <optional>
#include <string>

#include "raw_client.h"

namespace stridewire {

/// RawClient over a WebSocket (Beast's client): what is sent at once is one binary message, and
/// what comes has to be one frame a message.
class WebClient : public RawClient {
 public:
  struct Options {
    std::string path = "/stream";
    std::string host;    ///< Header Host; empty: the address.
    std::string origin;  ///< Empty: none, as of a program.
    int receive_buffer_bytes = 0;
  };

  explicit WebClient(std::uint16_t port) : WebClient(port, Options{}) {}
  WebClient(std::uint16_t port, const Options& options);
  ~WebClient() override;

  /// The status the upgrade was answered with: 101 if there is a WebSocket.
  [[nodiscard]] unsigned upgrade_status() const { return upgrade_status_; }
  [[nodiscard]] const std::string& extensions() const { return extensions_; }

  void SendBytes(std::span<const std::byte> bytes) override;
  void SendText(const std::string& text);
  /// A part of a binary message.
  void SendFragment(std::span<const std::byte> bytes, bool is_last);
  void Ping();
  /// Bytes below the WebSocket's frames.
  void SendRaw(std::span<const std::byte> bytes);

  [[nodiscard]] std::optional<protocol::Message> Receive(
      std::chrono::milliseconds patience = kPatience) override;
  void Abort() override;
  /// Closes in an orderly way and waits for the end.
  void CloseWebSocket();

  /// How the server closed; 0: not at all, or without a word.
  [[nodiscard]] unsigned close_code() const { return stream_.reason().code; }
  /// Pongs that have come.
  [[nodiscard]] int pongs() const { return pongs_; }
  /// The last frame, byte by byte.
  [[nodiscard]] std::span<const std::byte> last_frame() const { return frame_; }

 private:
  void BeginRead();

  boost::asio::io_context context_;
  boost::beast::websocket::stream<boost::asio::ip::tcp::socket> stream_;
  boost::beast::flat_buffer buffer_;
  std::vector<std::byte> frame_;
  bool is_reading_ = false;
  bool has_message_ = false;
  unsigned upgrade_status_ = 0;
  int pongs_ = 0;
  std::string extensions_;
};

}  // namespace stridewire
