#pragma once

#include <cstddef>

/// Counts what `new` gives out, so that a test can hold a parser to its bound. A program that links
/// counted_memory.cpp has its operators new and delete replaced; malloc itself is not counted.
namespace stridewire::counted_memory {

[[nodiscard]] std::size_t LiveBytes();

/// Largest LiveBytes since the last ResetPeak.
[[nodiscard]] std::size_t PeakBytes();
void ResetPeak();

}  // namespace stridewire::counted_memory
