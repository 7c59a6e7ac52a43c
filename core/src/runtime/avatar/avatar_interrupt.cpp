// AvatarSimulation: changes between movements, at the end of a movement or during it.

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/contact_keytimes.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {

namespace {

// Maximum distance by which the swinging foot may land behind its current position, in metres.
constexpr double kMaxSwingBackM = 0.06;
// A foot whose swing is cut short lands this far ahead of its current position, in metres.
constexpr double kEarlyLandingM = 0.12;

// Returns a request for a step that the avatar plans itself, during a walk or to bring the feet
// together. Because of allow_nearest, it is not rejected as out of reach.
MovementRequest PlannedStep(std::uint64_t id) {
  return {.id = id, .movement = StepRequest{.allow_nearest = true}};
}

// Returns the approximate fraction of its path that a swinging foot has covered.
double SwingShare(double phase) {
  const double part = std::clamp(phase - 1.0, 0.0, 1.0);
  return part * part * (3.0 - 2.0 * part);
}

}  // namespace

// Returns the earliest movement time at which the movement can end with both feet on the ground:
// the current time if both stand, and otherwise the end of the swing. Jumps and inserted steps do
// not end before their swing, even while both feet still stand.
double AvatarSimulation::LandingTime() const {
  const SwingTimes swing = SwingTimesOf(group().kind, body_.movement);
  return IsStep(group().kind) && inserted_steps_ == 0 && movement_time_s_ <= swing.release_s
             ? movement_time_s_
             : std::max(movement_time_s_, swing.land_s);
}

// Returns true if the current step ends with the feet apart, so that another step must bring them
// together.
bool AvatarSimulation::LandsWithFeetApart() const {
  if (!IsStep(group().kind) || !body_.movement.feet.is_active) return false;
  const FootPlan& feet = body_.movement.feet;
  const double heading_rad = body_.movement.base.heading_rad + body_.movement.heading_change_rad +
                             body_.movement.extra_turn_rad;
  const DVec3 apart = feet.foot(Foot::kLeft).to.position_m - feet.foot(Foot::kRight).to.position_m;
  return AreFeetApart({RotateYaw(-heading_rad, apart)}, stand_feet_);
}

double AvatarSimulation::MovementEnd() const {
  const double end_s = body_.movement.duration_s();
  if (!interrupts_ || IsStartDelayed()) return end_s;
  if (std::holds_alternative<StandRequest>(queue_[queue_head_].movement)) {
    // A stand begins at the end of a step that brings the feet together. The current step must be
    // completed if it does so, because no pose before its end is a standing pose. The same applies
    // if the feet were together before the step and the foot has not left the ground yet, because
    // no closing step would follow.
    const bool is_stepping =
        movement_time_s_ > SwingTimesOf(group().kind, body_.movement).release_s;
    if (is_stepping ? !LandsWithFeetApart() : !is_walking_) return end_s;
  }
  return std::min(LandingTime(), end_s);
}

// Returns the phase of the current step: 0 at its start, 1 when the foot leaves the ground, 2 when
// it lands.
double AvatarSimulation::StepPhase() const {
  const SwingTimes swing = SwingTimesOf(group().kind, body_.movement);
  return movement_time_s_ <= swing.release_s
             ? movement_time_s_ / swing.release_s
             : 1.0 + (movement_time_s_ - swing.release_s) / (swing.land_s - swing.release_s);
}

// Returns true if the swinging foot can land on a footprint without moving back by more than
// kMaxSwingBackM.
bool AvatarSimulation::IsAheadOfSwing(const Footprint& print, double phase) const {
  const FootTrajectory& swing = body_.movement.feet.foot(MovingFoot(group().kind));
  const DVec3 path = swing.to.position_m - swing.from.position_m;
  const double length_m = std::hypot(path.x, path.z);
  const DVec3 now = swing.from.position_m + SwingShare(phase) * path;
  const DVec3 rest = print.position_m - now;
  return rest.x * path.x + rest.z * path.z >= -kMaxSwingBackM * length_m;
}

// Plans a step in which the swinging foot lands shortly ahead of its current position. Returns
// nullopt if that step is hardly shorter than the current one.
std::optional<AvatarSimulation::Redirection> AvatarSimulation::PlanEarlyLanding(
    double phase) const {
  const Foot moving = MovingFoot(group().kind);
  const FootTrajectory& swing = body_.movement.feet.foot(moving);
  const DVec3 path = swing.to.position_m - swing.from.position_m;
  const double length_m = std::hypot(path.x, path.z);
  const double share = SwingShare(phase) + kEarlyLandingM / std::max(length_m, kEarlyLandingM);
  if ((1.0 - share) * length_m < kEarlyLandingM) return std::nullopt;
  const StepRequest step{
      .foot = moving,
      .at = FootprintRequest{swing.from.position_m + share * path, swing.to.heading_rad},
      .allow_nearest = true};
  auto plan = PlanRequest({.movement = step});
  if (!plan) return std::nullopt;
  return Redirection{*plan, {.movement = step}, true, false};
}

// Plans a step that replaces the current one for the request at the head of the queue. It moves the
// same foot to the place that the request requires. Returns nullopt if the current step must land
// first.
std::optional<AvatarSimulation::Redirection> AvatarSimulation::PlanRedirection(double phase) {
  const MovementRequest& request = queue_[queue_head_];
  const Foot moving = MovingFoot(group().kind);
  if (const auto* step = std::get_if<StepRequest>(&request.movement)) {
    if (step->foot.value_or(moving) != moving) return std::nullopt;
    MovementRequest redirected = request;
    std::get<StepRequest>(redirected.movement).foot = moving;
    const auto plan = PlanRequest(redirected);
    STRIDEWIRE_CHECK(plan.has_value());
    return Redirection{*plan, redirected};
  }
  // Requests other than steps redirect the swing only if feet are planted. They wait while planting
  // fades in, because a new fade-in would move standing feet.
  const bool is_fading =
      movement_time_s_ < body_.movement.start_offset_s + body_.movement.feet.plant_fade_s;
  if (!body_.plants_feet || is_fading) return std::nullopt;
  std::optional<Redirection> redirection;
  if (std::holds_alternative<WalkRequest>(request.movement)) {
    WalkProgress progress = walk_;
    const WalkDecision decision = PlanNextWalkStep(progress);
    if (decision.outcome != WalkOutcome::kStep ||
        MovingFoot(body_.library->group(decision.plan.group).kind) != moving ||
        !IsAheadOfSwing(*decision.plan.exact, phase)) {
      return std::nullopt;
    }
    walk_ = progress;
    redirection = Redirection{decision.plan, PlannedStep(request.id)};
  } else {
    if (inserted_steps_ > 0 || !LandsWithFeetApart()) return std::nullopt;
    if (auto plan = PlanPlantedClosingStep(moving); plan && IsAheadOfSwing(*plan->exact, phase)) {
      redirection = Redirection{*plan, PlannedStep(0), true,
                                std::holds_alternative<StandRequest>(request.movement)};
    } else {
      redirection = PlanEarlyLanding(phase);
    }
  }
  if (redirection) redirection->plan.pace.max_rate = kHurriedRate;
  return redirection;
}

// Stores the state at `time_s` of the current movement, from which the next movement will blend.
void AvatarSimulation::CaptureBlendSource(double time_s) {
  const bool keeps_speed = options_.blend == BlendKind::kInertialization &&
                           time_s - body_.movement.start_offset_s >= kBlendStepS;
  moved_until_s_ = keeps_speed ? time_s_ : -1.0;
  body_.CaptureBlendSource(time_s, keeps_speed);
}

// Records in change_, for replicas, that the avatar leaves the current movement at `time_s`. If
// that movement began in the same Advance, replicas have not received it, so they need the whole
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

// Tries to replace the current step, for the request at the head of the queue, with a step of the
// same foot that continues at the same phase. Returns false if that is impossible. If the new step
// is rejected, returns true, and the current step continues.
bool AvatarSimulation::Redirect(PlanScratch& scratch) {
  if (!may_redirect_ || IsStartDelayed() || !IsStep(group().kind) ||
      body_.plants_feet != foot_planting()) {
    return false;
  }
  const double phase = StepPhase();
  // While both feet stand, the next movement can start at once. Shortly before the landing, it is
  // too late to redirect the step.
  if (phase <= 1.0 || phase >= 2.0 - kLeastSwingLeft) return false;
  // If feet are not planted, the plan depends on the position of the standing foot in the current
  // pose, which may not have been evaluated yet.
  if (!body_.plants_feet) body_.Evaluate(movement_time_s_);
  const auto redirection = PlanRedirection(phase);
  may_redirect_ = false;
  if (!redirection) return false;
  const MovementRequest& request = redirection->request;
  const auto& head = queue_[queue_head_].movement;
  const bool is_walk = std::holds_alternative<WalkRequest>(head);
  if (std::holds_alternative<StepRequest>(head)) PopQueue();
  if (redirection->ends_interrupt) interrupts_ = false;
  CaptureBlendSource(movement_time_s_);
  const AvatarEvent left{.type = AvatarEventType::kFinished,
                         .request_id = request_id_,
                         .kind = group().kind,
                         .group = body_.movement.group,
                         .is_cut_short = true,
                         .base = base_,
                         .outcome = MovementOutcome(true)};
  const AvatarChange before = change_;
  RecordLeaving(movement_time_s_, true);
  if (!PlanRequested(request, redirection->plan, phase, scratch)) {
    change_ = before;
    return true;
  }
  AddEvent(left);
  EndDroppedWalk();
  BeginMovement(redirection->plan, request.id);
  is_walk_step_ = is_walk;
  if (redirection->is_inserted) inserted_steps_ = 1;
  return true;
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
    // Without a terrain, the ground is assumed at the height of the base. If the ball is more than
    // a few centimetres above or below its height on that ground, the foot stands on another level.
    const double ball_height_m =
        BallPosition(skeleton, body_.pose, foot).y - rig.side(foot).ball_height_m;
    lock.print.position_m.y += GroundRise(ball_height_m - base_.position_m.y);
  }
}

}  // namespace stridewire
