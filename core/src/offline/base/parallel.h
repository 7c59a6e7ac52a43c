#pragma once

#include <functional>

namespace stridewire {

// Returns `requested`, or the number of processors if it is 0; 1 to 16 in either case.
[[nodiscard]] int ThreadCount(int requested);

// Calls work(i, thread) for every i in [0, count) on at most `threads` threads, one of which is the
// calling thread. `thread` is an index in [0, threads). Each thread takes `chunk` successive values
// of i at a time. Which thread handles which i is unspecified, so `work` must store its results by
// i if they may not depend on the number of threads. `work` must not throw.
void ParallelFor(int count, int chunk, int threads, const std::function<void(int, int)>& work);

}  // namespace stridewire
