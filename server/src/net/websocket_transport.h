#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <memory>

#include "net/transport.h"

namespace stridewire::server {

using UpgradeRequest = boost::beast::http::request<boost::beast::http::string_body>;

/// Sends binary, uncompressed WebSocket messages: one for all movements and poses of a write, and
/// one for each other frame. The first Receive answers `request`, which must be a WebSocket
/// upgrade; the peer must wait for the answer.
///
/// The transport answers pings and accepts fragmented messages. It delivers a message in pieces as
/// they arrive, so that an announced length does not allocate memory.
[[nodiscard]] std::unique_ptr<Transport> MakeWebSocketTransport(boost::asio::ip::tcp::socket socket,
                                                                UpgradeRequest request);

}  // namespace stridewire::server
