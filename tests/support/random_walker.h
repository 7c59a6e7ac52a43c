#pragma once

#include <ostream>
#include <string>
#include <vector>

namespace stridewire {

/// Who is asked for something else all the time, for tests that look at every frame.
struct RandomWalker {
  const char* name;
  std::vector<std::string> subjects;  ///< Captured; none: the generated library
  double longest_m;                   ///< Step asked for
};
inline void PrintTo(const RandomWalker& walker, std::ostream* out) { *out << walker.name; }

/// How many a test has.
#ifdef __SANITIZE_ADDRESS__
inline constexpr int kRandomWalkers = 3;  // one thread, twenty times as slow
#else
inline constexpr int kRandomWalkers = 15;
#endif

}  // namespace stridewire
