#pragma once

#include <cstddef>
#include <cstdint>

#include "runtime/skeleton/leg_rig.h"

namespace stridewire::kernels {

/// The inner loops of pose evaluation. They are written once for vectors of any width (Google
/// Highway) and compiled for each instruction set; the program chooses one at run time. They use no
/// fused multiply-add, no approximate instructions and no sums across lanes, so that every
/// instruction set produces the same bytes (docs/decisions/0002, 0017).
///
/// Most kernels process poses of up to kBlock movements side by side, one movement per lane. An
/// array [n][kBlock] contains n numbers per lane. Unused lanes are read, but their content does not
/// matter.

/// Maximum number of movements per block. The length of grid rows (GridLayout::row_floats) is a
/// multiple of this number.
inline constexpr std::size_t kBlock = 16;

/// Computes the weighted sum of the rows of `count` examples:
/// row[i] = sum of weights[e] * examples[e * row_floats + i], added in the order of e.
void SumRows(const float* examples, const float* weights, std::size_t count, std::size_t row_floats,
             float* row);

/// Computes the weighted sum of four rows: row[i] = sum of weights[k] * points[k][i], added in the
/// order of k.
void BlendPoints(const float* const points[4], const float weights[4], std::size_t row_floats,
                 float* row);

/// For each lane: a time of its movement, and the piece of the movement's time warp at this time.
struct GridTimes {
  alignas(64) double time_s[kBlock];
  alignas(64) double begin_s[kBlock], end_s[kBlock];  ///< TimeWarp::Piece
  alignas(64) double begin[kBlock], end[kBlock];
  alignas(64) double begin_slope[kBlock], end_slope[kBlock];
  alignas(64) double last_cell[kBlock];  ///< Index of the last cell: number of grid points - 2
  /// Copies of the members of Movement that have these names.
  alignas(64) double duration_s[kBlock], start_offset_s[kBlock], ease_out_s[kBlock];
};
/// Values at the times in GridTimes, one per lane: weights of grid points, and remaining fractions
/// of extra turns and difference poses.
struct GridSamples {
  alignas(64) std::int32_t first_point[kBlock];  ///< First of the four points to interpolate
  /// Weights of these points; 0 beyond the last point
  alignas(64) float weights[4][kBlock];
  /// Fraction of Movement::extra_turn_rad that is still to come
  alignas(64) double remaining_turn[kBlock];
  /// 1 while part of the difference pose remains, otherwise 0.
  alignas(64) float is_eased[kBlock];
  /// Remaining fraction of the difference pose: EaseOut of the elapsed fraction of the ease-out
  alignas(64) float fraction[kBlock];
  /// EaseOutSlope of the same elapsed fraction, times ease_out_s
  alignas(64) float slope_s[kBlock];
};
/// Computes the samples for `count` times. The weights are Catmull-Rom weights of the four grid
/// points around the position that the time warp determines. Points beyond the ends of the grid are
/// extrapolated quadratically. Uses doubles and performs the operations of TimeWarp::GridPosition,
/// CellWeightsAt and EaseOut in the same order, so that the results have the same bits.
void ComputeGridSamples(std::size_t count, const GridTimes& times, GridSamples& samples);

/// Input and output of BlendRows, which blends the poses of several movements of one group. The
/// movements are in `lanes` successive lanes, beginning with `lane`.
struct BlendRowsJob {
  const float* grid;  ///< [point][example][row_floats]
  std::size_t examples;
  std::size_t row_floats;
  int point_count;
  std::size_t lane;
  std::size_t lanes;
  std::size_t poses;            ///< Number of poses per movement
  const GridSamples* samples;   ///< [pose]
  const float* const* weights;  ///< [kBlock][example]
  float* ring;                  ///< Scratch: [4][row_floats] for each of `lanes`
  float* rows;                  ///< Output: [pose][kBlock][row_floats]
};

/// Blends the rows of all poses: SumRows for each grid point, then BlendPoints for each pose. Two
/// movements at a time read the rows of a grid point that both need, so the library is read less
/// often.
void BlendRows(const BlendRowsJob& run);

/// Rotations of a blended row and the difference pose that is added to them.
struct RotationBlend {
  const float* row;  ///< Blended row in the layout of GridLayout
  std::size_t joint_count;
  const float* difference;  ///< [joint] x y z w: difference pose, or null if there is none.
  /// Fraction of the difference pose to add, in [0, 1]: r := r slerp(1, difference, fraction).
  float fraction;
  /// [joint] x y z: velocity of the difference pose as rotation vectors per second, or null.
  const float* velocity;
  /// Time by which the velocity is multiplied: r := r q, where q is approximately the rotation by
  /// the rotation vector seconds * velocity.
  float seconds;
};

/// Adds the difference pose to the rotations of the row, and writes the normalized results to
/// out[joint] x y z w. Returns false if a rotation of the row is shorter than kSmallestNorm. In
/// this case, the examples' rotations cancel each other out and have no mean, and the output for
/// that joint is undefined.
[[nodiscard]] bool BlendRotations(const RotationBlend& blend, float* out);

/// If a weighted sum of quaternions is shorter than this, it does not determine a rotation
/// reliably.
inline constexpr float kSmallestNorm = 0.1f;

/// A layer that is blended over the rotations of some joints of a pose.
struct LayerBlend {
  const float* keys[4];        ///< [joint_count] x y z w: the keys around the current time
  const float* key_weights;    ///< [4]: their weights, with sum 1
  const int* joints;           ///< [joint_count]: joints of the pose that the layer moves
  const float* joint_weights;  ///< [joint_count]: weights of these joints, in (0, 1]
  std::size_t joint_count;
  float weight;  ///< Weight of the layer, in [0, 1]
};
/// Changes the rotation r of each of the layer's joints (rotations[joint] x y z w) to
/// r slerp(1, r^-1 c, weight * joint weight), where c is the weighted mean of the keys.
void BlendLayer(const LayerBlend& layer, float* rotations);

/// Computes sine and cosine of `count` angles with |x| <= 1e5. The results have the same bits as
/// Sin and Cos of base/trig.h.
void SinCos(const double* angles_rad, std::size_t count, double* sines, double* cosines);

/// Transposes `count` floats of each of the first `lanes` lanes: to[i][lane] = from[lane][i].
/// `from` has kBlock entries, none of them null.
void Transpose(const float* const from[kBlock], std::size_t count, std::size_t lanes, float* to);

/// Copies the rotations of `joint_count` joints from each lane to a separate array of quaternions:
/// to[lane][j] = rotations[j][x y z w][lane].
void ScatterRotations(const float* rotations, std::size_t joint_count, std::size_t lanes,
                      float* const* to);

/// Number of floats per joint that PrepareDifferences writes: the rotation vector of half the
/// rotation, along the shorter arc, and the square of its length.
inline constexpr std::size_t kDifferenceFloats = 4;
/// Precomputes, for a difference pose [joint][x y z w][kBlock], the values that stay constant while
/// it fades out: [joint][kDifferenceFloats][kBlock].
void PrepareDifferences(const float* difference, std::size_t joint_count, std::size_t lanes,
                        float* ease);
/// Sets fastest[lane] to the largest squared length of the vectors of that lane in `velocity`,
/// [joint][x y z][kBlock].
void FindLargestVelocities(const float* velocity, std::size_t joint_count, std::size_t lanes,
                           float* fastest);

/// Input of FinishPoses: the blended rows of a block and the difference poses to add to them.
struct FinishPosesJob {
  const float* const* rows;  ///< [kBlock]: rows in the layout of GridLayout
  std::size_t joint_count;
  std::size_t lanes;
  const double* base_m;          ///< [x y z][kBlock]: position of each movement's base frame
  const double* heading_rad;     ///< [kBlock]: heading of each base frame
  const double* sine;            ///< [kBlock]: sine of the heading
  const double* cosine;          ///< [kBlock]: cosine of the heading
  const double* extra_turn_rad;  ///< [kBlock]: Movement::extra_turn_rad
  const double* remaining_turn;  ///< GridSamples::remaining_turn
  // Remaining difference poses. Unused if `ease` is null.
  const float* ease;  ///< Output of PrepareDifferences; null if no lane has a difference left
  /// [joint][x y z][kBlock]: velocity of the difference pose; null if no lane is inertial
  /// (Movement::is_inertial)
  const float* velocity;
  const float* fastest;        ///< Output of FindLargestVelocities for `velocity`
  const float* root_ease_m;    ///< [x y z][kBlock]: difference of the root position
  const float* root_ease_m_s;  ///< [x y z][kBlock]: velocity of that difference
  const float* fraction;       ///< GridSamples::fraction
  const float* slope_s;        ///< GridSamples::slope_s
  const float* is_eased;       ///< GridSamples::is_eased
  /// [kBlock]: 1 if the lane is inertial, else 0; ignored for lanes that are not eased
  const float* is_inertial;
};

/// Normalizes rotations, adds the remaining difference poses and transforms the poses into world
/// space. Writes roots [x y z][kBlock] and rotations [joint][x y z w][kBlock]. Returns false if a
/// rotation in a row of some lane may be shorter than kSmallestNorm (see BlendRotations).
[[nodiscard]] bool FinishPoses(const FinishPosesJob& blend, float* root_m, float* rotations);

/// Positions of both feet, relative to the root and in world axes, each [foot][x y z][kBlock].
struct FeetPositions {
  float* balls_m;
  float* ankles_m;
  float* toe_tips_m;
};

/// Computes the positions of the feet. `rotations` has the layout that FinishPoses writes, but only
/// for the joints in LegRig::joints. `rig` must be usable.
void ComputeFeet(const LegRig& rig, const float* rotations, std::size_t lanes,
                 const FeetPositions& feet);

/// A block of poses whose feet are to be planted. PlantPoses modifies the poses in place.
struct PlantPosesJob {
  const float* plan;     ///< [kPackedPlanFloats][kBlock]: transposed PackedFootPlan of each lane
  const double* time_s;  ///< [kBlock]: time since the start of the movement
  const double* base_m;  ///< [x y z][kBlock]: base position of the movement
  float* root_m;         ///< [x y z][kBlock]: root positions in world space; changed by planting
  /// [joint][x y z w][kBlock]: rotations; planting changes those of hips, knees, ankles and toes
  float* rotations;
};
/// Plants the feet of the first `count` lanes, as PlantFeet does. `rig` must be usable.
void PlantPoses(const LegRig& rig, const PlantPosesJob& block, std::size_t count);

/// One pose whose feet are to be planted. PlantPose modifies the pose in place.
struct PlantPoseJob {
  const float* plan = nullptr;  ///< PackedFootPlan
  double time_s = 0.0;          ///< Time since the start of the movement
  double base_m[3] = {};        ///< Base position of the movement
  float* root_m = nullptr;      ///< [3]: root position in world space; changed by planting
  /// [joint] x y z w: rotations; planting changes those of hips, knees, ankles and toes
  float* rotations = nullptr;
};
/// Plants the feet of one pose. The result has the same bytes as that of PlantPoses.
void PlantPose(const LegRig& rig, const PlantPoseJob& job);

}  // namespace stridewire::kernels
