#include "runtime/plan/walk_steering.h"

#include <algorithm>
#include <cmath>

#include "base/trig.h"
#include "runtime/library/locomotion_profile.h"

namespace stridewire {
namespace {

// Maximum turn of a foot per step, away from the other foot (out) and towards it (in).
struct TurnLimits {
  double out_rad;
  double in_rad;
};
constexpr TurnLimits kWalkTurn{0.7, 0.5};
constexpr TurnLimits kSpotTurn{1.0, 0.7};

// A waypoint is passed when the body is within this distance of it.
constexpr double kPassWaypointM = 0.35;
// If the feet deviate from their relative position in a stand by at most this, they are together.
constexpr double kTogetherM = 0.05;
constexpr double kTogetherRad = 0.15;
// A foot within this distance of its footprint at the goal is at the goal.
constexpr double kAtGoalM = 1e-3;
constexpr double kAtGoalRad = 2e-3;
// The same tolerances after a step that led to the goal. They are larger, because steps of the
// library often do not turn the feet or the body far enough.
constexpr double kAimedM = 0.02;
constexpr double kAimedRad = 0.5;
constexpr double kAimedBodyRad = 0.25;

// Effort of turning by one radian, in metres. The direction of a part of the path that is shorter
// than kNearM has a smaller weight, because a few steps may lead in any direction.
constexpr double kTurnEffort = 0.3;
constexpr double kNearM = 0.5;
// Effort of moving one metre sideways or backward, in metres.
constexpr double kSideEffort = 1.5;

// If the goal is further away than kMaxShiftM, an avatar turns and walks forward. It may reach
// closer goals with steps sideways or backward. With libraries whose longest step backward is
// shorter than kBackM, the limit is kMaxShiftWithoutBackM, because avatars then have to combine
// steps of other kinds.
constexpr double kMaxShiftM = 2.0;
constexpr double kMaxShiftWithoutBackM = 1.3;
constexpr double kBackM = 0.2;
// The avatar does not turn towards a goal that is closer than this.
constexpr double kShuffleM = 0.15;
// The sideways distance between footprints exceeds that of a stand by at most 1.2 times this.
constexpr double kSideStepM = 0.32;
// A sideways distance is divided into equal parts that are at most slightly longer than this. Each
// part takes a pair of steps: the outer foot moves first, and the other foot follows.
constexpr double kLongSideStepM = 0.345;
constexpr double kLeastBackM = 0.12;
constexpr double kLeastApartM = 0.12;
// Expected duration of a step forward, for comparing paths to a goal. Steps that turn on the spot
// or lead sideways or backward are played fast (RequestPlan::pace) and take kQuickStepS.
constexpr double kStrideS = 0.62;
// If a library has no short steps, or no steps backward, the avatar steps sideways only if that
// saves at least this time.
constexpr double kStrideMarginS = 0.3;

// If the angle between an avatar's heading and its path exceeds kSlowTurnRad, a step turns by up to
// kSpotTurn. The larger the angle that remains after the turn, the shorter the step. If that angle
// reaches kSlowTurnRad, the avatar turns on the spot.
constexpr double kSlowTurnRad = 0.7;
// The walk aims at a point behind the goal, so that it approaches the goal in a curve that ends in
// the heading at the goal. The distance of that point from the goal is this fraction of the
// remaining distance, at most kCurveM. It decreases to 0 for headings that would require a loop,
// between kMaxCurveRad - kCurveFadeRad and kMaxCurveRad.
constexpr double kCurvePart = 0.2;
constexpr double kCurveM = 0.6;
constexpr double kMaxCurveRad = 1.9;
constexpr double kCurveFadeRad = 0.6;

// The distance to walk is divided into equal steps. It may exceed a whole number of comfortable
// steps by this fraction of a step before the walk takes another step.
constexpr double kStretch = 0.15;
// Expected duration of the first step of a walk.
constexpr double kFirstStepS = 0.6;
constexpr double kShortestStepM = 0.2;

double Length(const DVec3& v) { return std::sqrt(v.x * v.x + v.z * v.z); }
double HeadingTo(const DVec3& v) { return Atan2(v.x, v.z); }
double Outward(Foot foot) { return foot == Foot::kLeft ? 1.0 : -1.0; }

// Returns the number of equal parts into which to divide a length, so that no part is much longer
// than `one`.
double PartCount(double length, double one) {
  return std::max(1.0, std::ceil(length / one - kStretch));
}

double TurnWithin(double turn_rad, Foot moving, const TurnLimits& limits) {
  const double outward = Outward(moving);
  const double out_rad = std::clamp(outward * turn_rad, -limits.in_rad, limits.out_rad);
  return outward * out_rad;
}

}  // namespace

WalkSteering::WalkSteering(const LocomotionProfile& profile, const WalkRequest& walk,
                           const WalkStance& stance)
    : profile_(profile), walk_(walk), stance_(stance) {
  goal_.position_m = walk.position_m;
  goal_.heading_rad = UnwrapAngle(walk.heading_rad, stance.heading_rad);
  approach_ = goal_;
  if (profile.stands_in_stride) {
    const DVec3 rear = profile.stand_feet_m[static_cast<std::size_t>(profile.RearFoot())];
    const double behind_m = FootOffset(profile.RearFoot(), profile.stand_m).z - rear.z;
    approach_.position_m -= RotateYaw(goal_.heading_rad, DVec3(0.0, 0.0, behind_m));
  }
}

// Returns the position of a foot relative to the body while the feet are side by side.
DVec3 WalkSteering::FootOffset(Foot foot, double width_m) const {
  const DVec3 left = profile_.stand_feet_m[0];
  const DVec3 right = profile_.stand_feet_m[1];
  const double ahead_m = profile_.stands_in_stride ? 0.5 * (left.z + right.z)
                         : foot == Foot::kLeft     ? left.z
                                                   : right.z;
  return {0.5 * (left.x + right.x) + 0.5 * Outward(foot) * width_m, 0.0, ahead_m};
}

WalkSteering::Body WalkSteering::BodyOver(Foot fixed) const {
  const DVec3 apart =
      RotateYaw(-stance_.heading_rad, At(fixed).position_m - At(OtherFoot(fixed)).position_m);
  const double width_m = std::clamp(Outward(fixed) * apart.x,
                                    std::min(profile_.width_m, profile_.stand_m), profile_.stand_m);
  Body body;
  body.heading_rad = stance_.heading_rad;
  body.position_m =
      At(fixed).position_m - RotateYaw(stance_.heading_rad, FootOffset(fixed, width_m));
  return body;
}

WalkSteering::Body WalkSteering::BodyNow() const {
  const Body left = BodyOver(Foot::kLeft);
  const Body right = BodyOver(Foot::kRight);
  return {0.5 * (left.position_m + right.position_m), stance_.heading_rad};
}

Footprint WalkSteering::GoalPrint(Foot foot) const {
  DVec3 offset = FootOffset(foot, profile_.stand_m);
  offset.z = profile_.stand_feet_m[static_cast<std::size_t>(foot)].z;
  return {goal_.position_m + RotateYaw(goal_.heading_rad, offset), goal_.heading_rad};
}

bool WalkSteering::IsWithin(Foot foot, double within_m, double within_rad) const {
  const Footprint goal = GoalPrint(foot);
  return Length(At(foot).position_m - goal.position_m) <= within_m &&
         std::fabs(WrapAngle(At(foot).heading_rad - goal.heading_rad)) <= within_rad;
}

bool WalkSteering::IsAtGoal(Foot foot) const {
  return stance_.is_aimed[static_cast<std::size_t>(foot)] ? IsWithin(foot, kAimedM, kAimedRad)
                                                          : IsWithin(foot, kAtGoalM, kAtGoalRad);
}

bool WalkSteering::HasArrived(double within_m, double within_rad) const {
  return std::fabs(WrapAngle(stance_.heading_rad - goal_.heading_rad)) <= within_rad &&
         IsWithin(Foot::kLeft, within_m, within_rad) &&
         IsWithin(Foot::kRight, within_m, within_rad);
}

bool WalkSteering::IsCloseToGoal() const {
  return std::fabs(WrapAngle(stance_.heading_rad - goal_.heading_rad)) <= kAimedBodyRad &&
         IsAtGoal(Foot::kLeft) && IsAtGoal(Foot::kRight);
}

void WalkSteering::PassWaypoints(std::size_t& next) const {
  const Body body = BodyNow();
  while (next < walk_.waypoints_m.size() &&
         Length(walk_.waypoints_m[next] - body.position_m) <= kPassWaypointM) {
    ++next;
  }
}

// Returns the length of the path through the remaining waypoints.
double WalkSteering::DistanceM(DVec3 from, std::size_t next_waypoint, const DVec3& to) const {
  double distance_m = 0.0;
  for (std::size_t i = next_waypoint; i < walk_.waypoints_m.size(); ++i) {
    distance_m += Length(walk_.waypoints_m[i] - from);
    from = walk_.waypoints_m[i];
  }
  return distance_m + Length(to - from);
}

double WalkSteering::EffortM(Foot moved, std::size_t next_waypoint) const {
  const Body body = BodyOver(moved);
  // Position of the body at the goal. Like `body`, it is derived from a footprint of this foot.
  const DVec3 goal_m = GoalPrint(moved).position_m -
                       RotateYaw(goal_.heading_rad, FootOffset(moved, profile_.stand_m));
  const double distance_m = DistanceM(body.position_m, next_waypoint, goal_m);
  DVec3 from = body.position_m;
  double heading_rad = body.heading_rad;
  double turn_rad = 0.0;
  const auto turn_along = [&](const DVec3& to) {
    const DVec3 way = to - from;
    const double length_m = Length(way);
    if (length_m < kAtGoalM) return;
    const double along_rad = HeadingTo(way);
    const double away_rad = WrapAngle(along_rad - heading_rad);
    const double part = std::min(1.0, length_m / kNearM);
    turn_rad += part * std::fabs(away_rad);
    heading_rad += part * away_rad;
    from = to;
  };
  for (std::size_t i = next_waypoint; i < walk_.waypoints_m.size(); ++i) {
    turn_along(walk_.waypoints_m[i]);
  }
  turn_along(goal_m);
  turn_rad += std::fabs(WrapAngle(goal_.heading_rad - heading_rad));
  const double walking_m = distance_m + kTurnEffort * turn_rad;
  if (next_waypoint < walk_.waypoints_m.size() || distance_m > kNearM) return walking_m;
  const double shifting_m =
      kSideEffort * distance_m +
      kTurnEffort * std::fabs(WrapAngle(goal_.heading_rad - body.heading_rad));
  return std::min(walking_m, shifting_m);
}

double WalkSteering::BodiesApartM() const {
  return Length(BodyOver(Foot::kLeft).position_m - BodyOver(Foot::kRight).position_m);
}

bool WalkSteering::IsGoalNear(Foot moving, std::size_t next_waypoint) const {
  return next_waypoint >= walk_.waypoints_m.size() &&
         Length(GoalPrint(moving).position_m - At(OtherFoot(moving)).position_m) <=
             profile_.longest_m + profile_.stand_m;
}

double WalkSteering::StepM() const {
  if (!walk_.speed_m_s) return profile_.step_m;
  const double step_s = stance_.last_step_s > 0.0 ? stance_.last_step_s : kFirstStepS;
  const double shortest_m = std::max(kShortestStepM, profile_.shortest_m);
  return std::clamp(*walk_.speed_m_s * step_s, std::min(shortest_m, profile_.longest_m),
                    profile_.longest_m);
}

double WalkSteering::Bearing(const Body& body, std::size_t next_waypoint) const {
  if (next_waypoint < walk_.waypoints_m.size()) {
    return HeadingTo(walk_.waypoints_m[next_waypoint] - body.position_m);
  }
  const DVec3 way = approach_.position_m - body.position_m;
  const double straight_rad = HeadingTo(way);
  const double remaining_m = Length(way);
  if (remaining_m <= (1.0 + kStretch) * StepM()) return straight_rad;
  const double bend_rad = std::fabs(WrapAngle(approach_.heading_rad - straight_rad));
  const double curve_m = std::min(kCurvePart * remaining_m, kCurveM) *
                         std::clamp((kMaxCurveRad - bend_rad) / kCurveFadeRad, 0.0, 1.0);
  return HeadingTo(way - RotateYaw(approach_.heading_rad, DVec3(0.0, 0.0, curve_m)));
}

// Returns true if steps sideways, backward or on the spot are expected to reach the goal as fast as
// walking forward, or faster.
bool WalkSteering::PrefersSideSteps(const Body& body, bool is_last_leg) const {
  if (!is_last_leg) return false;
  const DVec3 way = approach_.position_m - body.position_m;
  const double remaining_m = Length(way);
  if (remaining_m > (profile_.back_m >= kBackM ? kMaxShiftM : kMaxShiftWithoutBackM)) return false;
  if (remaining_m < kShuffleM) return true;
  const auto turning_s = [](double turn_rad, double free_rad) {
    return kQuickStepS * 2.0 * std::max(0.0, std::fabs(turn_rad) - free_rad) /
           (kSpotTurn.out_rad + kSpotTurn.in_rad);
  };
  const double way_rad = HeadingTo(way);
  const double walking_s = turning_s(WrapAngle(way_rad - body.heading_rad), kWalkTurn.out_rad) +
                           kStrideS * PartCount(remaining_m, StepM()) + kQuickStepS +
                           turning_s(WrapAngle(approach_.heading_rad - way_rad), kSpotTurn.out_rad);
  // The body turns to its final heading while it steps. The path is therefore measured from the
  // heading midway between the current and the final one. If it were measured from the current
  // heading, the preferred kind of step would change from step to step, and walks would zigzag.
  const double turn_rad = WrapAngle(approach_.heading_rad - body.heading_rad);
  const DVec3 local = RotateYaw(-body.heading_rad - 0.5 * turn_rad, way);
  const double along_s =
      local.z >= 0.0 ? kStrideS * PartCount(local.z, StepM())
                     : kQuickStepS * PartCount(-local.z, std::max(profile_.back_m, kLeastBackM));
  const double shifting_s = std::max(
      {kQuickStepS + along_s, kQuickStepS * 2.0 * PartCount(std::fabs(local.x), kLongSideStepM),
       kQuickStepS + turning_s(turn_rad, 0.0)});
  // Libraries without short steps or steps backward often lack side steps as well.
  const bool may_lack_steps = profile_.shortest_m > kShortestStepM || profile_.back_m < kBackM;
  return shifting_s <= walking_s - (may_lack_steps ? kStrideMarginS : 0.0);
}

// If the avatar is not walking and its feet are apart along the path, prefers the foot behind and
// returns true.
bool WalkSteering::PreferFootBehind(const Body& body, std::size_t next_waypoint) {
  if (stance_.last_step_s > 0.0) return false;
  const bool is_last_leg = next_waypoint >= walk_.waypoints_m.size();
  const double left_ahead_m =
      RotateYaw(-body.heading_rad, At(Foot::kLeft).position_m - At(Foot::kRight).position_m).z;
  if (std::fabs(left_ahead_m) <= kFeetApartForwardM) return false;
  // An avatar turns towards its goal before it walks forward. It therefore moves backward only
  // where it prefers side steps.
  const bool is_backward =
      PrefersSideSteps(body, is_last_leg) &&
      RotateYaw(-body.heading_rad, approach_.position_m - body.position_m).z < -kFeetApartForwardM;
  const Foot behind = (left_ahead_m > 0.0) != is_backward ? Foot::kRight : Foot::kLeft;
  feet_ = {behind, OtherFoot(behind)};
  return true;
}

std::span<const Foot> WalkSteering::FeetToMove(std::size_t next_waypoint) {
  const Foot expected = OtherFoot(stance_.last_moved);
  feet_ = {expected, stance_.last_moved};
  const bool is_last_leg = next_waypoint >= walk_.waypoints_m.size();
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    // The foot that is not at the goal yet moves next, unless it has just moved.
    if (!is_last_leg || !IsAtGoal(foot)) continue;
    if (stance_.last_step_s > 0.0 && OtherFoot(foot) != expected) continue;
    feet_ = {OtherFoot(foot), foot};
    return std::span(feet_).first(1);
  }
  const Body body = BodyNow();
  if (PreferFootBehind(body, next_waypoint)) return std::span(feet_).first(1);
  const Body left = BodyOver(Foot::kLeft);
  const Body right = BodyOver(Foot::kRight);
  const bool is_together =
      Length(left.position_m - right.position_m) <= kTogetherM &&
      std::fabs(WrapAngle(At(Foot::kLeft).heading_rad - At(Foot::kRight).heading_rad)) <=
          kTogetherRad;
  if (!is_together) return std::span(feet_).first(1);

