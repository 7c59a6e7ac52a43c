#pragma once

#include <cstddef>
#include <cstdint>

namespace stridewire {

inline constexpr std::size_t kCacheLineBytes = 64;

/// Prefetches `bytes` bytes of memory that will be read soon. It affects only the running time.
inline void PrefetchBytes(const void* at, std::size_t bytes) {
  const auto* from = static_cast<const char*>(at);
  const std::size_t in_line = reinterpret_cast<std::uintptr_t>(at) % kCacheLineBytes;
  for (std::size_t i = 0; i < in_line + bytes; i += kCacheLineBytes) __builtin_prefetch(from + i);
}

}  // namespace stridewire
