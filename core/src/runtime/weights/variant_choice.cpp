#include "runtime/weights/variant_choice.h"

#include <algorithm>
#include <span>

#include "runtime/weights/measure.h"

namespace stridewire {
namespace {

// Difference of parameters, as in LargestDifference, at which variants are no longer used.
constexpr double kReachM = 0.5;

}  // namespace

VariantShare ChooseVariant(const MotionGroup& group, const ParameterValues& wanted,
                           const StrideVariation& variation) {
  VariantShare share;
  double highest = 0.0;
  for (int i = 0; i < group.variant_count; ++i) {
    const std::span<const double> own = group.variant(i);
    ParameterValues parameters{.count = group.parameter_count()};
    std::copy(own.begin(), own.end(), parameters.values.begin());
    const double distance_m = LargestDifference(group, parameters, wanted);
    const double nearness = 1.0 - distance_m / kReachM;
    const double score = nearness * variation.VariantScore(i);
    if (!(score > highest)) continue;
    highest = score;
    share = {i, nearness * variation.VariantWeight()};
  }
  return share;
}

}  // namespace stridewire