  // From a stand, either foot may step first. The foot on the side of the turn or of the path is
  // preferred.
  Foot first = expected;
  const auto towards = [&](double value, double least) {
    if (std::fabs(value) > least) first = value > 0.0 ? Foot::kLeft : Foot::kRight;
    return std::fabs(value) > least;
  };
  if (PrefersSideSteps(body, is_last_leg)) {
    const DVec3 local = RotateYaw(-body.heading_rad, approach_.position_m - body.position_m);
    if (!towards(local.x, 0.06)) towards(WrapAngle(goal_.heading_rad - body.heading_rad), 0.1);
  } else {
    towards(WrapAngle(Bearing(body, next_waypoint) - body.heading_rad), 0.25);
  }
  feet_ = {first, OtherFoot(first)};
  return feet_;
}

WalkStep WalkSteering::NextStep(Foot moving, std::size_t next_waypoint, double part,
                                double bend_rad) const {
  const Body body = BodyOver(OtherFoot(moving));
  const bool is_last_leg = next_waypoint >= walk_.waypoints_m.size();
  if (is_last_leg && IsAtGoal(OtherFoot(moving))) {
    return part == 1.0 ? StepToGoal(moving) : StepTowardsGoal(moving, part);
  }
  if (PrefersSideSteps(body, is_last_leg)) return SideStep(body, moving, part, bend_rad);
  return Walk(body, moving, next_waypoint, part, bend_rad);
}

