#pragma once

#include <cstdint>
#include <string>

namespace stridewire::test {

/// Returns the port in the ready line of a server, for the key "listen" or "http". Returns 0 if the
/// line does not contain it.
inline std::uint16_t PortIn(const std::string& line, const std::string& key) {
  const std::string before = key + "=127.0.0.1:";
  const std::size_t at = line.find(before);
  if (at == std::string::npos) return 0;
  return static_cast<std::uint16_t>(std::stoi(line.substr(at + before.size())));
}

}  // namespace stridewire::test
