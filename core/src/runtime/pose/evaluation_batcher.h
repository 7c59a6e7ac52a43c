#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/pose/soa_pose_evaluator.h"

namespace stridewire {

/// Returns the number of poses that are not later than the end of a movement, clamped to 1 to
/// `most`. The first pose is at `time_s`, and poses are `ticks_apart` ticks of `step_s` seconds
/// apart.
[[nodiscard]] int SampleRunCount(const Movement& movement, double time_s, double step_s,
                                 int ticks_apart, int most);

/// Collects sample runs of different lengths and evaluates similar runs side by side.
///
/// Runs are similar if all or none have planted feet, if they have the same length and the same
/// group, and if they begin at about the same fraction of their movements. Similar runs read the
/// same parts of the library, and their difference poses fade out at about the same time. The
/// batcher keeps its memory between evaluations.
class EvaluationBatcher {
 public:
  /// Maximum number of poses per run.
  static constexpr int kMaxCount = 32;

  struct Item {
    SampleRun run;
    std::uint32_t key = 0;  ///< Sort key. Similar runs have similar keys.
    std::uint32_t tag = 0;  ///< Identifies the run for the caller.
    int count = 1;          ///< Number of poses in the run.
    bool is_planted = false;
  };

  /// Reserves memory for this number of runs. Up to that number, no other function allocates.
  void Reserve(std::size_t runs);

  /// Properties on which the sort key of a run depends, besides its time and its length.
  struct Similarity {
    double duration_s = 0.0;
    bool is_planted = false;
    std::uint8_t group = 0;
  };
  [[nodiscard]] static Similarity SimilarityOf(const Movement& movement);

  /// Adds a run of `count` poses, 1 to kMaxCount. Its movement must stay alive until Evaluate
  /// returns.
  void Add(const SampleRun& run, int count, std::uint32_t tag) {
    Add(run, SimilarityOf(*run.movement), count, tag);
  }
  /// Same for a caller that has kept the result of SimilarityOf. Does not read the movement, which
  /// is often not in the processor's cache.
  void Add(const SampleRun& run, const Similarity& similarity, int count, std::uint32_t tag);
  [[nodiscard]] bool empty() const { return items_.empty(); }

  /// Evaluates all added runs in blocks of up to SoaPose::kLanes and then removes them. For each
  /// pose index of a block it calls
  ///   use(std::span<const Item> items, int pose, const SoaPose& poses)
  /// Lane i of `poses` contains the pose with index `pose` of items[i]. If items[i] has no such
  /// pose (`pose` >= items[i].count), lane i is undefined.
  template <typename Use>
  void Evaluate(SoaPoseEvaluator& evaluator, Use&& use) {
    Sort();
    const std::span<const Item> all = order_;
    std::array<SampleRun, SoaPose::kLanes> runs;
    for (std::size_t begin = 0; begin < all.size();) {
      const std::span<const Item> block = BlockAt(begin);
      const std::size_t end = begin + block.size();
      const int count = block.front().count;
      for (std::size_t i = 0; i < block.size(); ++i) runs[i] = block[i].run;
      evaluator.Begin(std::span(runs).first(block.size()), count);
      for (int pose = 0; pose < count; ++pose) {
        PrefetchNext(end, pose, count);
        use(block, pose, evaluator.Next());
      }
      begin = end;
    }
    items_.clear();
  }

 private:
  void Sort();
  [[nodiscard]] std::span<const Item> BlockAt(std::size_t begin) const;
  void PrefetchNext(std::size_t end, int pose, int count) const;

  // Sort key of an item and its index in items_.
  struct SortEntry {
    std::uint32_t key;
    std::uint32_t item;
  };
  std::vector<Item> items_;
  std::vector<Item> order_;
  std::vector<SortEntry> entries_;
  std::vector<SortEntry> sorted_;
};

}  // namespace stridewire
