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

// Removes the default port of the scheme.
std::string_view WithoutDefaultPort(std::string_view scheme, std::string_view authority) {
  const std::string_view port = scheme == "https" ? ":443" : ":80";
  return authority.ends_with(port) ? authority.substr(0, authority.size() - port.size())
                                   : authority;
}

// Returns true for IP addresses and localhost. A web page's owner cannot make these names point to
// another address.
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
  if (at == std::string::npos)
    return false;  // Pages without an origin, such as local files, send "null".
  const std::string_view scheme = std::string_view(from).substr(0, at);
  if (scheme != "http" && scheme != "https") return false;
  const std::string_view page =
      WithoutDefaultPort(scheme, std::string_view(from).substr(at + kSchemeEnd.size()));
  const std::string own = Lower(host);
  if (page.empty() || page != WithoutDefaultPort(scheme, own)) return false;
  return !is_loopback_ || IsFixedHost(own);
}

}  // namespace stridewire::server
