#include "app/http_server.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <chrono>
#include <optional>

#include "net/websocket_transport.h"
#include "stridewire/base/version.h"

namespace stridewire::server {
namespace {

namespace beast = boost::beast;
namespace http = boost::beast::http;

constexpr std::size_t kMaxRequestBytes = std::size_t{8} << 10;
constexpr std::chrono::seconds kReadTimeout{10};
constexpr std::chrono::seconds kWriteTimeout{60};

std::string_view View(beast::string_view text) { return {text.data(), text.size()}; }

}  // namespace

/// Handles one connection and its requests.
class HttpServer::Visit : public std::enable_shared_from_this<Visit> {
 public:
  Visit(HttpServer& server, boost::asio::ip::tcp::socket socket)
      : server_(server),
        connections_(server.connections_),
        stream_(std::move(socket)),
        buffer_(kMaxRequestBytes) {
    ++*connections_;
  }
  ~Visit() { --*connections_; }

  void Read() {
    parser_.emplace();
    parser_->header_limit(kMaxRequestBytes);
    parser_->body_limit(kMaxRequestBytes);
    stream_.expires_after(kReadTimeout);
    http::async_read(
        stream_, buffer_, *parser_,
        [self = shared_from_this()](beast::error_code error, std::size_t) { self->OnRead(error); });
  }

 private:
  void OnRead(beast::error_code error) {
    if (error == http::error::end_of_stream || error == beast::error::timeout) return Close();
    if (error) {
      if (error.category() != http::make_error_code(http::error::bad_method).category()) return;
      Answer({.status = 400, .body = error.message() + "\n"}, false, false);
      return;
    }
    const auto& request = parser_->get();
    const std::string_view target = View(request.target());
    const std::size_t mark = std::min(target.find('?'), target.size());
    const HttpQuery query{.path = target.substr(0, mark),
                          .fields = target.substr(std::min(mark + 1, target.size())),
                          .if_none_match = View(request[http::field::if_none_match])};
    if (server_.stream_ != nullptr && query.path == server_.stream_->path) {
      if (auto refusal = RefusalOfStream()) {
        Answer(*std::move(refusal), request.method() == http::verb::head, false);
      } else {
        BecomeStream();
      }
      return;
    }
    const bool is_head = request.method() == http::verb::head;
    if (server_.IsSlow(View(request.method_string()), query)) {
      return AnswerLater(query, is_head, request.keep_alive());
    }
    Answer(server_.AnswerTo(View(request.method_string()), query), is_head, request.keep_alive());
  }

  // `query` refers to the parser, which lives until the response is sent.
  void AnswerLater(const HttpQuery& query, bool is_head, bool keep_alive) {
    if (server_.waiting_requests_ >= kMaxWaitingRequests) {
      server_.metrics_.Reached(Limit::kHttpWork);
      Answer({.status = 503,
              .body = "too many requests are being computed; retry later\n",
              .headers = {{"Retry-After", "1"}}},
             is_head, keep_alive);
      return;
    }
    ++server_.waiting_requests_;
    boost::asio::post(
        server_.worker_, [self = shared_from_this(), query, is_head, keep_alive]() mutable {
          HttpAnswer answer = self->server_.slow_page_.page(query);
          const auto executor = self->stream_.get_executor();
          // The response is sent on the thread of the connection.
          boost::asio::post(executor, [self = std::move(self), answer = std::move(answer), is_head,
                                       keep_alive]() mutable {
            --self->server_.waiting_requests_;
            self->Answer(std::move(answer), is_head, keep_alive);
          });
        });
  }

  // Returns an error response if the request cannot open a stream, otherwise nullopt.
  std::optional<HttpAnswer> RefusalOfStream() {
    const auto& request = parser_->get();
    if (!beast::websocket::is_upgrade(request)) {
      return HttpAnswer{
          .status = 426,
          .body = "expected a WebSocket upgrade; each message contains one protocol frame\n",
          .headers = {{"Upgrade", "websocket"}, {"Sec-WebSocket-Version", "13"}}};
    }
    std::optional<std::string_view> origin;
    if (request.count(http::field::origin) > 0) origin = View(request[http::field::origin]);
    if (!server_.stream_->policy.Allows(origin, View(request[http::field::host]))) {
      server_.metrics_.origins_refused.Add();
      spdlog::info("refused a WebSocket: the origin {:.200} of the page is not allowed", *origin);
      return HttpAnswer{
          .status = 403,
          .body =
              "pages of this origin may not open a stream; see allowed_origins in the "
              "configuration of the server\n"};
    }
    if (!server_.stream_->is_open()) {
      return HttpAnswer{.status = 503, .body = "the server is shutting down\n"};
    }
    if (buffer_.size() > 0) {
      return HttpAnswer{.status = 400, .body = "data was received before the WebSocket was open\n"};
    }
    return std::nullopt;
  }

