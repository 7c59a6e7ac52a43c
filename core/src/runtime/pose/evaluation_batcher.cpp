#include "runtime/pose/evaluation_batcher.h"

#include "base/check.h"

namespace stridewire {

namespace {

// The radix sort takes two passes, one per half of the key.
constexpr int kHalfBits = 11;
constexpr std::uint32_t kHalfMask = (1u << kHalfBits) - 1;
// The sort key divides the time within a movement into this many parts.
constexpr std::uint32_t kParts = 64;

}  // namespace

int SampleRunCount(const Movement& movement, double time_s, double step_s, int ticks_apart,
                   int most) {
  STRIDEWIRE_CHECK(step_s > 0.0 && ticks_apart >= 1 && most >= 1);
  const double apart_s = step_s * ticks_apart;
  const double left = (movement.duration_s() - time_s) / apart_s;
  if (!(left < most)) return most;
  return std::max(1, static_cast<int>(left) + 1);
}

void EvaluationBatcher::Reserve(std::size_t runs) {
  items_.reserve(runs);
  order_.reserve(runs);
  entries_.reserve(runs);
  sorted_.reserve(runs);
}

EvaluationBatcher::Similarity EvaluationBatcher::SimilarityOf(const Movement& movement) {
  STRIDEWIRE_CHECK(movement.group >= 0);
  return {movement.duration_s(), movement.feet.is_active,
          static_cast<std::uint8_t>(static_cast<std::uint32_t>(movement.group) & 0xffu)};
}

void EvaluationBatcher::Add(const SampleRun& run, const Similarity& similarity, int count,
                            std::uint32_t tag) {
  STRIDEWIRE_CHECK(count >= 1 && count <= kMaxCount && run.movement != nullptr);
  const double part = std::clamp(run.time_s / similarity.duration_s, 0.0, 1.0);
  // Runs without foot planting come first, and longer runs come before shorter ones.
  auto key = similarity.is_planted ? 1u : 0u;
  key = key << 5 | static_cast<std::uint32_t>(kMaxCount - count);
  key = key << 8 | similarity.group;
  key = key << 6 | static_cast<std::uint32_t>(part * (kParts - 1));
  items_.push_back({run, key, tag, count, similarity.is_planted});
}

void EvaluationBatcher::Sort() {
  entries_.resize(items_.size());
  sorted_.resize(items_.size());
  order_.resize(items_.size());
  for (std::uint32_t i = 0; i < items_.size(); ++i) entries_[i] = {items_[i].key, i};
  const auto pass = [](std::span<const SortEntry> from, std::span<SortEntry> to, int shift) {
    std::array<std::uint32_t, kHalfMask + 2> begins{};
    for (const SortEntry& entry : from) ++begins[(entry.key >> shift & kHalfMask) + 1];
    for (std::size_t i = 1; i < begins.size(); ++i) begins[i] += begins[i - 1];
    for (const SortEntry& entry : from) to[begins[entry.key >> shift & kHalfMask]++] = entry;
  };
  pass(entries_, sorted_, 0);
  pass(sorted_, entries_, kHalfBits);
  for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = items_[entries_[i].item];
}

std::span<const EvaluationBatcher::Item> EvaluationBatcher::BlockAt(std::size_t begin) const {
  STRIDEWIRE_CHECK(begin < order_.size() && order_.size() == items_.size());
  std::size_t end = std::min(begin + SoaPose::kLanes, order_.size());
  const bool is_planted = order_[begin].is_planted;
  // All runs of a block must have planting, or none. Runs with planting come last, so a block that
  // begins without planting ends before the first of them.
  while (order_[end - 1].is_planted != is_planted) --end;
  // The first run of a block determines how many poses are evaluated, so no other run may be
  // longer.
  STRIDEWIRE_CHECK(order_[end - 1].count <= order_[begin].count);
  return std::span(order_).subspan(begin, end - begin);
}

// Call it for each pose of a block. Each call prefetches a part of the data of the next two blocks:
// the arrays to which the movements of the next block point, and the movements of the block after
// it.
void EvaluationBatcher::PrefetchNext(std::size_t end, int pose, int count) const {
  const std::size_t lanes = SoaPose::kLanes;
  const auto first = static_cast<std::size_t>(pose) * lanes / static_cast<std::size_t>(count);
  const auto last = static_cast<std::size_t>(pose + 1) * lanes / static_cast<std::size_t>(count);
  for (std::size_t i = first; i < last; ++i) {
    if (end + lanes + i < order_.size()) {
      SoaPoseEvaluator::PrefetchMovement(*order_[end + lanes + i].run.movement);
    }
    if (end + i < order_.size()) SoaPoseEvaluator::Prefetch(order_[end + i].run);
  }
}

}  // namespace stridewire
