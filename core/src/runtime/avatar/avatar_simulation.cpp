#include "runtime/avatar/avatar_simulation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/check.h"
#include "base/prefetch.h"
#include "runtime/library/contact_keytimes.h"
#include "runtime/library/locomotion_profile.h"
#include "runtime/movement/stride_variation.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/foot_vector.h"
#include "runtime/weights/correction.h"

namespace stridewire {
namespace {

// Maximum number of events that a movement can add in one tick: started, two foot strikes,
// finished, the end of a dropped walk, the end of a walk or a rejection, and the start of the next
// movement.
constexpr std::size_t kEventReserve = 7;
// Number of events for which memory is reserved at construction. A tick usually has at most three
// events: finished, started and foot strike.
constexpr std::size_t kUsualEvents = 3;
// Phase at which a jump that interrupts another movement starts. The blend from the previous pose
// replaces the skipped part of the crouch.
constexpr double kJumpStartPhase = 0.25;
// If the angle between a standing foot and the heading of the avatar exceeds this, the foot counts
// as twisted (IsTwisted), and it should move next.
constexpr double kTwistedRad = 0.2;

}  // namespace

AvatarSimulation::AvatarSimulation(std::shared_ptr<const MotionLibrary> library,
                                   const BaseFrame& start, const AvatarOptions& options)
    : options_(options), body_(std::move(library)) {
  events_.reserve(kUsualEvents);
  stand_feet_.left_from_right_m =
      FootVector(body_.library->skeleton(), body_.library->stand_pose(), Foot::kLeft, 0.0);
  Teleport(start);
}

void AvatarSimulation::Teleport(const BaseFrame& start) {
  DropAll(RequestOutcome::kCancelled);
  base_ = start;
  ++revision_;
  const Pose& stand = body_.library->stand_pose();
  body_.pose = stand;
  body_.pose.root_position_m =
      Vec3(start.position_m + RotateYaw(start.heading_rad, DVec3(stand.root_position_m)));
  body_.pose.rotations[0] = YawRotation(start.heading_rad) * stand.rotations[0];
  is_moving_ = is_in_stand_ = is_idling_ = is_idle_reported_ = is_walking_ = false;
  is_settled_ = true;
  inserted_steps_ = 0;
  body_.blended_pose = body_.pose;
  moved_until_s_ = next_event_s_ = -1.0;
  body_.plants_feet = foot_planting();
  body_.begins_planting = false;
  if (body_.plants_feet) {
    body_.locks = FootLocksOf(body_.library->skeleton(), body_.library->leg_rig(), body_.pose,
                              start.position_m.y, options_.terrain.get());
    StandOn(body_.locks, body_.movement);
    body_.earlier_feet[0] = CorrectFeet(body_.library->skeleton(), body_.library->leg_rig(),
                                        body_.movement, 0.0, body_.blended_pose);
    PlantFeet(body_.library->leg_rig(), body_.movement, 0.0, body_.pose);
  }
  feet_ = stand_feet_;
  last_group_ = body_.library->groups().size();
  last_moved_ = Foot::kRight;
  STRIDEWIRE_CHECK(idle());
  body_.ApplyLayers();
  next_change_.needs_state = true;
}

Status AvatarSimulation::SetLayer(const LayerRequest& request) {
  if (Status status = body_.layers.Set(*body_.library, request); !status) return status;
  body_.layered_pose.rotations.resize(body_.pose.rotations.size());
  next_change_.has_layers = true;
  next_event_s_ = -1.0;
  return {};
}

Status AvatarSimulation::SetFootPlanting(bool enabled) {
  if (enabled && !body_.library->leg_rig().is_usable) {
    return Fail(ErrorCode::kUnsupported, "this skeleton does not support foot planting");
  }
  options_.foot_planting = enabled;
  return {};
}

void AvatarSimulation::AddEvent(const AvatarEvent& event) {
  STRIDEWIRE_CHECK(events_.size() < max_events_);
  STRIDEWIRE_CHECK(events_.empty() || events_.back().time_s <= time_s_);
  AvatarEvent& added = events_.emplace_back(event);
  added.time_s = time_s_;
  if (event.type == AvatarEventType::kStarted) started_ = added;
  if (event.type == AvatarEventType::kRejected && event.outcome == RequestOutcome::kNone) {
    added.outcome = RequestOutcome::kRejected;
  }
}

FootState AvatarSimulation::MeasureFeet() const {
  return {FootVector(body_.library->skeleton(), body_.pose, Foot::kLeft, base_.heading_rad)};
}

PlanScratch& AvatarSimulation::OwnScratch::Get(const MotionLibrary& library) {
  if (scratch_ == nullptr) scratch_ = std::make_unique<PlanScratch>(library);
  return *scratch_;
}

void AvatarSimulation::Advance(double dt_s) {
  AdvanceState(dt_s, own_scratch_.Get(*body_.library));
  UpdatePose();
}

void AvatarSimulation::UpdatePose() {
  if (displayed_movement() != nullptr) body_.Evaluate(movement_time_s_);
  body_.ApplyLayers();
}

void AvatarSimulation::AdvanceStates(std::span<AvatarSimulation* const> avatars, double dt_s,
                                     PlanScratch& scratch, std::vector<std::uint32_t>* eventful) {
  if (eventful != nullptr) eventful->clear();
  constexpr std::size_t kAhead = 16;
  for (std::size_t i = 0; i < avatars.size(); ++i) {
    if (i + 2 * kAhead < avatars.size()) avatars[i + 2 * kAhead]->PrefetchTickState();
    if (i + kAhead < avatars.size() && !avatars[i + kAhead]->StaysEventFree(dt_s)) {
      avatars[i + kAhead]->PrefetchState();
    }
    avatars[i]->AdvanceState(dt_s, scratch);
    if (eventful != nullptr && !avatars[i]->is_event_free()) {
      eventful->push_back(static_cast<std::uint32_t>(i));
    }
  }
}

void AvatarSimulation::UpdatePoses(std::span<AvatarSimulation* const> avatars,
                                   SoaPoseEvaluator& evaluator) {
  std::array<PoseJob, SoaPose::kLanes> jobs;
  while (!avatars.empty()) {
    const std::span<AvatarSimulation* const> block =
        avatars.first(std::min(avatars.size(), jobs.size()));
    std::size_t moving = 0;
    for (AvatarSimulation* avatar : block) {
      if (avatar->displayed_movement() == nullptr) continue;
      jobs[moving++] = {&avatar->body_.movement, avatar->movement_time_s_, &avatar->body_.pose};
    }
    EvaluatePoses(evaluator, std::span(jobs).first(moving));
    for (AvatarSimulation* avatar : block) avatar->body_.ApplyLayers();
    avatars = avatars.subspan(block.size());
  }
}

void AvatarSimulation::AdvanceAll(std::span<AvatarSimulation* const> avatars, double dt_s,
                                  PlanScratch& scratch, SoaPoseEvaluator& evaluator) {
  AdvanceStates(avatars, dt_s, scratch);
  UpdatePoses(avatars, evaluator);
}

// Prefetches the data of a walking avatar that AdvanceEventfully reads.
void AvatarSimulation::PrefetchState() const {
  PrefetchBytes(&change_, sizeof(change_) + sizeof(next_change_));
  PrefetchBytes(&events_, 1);
  PrefetchBytes(&body_.layers, sizeof(body_.layers));
  PrefetchBytes(&body_.movement, kCacheLineBytes);
  PrefetchBytes(&body_.movement.warp, 2 * kCacheLineBytes);
  PrefetchBytes(&body_.movement.feet.is_active, 1);
}

// Advances everything except the pose.
void AvatarSimulation::AdvanceState(double dt_s, PlanScratch& scratch) {
  STRIDEWIRE_CHECK(dt_s > 0.0 && dt_s <= 1.0);
  if (StaysEventFree(dt_s)) {
    movement_time_s_ += dt_s;
    time_s_ += dt_s;
    return;
  }
  AdvanceEventfully(dt_s, scratch);
  body_.layers.Advance(*body_.library, dt_s);
  next_event_s_ = NextEventTime();
}

// Returns the movement time of the next event, or -1 if the last Advance was not event-free.
double AvatarSimulation::NextEventTime() const {
  const bool is_waiting = is_idling_ && !is_in_stand_ && queue_size() == 0;
  const bool is_event_free = (is_moving_ || is_waiting) && !interrupts_ && body_.layers.empty() &&
                             events_.empty() && change_ == AvatarChange{};
  if (!is_event_free) return -1.0;
  if (is_waiting) return body_.movement.duration_s();
  const double strike_s = StrikeTime();
  return movement_time_s_ < strike_s ? std::min(strike_s, body_.movement.duration_s())
                                     : body_.movement.duration_s();
}

void AvatarSimulation::AdvanceEventfully(double dt_s, PlanScratch& scratch) {
  events_.clear();
  AddDroppedEvents();
  change_ = std::exchange(next_change_, {});
  const double end_s = time_s_ + dt_s;
  double left_s = dt_s;
  const auto advance_clock = [&] {
    // If no time has passed, rounding can make end_s - left_s smaller than time_s_ by one bit. The
    // clock must not run backwards.
    time_s_ = std::max(time_s_, end_s - left_s);
  };
  for (;;) {
    STRIDEWIRE_CHECK(left_s >= 0.0);
    STRIDEWIRE_CHECK(!(is_moving_ && is_in_stand_));
    // Movements that are shorter than a tick could overflow the event list. Once the list is nearly
    // full, no further movement starts or ends in this tick.
    const bool may_change = events_.size() + kEventReserve <= max_events_;
    if (is_moving_) {
      const double before_s = movement_time_s_;
      if (may_change && Redirect(scratch)) continue;
      const double duration_s = MovementEnd();
      if (before_s + left_s < duration_s || !may_change) {
        movement_time_s_ = before_s + left_s;
        time_s_ = end_s;
        if (may_change) ReportFootStrikes(before_s, movement_time_s_);
        break;
      }
      left_s = before_s + left_s - duration_s;
      advance_clock();
      ReportFootStrikes(before_s, duration_s);
      FinishMovement(duration_s);
    } else if (is_in_stand_) {
      if (stand_left_s_ > left_s || !may_change) {
        stand_left_s_ -= left_s;
        break;
      }
      left_s -= stand_left_s_;
      advance_clock();
      FinishStand();
    }
    if (!may_change || !StartNext(scratch)) break;
  }
  STRIDEWIRE_CHECK(time_s_ <= end_s);
  // If idle motion continues, it advances by the whole tick at once, as in replicas. A sum of two
  // parts of the tick could differ from that in the last bit.
  if (!is_moving_) AdvanceIdleMotion(is_idling_ ? dt_s : left_s, scratch);
  time_s_ = end_s;
  change_.idle_changed = idle() != std::exchange(was_idle_, idle());
}

bool AvatarSimulation::StartNext(PlanScratch& scratch) {
  STRIDEWIRE_CHECK(!is_moving_ && !is_in_stand_);
  const bool is_hurried = std::exchange(interrupts_, false);
  may_redirect_ = false;
  const bool is_empty = queue_size() == 0;
  const auto* stand = is_empty ? nullptr : std::get_if<StandRequest>(&queue_[queue_head_].movement);
  if (is_walking_ && (is_empty || stand != nullptr)) {
    // The walk ends here. The feet are brought together, so that the avatar does not stop in
    // mid-stride.
    is_walking_ = false;
    SwitchPlanting();
    if (auto plan = PlanClosingStep()) {
      if (is_hurried) plan->pace.max_rate = kHurriedRate;
      EndIdleMotion();  // The avatar may have started to idle while the next request was delayed.
      StartInserted(*plan, scratch);
      return true;
    }
  }
  if (is_empty) {
    if (!std::exchange(is_idle_reported_, true)) {
      AddEvent({.type = AvatarEventType::kIdle, .base = base_, .reason = WhyFeetAreApart()});
    }
    last_group_ = body_.library->groups().size();
    return false;
  }

  if (IsStartDelayed() && last_group_ == body_.library->groups().size()) return false;
  start_not_before_s_ = 0.0;
  is_idle_reported_ = false;
  if (stand == nullptr) {
    EndIdleMotion();
    SwitchPlanting();
  }
  if (std::holds_alternative<WalkRequest>(queue_[queue_head_].movement)) {
    StartWalkStep(scratch);
    return true;
  }
  if (stand != nullptr) {
    is_in_stand_ = true;
    is_walk_step_ = is_stand_cut_short_ = false;
    stand_left_s_ = stand->seconds;
    request_id_ = PopQueue();
    AddEvent({.type = AvatarEventType::kStarted,
              .request_id = request_id_,
              .reason = WhyFeetAreApart()});
    return true;
  }
  StartTransitionPath(is_hurried, scratch);
  return true;
}

// Starts the step or jump at the head of the queue, or a step that must precede it. If the request
// is out of reach or no path leads to it, rejects it.
void AvatarSimulation::StartTransitionPath(bool is_hurried, PlanScratch& scratch) {
  const MovementRequest& request = queue_[queue_head_];
  const auto direct = PlanRequest(request);
  STRIDEWIRE_CHECK(direct.has_value());  // Enqueue has checked that the library has this kind.
  TransitionPath path =
      FindTransitionPath(*body_.library, request, direct,
                         {feet_, last_moved_, last_group_, inserted_steps_, landing_conditions()});
  if (path.is_inserted) {
    if (is_hurried) path.plan->pace.max_rate = kHurriedRate;
    StartInserted(*path.plan, scratch);
    interrupts_ = is_hurried && std::holds_alternative<JumpRequest>(request.movement);
  } else if (path.plan) {
    const MovementRequest taken = request;
    PopQueue();
    // A jump that interrupts another movement starts at a later phase, because a moving body needs
    // less preparation.
    const double start_phase =
        is_hurried && body_.library->group(path.plan->group).kind == MovementKind::kJump
            ? kJumpStartPhase
            : 0.0;
    if (PlanRequested(taken, *path.plan, start_phase, scratch)) BeginMovement(*path.plan, taken.id);
  } else if (!AllowsNearest(request) && PlannedError(*direct).IsTooLarge()) {
    const MovementRequest taken = request;
    PopQueue();
    RejectOutOfReach(taken, *direct);
  } else {
    const bool is_standing = last_group_ == body_.library->groups().size();
    const MovementKind from =
        is_standing ? MovementKind::kStand : body_.library->groups()[last_group_].kind;
    AddEvent({.type = AvatarEventType::kRejected,
              .request_id = PopQueue(),
              .base = base_,
              .reason = NoPathReason(from, body_.library->group(direct->group).kind)});
  }
}

void AvatarSimulation::StartInserted(const RequestPlan& plan, PlanScratch& scratch) {
  const int inserted = inserted_steps_ + 1;
  STRIDEWIRE_CHECK(inserted <= kMaxInsertedSteps);
  StartPlan(plan, 0, scratch);
  inserted_steps_ = inserted;
}

// Plans the next step of the walk at the head of the queue, from the positions of the feet at the
// end of the last step.
WalkDecision AvatarSimulation::PlanNextWalkStep(WalkProgress& progress) const {
  WalkStance stance;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const auto f = static_cast<std::size_t>(foot);
    stance.feet[f] = body_.plants_feet ? body_.locks[f].print
                                       : Footprint{StandingPosition(foot), base_.heading_rad};
  }
  stance.heading_rad = base_.heading_rad;
  stance.last_moved = last_moved_;
  stance.vector = feet_;
  stance.last_group = last_group_;
  stance.last_step_s = is_walking_ ? body_.movement.duration_s() : 0.0;
  stance.is_exact = body_.plants_feet;
  stance.is_aimed = progress.is_aimed;
  return PlanWalkStep(*body_.library, options_.terrain.get(),
                      std::get<WalkRequest>(queue_[queue_head_].movement), stance, progress);
}

