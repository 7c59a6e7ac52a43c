#pragma once

#include <cstddef>
#include <cstdint>

#include "runtime/skeleton/leg_rig.h"

namespace stridewire::kernels {

/// The inner loops of evaluation, written once for vectors of any width (Google Highway) and compiled for each
/// instruction set; which one runs is decided when the program does. They use no fused multiply-add, no estimates
/// and no sums across lanes, so that every instruction set gives the same bytes (docs/decisions/0002, 0017).

/// Rows have a multiple of so many floats; batches have so many avatars at most.
inline constexpr std::size_t kBlock = 16;
/// row = sum of weights[e] * examples[e * row_floats ...] over `count` examples, in order.
void SumRows(const float* examples, const float* weights, std::size_t count, std::size_t row_floats,
             float* row);

/// row = sum of weights[k] * points[k], of four rows, in order.
void BlendPoints(const float* const points[4], const float weights[4], std::size_t row_floats,
                 float* row);

/// A time of each movement of a block: one number a lane.
struct GridTimes {
  alignas(64) double time_s[kBlock];
  alignas(64) double begin_s[kBlock], end_s[kBlock];  ///< TimeWarp::Piece
  alignas(64) double begin[kBlock], end[kBlock];
  alignas(64) double begin_slope[kBlock], end_slope[kBlock];
  alignas(64) double last_cell[kBlock];  ///< Points of the grid less two
  alignas(64) double duration_s[kBlock], start_offset_s[kBlock],
      ease_out_s[kBlock];  ///< Of the movement
};
/// Where its poses lie in their grids, and how much of the poses before is left.
struct GridPlaces {
  alignas(64) std::int32_t first_point[kBlock];  ///< Of the rows that are interpolated
  alignas(64) float weights[4][kBlock];          ///< Of them, in order; 0 for one that is not there
  alignas(64) double steered[kBlock];            ///< EaseOut of the part of the movement behind
  alignas(64) float is_eased[kBlock];  ///< 1 while there is something left to ease out, or 0
  alignas(64) float fraction[kBlock];  ///< EaseOut of the part of the easing out behind
  alignas(64) float slope_s[kBlock];   ///< EaseOutSlope of it, times ease_out_s
};
/// In doubles and in the order of operations of TimeWarp::GridPosition, CellWeightsAt and EaseOut.
void FindInGrids(std::size_t count, const GridTimes& times, GridPlaces& places);

/// Movements of one group side by side, whose poses are to be blended: those of the lanes from `lane` on.
struct GridRun {
  const float* grid;  ///< [point][example][row_floats]
  std::size_t examples;
  std::size_t row_floats;
  int point_count;
  std::size_t lane;
  std::size_t lanes;
  std::size_t poses;            ///< Of each movement
  const GridPlaces* places;     ///< [pose]
  const float* const* weights;  ///< [lane]: of the examples; of all kBlock
  float* ring;                  ///< [4][row_floats] for each of `lanes`: scratch
  float* rows;                  ///< [pose][lane][row_floats]: blended; of all kBlock
};

/// Blends the rows of all poses: SumRows of each grid point, BlendPoints of four of them. Movements that pass the same
/// points read the library together.
void BlendRun(const GridRun& run);

/// Rotations of a blended row and, while the movement before is eased out, the difference to it.
struct RotationBlend {
  const float* row;  ///< Summed, as in GridLayout
  std::size_t joint_count;
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

/// Poses of up to kBlock movements side by side, a movement a lane: an array [n][kBlock] holds a number of each. What
/// stands in lanes of nobody is read, but means nothing.

/// to[i][lane] = from[lane][i] for `count` floats. `from` has kBlock entries, none of them null.
void Transpose(const float* const from[kBlock], std::size_t count, std::size_t lanes, float* to);

/// What does not change of a difference while it is eased out, [joint][kEaseFloats][kBlock]: the rotation vector of half
/// the short arc, and the square of its length.
inline constexpr std::size_t kEaseFloats = 4;
/// `difference`: [joint][x y z w][kBlock].
void PrepareEase(const float* difference, std::size_t joint_count, std::size_t lanes, float* ease);
/// fastest[lane] = the square of the longest of `velocity`, [joint][x y z][kBlock].
void FindFastest(const float* velocity, std::size_t joint_count, std::size_t lanes, float* fastest);

/// Blended rows of a block on their way to be its poses in the world.
struct LaneBlend {
  const float* const* rows;  ///< [lane]: a row as in GridLayout, kBlock of them
  std::size_t joint_count;
  std::size_t lanes;
  const double* base_m;       ///< [x y z][kBlock]
  const double* heading_rad;  ///< [kBlock], of the base
  const double* sine;         ///< Of it
  const double* cosine;
  const double* extra_turn_rad;
  const double* steered;  ///< GridPlaces
  // What is left of the poses before, while any lane has something left:
  const float* ease;           ///< PrepareEase, or null
  const float* velocity;       ///< [joint][x y z][kBlock], or null: no lane is inertial
  const float* fastest;        ///< FindFastest of it
  const float* root_ease_m;    ///< [x y z][kBlock]
  const float* root_ease_m_s;  ///< The same of its velocity
  const float* fraction;       ///< GridPlaces
  const float* slope_s;
  const float* is_eased;     ///< [kBlock]: 1 or 0
  const float* is_inertial;  ///< The same; only of those eased
};

/// Makes rotations unit, adds what is left of the poses before and takes the poses into the world: roots
/// [x y z][kBlock], rotations [joint][x y z w][kBlock]. False if a rotation of some lane's row may be shorter than
/// kSmallestNorm (BlendRotations).
[[nodiscard]] bool FinishLanes(const LaneBlend& blend, float* root_m, float* rotations);

/// Balls and ankles of both legs, relative to the root and in world axes: [foot][x y z][kBlock] each. `rotations` as of
/// FinishLanes, of LegRig::joints alone. `rig` is usable.
void FindFeet(const LegRig& rig, const float* rotations, std::size_t lanes, float* balls_m,
              float* ankles_m);

/// A block of poses whose feet are planted, in place.
struct PlantBlock {
  const float* plan;     ///< [number of PackedFootPlan][kBlock]
  const double* time_s;  ///< [kBlock], of the movement
  const double* base_m;  ///< [x y z][kBlock], the movement's base
  float* root_m;         ///< [x y z][kBlock] in the world
  float* rotations;      ///< [joint][x y z w][kBlock]; those of the legs change
};
/// PlantFeet of the first `count` lanes. `rig` is usable.
void PlantLanes(const LegRig& rig, const PlantBlock& block, std::size_t count);

/// One pose whose feet are planted, in place.
struct PlantJob {
  const float* plan = nullptr;  ///< PackedFootPlan
  double time_s = 0.0;          ///< Of its movement
  double base_m[3] = {};        ///< The movement's base
  float* root_m = nullptr;      ///< [3] in the world
  float* rotations = nullptr;   ///< [joint] x y z w; those of the legs change
};
/// PlantFeet of one pose: the same bytes as PlantLanes of it.
void PlantOne(const LegRig& rig, const PlantJob& job);

}  // namespace stridewire::kernels
