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

#include "net/origin_policy.h"
#include "net/transport.h"
#include "ops/metrics.h"

namespace stridewire::server {

/// What is asked for.
struct HttpQuery {
  std::string_view path;           ///< As it came, without what follows a '?'.
  std::string_view fields;         ///< What follows it: "a=1&b=2".
  std::string_view if_none_match;  ///< Empty if it was not there.
};

/// What a path answers.
struct HttpAnswer {
  unsigned status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string body;
  std::shared_ptr<const std::string> shared_body;  ///< Instead of `body`, if not null.
  std::string cache_control = "no-store";
  std::vector<std::pair<std::string, std::string>> headers;  ///< Further ones.

  [[nodiscard]] std::string_view bytes() const { return shared_body ? *shared_body : body; }
};

/// A small HTTP/1.1 server: GET and HEAD of what it was given, and one path that becomes a
/// WebSocket. Requests are read up to 8 KiB, each within 10 s; answers are written within 60 s. One
/// thread's, but for work that takes longer: that has a thread of its own, and 16 requests may wait
/// for it.
class HttpServer {
 public:
  using Page = std::function<HttpAnswer(const HttpQuery&)>;
  /// An upgraded connection, to be answered by whoever takes it, and who it is. It does not count
  /// as one of max_connections any more.
  using OnStream = std::function<void(std::unique_ptr<Transport>, const boost::asio::ip::address&)>;

  HttpServer(int max_connections, ThreadMetrics& metrics);
  ~HttpServer();

  void AddPage(std::string path, Page page) { pages_[std::move(path)] = std::move(page); }
  /// Asked, on a thread of its own, for paths that start with `prefix` and have no page.
  void SetWork(std::string prefix, Page page);
  /// Asked for paths that have no page.
  void SetFallback(Page page) { fallback_ = std::move(page); }
  /// Takes WebSockets at `path`, as long as `is_open` says so.
  void ServeStream(std::string path, OriginPolicy policy, std::function<bool()> is_open,
                   OnStream on_stream);

  void Accept(boost::asio::ip::tcp::socket socket);

 private:
  class Visit;
  struct Stream {
    std::string path;
    OriginPolicy policy;
    std::function<bool()> is_open;
    OnStream on_stream;
  };
  static constexpr int kMaxWaitingForWork = 16;
  struct Work {
    std::string prefix;
    Page page;
  };
  [[nodiscard]] bool IsWork(std::string_view method, const HttpQuery& query) const;
  [[nodiscard]] HttpAnswer AnswerTo(std::string_view method, const HttpQuery& query) const;

  int max_connections_;
  ThreadMetrics& metrics_;
  std::map<std::string, Page, std::less<>> pages_;
  Page fallback_;
  std::unique_ptr<const Stream> stream_;
  std::shared_ptr<int> connections_ = std::make_shared<int>(0);
  Work work_;
  int waiting_for_work_ = 0;
  boost::asio::thread_pool worker_{1};  // last: joined before anything it uses goes
};

}  // namespace stridewire::server
