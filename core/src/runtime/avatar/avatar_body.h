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

/// What can be seen of an avatar and what its next movement goes on from: the part that an Avatar,
/// which decides what it does, and an AvatarReplica, which is told, have in common. Times are the
/// movement's.
struct AvatarBody {
  explicit AvatarBody(std::shared_ptr<const MotionLibrary> of_library);

  std::shared_ptr<const MotionLibrary> library;
  Pose pose;  ///< Displayed, but for layers
  LayerStack layers;
  Pose layered_pose;  ///< With layers, if there are any; of no size before the first
  bool has_layers = false;
  bool plants_feet = false;      ///< What is displayed has planted feet, or would
  bool begins_planting = false;  ///< The movement that begins next is the first planted
  Pose blended_pose;  ///< Where a movement ended or gave way: the same before feet were planted
  /// What a movement that begins goes on from: corrections of the feet at the end of the one before
  /// and, if it begins then and keeps their speed, kBlendStepS before, as well as the blended pose.
  std::array<FeetCorrection, 2> earlier_feet;
  Pose earlier_pose;
  Movement movement;  ///< Under way, or the last one
  FootLocks locks;    ///< Where the feet stood when the movement began

  [[nodiscard]] ConstPoseSpan DisplayedPose() const { return has_layers ? layered_pose : pose; }
  [[nodiscard]] const MotionGroup& group() const { return library->group(movement.group); }

  /// Shows a time of the movement, and keeps what the blend has then.
  void Evaluate(double time_s);

  /// What a movement that begins at `time_s` of this one goes on from. Leaves blended_pose at
  /// `time_s`.
  void CaptureBlendSource(double time_s, bool keeps_speed);

  /// What is displayed at a time of the movement is taken for what the blend has then: whatever of
  /// it is to end is eased out, and feet need no correction.
  void UseDisplayedAsBlended(double time_s, bool keeps_speed);

  /// Where feet that are planted stand when the movement ends at `time_s`; CaptureBlendSource came
  /// before.
  void CaptureFootLocks(double time_s);

  /// Goes on with a movement that has its weights, from `base`.
  void StartWeighted(const BaseFrame& base);

  /// The movement just started is entered later than at its beginning.
  void SetStartOffset(double time_s);

  /// Plans the feet of the movement just started, if they are planted, and what of the pose before
  /// is eased out.
  void BlendIn(const LandingTarget& target, bool keeps_speed, FootPlanScratch& scratch);
  void BlendIn(const LandingDecision& decision, bool keeps_speed, FootPlanScratch& scratch);

  /// Lays the layers over the pose.
  void ApplyLayers();

 private:
  void ContinueFeet(bool keeps_speed, const std::array<FeetAt, 2>& blended);
  template <typename Landing>
  void BlendInAt(const Landing& landing, bool keeps_speed, FootPlanScratch& scratch);
};

/// Room for any movement of a library.
void Reserve(const MotionLibrary& library, Movement& movement);

}  // namespace stridewire
