#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <memory>

#include "net/transport.h"

namespace stridewire::server {

using UpgradeRequest = boost::beast::http::request<boost::beast::http::string_body>;

/// Each frame as one binary message, uncompressed. The first Receive answers `request`, which must
/// be an upgrade to WebSocket; its sender has to wait for that before it sends anything.
/// Pings are answered and fragments put together on the way; a message is received in pieces as
/// they come, so that its announced length allocates nothing.
[[nodiscard]] std::unique_ptr<Transport> MakeWebSocketTransport(boost::asio::ip::tcp::socket socket,
                                                                UpgradeRequest request);

}  // namespace stridewire::server
