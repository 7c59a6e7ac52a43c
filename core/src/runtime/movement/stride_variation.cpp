#include "runtime/movement/stride_variation.h"

#include "base/scramble.h"

namespace stridewire {
namespace {

// Maps random bits to a number in [-1, 1).
double SignedFractionOf(std::uint64_t bits) { return 2.0 * FractionOf(bits) - 1.0; }

// Numbers of the random values of one step. Those of WeightDirection begin at 1 and end at the
// maximum number of examples.
constexpr std::uint64_t kVariantWeight = 100'000;
constexpr std::uint64_t kFirstVariant = 100'001;

}  // namespace

StrideVariation::StrideVariation(std::uint64_t seed, std::uint64_t movement_number)
    : bits_(Scramble(Scramble(seed) + movement_number)),
      previous_bits_(Scramble(Scramble(seed) + movement_number - 1)) {}

double StrideVariation::RateFactor() const {
  return 1.0 + 0.5 * kMaxRateChange * (SignedFractionOf(bits_) + SignedFractionOf(previous_bits_));
}

double StrideVariation::WeightDirection(std::size_t example) const {
  return SignedFractionOf(Scramble(bits_ + 1 + example));
}

double StrideVariation::VariantScore(int variant) const {
  return FractionOf(Scramble(bits_ + kFirstVariant + static_cast<std::uint64_t>(variant)));
}

double StrideVariation::VariantWeight() const {
  return 0.7 + 0.3 * FractionOf(Scramble(bits_ + kVariantWeight));
}

}  // namespace stridewire
