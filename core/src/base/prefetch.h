#pragma once

#include <cstddef>
#include <cstdint>

namespace stridewire {

inline constexpr std::size_t kCacheLineBytes = 64;

/// Prefetches `bytes` bytes of memory that will be read soon. This affects only the running time.
inline void PrefetchBytes(const void* at, std::size_t bytes) {
  const std::size_t in_line = reinterpret_cast<std::uintptr_t>(at) % kCacheLineBytes;
  const auto* from = static_cast<const char*>(at) - in_line;
  for (std::size_t i = 0; i < in_line + bytes; i += kCacheLineBytes) {
#if defined(__wasm__)
    // WebAssembly has no prefetch instruction. The processor does not wait for this load, because
    // nothing uses its value.
    (void)*static_cast<const volatile char*>(from + i);
#else
    __builtin_prefetch(from + i);
#endif
  }
}

}  // namespace stridewire