WalkStep WalkSteering::ComfortableStep(Foot moving, double turn_rad) const {
  Body body = BodyOver(OtherFoot(moving));
  body.heading_rad += turn_rad;
  body.position_m += RotateYaw(body.heading_rad, DVec3(0.0, 0.0, profile_.step_m));
  return StepTo(body, moving);
}

WalkStep WalkSteering::Pivot(Foot moving, double turn_rad) const {
  Body body = BodyOver(OtherFoot(moving));
  body.heading_rad += turn_rad;
  return StepTo(body, moving);
}

WalkStep WalkSteering::StepToGoal(Foot moving) const {
  const DVec3 fixed_m = BodyOver(OtherFoot(moving)).position_m;
  const bool is_at_goal = IsAtGoal(OtherFoot(moving));
  return {GoalPrint(moving), is_at_goal ? goal_.position_m : 0.5 * (fixed_m + goal_.position_m),
          true};
}

// Returns a step that covers the fraction `part` of the distance to the foot's place at the goal.
WalkStep WalkSteering::StepTowardsGoal(Foot moving, double part) const {
  WalkStep step = StepToGoal(moving);
  const Footprint& from = At(moving);
  step.print.position_m = from.position_m + part * (step.print.position_m - from.position_m);
  step.print.heading_rad =
      stance_.heading_rad + part * WrapAngle(goal_.heading_rad - stance_.heading_rad);
  step.is_last = false;
  return step;
}

