#include "ops/http_server.h"

#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <memory>
#include <optional>
#include <utility>

#include "stridewire/base/version.h"

namespace stridewire::server {
namespace {

namespace beast = boost::beast;
namespace http = boost::beast::http;

constexpr std::size_t kMaxRequestBytes = std::size_t{8} << 10;
constexpr std::chrono::seconds kTimeout{10};

}  // namespace

/// One connection and the requests that come over it.
class HttpServer::Visit : public std::enable_shared_from_this<Visit> {
 public:
  Visit(HttpServer& server, boost::asio::ip::tcp::socket socket)
      : server_(server), stream_(std::move(socket)), buffer_(kMaxRequestBytes) {
    ++server_.connections_;
  }
  ~Visit() { --server_.connections_; }

  void Read() {
    parser_.emplace();
    parser_->header_limit(kMaxRequestBytes);
    parser_->body_limit(kMaxRequestBytes);
    stream_.expires_after(kTimeout);
    http::async_read(
        stream_, buffer_, *parser_,
        [self = shared_from_this()](beast::error_code error, std::size_t) { self->OnRead(error); });
  }

 private:
  void OnRead(beast::error_code error) {
    if (error == http::error::end_of_stream || error == beast::error::timeout) return Close();
    if (error) {
      if (error.category() != http::make_error_code(http::error::bad_method).category()) return;
      Answer({400, "text/plain; charset=utf-8", error.message() + "\n"}, false, false);
      return;
    }
    const auto& request = parser_->get();
    const bool is_head = request.method() == http::verb::head;
    const auto target = request.target();
    const auto method = request.method_string();
    Answer(server_.AnswerTo({method.data(), method.size()}, {target.data(), target.size()}),
           is_head, request.keep_alive());
  }

  void Answer(HttpAnswer answer, bool is_head, bool keep_alive) {
    server_.metrics_.http_requests.Add();
    response_ = {};
    response_.version(11);
    response_.result(answer.status);
    response_.set(http::field::server, std::string("stridewired/") + kVersion);
    response_.set(http::field::content_type, answer.content_type);
    response_.set(http::field::cache_control, "no-store");
    if (answer.status == 405) response_.set(http::field::allow, "GET, HEAD");
    response_.keep_alive(keep_alive);
    response_.content_length(answer.body.size());
    if (!is_head) response_.body() = std::move(answer.body);
    stream_.expires_after(kTimeout);
    http::async_write(
        stream_, response_,
        [self = shared_from_this(), keep_alive](beast::error_code error, std::size_t) {
          if (error) return;
          if (keep_alive) return self->Read();
          self->Close();
        });
  }

  void Close() {
    beast::error_code ignored;
    stream_.socket().shutdown(boost::asio::ip::tcp::socket::shutdown_send, ignored);
  }

  HttpServer& server_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  http::response<http::string_body> response_;
};

HttpServer::HttpServer(int max_connections, ThreadMetrics& metrics)
    : max_connections_(max_connections), metrics_(metrics) {}

HttpServer::~HttpServer() = default;

void HttpServer::Accept(boost::asio::ip::tcp::socket socket) {
  if (connections_ >= max_connections_) {
    metrics_.Reached(Limit::kHttpConnections);
    return;  // closes it
  }
  std::make_shared<Visit>(*this, std::move(socket))->Read();
}

HttpAnswer HttpServer::AnswerTo(std::string_view method, std::string_view target) const {
  if (method != "GET" && method != "HEAD") {
    return {405, "text/plain; charset=utf-8", "only GET and HEAD\n"};
  }
  const auto page = pages_.find(target.substr(0, target.find('?')));
  if (page == pages_.end()) return {404, "text/plain; charset=utf-8", "no such page\n"};
  return page->second();
}

}  // namespace stridewire::server
