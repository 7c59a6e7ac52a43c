#include "stridewire/runtime/avatar.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "stridewire/base/check.h"
#include "stridewire/runtime/correction.h"
#include "stridewire/runtime/foot_vector.h"

namespace stridewire {
namespace {

// Feet this far from where the stand pose has them, forward or aside, are not a stand. Few libraries
// have steps that bring feet together sideways, so a wide stand is left alone for longer.
constexpr double kFeetApartForwardM = 0.12;
constexpr double kFeetApartAsideM = 0.3;

// A library may not reach a stand in one step from a long stride; after this many it stands as it is.
constexpr int kMaxClosingSteps = 3;
constexpr double kClosingGainM = 0.03;  // a second one must be worth taking

// Parameters of height are measured at the balls, which differ by some centimetres on level ground
// at the middle of double support, since feet roll. Taken for ground, that climbs half a metre in a
// hundred level steps.
constexpr double kLevelRiseM = 0.05;

// Events one movement can add in a tick: started, two foot-strikes, finished, and the next started.
constexpr std::size_t kEventReserve = 6;

// The keytime at which feet land, counted from the end: a jump has its lowest point after it.
int LandingKeytime(const MotionGroup& group) {
  const int n = group.interval_count();
  return group.kind == MovementKind::kJump && n == 5 ? 3 : std::max(n - 1, 0);
}

}  // namespace

Avatar::Avatar(std::shared_ptr<const MotionLibrary> library, const BaseFrame& start,
               const AvatarOptions& options)
    : library_(std::move(library)), options_(options), cache_(library_->layout()) {
  const int joint_count = library_->skeleton().joint_count();
  pose_ = Pose(joint_count);
  movement_.difference = Pose(joint_count);
  movement_.weights.reserve(static_cast<std::size_t>(library_->max_example_count()));
  weight_scratch_.resize(static_cast<std::size_t>(library_->max_example_count()));
  stand_feet_.left_from_right_m =
      FootVector(library_->skeleton(), library_->stand_pose(), Foot::kLeft, 0.0);
  Teleport(start);
}

void Avatar::Teleport(const BaseFrame& start) {
  base_ = start;
  const Pose& stand = library_->stand_pose();
  pose_ = stand;
  pose_.root_position_m =
      Vec3(start.position_m + RotateYaw(start.heading_rad, DVec3(stand.root_position_m)));
  pose_.rotations[0] = YawRotation(start.heading_rad) * stand.rotations[0];
  is_moving_ = is_in_stand_ = is_idle_reported_ = is_walking_ = false;
  closing_steps_ = 0;
  feet_ = stand_feet_;
  last_moved_ = Foot::kRight;
  CancelQueue();
}

Status Avatar::Enqueue(const MovementRequest& request) {
  if (Status status = ValidateRequest(*library_, request); !status) return status;
  if (queue_size() >= kMaxQueue) {
    return Fail(ErrorCode::kLimitExceeded, "the avatar's queue is full", kMaxQueue);
  }
  if (queue_head_ > 64 && queue_head_ * 2 > queue_.size()) {
    queue_.erase(queue_.begin(), queue_.begin() + static_cast<std::ptrdiff_t>(queue_head_));
    queue_head_ = 0;
  }
  queue_.push_back(request);
  return {};
}

int Avatar::CancelQueue() {
  const int dropped = queue_size();
  queue_.clear();
  queue_head_ = 0;
  return dropped;
}

void Avatar::AddEvent(const AvatarEvent& event) {
  STRIDEWIRE_CHECK(event_count_ < events_.size());
  events_[event_count_] = event;
  events_[event_count_].time_s = time_s_;
  if (event.type == AvatarEventType::kStarted) started_ = events_[event_count_];
  ++event_count_;
}

FootState Avatar::MeasureFeet() const {
  return {FootVector(library_->skeleton(), pose_, Foot::kLeft, base_.heading_rad)};
}

void Avatar::Evaluate(double time_s) {
  EvaluateMovement(group(), library_->layout(), movement_, time_s, cache_, pose_);
}

void Avatar::Advance(double dt_s) {
  STRIDEWIRE_CHECK(dt_s > 0.0 && dt_s <= 1.0);
  event_count_ = 0;
  const double end_s = time_s_ + dt_s;
  double left_s = dt_s;
  for (;;) {
    // Movements shorter than a tick could otherwise outrun the event list; the rest of the time
    // is then spent in the next tick.
    const bool may_change = event_count_ + kEventReserve <= events_.size();
    if (is_moving_) {
      const double before_s = movement_time_s_;
      const double duration_s = movement_.duration_s();
      if (before_s + left_s < duration_s || !may_change) {
        movement_time_s_ = before_s + left_s;
        time_s_ = end_s;
        if (may_change) ReportFootStrikes(before_s, movement_time_s_);
        break;
      }
      left_s = before_s + left_s - duration_s;
      time_s_ = end_s - left_s;
      ReportFootStrikes(before_s, duration_s);
      FinishMovement();
    } else if (is_in_stand_) {
      if (stand_left_s_ > left_s || !may_change) {
        stand_left_s_ -= left_s;
        break;
      }
      left_s -= stand_left_s_;
      time_s_ = end_s - left_s;
      FinishStand();
    }
    if (!may_change || !StartNext()) break;
  }
  time_s_ = end_s;
  if (is_moving_) Evaluate(movement_time_s_);
}

bool Avatar::BringsFeetTogether(const RequestPlan& plan) const {
  const int end_z = library_->group(plan.group).FindParameter(ParameterName::kEndZ);
  if (end_z < 0) return false;
  return std::fabs(plan.applied.values[static_cast<std::size_t>(end_z)]) <
         std::fabs(feet_.left_from_right_m.z) - kClosingGainM;
}

bool Avatar::StartNext() {
  const bool is_empty = queue_size() == 0;
  const bool next_is_step =
      !is_empty && std::holds_alternative<StepRequest>(queue_[queue_head_].movement);
  if (is_walking_ && !next_is_step) {
    // The walk ends here: bring the feet together, so that nobody freezes in mid-air.
    is_walking_ = false;
    const auto plan = PlanStep(*library_, StepRequest{}, feet_, last_moved_, false);
    if (plan && (closing_steps_ == 0 || BringsFeetTogether(*plan))) {
      const int closing_steps = closing_steps_ + 1;
      StartPlan(*plan, 0);
      closing_steps_ = closing_steps;
      return true;
    }
  }
  if (is_empty) {
    if (!std::exchange(is_idle_reported_, true)) {
      AddEvent({.type = AvatarEventType::kIdle, .base = base_});
    }
    return false;
  }

  const MovementRequest request = queue_[queue_head_++];
  if (queue_size() == 0) CancelQueue();
  is_idle_reported_ = false;
  if (const auto* stand = std::get_if<StandRequest>(&request.movement)) {
    is_in_stand_ = true;
    request_id_ = request.id;
    stand_left_s_ = stand->seconds;
    AddEvent({.type = AvatarEventType::kStarted, .request_id = request.id});
    return true;
  }
  const auto* step = std::get_if<StepRequest>(&request.movement);
  const auto plan = step != nullptr ? PlanStep(*library_, *step, feet_, last_moved_, !is_walking_)
                                    : PlanJump(*library_, std::get<JumpRequest>(request.movement));
  STRIDEWIRE_CHECK(plan.has_value());  // Enqueue saw to it that the library has the kind
  StartPlan(*plan, request.id);
  return true;
}

void Avatar::StartPlan(const RequestPlan& plan, std::uint64_t request_id) {
  const MotionGroup& next = library_->group(plan.group);
  const Pose& displayed = pose_;
  ParameterValues parameters = plan.applied;
  if (options_.run_time_correction) {
    // The difference pose is made below: until then it is room to measure in.
    parameters =
        CorrectParameters(*library_, plan.group, plan.applied, DefaultCorrectionLimits(next),
                          weight_scratch_, cache_, movement_.difference, movement_)
            .parameters;
  }
  cache_.Clear();
  StartMovement(next, plan.group,
                std::span(parameters.values).first(static_cast<std::size_t>(parameters.count)),
                base_, weight_scratch_, movement_);
  // D = P - M(0), with P what is displayed.
  EvaluateBlend(next, library_->layout(), movement_, 0.0, cache_, movement_.difference);
  Subtract(displayed, movement_.difference, movement_.difference);

  is_moving_ = true;
  closing_steps_ = 0;
  is_idle_reported_ = false;
  movement_time_s_ = 0.0;
  request_id_ = request_id;
  const int rise =
      next.FindParameter(IsStep(next.kind) ? ParameterName::kEndY : ParameterName::kHeight);
  const double rise_m = rise >= 0 ? plan.applied.values[static_cast<std::size_t>(rise)] : 0.0;
  ground_rise_m_ = std::fabs(rise_m) > kLevelRiseM ? rise_m : 0.0;
  AddEvent({.type = AvatarEventType::kStarted,
            .request_id = request_id,
            .kind = next.kind,
            .group = plan.group,
            .requested = plan.requested,
            .applied = plan.applied,
            .extrapolated = plan.extrapolated,
            .clamped = plan.clamped});
}

void Avatar::FinishMovement() {
  const MotionGroup& finished = group();
  Evaluate(movement_.duration_s());
  base_ = BaseAfter(movement_, pose_);
  base_.position_m.y += ground_rise_m_;
  feet_ = MeasureFeet();
  is_moving_ = false;
  is_walking_ = false;
  if (IsStep(finished.kind)) {
    last_moved_ = MovingFoot(finished.kind);
    const DVec3 apart = feet_.left_from_right_m - stand_feet_.left_from_right_m;
    is_walking_ = closing_steps_ < kMaxClosingSteps && (std::fabs(apart.z) > kFeetApartForwardM ||
                                                        std::fabs(apart.x) > kFeetApartAsideM);
  }
  AddEvent({.type = AvatarEventType::kFinished,
            .request_id = request_id_,
            .kind = finished.kind,
            .group = movement_.group,
            .base = base_});
}

void Avatar::FinishStand() {
  is_in_stand_ = false;
  AddEvent({.type = AvatarEventType::kFinished, .request_id = request_id_, .base = base_});
}

void Avatar::ReportFootStrikes(double before_s, double after_s) {
  const MotionGroup& moving = group();
  const double strike_s = movement_.keytimes_s[static_cast<std::size_t>(LandingKeytime(moving))];
  if (!(before_s < strike_s && strike_s <= after_s)) return;
  Evaluate(strike_s);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    if (IsStep(moving.kind) && foot != MovingFoot(moving.kind)) continue;
    AddEvent({.type = AvatarEventType::kFootStrike,
              .request_id = request_id_,
              .kind = moving.kind,
              .group = movement_.group,
              .foot = foot,
              .position_m = BallPosition(library_->skeleton(), pose_, foot)});
  }
}

}  // namespace stridewire
