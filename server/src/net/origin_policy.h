#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stridewire::server {

/// Decides which web pages may open a stream. Browsers let any page connect to any server, but they
/// send the origin of the page (header Origin, RFC 6454). If a server accepted every origin, any
/// web page that its user visits could command its avatars.
///
/// Three kinds of requests are allowed: requests without Origin, because they do not come from a
/// browser; requests of the server's own pages, whose Origin has the host and port of the header
/// Host; and requests of the listed origins.
///
/// If the server listens on a loopback address, a page counts as the server's own only if Host is
/// an IP address or localhost. Other names could resolve to this machine because the page's owner
/// configured its DNS that way (DNS rebinding).
class OriginPolicy {
 public:
  /// `is_loopback` is true if the server listens on a loopback address.
  OriginPolicy(std::vector<std::string> allowed, bool is_loopback);

  [[nodiscard]] bool Allows(std::optional<std::string_view> origin, std::string_view host) const;

 private:
  std::vector<std::string> allowed_;  // lower case
  bool is_loopback_;
};

}  // namespace stridewire::server
