#pragma once

#include <cstddef>
#include <cstdint>

namespace stridewire {

/// Random deviations of one step from the planned one, so that an avatar does not repeat equal
/// steps exactly. They depend only on the seed of the avatar and on the number of the movement.
class StrideVariation {
 public:
  /// Maximum deviation of RateFactor() from 1.
  static constexpr double kMaxRateChange = 0.036;

  /// `movement_number` counts the movements of the avatar.
  StrideVariation(std::uint64_t seed, std::uint64_t movement_number);

  /// Returns the factor for the playback speed of the step. Its deviation from 1 is the mean of two
  /// random values, one of this step and one of the previous step, because successive strides of
  /// people are correlated (Hausdorff et al. 1995). The duration of a stride (two steps) then
  /// varies by 1.3 %, as in young adults (Hausdorff et al. 1996; decision 0041).
  [[nodiscard]] double RateFactor() const;

  /// Returns a number in [-1, 1) for an example. These numbers form the direction in which the
  /// weights of the step deviate.
  [[nodiscard]] double WeightDirection(std::size_t example) const;

  /// Returns a number in [0, 1) for a variant of a group (see MotionGroup), by which ChooseVariant
  /// chooses among them.
  [[nodiscard]] double VariantScore(int variant) const;

  /// Returns the weight of the chosen variant if it fits perfectly, in [0.7, 1).
  [[nodiscard]] double VariantWeight() const;

 private:
  std::uint64_t bits_;
  std::uint64_t previous_bits_;
};

}  // namespace stridewire
