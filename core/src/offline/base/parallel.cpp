#include "offline/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace stridewire {

int ThreadCount(int requested) {
  constexpr int kMaxThreads = 16;
  const int count =
      requested > 0 ? requested : static_cast<int>(std::thread::hardware_concurrency());
  return std::clamp(count, 1, kMaxThreads);
}

void ParallelFor(int count, int chunk, int threads, const std::function<void(int, int)>& work) {
  std::atomic<int> next{0};
  const auto run = [&](int thread) {
    for (;;) {
      const int begin = next.fetch_add(chunk, std::memory_order_relaxed);
      if (begin >= count) return;
      for (int i = begin; i < std::min(begin + chunk, count); ++i) work(i, thread);
    }
  };
  std::vector<std::jthread> others;
  for (int thread = 1; thread < threads && thread * chunk < count; ++thread) {
    others.emplace_back(run, thread);
  }
  run(0);
}

}  // namespace stridewire