// Starts the next step of the walk at the head of the queue. The request stays in the queue until
// the walk has arrived or is rejected.
void AvatarSimulation::StartWalkStep(PlanScratch& scratch) {
  walk_pace_.Add(base_.position_m, time_s_);
  const WalkDecision decision = PlanNextWalkStep(walk_);
  if (decision.outcome == WalkOutcome::kStep) {
    StartPlan(decision.plan, queue_[queue_head_].id, scratch);
    is_walk_step_ = true;
    return;
  }
  // The speed is read before PopQueue, because PopQueue may reset walk_pace_.
  const double speed_m_s = walk_pace_.mean_m_s();
  const std::uint64_t id = PopQueue();
  walk_ = {};
  walk_pace_ = {};
  if (decision.outcome == WalkOutcome::kArrived) {
    AddEvent({.type = AvatarEventType::kFinished,
              .request_id = id,
              .base = base_,
              .speed_m_s = speed_m_s,
              .outcome = RequestOutcome::kCompleted});
  } else {
    AddEvent({.type = AvatarEventType::kRejected,
              .request_id = id,
              .base = base_,
              .reason = decision.reason,
              .speed_m_s = speed_m_s});
  }
}

// Returns the position of a foot between two movements: its footprint, or the ball if feet are not
// planted.
DVec3 AvatarSimulation::StandingPosition(Foot foot) const {
  return body_.plants_feet ? body_.locks[static_cast<std::size_t>(foot)].print.position_m
                           : DVec3(BallPosition(body_.library->skeleton(), body_.pose, foot));
}

