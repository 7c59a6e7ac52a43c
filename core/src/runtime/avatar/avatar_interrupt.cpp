// AvatarSimulation: changes from one movement to the next, at its end or in the middle of it.

#include <algorithm>

#include "base/check.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/contact_keytimes.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {

// Returns the movement time at which both feet are on the ground: the current time if they already
// are, otherwise the end of the swing. A jump that has begun is always completed.
double AvatarSimulation::LandingTime() const {
  const SwingTimes swing = SwingTimesOf(group().kind, body_.movement);
  return IsStep(group().kind) && movement_time_s_ <= swing.release_s
             ? movement_time_s_
             : std::max(movement_time_s_, swing.land_s);
}

double AvatarSimulation::MovementEnd() const {
  return interrupts_ && !IsStartDelayed() ? std::min(LandingTime(), body_.movement.duration_s())
                                          : body_.movement.duration_s();
}

// Returns true if the request at the head of the queue can redirect the current swing: it moves the
// foot that is in the air, and enough of the swing is left.
bool AvatarSimulation::RedirectsSwing() const {
  if (!interrupts_ || IsStartDelayed() || !IsStep(group().kind) ||
      body_.plants_feet != foot_planting()) {
    return false;
  }
  const auto* step = std::get_if<StepRequest>(&queue_[queue_head_].movement);
  if (step == nullptr ||
      step->foot.value_or(MovingFoot(group().kind)) != MovingFoot(group().kind)) {
    return false;
  }
  const SwingTimes swing = SwingTimesOf(group().kind, body_.movement);
  return movement_time_s_ > swing.release_s &&
         swing.land_s - movement_time_s_ > kLeastSwingLeft * (swing.land_s - swing.release_s);
}

// Stores the state at `time_s` of the current movement that the next movement will blend from.
void AvatarSimulation::CaptureBlendSource(double time_s) {
  const bool keeps_speed = options_.blend == BlendKind::kInertialization &&
                           time_s - body_.movement.start_offset_s >= kBlendStepS;
  moved_until_s_ = keeps_speed ? time_s_ : -1.0;
  body_.CaptureBlendSource(time_s, keeps_speed);
}

// Records in change_, for replicas, that the avatar leaves the current movement at `time_s`.
// Replicas do not know a movement that began in the same Advance, so such a change needs the whole
// state.
void AvatarSimulation::RecordLeaving(double time_s, bool is_redirected) {
  if (change_.has_left || change_.has_begun) {
    change_.needs_state = true;
    return;
  }
  STRIDEWIRE_CHECK(time_s >= 0.0 && time_s <= body_.movement.duration_s());
  change_.has_left = true;
  change_.left_s = time_s;
  change_.is_left_at_end = time_s == body_.movement.duration_s();
  change_.left_keeps_speed = keeps_speed();
  change_.is_redirected = is_redirected;
}

// Replaces the current step by a step of the same foot, at the same fraction of the swing. If the
// new step is rejected, the current step continues.
void AvatarSimulation::RedirectSwing(PlanScratch& scratch) {
  STRIDEWIRE_CHECK(is_moving_ && interrupts_ && queue_size() > 0);
  const SwingTimes swing = SwingTimesOf(group().kind, body_.movement);
  const double part = (movement_time_s_ - swing.release_s) / (swing.land_s - swing.release_s);
  MovementRequest request = queue_[queue_head_];
  CancelQueue();
  auto& step = std::get<StepRequest>(request.movement);
  step.foot = MovingFoot(group().kind);
  CaptureBlendSource(movement_time_s_);
  const auto plan = PlanRequest(request);
  STRIDEWIRE_CHECK(plan.has_value());
  const AvatarEvent left{.type = AvatarEventType::kFinished,
                         .request_id = request_id_,
                         .kind = group().kind,
                         .group = body_.movement.group,
                         .is_cut_short = true,
                         .base = base_};
  if (!PlanRequested(request, *plan, part, scratch)) return;
  AddEvent(left);
  RecordLeaving(movement_time_s_, true);
  BeginMovement(*plan, request.id);
}

// Applies a change of the foot planting setting. Call it before planning a movement.
void AvatarSimulation::SwitchPlanting() {
  STRIDEWIRE_CHECK(!is_moving_);
  if (body_.plants_feet == foot_planting()) return;
  body_.plants_feet = body_.begins_planting = foot_planting();
  change_.needs_state = true;
  body_.UseDisplayedAsBlended(movement_time_s_, keeps_speed());
  if (!body_.plants_feet) return;
  const Skeleton& skeleton = body_.library->skeleton();
  const LegRig& rig = body_.library->leg_rig();
  const Terrain* terrain = options_.terrain.get();
  body_.locks = FootLocksOf(skeleton, rig, body_.pose, base_.position_m.y, terrain);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    FootLock& lock = body_.locks[static_cast<std::size_t>(foot)];
    lock.height_m = 0.0;
    lock.normal = Vec3(0.0f, 1.0f, 0.0f);
    if (terrain != nullptr) continue;
    // The ground is level, unless the feet stand on different steps of a staircase.
    const double ball_height_m =
        BallPosition(skeleton, body_.pose, foot).y - rig.side(foot).ball_height_m;
    lock.print.position_m.y += GroundRise(ball_height_m - base_.position_m.y);
  }
}

}  // namespace stridewire
