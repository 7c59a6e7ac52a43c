#include "runtime/avatar/avatar_body.h"

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "runtime/plan/root_approach.h"
#include "runtime/plan/root_dip.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"

namespace stridewire {

void Reserve(const MotionLibrary& library, Movement& movement) {
  const int joint_count = library.skeleton().joint_count();
  movement.difference = Pose(joint_count);
  movement.difference_velocity.joints_rad_s.resize(static_cast<std::size_t>(joint_count));
  movement.weights.reserve(static_cast<std::size_t>(library.max_row_count()));
}

AvatarBody::AvatarBody(std::shared_ptr<const MotionLibrary> of_library)
    : library(std::move(of_library)),
      pose(library->skeleton().joint_count()),
      blended_pose(library->skeleton().joint_count()),
      earlier_pose(library->skeleton().joint_count()) {
  stridewire::Reserve(*library, movement);
}

void AvatarBody::Evaluate(double time_s) {
  GridCache cache(library->layout());
  EvaluateWith(cache, time_s);
}

void AvatarBody::EvaluateWith(GridCache& cache, double time_s) {
  EvaluateMovement(group(), library->layout(), movement, time_s, cache, blended_pose);
  pose = blended_pose;
  PlantFeet(library->leg_rig(), movement, time_s, pose);
}

void AvatarBody::CaptureBlendSource(double time_s, bool keeps_speed) {
  STRIDEWIRE_CHECK(time_s >= 0.0 && time_s <= movement.duration_s());
  const auto corrections = [&](double at_s, const Pose& blended) {
    return movement.feet.is_active
               ? CorrectFeet(library->skeleton(), library->leg_rig(), movement, at_s, blended)
               : FeetCorrection{};
  };
  // Both poses share this cache, because they usually lie between the same grid points.
  GridCache cache(library->layout());
  if (keeps_speed) {
    const double earlier_s = time_s - kBlendStepS;
    EvaluateMovement(group(), library->layout(), movement, earlier_s, cache, earlier_pose);
    earlier_feet[1] = corrections(earlier_s, earlier_pose);
  }
  EvaluateWith(cache, time_s);
  earlier_feet[0] = corrections(time_s, blended_pose);
  // If planting has not completely faded in yet, the next movement starts to fade it in again.
  begins_planting =
      movement.feet.is_active && time_s < movement.start_offset_s + movement.feet.plant_fade_s;
  if (begins_planting) UseDisplayedAsBlended(time_s, keeps_speed);
}

void AvatarBody::UseDisplayedAsBlended(double time_s, bool keeps_speed) {
  if (keeps_speed) {
    Evaluate(time_s - kBlendStepS);
    earlier_pose = pose;
    Evaluate(time_s);
  }
  blended_pose = pose;
  earlier_feet = {};
}

void AvatarBody::CaptureFootLocks(double time_s) {
  STRIDEWIRE_CHECK(movement.feet.is_active);
  locks = FootLocksAt(*library, movement, time_s, blended_pose);
  if (!begins_planting) return;
  for (FootLock& lock : locks) lock.height_m = lock.turn_rad = 0.0;
}

void AvatarBody::StartWeighted(const BaseFrame& base, double rate) {
  stridewire::StartWeighted(group(), base, movement, rate);
}

void AvatarBody::SetStartOffset(double time_s) {
  STRIDEWIRE_CHECK(time_s >= 0.0 && time_s < movement.duration_s());
  movement.start_offset_s = time_s;
  movement.ease_out_s = std::min(group().ease_out_s, movement.duration_s() - time_s);
}

template <typename Landing>
void AvatarBody::BlendInAt(const Landing& landing, bool keeps_speed, FootPlanScratch& scratch) {
  STRIDEWIRE_CHECK(movement.group >= 0);
  STRIDEWIRE_CHECK(movement.weights.size() == static_cast<std::size_t>(group().row_count()));
  STRIDEWIRE_CHECK(movement.start_offset_s < movement.duration_s());
  STRIDEWIRE_CHECK(!plants_feet || library->leg_rig().is_usable);
  std::optional<ConstPoseSpan> earlier;
  if (keeps_speed) earlier.emplace(earlier_pose);
  GridCache& cache = scratch.cache();
  cache.Clear();
  if (plants_feet) {
    TransitionSamples transition(scratch, pose);
    const FootPlanJob job{.library = *library,
                          .locks = locks,
                          .source = {blended_pose, earlier},
                          .scratch = scratch,
                          .pose = pose,
                          .movement = movement,
                          .transition = transition};
    ContinueFeet(keeps_speed, PlanFeet(job, landing));
    PlanRootApproach(job);
    LiftWhileSettling(job);
    PlanRootDip(job);
    if (begins_planting) BeginPlantFade(library->leg_rig(), blended_pose, movement, pose);
    movement.feet.packed = PackFootPlan(movement);
    return;
  }
  // Sets the difference pose D = P - M, where P is the displayed pose, and M the blended pose of
  // the new movement (paper, Eq. (5)).
  movement.feet.is_active = false;
  EvaluateBlend(group(), library->layout(), movement, movement.start_offset_s, cache,
                movement.difference);
  Subtract(pose, movement.difference, movement.difference);
  if (earlier) {
    SetDifferenceVelocity(group(), library->layout(), blended_pose, *earlier, cache, pose,
                          movement);
  }
}

void AvatarBody::BlendIn(const LandingTarget& target, bool keeps_speed, FootPlanScratch& scratch) {
  BlendInAt(target, keeps_speed, scratch);
}

void AvatarBody::BlendIn(const LandingDecision& decision, bool keeps_speed,
                         FootPlanScratch& scratch) {
  BlendInAt(decision, keeps_speed, scratch);
}

// Makes the foot corrections of the planned movement continue smoothly from the previous
// corrections.
void AvatarBody::ContinueFeet(bool keeps_speed, const std::array<FeetAt, 2>& blended) {
  const double start_offset_s = movement.start_offset_s;
  std::array<FeetCorrection, 2> planned{CorrectFeet(movement, start_offset_s, blended[0])};
  if (keeps_speed) {
    planned[1] = CorrectFeet(movement, start_offset_s + kBlendStepS, blended[1]);
  } else {
    planned[1] = planned[0];
    earlier_feet[1] = earlier_feet[0];
  }
  ContinueFrom(earlier_feet, planned, keeps_speed ? blended : std::array{blended[0], blended[0]},
               movement);
}

void AvatarBody::ApplyLayers() {
  has_layers = !layers.empty();
  if (!has_layers) return;
  STRIDEWIRE_CHECK(layered_pose.rotations.size() == pose.rotations.size());
  layered_pose = pose;  // Both poses have the same size, so this does not allocate.
  layers.Apply(*library, layered_pose);
}

}  // namespace stridewire