// Returns true if the footprint of a foot deviates far from the heading of the avatar, because the
// body has turned while the foot stood.
bool AvatarSimulation::IsTwisted(Foot foot) const {
  if (!body_.plants_feet) return false;
  const double print_rad = body_.locks[static_cast<std::size_t>(foot)].print.heading_rad;
  return std::fabs(WrapAngle(print_rad - base_.heading_rad)) > kTwistedRad;
}

// Returns the height of the ground where a step would land, relative to the ground at the standing
// foot, in metres.
double AvatarSimulation::RiseAhead(const StepRequest& step) const {
  const Foot foot = step.foot.value_or(OtherFoot(last_moved_));
  const auto f = static_cast<std::size_t>(foot);
  const double outward = foot == Foot::kLeft ? 1.0 : -1.0;
  const double side_m = step.side_m.value_or(outward * stand_feet_.Vector(foot).x);
  const DVec3 stands = body_.locks[1 - f].print.position_m;
  const DVec3 planted = stands + RotateYaw(base_.heading_rad + step.turn_rad,
                                           DVec3(outward * side_m, 0.0, step.length_m));
  return GroundRise(options_.terrain->HeightAt(planted.x, planted.z) - stands.y);
}

// Returns the footprint of a step that is requested by length, side and turn. If the request does
// not specify the side, the feet end as far apart sideways as in a walk or, if they end side by
// side, as in the stand pose.
FootprintRequest AvatarSimulation::FootprintOf(const StepRequest& step) const {
  STRIDEWIRE_CHECK(step.foot.has_value());
  const LocomotionProfile& profile = body_.library->locomotion_profile();
  const double outward = *step.foot == Foot::kLeft ? 1.0 : -1.0;
  const double side_m = step.side_m.value_or(
      std::fabs(step.length_m) > kFeetApartForwardM ? profile.width_m : profile.stand_m);
  const double heading_rad = base_.heading_rad + step.turn_rad;
  const DVec3 vector(outward * side_m, step.height_m, step.length_m);
  return {StandingPosition(OtherFoot(*step.foot)) + RotateYaw(heading_rad, vector), heading_rad};
}

