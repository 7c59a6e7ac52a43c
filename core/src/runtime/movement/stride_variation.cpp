#include "runtime/movement/stride_variation.h"

#include "base/scramble.h"

namespace stridewire {
namespace {

// Maps random bits to a number in [-1, 1).
double SignedFractionOf(std::uint64_t bits) { return 2.0 * FractionOf(bits) - 1.0; }

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

}  // namespace stridewire
