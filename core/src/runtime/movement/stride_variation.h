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

  /// Returns the factor for the playback speed of the step. Half of its deviation is random for
  /// this step, and the other half is that of the previous step, because successive strides of
  /// people are correlated (Hausdorff et al. 1995). The times of strides, which are two steps, then
  /// vary by 1.3 %, like those of young adults (Hausdorff et al. 1996; decision 0041).
  [[nodiscard]] double RateFactor() const;

  /// Returns a number in [-1, 1) for an example. These numbers form the direction in which the
  /// weights of the step deviate.
  [[nodiscard]] double WeightDirection(std::size_t example) const;

 private:
  std::uint64_t bits_;
  std::uint64_t previous_bits_;
};

}  // namespace stridewire