std::optional<RequestPlan> AvatarSimulation::PlanRequest(const MovementRequest& request) const {
  if (const auto* jump = std::get_if<JumpRequest>(&request.movement)) {
    return PlanJump(*body_.library, *jump);
  }
  StepRequest step = std::get<StepRequest>(request.movement);
  if (!step.at) {
    if (options_.terrain != nullptr && body_.plants_feet) step.height_m = RiseAhead(step);
    const bool may_choose_foot = !is_walking_ && !IsTwisted(OtherFoot(last_moved_));
    const auto plan = PlanStep(*body_.library, step, feet_, last_moved_, may_choose_foot);
    if (!plan || !step.exact_only || !body_.plants_feet) return plan;
    step.foot = MovingFoot(body_.library->group(plan->group).kind);
    step.at = FootprintOf(step);
  }

  // A step to a footprint is planned relative to the fixed foot.
  Footprint exact{step.at->position_m, step.at->heading_rad.value_or(base_.heading_rad)};
  exact.heading_rad = UnwrapAngle(exact.heading_rad, base_.heading_rad);
  if (options_.terrain != nullptr) {
    exact.position_m.y = options_.terrain->HeightAt(exact.position_m.x, exact.position_m.z);
  }
  Foot foot = step.foot.value_or(OtherFoot(last_moved_));
  if (!step.foot && !is_walking_) {
    const DVec3 centre = 0.5 * (StandingPosition(Foot::kLeft) + StandingPosition(Foot::kRight));
    const double side_m = RotateYaw(-exact.heading_rad, exact.position_m - centre).x;
    foot = side_m >= 0.0 ? Foot::kLeft : Foot::kRight;
  }
  auto plan = PlanFootprint(*body_.library, foot, exact, StandingPosition(OtherFoot(foot)),
                            base_.heading_rad, feet_, FootprintOrigin{});
  // The whole pose determines whether a leg reaches a footprint exactly, so a step with exact
  // placement must not be varied.
  if (plan) plan->is_varied = !step.exact_only;
  return plan;
}

