#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/thread_pool.hpp>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/metrics.h"
#include "base/trusted_proxies.h"
#include "net/origin_policy.h"
#include "net/transport.h"

namespace stridewire::server {

/// The parts of an HTTP request that pages use. The views are valid until the response is sent.
struct HttpQuery {
  std::string_view path;           ///< Path as received, without the query after '?'.
  std::string_view fields;         ///< The query, such as "a=1&b=2".
  std::string_view if_none_match;  ///< Value of the header If-None-Match; empty if it is missing.
};

/// An HTTP response.
struct HttpAnswer {
  unsigned status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string body;
  /// Body that is shared between responses. If not null, it is used instead of `body`.
  std::shared_ptr<const std::string> shared_body;
  std::string cache_control = "no-store";
  std::vector<std::pair<std::string, std::string>> headers;  ///< Additional headers.

  [[nodiscard]] std::string_view bytes() const { return shared_body ? *shared_body : body; }
};

/// A small HTTP/1.1 server. It supports GET and HEAD for registered pages, and WebSocket upgrades
/// for one path. The header and the body of a request have at most 8 KiB each. A request
/// must be received within 10 s, and a response must be sent within 60 s. The server runs on one
/// thread, except for slow pages, which have their own thread. At most 16 requests for slow pages
/// may be waiting or in progress.
class HttpServer {
 public:
  using Page = std::function<HttpAnswer(const HttpQuery&)>;
  /// Receives a connection that requests a WebSocket upgrade, and the address of the client. The
  /// transport answers the upgrade. The connection no longer counts against max_connections.
  using OnStream = std::function<void(std::unique_ptr<Transport>, const boost::asio::ip::address&)>;

  HttpServer(int max_connections, ThreadMetrics& metrics);
  ~HttpServer();

  void AddPage(std::string path, Page page) { pages_[std::move(path)] = std::move(page); }
  /// Sets the page for all paths that start with `prefix` and are not those of AddPage. The server
  /// calls `page` on a separate thread.
  void SetSlowPage(std::string prefix, Page page);
  /// Sets the page for all paths that have no other page.
  void SetFallback(Page page) { fallback_ = std::move(page); }
  /// A path that accepts WebSockets while `is_open` returns true.
  struct Stream {
    std::string path;
    OriginPolicy policy;
    TrustedProxies proxies;
    std::function<bool()> is_open;
    OnStream on_stream;
  };
  void ServeStream(Stream stream);

  void Accept(boost::asio::ip::tcp::socket socket);

 private:
  class Visit;
  static constexpr int kMaxWaitingRequests = 16;
  struct SlowPage {
    std::string prefix;
    Page page;
  };
  [[nodiscard]] bool IsSlow(std::string_view method, const HttpQuery& query) const;
  [[nodiscard]] HttpAnswer AnswerTo(std::string_view method, const HttpQuery& query) const;

  int max_connections_;
  ThreadMetrics& metrics_;
  std::map<std::string, Page, std::less<>> pages_;
  Page fallback_;
  std::unique_ptr<const Stream> stream_;
  std::shared_ptr<int> connections_ = std::make_shared<int>(0);
  SlowPage slow_page_;
  int waiting_requests_ = 0;
  boost::asio::thread_pool worker_{
      1};  // Declared last, so that its thread ends before other members are destroyed.
};

}  // namespace stridewire::server
