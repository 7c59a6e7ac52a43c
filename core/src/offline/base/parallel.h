#pragma once

#include <functional>

namespace stridewire {

// How many threads to use where `asked` says 0: one a processor, at most 16.
[[nodiscard]] int ThreadCount(int asked);

// Calls work(i, thread) for every i in [0, count) on `threads` threads, this one included. Which thread
// takes which i is left open: work must put its result where i says, so that it is the same for any
// number of threads. `chunk` of them are taken at a time. `work` must not throw.
void ParallelFor(int count, int chunk, int threads, const std::function<void(int, int)>& work);

}  // namespace stridewire