void AvatarSimulation::StartPlan(const RequestPlan& plan, std::uint64_t request_id,
                                 PlanScratch& scratch) {
  PlanMovement(plan, 0.0, scratch);
  BeginMovement(plan, request_id);
}

// Plans a movement that starts at a phase (StepPhase), for example that of the step it replaces.
void AvatarSimulation::PlanMovement(const RequestPlan& plan, double start_phase,
                                    PlanScratch& scratch) {
  STRIDEWIRE_CHECK(&scratch.feet.library() == body_.library.get());
  STRIDEWIRE_CHECK(plan.group >= 0 &&
                   static_cast<std::size_t>(plan.group) < body_.library->groups().size());
  const MotionGroup& next = body_.library->group(plan.group);
  STRIDEWIRE_CHECK(plan.applied.count == next.parameter_count());
  std::optional<StrideVariation> variation;
  if (options_.stride_variation && plan.is_varied && IsStep(next.kind)) {
    variation.emplace(options_.seed, movement_number_);
  }
  if (options_.run_time_correction) {
    CorrectWeights(next, plan.applied, DefaultCorrectionLimits(next), scratch.correction,
                   body_.movement, variation);
    body_.movement.group = plan.group;
  } else {
    SetWeights(next, plan.group,
               std::span(plan.applied.values).first(static_cast<std::size_t>(plan.applied.count)),
               scratch.correction.weights(next), body_.movement);
  }
  body_.StartWeighted(base_, 1.0);
  double rate = plan.pace.RateOf(body_.movement.duration_s());
  if (variation) rate *= variation->RateFactor();
  if (rate != 1.0) body_.StartWeighted(base_, rate);
  if (start_phase > 0.0) {
    body_.SetStartOffset(TimeAtPhase(SwingTimesOf(next.kind, body_.movement), start_phase));
  }
  // If the avatar was standing, it has no velocity to keep.
  body_.BlendIn(LandingTarget{plan, options_.terrain.get(), base_.position_m}, keeps_speed(),
                scratch.feet);
}

