#include "server_metrics.h"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>

namespace stridewire::load {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;

constexpr std::size_t kMaxPageBytes = std::size_t{4} << 20;

/// A line of the page. `labels` is the text between the braces.
struct Sample {
  std::string_view name;
  std::string_view labels;
  double value = 0.0;
};

std::string_view TakeWord(std::string_view& text) {
  const std::size_t first = std::min(text.find_first_not_of(' '), text.size());
  text.remove_prefix(first);
  const std::string_view word = text.substr(0, text.find(' '));
  text.remove_prefix(word.size());
  return word;
}

bool ReadNumber(std::string_view text, double& number) {
  if (text == "+Inf" || text == "Inf") {
    number = std::numeric_limits<double>::infinity();
    return true;
  }
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), number);
  return !text.empty() && code == std::errc() && end == text.data() + text.size();
}

bool ReadSample(std::string_view line, Sample& sample) {
  const std::size_t name_end = line.find_first_of("{ ");
  if (name_end == 0 || name_end == std::string_view::npos) return false;
  sample.name = line.substr(0, name_end);
  line.remove_prefix(name_end);
  sample.labels = {};
  if (line.starts_with('{')) {
    // A quoted value can contain braces, so the last one ends the labels.
    const std::size_t close = line.rfind('}');
    if (close == std::string_view::npos) return false;
    sample.labels = line.substr(1, close - 1);
    line.remove_prefix(close + 1);
  }
  return ReadNumber(TakeWord(line), sample.value);
}

/// Reads the label `le`, which is the upper bound of a bin.
bool ReadBound(std::string_view labels, double& bound) {
  constexpr std::string_view kLabel = "le=\"";
  const std::size_t at = labels.find(kLabel);
  if (at == std::string_view::npos) return false;
  const std::string_view value = labels.substr(at + kLabel.size());
  return ReadNumber(value.substr(0, value.find('"')), bound);
}

Error SystemError(const Address& address, const boost::system::error_code& code) {
  return Error{ErrorCode::kIo, "cannot read the server's metrics", -1,
               "http://" + ToText(address) + "/metrics: " + code.message()};
}

}  // namespace

Expected<ServerMetrics> ParseServerMetrics(std::string_view text) {
  ServerMetrics metrics;
  struct Wanted {
    std::string_view name;
    double* value;
    bool is_maximum;
    bool found = false;
  };
  Wanted wanted[] = {
      {"stridewire_tick_seconds_max", &metrics.tick_max_s, true},
      {"stridewire_tick_seconds_max_since_scrape", &metrics.tick_max_since_scrape_s, true},
      {"stridewire_ticks_missed_total", &metrics.ticks_missed, false},
      {"stridewire_avatars", &metrics.avatars, false},
  };
  std::int64_t line_number = 0;
  while (!text.empty()) {
    ++line_number;
    std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (line.empty() || line.starts_with('#')) continue;
    Sample sample;
    if (!ReadSample(line, sample)) {
      return Fail(ErrorCode::kMalformed, "invalid line in the server's metrics", line_number);
    }
    if (sample.name == "stridewire_tick_seconds_bucket") {
      double bound = 0.0;
      if (!ReadBound(sample.labels, bound)) {
        return Fail(ErrorCode::kMalformed, "a bin in the server's metrics has no bound",
                    line_number);
      }
      metrics.tick_bins[bound] += sample.value;
      continue;
    }
    for (Wanted& each : wanted) {
      if (sample.name != each.name) continue;
      *each.value =
          each.is_maximum ? std::max(*each.value, sample.value) : *each.value + sample.value;
      each.found = true;
    }
  }
  for (const Wanted& each : wanted) {
    if (!each.found) {
      return Fail(ErrorCode::kNotFound, "missing in the server's metrics", std::string(each.name));
    }
  }
  if (metrics.tick_bins.empty()) {
    return Fail(ErrorCode::kNotFound, "missing in the server's metrics",
                std::string("stridewire_tick_seconds_bucket"));
  }
  return metrics;
}

Expected<ServerMetrics> ScrapeServerMetrics(const Address& address, double timeout_s) {
  asio::io_context io;
  asio::ip::tcp::resolver resolver(io);
  beast::tcp_stream stream(io);
  beast::flat_buffer buffer;
  http::request<http::empty_body> request{http::verb::get, "/metrics", 11};
  request.set(http::field::host, ToText(address));
  request.set(http::field::user_agent, "stridewire-load");
  request.set(http::field::connection, "close");
  http::response_parser<http::string_body> response;
  response.body_limit(kMaxPageBytes);

  stream.expires_after(std::chrono::duration_cast<std::chrono::steady_clock::duration>(
      std::chrono::duration<double>(timeout_s)));
  boost::system::error_code result = asio::error::timed_out;
  resolver.async_resolve(
      address.host, std::to_string(address.port),
      [&](boost::system::error_code code, const asio::ip::tcp::resolver::results_type& found) {
        result = code;
        if (code) return;
        stream.async_connect(found, [&](boost::system::error_code connected, const auto&) {
          result = connected;
          if (connected) return;
          http::async_write(stream, request, [&](boost::system::error_code sent, std::size_t) {
            result = sent;
            if (sent) return;
            http::async_read(stream, buffer, response,
                             [&](boost::system::error_code read, std::size_t) { result = read; });
          });
        });
      });
  // The timeout of the stream does not include the name resolution.
  io.run_for(std::chrono::milliseconds(static_cast<std::int64_t>(1000.0 * (timeout_s + 1.0))));
  if (!io.stopped()) result = asio::error::timed_out;
  if (result) return std::unexpected(SystemError(address, result));
  if (response.get().result() != http::status::ok) {
    return Fail(ErrorCode::kIo, "cannot read the server's metrics: HTTP status",
                "http://" + ToText(address) + "/metrics", response.get().result_int());
  }
  Expected<ServerMetrics> metrics = ParseServerMetrics(response.get().body());
  if (!metrics) {
    Error error = metrics.error();
    error.where =
        "http://" + ToText(address) + "/metrics" + (error.where.empty() ? "" : ": " + error.where);
    return std::unexpected(std::move(error));
  }
  return metrics;
}

Quantiles TicksBetween(const ServerMetrics& before, const ServerMetrics& after) {
  Quantiles ticks;
  ticks.max = 1e3 * (after.tick_max_s > before.tick_max_s
                         // The maximum has increased, so it was reached in this interval.
                         ? after.tick_max_s
                         : after.tick_max_since_scrape_s);
  const auto count_below = [&](double bound, double count) {
    const auto earlier = before.tick_bins.find(bound);
    return count - (earlier == before.tick_bins.end() ? 0.0 : earlier->second);
  };
  if (after.tick_bins.empty()) return ticks;
  const double total =
      count_below(after.tick_bins.rbegin()->first, after.tick_bins.rbegin()->second);
  const auto quantile = [&](double q) {
    double lower_s = 0.0;
    double lower_count = 0.0;
    for (const auto& [upper_s, cumulative] : after.tick_bins) {
      const double upper_count = count_below(upper_s, cumulative);
      if (upper_count >= q * total && upper_count > lower_count) {
        if (std::isinf(upper_s)) return ticks.max;
        const double share = (q * total - lower_count) / (upper_count - lower_count);
        return std::min(ticks.max, 1e3 * (lower_s + share * (upper_s - lower_s)));
      }
      lower_s = upper_s;
      lower_count = upper_count;
    }
    return ticks.max;
  };
  if (total <= 0.0) return ticks;
  ticks.p50 = quantile(0.5);
  ticks.p99 = quantile(0.99);
  return ticks;
}

}  // namespace stridewire::load
