#pragma once

#include <cstdint>
#include <string>

namespace stridewire::test {

/// Where a server listens that wrote `line` when it was ready, for "listen" or "http"; 0: it does not say.
inline std::uint16_t PortIn(const std::string& line, const std::string& key) {
  const std::string before = key + "=127.0.0.1:";
  const std::size_t at = line.find(before);
  if (at == std::string::npos) return 0;
  return static_cast<std::uint16_t>(std::stoi(line.substr(at + before.size())));
}

}  // namespace stridewire::test