// Starts the movement that was just planned.
void AvatarSimulation::BeginMovement(const RequestPlan& plan, std::uint64_t request_id) {
  const MotionGroup& next = group();
  // If planting reaches the requested footprint, the step is not reported as clamped, even if its
  // parameters are.
  const bool is_met = plan.exact && body_.movement.feet.is_active &&
                      body_.movement.feet.missed_m == DVec3(0.0) &&
                      body_.movement.feet.missed_rad == 0.0;

  STRIDEWIRE_CHECK(!is_in_stand_ && !is_idling_ && body_.movement.group == plan.group);
  STRIDEWIRE_CHECK(body_.movement.feet.is_active == body_.plants_feet);
  ++revision_;
  ++movement_number_;
  change_.has_begun = true;
  change_.begun_keeps_speed = keeps_speed();
  is_moving_ = true;
  is_settled_ = false;
  body_.begins_planting = false;
  is_exact_ = plan.exact.has_value();
  is_walk_step_ = false;
  inserted_steps_ = 0;
  is_idle_reported_ = false;
  movement_time_s_ = body_.movement.start_offset_s;
  request_id_ = request_id;
  const int rise =
      next.FindParameter(IsStep(next.kind) ? ParameterName::kEndY : ParameterName::kHeight);
  ground_rise_m_ =
      rise >= 0 ? GroundRise(plan.applied.values[static_cast<std::size_t>(rise)]) : 0.0;
  AddEvent({.type = AvatarEventType::kStarted,
            .request_id = request_id,
            .kind = next.kind,
            .group = plan.group,
            .requested = plan.requested,
            .applied = plan.applied,
            .extrapolated = plan.extrapolated,
            .clamped = is_met ? false : plan.clamped});
}

