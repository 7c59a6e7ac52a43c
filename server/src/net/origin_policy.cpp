#include "net/origin_policy.h"

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <utility>

namespace stridewire::server {
namespace {

constexpr std::string_view kSchemeEnd = "://";

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c;
  });
  return lower;
}

// Without the port that the scheme has anyway.
std::string_view WithoutDefaultPort(std::string_view scheme, std::string_view authority) {
  const std::string_view port = scheme == "https" ? ":443" : ":80";
  return authority.ends_with(port) ? authority.substr(0, authority.size() - port.size())
                                   : authority;
}

// Is it a name that cannot have been made to point somewhere else?
bool IsFixedHost(std::string_view authority) {
  std::string_view host = authority;
  if (host.starts_with('[')) {
    host = host.substr(1, host.find(']') - 1);
  } else {
    host = host.substr(0, host.find(':'));
  }
  if (host == "localhost") return true;
  boost::system::error_code error;
  boost::asio::ip::make_address(std::string(host), error);
  return !error;
}

}  // namespace

OriginPolicy::OriginPolicy(std::vector<std::string> allowed, bool is_loopback)
    : allowed_(std::move(allowed)), is_loopback_(is_loopback) {
  for (std::string& origin : allowed_) origin = Lower(origin);
}

bool OriginPolicy::Allows(std::optional<std::string_view> origin, std::string_view host) const {
  if (!origin) return true;
  const std::string from = Lower(*origin);
  if (std::ranges::find(allowed_, from) != allowed_.end()) return true;
  const auto at = from.find(kSchemeEnd);
  if (at == std::string::npos) return false;  // "null": a page from nowhere
  const std::string_view scheme = std::string_view(from).substr(0, at);
  if (scheme != "http" && scheme != "https") return false;
  const std::string_view page =
      WithoutDefaultPort(scheme, std::string_view(from).substr(at + kSchemeEnd.size()));
  const std::string own = Lower(host);
  if (page.empty() || page != WithoutDefaultPort(scheme, own)) return false;
  return !is_loopback_ || IsFixedHost(own);
}

Status CheckOrigin(std::string_view origin) {
  const auto at = origin.find(kSchemeEnd);
  const bool is_good =
      at != std::string_view::npos && at > 0 && at + kSchemeEnd.size() < origin.size() &&
      origin.find_first_of("/?#*, \t\"\\", at + kSchemeEnd.size()) == std::string_view::npos &&
      std::ranges::all_of(origin, [](char c) { return c > ' ' && c < 0x7f; });
  if (is_good) return {};
  return Fail(ErrorCode::kInvalidArgument,
              "expected a page's origin, such as https://example.org or http://localhost:8080, "
              "without a path");
}

}  // namespace stridewire::server
