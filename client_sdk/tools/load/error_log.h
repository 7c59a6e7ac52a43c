#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace stridewire::load {

/// Collects what went wrong, from any thread: the first kMaxKept texts and how many more there were.
class ErrorLog {
 public:
  static constexpr std::size_t kMaxKept = 50;

  void Add(std::string text) {
    const std::lock_guard lock(mutex_);
    if (texts_.size() < kMaxKept) {
      texts_.push_back(std::move(text));
    } else {
      ++left_out_;
    }
  }

  [[nodiscard]] bool empty() const {
    const std::lock_guard lock(mutex_);
    return texts_.empty();
  }

  [[nodiscard]] std::vector<std::string> Texts() const {
    const std::lock_guard lock(mutex_);
    std::vector<std::string> texts = texts_;
    if (left_out_ > 0) texts.push_back("and " + std::to_string(left_out_) + " more");
    return texts;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> texts_;
  std::uint64_t left_out_ = 0;
};

}  // namespace stridewire::load
