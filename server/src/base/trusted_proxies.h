#pragma once

#include <boost/asio/ip/address.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"

namespace stridewire::server {

/// The proxies whose X-Forwarded-For header the server trusts.
///
///   client 203.0.113.7 --> proxy 10.0.0.2 --> server
///   X-Forwarded-For: 203.0.113.7
class TrustedProxies {
 public:
  /// Trusts no proxy.
  TrustedProxies() = default;
  /// `networks` are addresses, such as "10.0.0.2", or networks, such as "10.0.0.0/8" and
  /// "fd00::/8". Fails with kInvalidArgument and the index of the first one that is neither.
  [[nodiscard]] static Expected<TrustedProxies> Parse(std::span<const std::string> networks);

  /// Returns the address of the client of a connection from `peer`. `forwarded` is the content of
  /// X-Forwarded-For: addresses separated by commas, to which each proxy appends the address of its
  /// own peer. The search starts at `peer` and goes through the list from its end. It stops at the
  /// first address that is not trusted, at the start of the list, or before an entry that is not an
  /// address, and returns the address at which it stopped. The rest of the list is ignored, because
  /// a client can send a header with any addresses.
  [[nodiscard]] boost::asio::ip::address ClientOf(const boost::asio::ip::address& peer,
                                                  std::string_view forwarded) const;

 private:
  struct Network {
    boost::asio::ip::address_v6 base;  // IPv4 addresses are mapped to IPv6.
    int prefix_bits = 128;
  };
  [[nodiscard]] bool Trusts(const boost::asio::ip::address& address) const;

  std::vector<Network> networks_;
};

}  // namespace stridewire::server
