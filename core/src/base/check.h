#pragma once

namespace stridewire {

/// Prints the failed condition with its file and line to stderr, then aborts the program.
[[noreturn]] void CheckFailed(const char* condition, const char* file, int line);

}  // namespace stridewire

/// Aborts the program if an invariant of this code base does not hold. The check is active in every
/// build. Use it only for conditions that only a bug can break. For invalid input, return an Error.
#define STRIDEWIRE_CHECK(condition) \
  ((condition) ? (void)0 : ::stridewire::CheckFailed(#condition, __FILE__, __LINE__))
