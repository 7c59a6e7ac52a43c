#pragma once

#include <cstddef>

/// Counts memory allocated with `new`, so that tests can check limits on it. A program that links
/// counted_memory.cpp has its operators new and delete replaced. malloc itself is not counted.
namespace stridewire::counted_memory {

[[nodiscard]] std::size_t LiveBytes();

/// Largest LiveBytes since the last call of ResetPeak.
[[nodiscard]] std::size_t PeakBytes();
void ResetPeak();

}  // namespace stridewire::counted_memory
