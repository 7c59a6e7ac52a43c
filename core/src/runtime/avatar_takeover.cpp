// The part of an avatar that goes from one movement to the next, at its end or in the middle of it.

#include <algorithm>

#include "stridewire/base/check.h"
#include "stridewire/runtime/avatar.h"

namespace stridewire {

// When both feet stand again, or if they do the time that it is. Who has begun to jump jumps.
double Avatar::Landed() const {
  const SwingTimes swing = SwingTimesOf(group().kind, movement_);
  return IsStep(group().kind) && movement_time_s_ <= swing.release_s
             ? movement_time_s_
             : std::max(movement_time_s_, swing.land_s);
}

double Avatar::EndOfMovement() const {
  return takes_over_ ? std::min(Landed(), movement_.duration_s()) : movement_.duration_s();
}

// The foot in the air is the one that the request at the queue's head moves, and far from landing.
bool Avatar::RedirectsSwing() const {
  if (!takes_over_ || !IsStep(group().kind)) return false;
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
