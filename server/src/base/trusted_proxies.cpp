#include "base/trusted_proxies.h"

#include <algorithm>
#include <charconv>
#include <optional>

namespace stridewire::server {
namespace {

namespace ip = boost::asio::ip;

constexpr int kMappedBits = 96;  // Length of ::ffff:0:0/96, the prefix of mapped addresses.

std::optional<ip::address> ParseAddress(std::string_view text) {
  boost::system::error_code error;
  const ip::address address = ip::make_address(std::string(text), error);
  if (error) return std::nullopt;
  // Dual-stack sockets report IPv4 clients as mapped addresses. Both forms are the same client.
  if (address.is_v6() && address.to_v6().is_v4_mapped()) {
    return ip::make_address_v4(ip::v4_mapped, address.to_v6());
  }
  return address;
}

// Parses an entry of X-Forwarded-For. Some proxies append the port: "1.2.3.4:567", "[::1]:567".
std::optional<ip::address> ParseEntry(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  if (text.starts_with('[')) return ParseAddress(text.substr(1, text.find(']') - 1));
  if (std::ranges::count(text, ':') == 1) text = text.substr(0, text.find(':'));
  return ParseAddress(text);
}

ip::address_v6 Mapped(const ip::address& address) {
  return address.is_v4() ? ip::make_address_v6(ip::v4_mapped, address.to_v4()) : address.to_v6();
}

}  // namespace

Expected<TrustedProxies> TrustedProxies::Parse(std::span<const std::string> networks) {
  TrustedProxies proxies;
  for (std::size_t i = 0; i < networks.size(); ++i) {
    const auto fail = [&] {
      return Fail(ErrorCode::kInvalidArgument,
                  "expected an address or network, such as 10.0.0.2, 10.0.0.0/8 or fd00::/8",
                  static_cast<std::int64_t>(i));
    };
    const std::string_view text = networks[i];
    const std::size_t slash = std::min(text.find('/'), text.size());
    const auto address = ParseAddress(text.substr(0, slash));
    if (!address) return fail();
    const int most_bits = address->is_v4() ? 32 : 128;
    int bits = most_bits;
    if (slash < text.size()) {
      const char* const end = text.data() + text.size();
      const auto [parsed_to, error] = std::from_chars(text.data() + slash + 1, end, bits);
      if (error != std::errc() || parsed_to != end || bits < 0 || bits > most_bits) return fail();
    }
    proxies.networks_.push_back({Mapped(*address), address->is_v4() ? kMappedBits + bits : bits});
  }
  return proxies;
}

bool TrustedProxies::Trusts(const ip::address& address) const {
  const auto bytes = Mapped(address).to_bytes();
  return std::ranges::any_of(networks_, [&](const Network& network) {
    const auto base = network.base.to_bytes();
    for (int bit = 0; bit < network.prefix_bits; ++bit) {
      const auto byte = static_cast<std::size_t>(bit / 8);
      if (((bytes[byte] ^ base[byte]) >> (7 - bit % 8) & 1) != 0) return false;
    }
    return true;
  });
}

ip::address TrustedProxies::ClientOf(const ip::address& peer, std::string_view forwarded) const {
  ip::address client = peer;
  while (Trusts(client) && !forwarded.empty()) {
    const std::size_t comma = forwarded.rfind(',');
    const std::size_t first = comma == std::string_view::npos ? 0 : comma + 1;
    const auto entry = ParseEntry(forwarded.substr(first));
    if (!entry) break;
    client = *entry;
    forwarded = forwarded.substr(0, first == 0 ? 0 : comma);
  }
  return client;
}

}  // namespace stridewire::server
