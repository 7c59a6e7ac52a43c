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

/// row = sum of weights[e] * examples[e * row_floats ...] over `count` examples, in order.
void SumRows(const float* examples, const float* weights, std::size_t count, std::size_t row_floats,
             float* row);

/// SumRows, then each of the first `joint_count` quaternions made unit. `padded` joints lie component by component, as
/// in GridLayout. Returns how many norms fell below 0.1: their components are left as they were summed. All pointers
/// 4-byte aligned; up to kBlock floats beyond the row are read.
[[nodiscard]] std::uint32_t BlendRow(const float* examples, const float* weights, std::size_t count,
                                     std::size_t row_floats, std::size_t padded,
                                     std::size_t joint_count, float* row);

/// Local rotations between four grid rows and, while the movement before is eased out, the difference to it.
struct RotationBlend {
  const float* rows[4] =
      {};  ///< Blended rows around the cell; signs are taken along rows[1]. Read as BlendRow's
  float weights[4] = {};              ///< Of the rows, 0 for one that is not there
  std::size_t padded = 0;             ///< Joints in a row
  std::size_t joint_count = 0;        ///< Joints written
  const float* difference = nullptr;  ///< [joint] x y z w, or null; see slerp below
  float fraction = 0.0f;              ///< r := r slerp(1, difference, fraction), in [0, 1]
  const float* velocity = nullptr;    ///< [joint] x y z rotation vectors a second, or null
  float seconds = 0.0f;               ///< r := r * rotation along seconds * velocity
};

/// out[joint] x y z w, unit. Norms below 1e-12 give the identity.
void BlendRotations(const RotationBlend& blend, float* out);

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