WalkStep WalkSteering::StepTo(const Body& body, Foot moving) const {
  const DVec3 fixed = At(OtherFoot(moving)).position_m;
  const DVec3 local = RotateYaw(-body.heading_rad, body.position_m - fixed);
  // In long steps, the feet are closer together sideways than in a stand.
  const double stride = std::clamp(std::fabs(local.z) / 0.35, 0.0, 1.0);
  const double width_m = profile_.stand_m + (profile_.width_m - profile_.stand_m) * stride;
  DVec3 vector = local + FootOffset(moving, width_m);
  const double outward = Outward(moving);
  const double least_m = std::min(kLeastApartM, width_m);
  vector.x = outward * std::clamp(outward * vector.x, least_m, profile_.stand_m + 1.2 * kSideStepM);
  vector.z =
      std::clamp(vector.z, -std::max(profile_.back_m, kLeastBackM) - 0.05, profile_.longest_m);
  WalkStep step;
  step.print.position_m = fixed + RotateYaw(body.heading_rad, vector);
  step.print.heading_rad = body.heading_rad;
  step.root_m = 0.5 * (body.position_m + BodyOver(OtherFoot(moving)).position_m);
  return step;
}

// Returns the number of equal steps for a distance. If the stand pose of the library is a stride,
// the rear foot must take the last of these steps, so the number must be odd or even accordingly.
double WalkSteering::StepCount(Foot moving, double distance_m, bool is_last_leg) const {
  const double steps = PartCount(distance_m, StepM());
  if (!profile_.stands_in_stride || !is_last_leg) return steps;
  const bool ends_with_moving = std::fmod(steps, 2.0) == 1.0;
  if (ends_with_moving == (moving == profile_.RearFoot())) return steps;
  const bool may_be_longer =
      steps > 1.0 && distance_m / (steps - 1.0) <= (1.0 + kStretch) * profile_.longest_m;
  return may_be_longer ? steps - 1.0 : steps + 1.0;
}