// Moves the base sideways so that straight steps stay on the line of the walk. In groups without a
// sideways parameter, the examples determine the position of the base only along the walking
// direction. Sideways, the base follows the body.
void AvatarSimulation::KeepToLine(const DVec3& line_m) {
  if (!IsStep(group().kind) || group().FindParameter(ParameterName::kEndX) >= 0) return;
  const double heading_rad = body_.movement.base.heading_rad;
  const DVec3 root = DVec3(body_.blended_pose.root_position_m);
  const double side_m = RotateYaw(-heading_rad, root - body_.movement.base.position_m).x +
                        RotateYaw(-heading_rad, line_m - base_.position_m).x;
  base_.position_m += RotateYaw(heading_rad, DVec3(side_m, 0.0, 0.0));
}

void AvatarSimulation::FinishMovement(double at_s) {
  STRIDEWIRE_CHECK(is_moving_);
  const MotionGroup& finished = group();
  const bool has_moved = at_s > SwingTimesOf(finished.kind, body_.movement).release_s;
  CaptureBlendSource(at_s);
  RecordLeaving(at_s, false);
  movement_time_s_ = at_s;
  ++revision_;
  // Without planting, the base frame follows the root, and its height changes by the rise of the
  // movement.
  const BaseFrame before = base_;
  base_ = BaseAfter(body_.movement, body_.pose);
  base_.position_m.y = before.position_m.y + (has_moved ? ground_rise_m_ : 0.0);
  if (!has_moved) base_.heading_rad = before.heading_rad;
  if (body_.movement.feet.is_active) {
    if (!is_exact_) KeepToLine(before.position_m);
    body_.CaptureFootLocks(at_s);
    const auto& left = body_.locks[0].print.position_m;
    const auto& right = body_.locks[1].print.position_m;
    if (IsStep(finished.kind)) {
      const Foot landed = has_moved ? MovingFoot(finished.kind) : last_moved_;
      base_.position_m.y = (landed == Foot::kLeft ? left : right).y;
    } else {
      base_.position_m.y = 0.5 * (left.y + right.y);
    }
  }
  feet_ = MeasureFeet();
  last_group_ = static_cast<std::size_t>(body_.movement.group);
  is_moving_ = false;
  is_walking_ = false;
  if (IsStep(finished.kind)) {
    if (has_moved) last_moved_ = MovingFoot(finished.kind);
    is_walking_ = inserted_steps_ < kMaxInsertedSteps && AreFeetApart(feet_, stand_feet_);
  }
  AddEvent({.type = AvatarEventType::kFinished,
            .request_id = request_id_,
            .kind = finished.kind,
            .group = body_.movement.group,
            .is_cut_short = at_s < body_.movement.duration_s(),
            .base = base_,
            .outcome = MovementOutcome(at_s < body_.movement.duration_s())});
  EndDroppedWalk();
}

void AvatarSimulation::FinishStand() {
  STRIDEWIRE_CHECK(is_in_stand_ && !is_moving_);
  is_in_stand_ = false;
  last_group_ = body_.library->groups().size();
  AddEvent({.type = AvatarEventType::kFinished,
            .request_id = request_id_,
            .is_cut_short = is_stand_cut_short_,
            .base = base_,
            .outcome = MovementOutcome(is_stand_cut_short_)});
}

Vec3 AvatarSimulation::LandingBall(Foot foot) const {
  if (!body_.movement.feet.is_active)
    return BallPosition(body_.library->skeleton(), body_.pose, foot);
  const DVec3 print = body_.movement.feet.foot(foot).to.position_m;
  return Vec3(print.x, print.y + body_.library->leg_rig().side(foot).ball_height_m, print.z);
}

double AvatarSimulation::StrikeTime() const {
  return body_.movement.warp.keytime_s(
      ContactKeytimesOf(group().kind, group().interval_count()).landing);
}

void AvatarSimulation::ReportFootStrikes(double before_s, double after_s) {
  const MotionGroup& moving = group();
  const double strike_s = StrikeTime();
  if (!(before_s < strike_s && strike_s <= after_s)) return;
  if (!body_.movement.feet.is_active) body_.Evaluate(strike_s);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    if (IsStep(moving.kind) && foot != MovingFoot(moving.kind)) continue;
    AddEvent({.type = AvatarEventType::kFootStrike,
              .request_id = request_id_,
              .kind = moving.kind,
              .group = body_.movement.group,
              .foot = foot,
              .position_m = LandingBall(foot)});
  }
}

}  // namespace stridewire
