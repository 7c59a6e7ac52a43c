#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"

namespace stridewire::server {

/// Which web pages may open a stream. A browser tells which page does (Origin, RFC 6454) and lets
/// any page connect to any server, so a server that takes all of them hands its avatars to every
/// page its user happens to look at.
///
/// Allowed are: no Origin at all, since it is no browser; the server's own pages (Origin's host and
/// port are those of Host); and those listed. A server that only its own machine reaches takes
/// Host for its own name only if it is an address or localhost: any other name may have been made
/// to point there by the page itself (DNS rebinding).
class OriginPolicy {
 public:
  /// `is_loopback`: only the own machine reaches the server.
  OriginPolicy(std::vector<std::string> allowed, bool is_loopback);

  [[nodiscard]] bool Allows(std::optional<std::string_view> origin, std::string_view host) const;

 private:
  std::vector<std::string> allowed_;  // lower case
  bool is_loopback_;
};

/// One that may be listed: scheme://host or scheme://host:port, nothing behind it.
[[nodiscard]] Status CheckOrigin(std::string_view origin);

}  // namespace stridewire::server
