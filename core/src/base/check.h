#pragma once

namespace stridewire {

/// Prints the broken invariant and stops the program. Never returns.
[[noreturn]] void CheckFailed(const char* condition, const char* file, int line);

}  // namespace stridewire

/// An invariant of ours, on in every build. Bad input is never a reason for it.
#define STRIDEWIRE_CHECK(condition) \
  ((condition) ? (void)0 : ::stridewire::CheckFailed(#condition, __FILE__, __LINE__))
