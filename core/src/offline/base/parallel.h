#pragma once

#include <functional>

namespace stridewire {

// Returns `requested`, or the number of processors if it is 0; 1 to 16 in either case.
[[nodiscard]] int ThreadCount(int requested);

// Calls work(i, thread) for every i in [0, count) on `threads` threads, including the calling one,
// in chunks of `chunk` calls. The assignment of i to threads is unspecified. For results that do
// not depend on the number of threads, `work` must store its result by i. `work` must not throw.
void ParallelFor(int count, int chunk, int threads, const std::function<void(int, int)>& work);

}  // namespace stridewire
