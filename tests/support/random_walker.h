#pragma once

#include <ostream>
#include <string>
#include <vector>

namespace stridewire {

/// Who is asked for something else all the time, for tests that look at every frame.
struct RestlessWalker {
  const char* name;
  std::vector<std::string> subjects;  ///< Captured; none: the generated library
  double longest_m;                   ///< Step asked for
};
inline void PrintTo(const RestlessWalker& walker, std::ostream* out) { *out << walker.name; }

/// How many a test has.
#ifdef __SANITIZE_ADDRESS__
inline constexpr int kRestlessWalkers = 3;  // one thread, twenty times as slow
#else
inline constexpr int kRestlessWalkers = 15;
#endif

}  // namespace stridewire
