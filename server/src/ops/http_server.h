#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <functional>
#include <map>
#include <string>
#include <string_view>

#include "ops/metrics.h"

namespace stridewire::server {

/// What a path answers.
struct HttpAnswer {
  unsigned status = 200;
  std::string content_type = "text/plain; charset=utf-8";
  std::string body;
};

/// A small HTTP/1.1 server: GET and HEAD of a few fixed paths. Requests are read up to 8 KiB,
/// each within 10 s; one thread's.
class HttpServer {
 public:
  using Page = std::function<HttpAnswer()>;

  HttpServer(int max_connections, ThreadMetrics& metrics);
  ~HttpServer();

  void AddPage(std::string path, Page page) { pages_[std::move(path)] = std::move(page); }
  void Accept(boost::asio::ip::tcp::socket socket);

 private:
  class Visit;
  [[nodiscard]] HttpAnswer AnswerTo(std::string_view method, std::string_view target) const;

  int max_connections_;
  ThreadMetrics& metrics_;
  std::map<std::string, Page, std::less<>> pages_;
  int connections_ = 0;
};

}  // namespace stridewire::server
