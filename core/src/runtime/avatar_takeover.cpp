// The part of an avatar that goes from one movement to the next, at its end or in the middle of it.

#include <algorithm>

#include "stridewire/base/check.h"
#include "stridewire/runtime/avatar.h"
#include "stridewire/runtime/contact_keytimes.h"

namespace stridewire {

// When both feet stand again, or if they do the time that it is. Who has begun to jump jumps.
double Avatar::Landed() const {
  const SwingTimes swing = SwingTimesOf(group().kind, movement_);
  return IsStep(group().kind) && movement_time_s_ <= swing.release_s
             ? movement_time_s_
             : std::max(movement_time_s_, swing.land_s);
}

double Avatar::EndOfMovement() const {
  return takes_over_ && !IsHeld() ? std::min(Landed(), movement_.duration_s())
                                  : movement_.duration_s();
}

// The foot in the air is the one that the request at the queue's head moves, and far from landing.
bool Avatar::RedirectsSwing() const {
  if (!takes_over_ || IsHeld() || !IsStep(group().kind) || plants_feet_ != foot_planting()) {
    return false;
  }
  const auto* step = std::get_if<StepRequest>(&queue_[queue_head_].movement);
  if (step == nullptr ||
      step->foot.value_or(MovingFoot(group().kind)) != MovingFoot(group().kind)) {
    return false;
  }
  const SwingTimes swing = SwingTimesOf(group().kind, movement_);
  return movement_time_s_ > swing.release_s &&
         swing.land_s - movement_time_s_ > kLeastSwingLeft * (swing.land_s - swing.release_s);
}

// What a movement that begins at `time_s` of this one goes on from. Leaves blended_pose_ at `time_s`.
void Avatar::KeepJoin(double time_s) {
  const bool keeps_speed =
      options_.join == JoinKind::kInertial && time_s - movement_.entered_s >= kJoinStepS;
  moved_until_s_ = keeps_speed ? time_s_ : -1.0;
  const auto corrections = [&](double at_s) {
    return movement_.feet.is_active ? CorrectFeet(library_->skeleton(), library_->leg_rig(),
                                                  movement_, at_s, blended_pose_)
                                    : FeetCorrection{};
  };
  if (keeps_speed) {
    Evaluate(time_s - kJoinStepS);
    earlier_pose_ = blended_pose_;
    earlier_feet_[1] = corrections(time_s - kJoinStepS);
  }
  Evaluate(time_s);
  earlier_feet_[0] = corrections(time_s);
  // Planting that has not set in yet sets in anew.
  begins_planting_ =
      movement_.feet.is_active && time_s < movement_.entered_s + movement_.feet.settle_s;
  if (begins_planting_) TakeForBlended(time_s);
}

// What is displayed at a time of the movement is taken for what the blend has then: whatever of it is to end is
// eased out, and feet need no correction.
void Avatar::TakeForBlended(double time_s) {
  if (moved_until_s_ == time_s_) {
    Evaluate(time_s - kJoinStepS);
    earlier_pose_ = pose_;
    Evaluate(time_s);
  }
  blended_pose_ = pose_;
  earlier_feet_ = {};
}

// A step of the foot in the air takes over from the step under way, at the same part of the swing. One that may
// be refused and is leaves the step under way to go on.
void Avatar::RedirectSwing() {
  const SwingTimes swing = SwingTimesOf(group().kind, movement_);
  const double part = (movement_time_s_ - swing.release_s) / (swing.land_s - swing.release_s);
  MovementRequest request = queue_[queue_head_];
  CancelQueue();
  auto& step = std::get<StepRequest>(request.movement);
  step.foot = MovingFoot(group().kind);
  KeepJoin(movement_time_s_);
  const auto plan = PlanRequest(request);
  STRIDEWIRE_CHECK(plan.has_value());
  const AvatarEvent left{.type = AvatarEventType::kFinished,
                         .request_id = request_id_,
                         .kind = group().kind,
                         .group = movement_.group,
                         .is_cut_short = true,
                         .base = base_};
  if (!PlanRequested(request, *plan, part)) return;
  AddEvent(left);
  BeginMovement(*plan, request.id);
}

// Before a movement is planned that feet are planted in as they were not before, or the other way round.
void Avatar::SwitchPlanting() {
  if (plants_feet_ == foot_planting()) return;
  plants_feet_ = begins_planting_ = foot_planting();
  TakeForBlended(movement_time_s_);
  if (!plants_feet_) return;
  const Skeleton& skeleton = library_->skeleton();
  const LegRig& rig = library_->leg_rig();
  const Terrain* terrain = options_.terrain.get();
  holds_ = HoldsOf(skeleton, rig, pose_, base_.position_m.y, terrain);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    FootHold& hold = holds_[static_cast<std::size_t>(foot)];
    hold.height_m = 0.0;
    hold.normal = Vec3(0.0f, 1.0f, 0.0f);
    if (terrain != nullptr) continue;
    // Level, but for feet on different steps of stairs.
    const double stands_m = BallPosition(skeleton, pose_, foot).y - rig.side(foot).ball_height_m;
    hold.print.position_m.y += GroundRise(stands_m - base_.position_m.y);
  }
}

// The corrections of the movement just planned go on from those before it.
void Avatar::KeepFeetGoing(bool keeps_speed) {
  const auto corrections = [&](double time_s) {
    EvaluateMovement(group(), library_->layout(), movement_, time_s, cache_, pose_);
    return CorrectFeet(library_->skeleton(), library_->leg_rig(), movement_, time_s, pose_);
  };
  const double entered_s = movement_.entered_s;
  std::array<FeetCorrection, 2> planned{corrections(entered_s)};
  if (keeps_speed) {
    planned[1] = corrections(entered_s + kJoinStepS);
  } else {
    planned[1] = planned[0];
    earlier_feet_[1] = earlier_feet_[0];
  }
  GoOnFrom(earlier_feet_, planned, movement_);
}

}  // namespace stridewire
