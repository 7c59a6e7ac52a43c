#pragma once

#include <cstddef>
#include <cstdint>

#include "stridewire/runtime/leg_rig.h"

namespace stridewire::kernels {

/// The inner loops of evaluation, written once for vectors of any width (Google Highway) and compiled for each
/// instruction set; which one runs is decided when the program does. They use no fused multiply-add, no estimates
/// and no sums across lanes, so that every instruction set gives the same bytes (docs/decisions/0002, 0017).

/// Rows have a multiple of so many floats; batches have so many avatars at most.
inline constexpr std::size_t kBlock = 16;
/// The longest row of a grid.
inline constexpr std::size_t kMaxRowFloats = 4 * (static_cast<std::size_t>(kMaxJoints) + 8);

/// row = sum of weights[e] * examples[e * row_floats ...] over `count` examples, in order.
void SumRows(const float* examples, const float* weights, std::size_t count, std::size_t row_floats,
             float* row);

/// row = sum of weights[k] * points[k], of four rows, in order.
void BlendPoints(const float* const points[4], const float weights[4], std::size_t row_floats,
                 float* row);

/// Where the poses of a block lie in their movements' grids, and how much of the poses before is left: one number a
/// pose. In doubles and in the order of operations of TimeWarp::GridPosition, CellWeightsAt and EaseOut.
struct GridTimes {
  // What is known of each:
  alignas(64) double time_s[kBlock];
  alignas(64) double begin_s[kBlock], end_s[kBlock];  ///< TimeWarp::Piece
  alignas(64) double begin[kBlock], end[kBlock];
  alignas(64) double begin_slope[kBlock], end_slope[kBlock];
  alignas(64) double last_cell[kBlock];  ///< Points of the grid less two
  alignas(64) double duration_s[kBlock], entered_s[kBlock],
      ease_out_s[kBlock];  ///< Of the movement
  // What follows:
  alignas(64) double first_point[kBlock];  ///< Of the rows that are interpolated
  alignas(64) float weights[4][kBlock];    ///< Of them, in order; 0 for one that is not there
  alignas(64) double steered[kBlock];      ///< EaseOut of the part of the movement behind
  alignas(64) double eased[kBlock];    ///< Part of the easing out that is behind, above 1 beyond it
  alignas(64) float fraction[kBlock];  ///< EaseOut of that
  alignas(64) float slope_s[kBlock];   ///< EaseOutSlope of it, times ease_out_s
};
void FindInGrids(std::size_t count, GridTimes& times);

/// Rotations of a blended row and, while the movement before is eased out, the difference to it.
struct RotationBlend {
  const float* row;    ///< Summed; `padded` joints lie component by component, as in GridLayout
  std::size_t padded;  ///< Joints in the row. Up to kBlock floats beyond it are read
  std::size_t joint_count;  ///< Joints written
  const float* difference;  ///< [joint] x y z w, or null; see slerp below
  float fraction;           ///< r := r slerp(1, difference, fraction), in [0, 1]
  const float* velocity;    ///< [joint] x y z rotation vectors a second, or null
  float seconds;            ///< r := r * rotation along seconds * velocity
};

/// out[joint] x y z w, unit. False if a rotation of the row is shorter than kSmallestNorm: rotations that cancel each
/// other have no mean, and what is written of such a joint means nothing.
[[nodiscard]] bool BlendRotations(const RotationBlend& blend, float* out);

/// Sums of rotations that are shorter are none.
inline constexpr float kSmallestNorm = 0.1f;

/// Sine and cosine of `count` angles, the same bits as Sin and Cos of base/trig.h. |x| <= 1e5.
void SinCos(const double* angles_rad, std::size_t count, double* sines, double* cosines);

/// One pose whose feet are planted, in place or from one place to another.
struct PlantJob {
  const float* plan = nullptr;    ///< PackedFootPlan
  double time_s = 0.0;            ///< Of its movement
  double base_m[3] = {};          ///< The movement's base
  const float* root_m = nullptr;  ///< [3] blended, in the world
  float* rotations = nullptr;     ///< [joint] x y z w, blended; those of the legs change
  float* root_out_m = nullptr;    ///< [3] planted; may be root_m
};

/// PlantFeet of `count` poses of one skeleton. `rig` is usable.
void PlantPoses(const LegRig& rig, const PlantJob* jobs, std::size_t count);

}  // namespace stridewire::kernels
