#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "offline/complete/posture_mix.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire::complete {

/// Number of points per keytime interval at which the mean stride is stored.
inline constexpr int kPointsPerInterval = 16;
/// Number of keytime intervals of a step: between start, toe-off, heel-strike and end.
inline constexpr int kIntervals = 3;
inline constexpr int kPointCount = kIntervals * kPointsPerInterval + 1;

/// Mean of the level, straight strides of one foot in the captures, as a function of generic time.
/// See MeasureStride. The horizontal origin is the ball of the fixed foot.
struct StrideModel {
  std::vector<PostureSample> points;  ///< [point]
  std::array<double, kIntervals + 1> keytimes_s{};
  double start_length_m = 0.0;  ///< Distance by which the fixed foot is ahead at the start.
  double end_length_m = 0.0;    ///< Distance by which the moving foot is ahead at the end.
  /// Sideways distance from the fixed to the moving foot, positive outward; mean of start and end.
  double width_m = 0.0;

  /// [point]: distance from hip to ankle of the fixed foot's leg. Set by MeasureLegs.
  std::vector<double> leg_m;

  /// Velocities of the root at the ends of the stride, in m/s. Set by JoinStrides: the velocity at
  /// the end of one foot's stride equals that at the start of the other foot's stride.
  DVec3 start_velocity = DVec3(0.0);
  DVec3 end_velocity = DVec3(0.0);

  /// Returns the posture at a generic time in [0, 3].
  [[nodiscard]] PostureSample At(double generic_time) const;
  /// Returns the distance from hip to ankle of the fixed foot's leg at a generic time in [0, 3].
  [[nodiscard]] double LegAt(double generic_time) const;
  /// Writes the posture at a generic time in [0, 3] to `out`, whose memory it reuses.
  void Sample(double generic_time, PostureSample& out) const;
  /// Same, but writes only the root, the feet and the rotations of `joints`.
  void Sample(double generic_time, std::span<const std::size_t> joints, PostureSample& out) const;
  /// Return the velocities of the root at the start and at the end of the mean stride, in m/s. They
  /// are averages over half of the first and half of the last keytime interval.
  [[nodiscard]] DVec3 MeasuredStartVelocity() const;
  [[nodiscard]] DVec3 MeasuredEndVelocity() const;
};

/// Changes the strides of both feet so that each continues the other. The end of one stride and
/// the start of the other are averages of different steps, so they differ. Both get the mean of
/// their postures and velocities. The corrections fade out over 45 % of the duration of each
/// stride, and those of the feet within double support.
void JoinStrides(std::array<StrideModel, 2>& strides);

/// Measures the distance from hip to ankle of the fixed foot's leg at each point of both strides,
/// and stores it in StrideModel::leg_m.
void MeasureLegs(const Skeleton& skeleton, const LegRig& rig, std::array<StrideModel, 2>& strides);

/// Returns the time of a point of a stride with these keytimes.
[[nodiscard]] double TimeAtPoint(std::span<const double> keytimes_s, std::size_t point);

/// Returns the mean of the level, straight strides of a foot in the first captured group that
/// contains any. Omits steps over obstacles and strides of unusual length. If there are strides of
/// the other foot only, uses their mirror images, provided that the skeleton can be mirrored.
/// Returns nullopt if there are no strides.
[[nodiscard]] std::optional<StrideModel> MeasureStride(const RawLibrary& library, Foot moving);

}  // namespace stridewire::complete
