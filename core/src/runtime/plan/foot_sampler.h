#pragma once

#include <cstddef>
#include <span>

#include "runtime/pose/pose_kernels.h"
#include "runtime/movement/foot_plan.h"
#include "stridewire/runtime/motion_library.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"

namespace stridewire {

/// Where a movement has the feet at several times before they are planted: to the bit what EvaluateMovement,
/// EvaluateBlend and FootOf say of each time. The times are evaluated side by side, and of poses only the legs.
class FootSampler {
 public:
  static constexpr std::size_t kMost = kernels::kBlock;

  /// Borrows everything; the library's leg rig is usable. `scratch` is of its skeleton.
  FootSampler(const MotionLibrary& library, GridCache& cache, PoseSpan scratch)
      : library_(library), cache_(cache), scratch_(scratch) {}

  /// Looks at up to kMost times of a movement: at the first `eased` with what is left of the pose before
  /// (EvaluateMovement), at the others without (EvaluateBlend). `cache` is of this movement.
  void Sample(const Movement& movement, std::span<const double> times_s, std::size_t eased);

  /// Of the `i`th time, in the world.
  [[nodiscard]] DVec3 Ball(std::size_t i, Foot foot) const;
  [[nodiscard]] BlendedFoot FootAt(std::size_t i, Foot foot) const;

 private:
  [[nodiscard]] bool SampleTogether(const Movement& movement, std::span<const double> times_s,
                                    std::size_t eased);
  void SampleOne(const Movement& movement, double time_s, bool is_eased, std::size_t i);
  [[nodiscard]] Vec3 At(const float (&of)[3][kMost], std::size_t i) const {
    return {of[0][i], of[1][i], of[2][i]};
  }

  const MotionLibrary& library_;
  GridCache& cache_;
  PoseSpan scratch_;
  alignas(64) float roots_m_[3][kMost];      // in the world
  alignas(64) float balls_m_[2][3][kMost];   // of each foot, relative to the root
  alignas(64) float ankles_m_[2][3][kMost];  // the same
};

}  // namespace stridewire
