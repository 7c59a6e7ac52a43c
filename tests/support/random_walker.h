#pragma once

#include <ostream>
#include <string>
#include <vector>

namespace stridewire {

/// Parameters of an avatar that receives random requests, for tests that measure every frame.
struct RandomWalker {
  const char* name;
  std::vector<std::string> subjects;  ///< Captured subjects; empty: the built-in library.
  double longest_m;                   ///< Longest step to request.
};
inline void PrintTo(const RandomWalker& walker, std::ostream* out) { *out << walker.name; }

/// Number of random walkers per test.
#ifdef __SANITIZE_ADDRESS__
inline constexpr int kRandomWalkers = 3;  // Sanitizer builds are twenty times as slow.
#else
inline constexpr int kRandomWalkers = 15;
#endif

}  // namespace stridewire