WalkStep WalkSteering::Walk(const Body& body, Foot moving, std::size_t next_waypoint, double part,
                            double bend_rad) const {
  const bool is_last_leg = next_waypoint >= walk_.waypoints_m.size();
  const double away_rad = WrapAngle(Bearing(body, next_waypoint) + bend_rad - body.heading_rad);
  const double turn_rad =
      part *
      TurnWithin(away_rad, moving, std::fabs(away_rad) > kSlowTurnRad ? kSpotTurn : kWalkTurn);
  const double rest_rad = std::fabs(away_rad - turn_rad);
  const double remaining_m = DistanceM(body.position_m, next_waypoint, approach_.position_m);
  const double steps = StepCount(moving, remaining_m, is_last_leg);
  if (is_last_leg && steps <= 1.0 && part == 1.0 && bend_rad == 0.0 && rest_rad < 0.1) {
    const double last_rad = WrapAngle(goal_.heading_rad - body.heading_rad);
    const double turned_rad = TurnWithin(last_rad, moving, kWalkTurn);
    if (turned_rad == last_rad) return StepToGoal(moving);
    return StepTo({approach_.position_m, body.heading_rad + turned_rad}, moving);
  }
  const double step_m =
      part * remaining_m / steps * std::clamp(1.0 - rest_rad / kSlowTurnRad, 0.0, 1.0);
  Body next;
  next.heading_rad = body.heading_rad + turn_rad;
  next.position_m = body.position_m + RotateYaw(next.heading_rad, DVec3(0.0, 0.0, step_m));
  return StepTo(next, moving);
}

