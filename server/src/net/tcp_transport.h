#pragma once

#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <vector>

#include "net/transport.h"

namespace stridewire::server {

/// Sends frames one after the other over plain TCP, several per system call.
[[nodiscard]] std::unique_ptr<Transport> MakeTcpTransport(boost::asio::ip::tcp::socket socket);

}  // namespace stridewire::server
