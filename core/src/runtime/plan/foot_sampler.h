#pragma once

#include <cstddef>
#include <span>

#include "runtime/movement/foot_plan.h"
#include "runtime/movement/movement.h"
#include "runtime/plan/plan_scratch.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/pose/pose_kernels.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Computes the feet of a movement, before planting, at several times in one call. It evaluates
/// only the joints of the legs, with SIMD and one time per lane. The results have the same bits as
/// those of EvaluateMovement or EvaluateBlend followed by FootOf. Getters take the index of a time
/// in the last call of Sample.
class FootSampler {
 public:
  static constexpr std::size_t kMaxTimes = kernels::kBlock;  ///< Maximum number of times per call.

  /// Borrows both arguments. The leg rig of the scratch's library must be usable. `pose` is scratch
  /// memory as well. It must have one rotation per joint of the library's skeleton.
  FootSampler(FootPlanScratch& scratch, PoseSpan pose)
      : library_(scratch.library()), scratch_(scratch), pose_(pose) {}

  /// Copies the difference pose of a movement to the scratch memory, for Sample. All samplers that
  /// use this scratch memory share the copy. Call SetDifference again when the difference pose has
  /// changed.
  void SetDifference(const Movement& movement);

  /// Samples a movement at up to kMaxTimes times: the first `eased` of them with the difference
  /// pose, as EvaluateMovement does, and the others without it, as EvaluateBlend does. The cache of
  /// the scratch memory must not contain rows of other movements. If `eased` is not 0, call
  /// SetDifference first.
  void Sample(const Movement& movement, std::span<const double> times_s, std::size_t eased);

  /// Returns the root at time `i`, in world space.
  [[nodiscard]] DVec3 Root(std::size_t i) const { return DVec3(At(roots_m_, i)); }
  /// Returns the ball of a foot at time `i`, in world space.
  [[nodiscard]] DVec3 Ball(std::size_t i, Foot foot) const;
  /// Returns a foot at time `i`.
  [[nodiscard]] BlendedFoot FootAt(std::size_t i, Foot foot) const;
  /// Returns the height of the sole at time `i`, in world space: LegPose::LowestSole plus the
  /// height of the root.
  [[nodiscard]] double LowestSole(std::size_t i, Foot foot) const;
  /// Returns the smaller of two heights at time `i`, in world space: those of the ball and of the
  /// ankle, each minus its height above the ground in the stand pose.
  [[nodiscard]] double LowestFlatSole(std::size_t i, Foot foot) const;
  /// Same as LowestFlatSole, for ball, ankle and toe tip. Unlike LowestSole, it has no allowance
  /// for toes that bend.
  [[nodiscard]] double LowestPoint(std::size_t i, Foot foot) const;

 private:
  [[nodiscard]] bool SampleTogether(const Movement& movement, std::span<const double> times_s,
                                    std::size_t eased);
  // Returns a leg in which only the positions of ankle, ball and toe tip are set.
  [[nodiscard]] LegPose LegAt(std::size_t i, Foot foot) const;
  void SampleOne(const Movement& movement, double time_s, bool is_eased, std::size_t i);
  [[nodiscard]] Vec3 At(const float (&of)[3][kMaxTimes], std::size_t i) const {
    return {of[0][i], of[1][i], of[2][i]};
  }

  const MotionLibrary& library_;
  FootPlanScratch& scratch_;
  PoseSpan pose_;
  alignas(64) float roots_m_[3][kMaxTimes];        // Positions of the root in world space.
  alignas(64) float balls_m_[2][3][kMaxTimes];     // [foot]: balls relative to the root.
  alignas(64) float ankles_m_[2][3][kMaxTimes];    // [foot]: ankles relative to the root.
  alignas(64) float toe_tips_m_[2][3][kMaxTimes];  // [foot]: toe tips relative to the root.
};

}  // namespace stridewire
