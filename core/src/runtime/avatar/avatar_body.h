#pragma once

#include <array>
#include <memory>
#include <optional>

#include "runtime/movement/movement.h"
#include "runtime/plan/foot_planner.h"
#include "runtime/pose/layer_stack.h"
#include "runtime/pose/plant_feet.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// The displayed state of an avatar, and all data on which its next movement depends.
/// AvatarSimulation decides how an avatar moves, and AvatarReplica receives these decisions. Both
/// contain an AvatarBody. Times are relative to the start of the movement.
struct AvatarBody {
  explicit AvatarBody(std::shared_ptr<const MotionLibrary> of_library);

  std::shared_ptr<const MotionLibrary> library;
  Pose pose;  ///< Displayed pose without layers.
  LayerStack layers;
  Pose layered_pose;        ///< Pose with layers; empty until the first layer is set.
  bool has_layers = false;  ///< True if `layered_pose` is displayed instead of `pose`.
  /// True if the current movement plants the feet. While the avatar stands still: true if its feet
  /// were planted when it came to rest.
  bool plants_feet = false;
  /// True if the changes due to planting fade in during the next movement (FootPlan::plant_fade_s),
  /// because it is the first one with planted feet or because an earlier fade was interrupted.
  bool begins_planting = false;
  /// Pose that the next movement blends from, without planting. Set when the movement ends or is
  /// interrupted.
  Pose blended_pose;
  /// Data from which the next movement blends: the foot corrections at the end of the previous
  /// movement and, if its velocity is kept, kBlendStepS before that. `earlier_pose` is the blended
  /// pose at the earlier of these times.
  std::array<FeetCorrection, 2> earlier_feet;
  Pose earlier_pose;
  Movement movement;  ///< The current movement, or the previous one while standing still.
  FootLocks locks;    ///< Positions and headings of the feet when the movement began.

  [[nodiscard]] ConstPoseSpan DisplayedPose() const { return has_layers ? layered_pose : pose; }
  [[nodiscard]] const MotionGroup& group() const { return library->group(movement.group); }

  /// Evaluates `pose` and `blended_pose` at a time of the movement.
  void Evaluate(double time_s);

  /// Stores the data from which the next movement blends. That movement begins at `time_s` of the
  /// current one. Also evaluates `blended_pose` at `time_s`.
  void CaptureBlendSource(double time_s, bool keeps_speed);

  /// Uses the displayed pose at `time_s` as the blended pose. The next movement then blends from
  /// the displayed pose as a whole, so that the corrections of the feet fade out with the
  /// difference pose.
  void UseDisplayedAsBlended(double time_s, bool keeps_speed);

  /// Stores the positions of planted feet for a movement that ends at `time_s`. Call
  /// CaptureBlendSource first.
  void CaptureFootLocks(double time_s);

  /// Starts the movement at `base` with the playback speed `rate`. Its weights must be set.
  void StartWeighted(const BaseFrame& base, double rate);

  /// Makes the avatar enter the current movement at `time_s` instead of 0. Call it after
  /// StartWeighted.
  void SetStartOffset(double time_s);

  /// Plans the feet of the movement if they are planted, and computes the difference pose that
  /// fades out. Call it after StartWeighted, and after SetStartOffset if that is called.
  void BlendIn(const LandingTarget& target, bool keeps_speed, FootPlanScratch& scratch);
  void BlendIn(const LandingDecision& decision, bool keeps_speed, FootPlanScratch& scratch);

  /// Applies the layers to the pose.
  void ApplyLayers();

 private:
  void EvaluateWith(GridCache& cache, double time_s);
  void ContinueFeet(bool keeps_speed, const std::array<FeetAt, 2>& blended);
  template <typename Landing>
  void BlendInAt(const Landing& landing, bool keeps_speed, FootPlanScratch& scratch);
};

/// Reserves memory for any movement of a library.
void Reserve(const MotionLibrary& library, Movement& movement);

}  // namespace stridewire