  void BecomeStream() {
    server_.metrics_.http_requests.Add();
    auto socket = stream_.release_socket();
    beast::error_code error;
    const auto remote = socket.remote_endpoint(error);
    if (error) return;  // The peer has closed the connection.
    auto request = parser_->release();
    // A proxy may append to the header, or add another header of the same name.
    std::string forwarded;
    const auto [first, last] = request.equal_range("X-Forwarded-For");
    for (auto it = first; it != last; ++it) {
      if (!forwarded.empty()) forwarded += ',';
      forwarded += View(it->value());
    }
    const auto client = server_.stream_->proxies.ClientOf(remote.address(), forwarded);
    server_.stream_->on_stream(MakeWebSocketTransport(std::move(socket), std::move(request)),
                               client);
  }

  void Answer(HttpAnswer answer, bool is_head, bool keep_alive) {
    server_.metrics_.http_requests.Add();
    answer_ = std::move(answer);
    response_ = {};
    response_.version(11);
    response_.result(answer_.status);
    response_.set(http::field::server, std::string("stridewired/") + kVersion);
    if (answer_.status != 304) response_.set(http::field::content_type, answer_.content_type);
    response_.set(http::field::cache_control, answer_.cache_control);
    // Prevents browsers from guessing another content type.
    response_.set("X-Content-Type-Options", "nosniff");
    if (answer_.status == 405) response_.set(http::field::allow, "GET, HEAD");
    for (const auto& [name, value] : answer_.headers) response_.set(name, value);
    response_.keep_alive(keep_alive);
    const std::string_view bytes = answer_.bytes();
    if (answer_.status != 304) response_.content_length(bytes.size());
    if (!is_head) response_.body() = {bytes.data(), bytes.size()};
    stream_.expires_after(kWriteTimeout);
    http::async_write(
        stream_, response_,
        [self = shared_from_this(), keep_alive](beast::error_code error, std::size_t) {
          if (error) return;
          self->answer_ = {};
          if (keep_alive) return self->Read();
          self->Close();
        });
  }

  void Close() {
    beast::error_code ignored;
    stream_.socket().shutdown(boost::asio::ip::tcp::socket::shutdown_send, ignored);
  }

  HttpServer& server_;
  std::shared_ptr<int> connections_;  // Shared, because it may outlive the server.
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  HttpAnswer answer_;
  http::response<http::span_body<const char>> response_;  // Refers to the bytes of answer_.
};

HttpServer::HttpServer(int max_connections, ThreadMetrics& metrics)
    : max_connections_(max_connections), metrics_(metrics) {}

HttpServer::~HttpServer() {
  worker_.stop();
  worker_.join();
}

void HttpServer::SetSlowPage(std::string prefix, Page page) {
  slow_page_ = {std::move(prefix), std::move(page)};
}

bool HttpServer::IsSlow(std::string_view method, const HttpQuery& query) const {
  return slow_page_.page && (method == "GET" || method == "HEAD") &&
         query.path.starts_with(slow_page_.prefix) && pages_.find(query.path) == pages_.end();
}

void HttpServer::ServeStream(Stream stream) {
  stream_ = std::make_unique<const Stream>(std::move(stream));
}

void HttpServer::Accept(boost::asio::ip::tcp::socket socket) {
  if (*connections_ >= max_connections_) {
    metrics_.Reached(Limit::kHttpConnections);
    return;  // The destructor of the socket closes the connection.
  }
  std::make_shared<Visit>(*this, std::move(socket))->Read();
}

HttpAnswer HttpServer::AnswerTo(std::string_view method, const HttpQuery& query) const {
  if (method != "GET" && method != "HEAD") {
    return {.status = 405, .body = "only GET and HEAD are supported\n"};
  }
  const auto page = pages_.find(query.path);
  if (page != pages_.end()) return page->second(query);
  if (fallback_) return fallback_(query);
  return {.status = 404, .body = "not found\n"};
}

}  // namespace stridewire::server
