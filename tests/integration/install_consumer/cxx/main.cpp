#include <cstdio>
#include <cstring>

#include "every_header.h"

int main() {
  // Calls into the compiled libraries, so that the program must be linked with them.
  double heading_rad = 0.0;
  if (!stridewire::HeadingOf(stridewire::YawRotation(0.5), heading_rad)) return 1;
  if (std::strcmp(stridewire_version(), stridewire::kVersion) != 0) return 1;
  if (!stridewire::client::Client::Create()) return 1;
  std::printf("stridewire %s, heading %.3f rad\n", stridewire::kVersion, heading_rad);
  return heading_rad > 0.499 && heading_rad < 0.501 ? 0 : 1;
}
