#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace stridewire::load {

/// Collects error texts: the first kMaxKept of them, and the number of further ones. Thread-safe.
class ErrorLog {
 public:
  static constexpr std::size_t kMaxKept = 50;

  void Add(std::string text) {
    const std::lock_guard lock(mutex_);
    if (texts_.size() < kMaxKept) {
      texts_.push_back(std::move(text));
    } else {
      ++omitted_;
    }
  }

  [[nodiscard]] bool empty() const {
    const std::lock_guard lock(mutex_);
    return texts_.empty();
  }

  [[nodiscard]] std::vector<std::string> Texts() const {
    const std::lock_guard lock(mutex_);
    std::vector<std::string> texts = texts_;
    if (omitted_ > 0) texts.push_back("and " + std::to_string(omitted_) + " more");
    return texts;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> texts_;
  std::uint64_t omitted_ = 0;
};

}  // namespace stridewire::load