WalkStep WalkSteering::SideStep(const Body& body, Foot moving, double part, double bend_rad) const {
  DVec3 local = RotateYaw(-body.heading_rad, approach_.position_m - body.position_m);
  local = RotateYaw(bend_rad, local);
  const double turn_rad = WrapAngle(approach_.heading_rad - body.heading_rad);
  const double outward = Outward(moving);
  const double aside_m = outward * local.x;
  const double turn_out_rad = outward * turn_rad;
  const double inner_m = std::max(0.02, profile_.stand_m - kLeastApartM);

  // Sideways motion and turning take pairs of steps: the outer foot moves first, and the other foot
  // follows.
  const double side_pairs = std::fabs(local.x) <= inner_m && aside_m < 0.0
                                ? 0.0
                                : PartCount(std::fabs(local.x), kLongSideStepM);
  const double turn_pairs =
      std::fabs(turn_rad) <= kSpotTurn.in_rad && turn_out_rad < 0.0
          ? 0.0
          : PartCount(std::fabs(turn_rad), kSpotTurn.out_rad + kSpotTurn.in_rad);
  const auto steps_of = [](double pairs, bool is_outer) {
    return pairs == 0.0 ? 1.0 : 2.0 * pairs - (is_outer ? 1.0 : 0.0);
  };
  const double ahead_m = local.z >= 0.0 ? StepM() : std::max(profile_.back_m, kLeastBackM);
  const double steps =
      std::max({PartCount(std::fabs(local.z), ahead_m), steps_of(side_pairs, aside_m >= 0.0),
                steps_of(turn_pairs, turn_out_rad >= 0.0)});

  Body next = body;
  DVec3 move(0.0, 0.0, local.z / steps);
  if (aside_m >= 0.0) {
    move.x = outward * std::min(aside_m / std::max(side_pairs, 1.0), 1.15 * kSideStepM);
  } else {
    move.x = -outward * std::min(-aside_m, side_pairs == 0.0 ? inner_m : 0.0);
  }
  double turned_rad = 0.0;
  if (turn_out_rad >= 0.0) {
    const double pairs = std::max(turn_pairs, 1.0);
    turned_rad = pairs == 1.0 ? std::min(turn_out_rad, kSpotTurn.out_rad)
                              : std::min(turn_out_rad / pairs, kSpotTurn.out_rad);
  } else {
    turned_rad = -std::min(-turn_out_rad, kSpotTurn.in_rad);
  }
  if (steps == 1.0 && part == 1.0 && bend_rad == 0.0 && turned_rad == turn_out_rad) {
    return StepToGoal(moving);
  }
  next.position_m += RotateYaw(body.heading_rad, part * move);
  next.heading_rad += part * outward * turned_rad;
  return StepTo(next, moving);
}

}  // namespace stridewire
