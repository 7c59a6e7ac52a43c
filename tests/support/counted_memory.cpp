#include "counted_memory.h"

#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <new>

namespace stridewire::counted_memory {
namespace {

std::atomic<std::size_t> live_bytes = 0;
std::atomic<std::size_t> peak_bytes = 0;

void* Allocate(std::size_t size) {
  void* memory = std::malloc(size == 0 ? 1 : size);
  if (memory == nullptr) throw std::bad_alloc();
  const std::size_t live = live_bytes += malloc_usable_size(memory);
  std::size_t peak = peak_bytes;
  while (live > peak && !peak_bytes.compare_exchange_weak(peak, live)) {
  }
  return memory;
}

void Free(void* memory) {
  if (memory != nullptr) live_bytes -= malloc_usable_size(memory);
  std::free(memory);
}

}  // namespace

std::size_t LiveBytes() { return live_bytes; }
std::size_t PeakBytes() { return peak_bytes; }
void ResetPeak() { peak_bytes = live_bytes.load(); }

}  // namespace stridewire::counted_memory

void* operator new(std::size_t size) { return stridewire::counted_memory::Allocate(size); }
void* operator new[](std::size_t size) { return stridewire::counted_memory::Allocate(size); }
// The sorting functions of the standard library allocate in this way.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  try {
    return stridewire::counted_memory::Allocate(size);
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}
void* operator new[](std::size_t size, const std::nothrow_t& tag) noexcept {
  return operator new(size, tag);
}
void operator delete(void* memory) noexcept { stridewire::counted_memory::Free(memory); }
void operator delete(void* memory, std::size_t) noexcept {
  stridewire::counted_memory::Free(memory);
}
void operator delete[](void* memory) noexcept { stridewire::counted_memory::Free(memory); }
void operator delete[](void* memory, std::size_t) noexcept {
  stridewire::counted_memory::Free(memory);
}
