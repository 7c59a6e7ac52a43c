#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/pose/soa_pose_evaluator.h"

namespace stridewire {

/// How many poses of a movement, from `time_s` on and `ticks_apart` ticks of `step_s` apart, come before its end: 1 to
/// `most`.
[[nodiscard]] int SampleRunCount(const Movement& movement, double time_s, double step_s,
                               int ticks_apart, int most);

/// Stretches of different lengths that wait to be evaluated, in the order in which those that are alike lie side by side:
/// planted or not, equally long, of one group and at about the same part of it, so that they read the same of the
/// library and ease out together. Keeps its memory.
class EvaluationBatcher {
 public:
  /// Of more poses none may be asked for at once.
  static constexpr int kMaxCount = 32;

  struct Item {
    SampleRun stretch;
    std::uint32_t key = 0;  ///< What is alike comes together
    std::uint32_t tag = 0;  ///< The caller's
    int count = 1;          ///< Poses
  };

  /// `count`: 1 to kMaxCount.
  void Add(const SampleRun& stretch, int count, std::uint32_t tag);
  [[nodiscard]] bool empty() const { return items_.empty(); }

  /// Evaluates all of them, and forgets them. For the poses of each block of stretches one after the other calls
  ///   use(std::span<const Item> items, int pose, const SoaPose& poses)
  /// where `poses` has the pose of items[i], its `pose`th, in lane i; those beyond an item's count mean nothing.
  template <typename Use>
  void Evaluate(SoaPoseEvaluator& evaluator, Use&& use) {
    Sort();
    const std::span<const Item> all = order_;
    std::array<SampleRun, SoaPose::kLanes> stretches;
    for (std::size_t begin = 0; begin < all.size();) {
      const std::span<const Item> block = BlockAt(begin);
      const std::size_t end = begin + block.size();
      const int count = block.front().count;
      for (std::size_t i = 0; i < block.size(); ++i) stretches[i] = block[i].stretch;
      evaluator.Begin(std::span(stretches).first(block.size()), count);
      for (int pose = 0; pose < count; ++pose) {
        PrefetchBehind(end, pose, count);
        use(block, pose, evaluator.Next());
      }
      begin = end;
    }
    items_.clear();
  }

 private:
  void Sort();
  [[nodiscard]] std::span<const Item> BlockAt(std::size_t begin) const;
  void PrefetchBehind(std::size_t end, int pose, int count) const;

  // Key and place of an item.
  struct Place {
    std::uint32_t key;
    std::uint32_t item;
  };
  std::vector<Item> items_;
  std::vector<Item> order_;
  std::vector<Place> places_;
  std::vector<Place> sorted_;
};

}  // namespace stridewire
