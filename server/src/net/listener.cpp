#include "net/listener.h"

#include <spdlog/spdlog.h>

#include <utility>

namespace stridewire::server {

namespace asio = boost::asio;
using boost::system::error_code;

Listener::Listener(asio::io_context& context)
    : context_(context), acceptor_(context), pause_(context) {}

Status Listener::Open(const Endpoint& endpoint, const char* name) {
  const auto fail = [&](const char* text, const error_code& error) {
    return Fail(ErrorCode::kIo, text,
                std::string(name) + ": " + ToText(endpoint) + ": " + error.message());
  };
  error_code error;
  asio::ip::tcp::resolver resolver(context_);
  const auto results = resolver.resolve(endpoint.host, std::to_string(endpoint.port),
                                        asio::ip::tcp::resolver::passive, error);
  if (error || results.empty()) return fail("cannot resolve the address", error);
  const asio::ip::tcp::endpoint address = results.begin()->endpoint();
  acceptor_.open(address.protocol(), error);
  if (error) return fail("cannot create a socket", error);
  // A restarted server must not wait until connections of the previous process have timed out.
  acceptor_.set_option(asio::socket_base::reuse_address(true), error);
  acceptor_.bind(address, error);
  if (error) return fail("cannot bind the address", error);
  acceptor_.listen(asio::socket_base::max_listen_connections, error);
  if (error) return fail("cannot listen on the address", error);
  return {};
}

void Listener::Start(OnSocket on_socket) {
  on_socket_ = std::move(on_socket);
  Accept();
}

void Listener::Accept() {
  acceptor_.async_accept(context_, [this](const error_code& error, Socket socket) {
    if (!acceptor_.is_open()) return;
    if (!error) {
      on_socket_(std::move(socket));
      Accept();
      return;
    }
    if (error == asio::error::operation_aborted) return;
    if (error == asio::error::connection_aborted) {
      Accept();
      return;
    }
    // The process is out of file descriptors or memory. Retrying at once would busy-wait.
    spdlog::warn("cannot accept a connection: {}; retrying in 100 ms", error.message());
    pause_.expires_after(std::chrono::milliseconds(100));
    pause_.async_wait([this](const error_code& cancelled) {
      if (!cancelled && acceptor_.is_open()) Accept();
    });
  });
}

void Listener::Close() {
  error_code ignored;
  acceptor_.close(ignored);
  pause_.cancel();
}

Endpoint Listener::endpoint() const {
  error_code ignored;
  const auto local = acceptor_.local_endpoint(ignored);
  return {local.address().to_string(), local.port()};
}

}  // namespace stridewire::server
