#include "runtime/plan/step_planner.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.h"
#include "base/trig.h"
#include "runtime/library/contact_keytimes.h"
#include "runtime/plan/foot_planner.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

constexpr double kPi = 3.14159265358979323846;

// Maximum difference in height between the end of the library's own step and the footprint. It
// applies to strict plans in libraries with climbing steps.
constexpr double kMaxErrorHeightM = 0.08;
// Maximum error of the heading of the body after a step of a plan that is not strict.
constexpr double kMaxLooseErrorRad = 0.5;
// Steps of walks may turn this much more or less than the library's own steps. If the limit were
// kMaxExtraTurnRad, libraries without steps that turn on the spot would need ten steps for a
// half-turn.
constexpr double kMaxWalkTurnRad = 0.6;
// When the planner looks ahead, the limits on the errors of distances and angles apply as they are.
// For the next step itself they are multiplied by kSlack, because feet do not land exactly as
// predicted when the planner looked ahead.
constexpr double kSlack = 1.05;
// A step that is not longer than this ends with the body above both feet, not above one of them.
constexpr double kForwardM = 0.2;

// Steps that are shorter than kStrideM or turn by more than kHurriedTurnRad are played fast.
constexpr double kStrideM = 0.35;
constexpr double kHurriedTurnRad = 0.25;

// Limits on the ground below a sole (FootSupport). They exclude edges, bumps and walls.
constexpr double kLeastCarried = 0.999;
constexpr double kDeepestGapM = 0.04;
constexpr double kHighestRiseM = 0.04;
// On treads that are too short for a foot, these fractions of the sole behind and in front of the
// ball must rest on the tread. The rest may overhang its edges.
constexpr double kBearingHeel = 0.6;
constexpr double kBearingToes = 0.3;
// A tread ends where the ground rises or drops by more than kEdgeM within kEdgeStepM.
constexpr double kEdgeM = 0.04;
constexpr double kEdgeStepM = 0.02;
// Maximum height of an obstacle along a swing, above the highest of the two ends of the swing and
// the standing foot. Ground within kHurdleRadiusM of the path counts as an obstacle.
constexpr double kMaxHurdleM = 0.25;
constexpr double kHurdleRadiusM = 0.06;

// Radii of the rings of eight alternative footprints around the desired one, closest first.
constexpr std::array<double, 6> kRingsM{0.04, 0.08, 0.12, 0.16, 0.22, 0.28};

// Steps that would climb or descend by more than kEasyClimbM are shortened to fractions of their
// length, so that avatars do not skip treads of stairs. This applies if the shorter step still
// leads onto ground that is at least kLeastClimbM higher or lower than the standing foot.
constexpr double kEasyClimbM = 0.18;
// Replaces kEasyClimbM on slopes, where the y component of the ground normal is below
// kSlopeNormalY.
constexpr double kEasySlopeClimbM = 0.15;
constexpr float kSlopeNormalY = 0.985f;
constexpr double kLeastClimbM = 0.05;
// If no fraction leads onto such ground, steps longer than kLongClimbM end in front of the edge.
constexpr double kLongClimbM = 0.55;
constexpr std::array<double, 6> kShorterSteps{0.9, 0.8, 0.7, 0.6, 0.5, 0.4};

// Feet keep this distance from risers in front of their toes and behind their heels, if the
// footprint can be shifted accordingly.
constexpr double kRoomM = 0.02;
constexpr std::array<double, 10> kRoomShiftsM{-0.015, 0.015, -0.03, 0.03,   -0.045,
                                              0.045,  -0.06, 0.06,  -0.075, 0.075};

// After this many alternatives that the library cannot reach, the planner abandons the step.
constexpr int kMaxOutOfReach = 3;

}  // namespace

StepPlanner::StepPlanner(const MotionLibrary& library, const Terrain* terrain,
                         const WalkStance& stance, bool checks_ground)
    : library_(library),
      profile_(library.locomotion_profile()),
      terrain_(terrain),
      stance_(stance),
      checks_ground_(checks_ground) {}

std::optional<PlannedStep> StepPlanner::Plan(Foot moving, const WalkStep& step, bool is_strict) {
  moving_ = moving;
  is_strict_ = is_strict;
  outward_ = moving == Foot::kLeft ? 1.0 : -1.0;
  fixed_m_ = stance_.feet[static_cast<std::size_t>(OtherFoot(moving))].position_m;
  Footprint wanted{step.print.position_m, UnwrapAngle(step.print.heading_rad, stance_.heading_rad)};
  if (terrain_ == nullptr) return PlanExactStep(Level(wanted), step);
  if (!step.is_last) wanted = WithEasyClimb(WithRoom(wanted));
  if (!checks_ground_ || IsGood(wanted)) return PlanExactStep(OnGround(wanted), step);
  if (step.is_last) return std::nullopt;
  int out_of_reach = 0;
  for (const double ring_m : kRingsM) {
    for (int i = 0; i < 8; ++i) {
      // Directions of the alternatives: ahead and behind first, sideways last.
      constexpr std::array<double, 8> kAround{0.0,        kPi,         0.25 * kPi, -0.25 * kPi,
                                              0.75 * kPi, -0.75 * kPi, 0.5 * kPi,  -0.5 * kPi};
      const double way = wanted.heading_rad + kAround[static_cast<std::size_t>(i)];
      Footprint print = wanted;
      print.position_m += RotateYaw(way, DVec3(0.0, 0.0, ring_m));
      print = WithEasyClimb(WithRoom(print));
      if (!KeepsApart(print) || !IsGood(print)) continue;
      if (auto plan = PlanExactStep(OnGround(print), step)) return plan;
      if (++out_of_reach >= kMaxOutOfReach) return std::nullopt;
    }
  }
  return std::nullopt;
}

WalkStep StepPlanner::TurnedWith(const PlannedStep& planned) const {
  WalkStep step;
  const double turn_rad = planned.heading_rad - planned.print.heading_rad;
  step.print.position_m = fixed_m_ + RotateYaw(turn_rad, planned.print.position_m - fixed_m_);
  step.print.heading_rad = planned.heading_rad;
  step.root_m = fixed_m_;
  if (planned.plan.root_m) {
    step.root_m += RotateYaw(turn_rad, *planned.plan.root_m - fixed_m_);
  }
  return step;
}

bool StepPlanner::GoalIsGood(const WalkSteering& steering) const {
  double heights_m[2];
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const Footprint print = OnGround(steering.GoalPrint(foot));
    if (!Carries(foot, print)) return false;
    heights_m[static_cast<std::size_t>(foot)] = print.position_m.y;
  }
  return std::fabs(heights_m[0] - heights_m[1]) <= kMaxWalkClimbM;
}

Footprint StepPlanner::Level(Footprint print) const {
  print.position_m.y = fixed_m_.y;
  return print;
}

Footprint StepPlanner::OnGround(Footprint print) const {
  print.position_m.y = terrain_->HeightAt(print.position_m.x, print.position_m.z);
  return print;
}

bool StepPlanner::KeepsApart(const Footprint& print) const {
  const DVec3 v = RotateYaw(-print.heading_rad, print.position_m - fixed_m_);
  return outward_ * v.x >= 0.08 && outward_ * v.x <= profile_.stand_m + 0.3 &&
         v.z <= profile_.longest_m && v.z >= -std::max(profile_.back_m, 0.15);
}

bool StepPlanner::Carries(const FootSupport& support) {
  return support.normal.y >= kLeastWalkNormalY && support.carried >= kLeastCarried &&
         support.gap_m <= kDeepestGapM && support.rise_m <= kHighestRiseM;
}

bool StepPlanner::Carries(Foot foot, const Footprint& print) const {
  return Carries(SupportOf(*terrain_, library_.leg_rig().side(foot), print));
}

bool StepPlanner::Carries(const Footprint& print) { return Carries(SupportAt(print)); }

const FootSupport& StepPlanner::SupportAt(const Footprint& print) {
  if (!supported_ || supported_->foot != moving_ ||
      supported_->print.position_m != print.position_m ||
      supported_->print.heading_rad != print.heading_rad) {
    supported_ =
        Supported{moving_, print, SupportOf(*terrain_, library_.leg_rig().side(moving_), print)};
  }
  return supported_->support;
}

double StepPlanner::CarriedByTread(const Footprint& print) {
  const FootSupport& whole = SupportAt(print);
  if (whole.rise_m > kHighestRiseM) return 0.0;
  Sole bearing = SoleOf(library_.leg_rig().side(moving_));
  bearing.heel_m *= kBearingHeel;
  bearing.toe_m *= kBearingToes;
  const FootSupport support =
      SupportOf(*terrain_, print.position_m.x, print.position_m.z, print.heading_rad, bearing);
  return Carries(support) ? whole.carried : 0.0;
}

bool StepPlanner::IsOnShortTread(const Footprint& print) const {
  const Sole sole = SoleOf(library_.leg_rig().side(moving_));
  const double length_m = sole.heel_m + sole.toe_m + 2.0 * kRoomM;
  double tread_m = 0.0;
  for (const double step_m : {kEdgeStepM, -kEdgeStepM}) {
    const DVec3 step = RotateYaw(print.heading_rad, DVec3(0.0, 0.0, step_m));
    DVec3 at = print.position_m;
    double height_m = terrain_->HeightAt(at.x, at.z);
    for (bool is_edge = false; !is_edge; tread_m += kEdgeStepM) {
      if (tread_m > length_m) return false;
      at += step;
      const double next_m = terrain_->HeightAt(at.x, at.z);
      is_edge = std::fabs(next_m - height_m) > kEdgeM;
      height_m = next_m;
    }
  }
  return tread_m <= length_m + kEdgeStepM;
}

bool StepPlanner::CarriesOrOverhangs(const Footprint& print) {
  return Carries(print) || (CarriedByTread(print) > 0.0 && IsOnShortTread(print));
}

bool StepPlanner::HasRoom(const Footprint& print) const {
  const LegRig::Side& side = library_.leg_rig().side(moving_);
  const auto at = [&](double forward_m) {
    return print.position_m + RotateYaw(print.heading_rad, DVec3(0.0, 0.0, forward_m));
  };
  const auto height_m = [&](const DVec3& point) { return terrain_->HeightAt(point.x, point.z); };
  const double ball_m = height_m(print.position_m);
  for (const double end_m : {side.toe_m, -side.foot_m - kSoleBehindAnkleM}) {
    const double expected_m = 2.0 * height_m(at(0.5 * end_m)) - ball_m;
    const DVec3 end = at(end_m);
    if (terrain_->HighestWithin(end.x, end.z, kRoomM) > expected_m + kHighestRiseM) return false;
  }
  return true;
}

Footprint StepPlanner::WithRoom(const Footprint& print) {
  const bool is_on_short_tread = IsOnShortTread(print);
  if (!is_on_short_tread && HasRoom(print)) return print;
  Footprint best = print;
  double most_carried = is_on_short_tread && HasRoom(print) ? CarriedByTread(print) : 0.0;
  for (const double shift_m : kRoomShiftsM) {
    Footprint moved = print;
    moved.position_m += RotateYaw(print.heading_rad, DVec3(0.0, 0.0, shift_m));
    if (!HasRoom(moved)) continue;
    if (!is_on_short_tread) {
      if (Carries(moved)) return moved;
      continue;
    }
    const double carried = CarriedByTread(moved);
    if (carried <= most_carried) continue;
    most_carried = carried;
    best = moved;
  }
  return best;
}

Footprint StepPlanner::WithEasyClimb(const Footprint& print) {
  const auto climb_m = [&](const Footprint& at) {
    return terrain_->HeightAt(at.position_m.x, at.position_m.z) - fixed_m_.y;
  };
  const double full_m = climb_m(print);
  if (std::fabs(full_m) <= std::min(kEasyClimbM, kEasySlopeClimbM)) return print;
  const bool is_sloped = SupportAt(print).normal.y < kSlopeNormalY;
  const double easy_m = is_sloped ? kEasySlopeClimbM : kEasyClimbM;
  if (std::fabs(full_m) <= easy_m) return print;
  const double ahead_m = RotateYaw(-print.heading_rad, print.position_m - fixed_m_).z;
  std::optional<Footprint> before_edge;
  for (const double part : kShorterSteps) {
    Footprint shorter = print;
    shorter.position_m -= RotateYaw(print.heading_rad, DVec3(0.0, 0.0, (1.0 - part) * ahead_m));
    shorter = WithRoom(shorter);
    const double part_m = climb_m(shorter) * (full_m > 0.0 ? 1.0 : -1.0);
    if (part_m > easy_m || !CarriesOrOverhangs(shorter)) continue;
    if (part_m >= kLeastClimbM) return shorter;
    if (!before_edge && part_m > -kLeastClimbM) before_edge = shorter;
  }
  return ahead_m > kLongClimbM ? before_edge.value_or(print) : print;
}

bool StepPlanner::IsGood(const Footprint& print) {
  if (is_exhausted()) return false;
  ++candidates_;
  const double height_m = terrain_->HeightAt(print.position_m.x, print.position_m.z);
  if (std::fabs(height_m - fixed_m_.y) > kMaxWalkClimbM) {
    has_seen_heights_ = true;
    return false;
  }
  if (!CarriesOrOverhangs(print)) {
    has_seen_bad_ground_ = true;
    return false;
  }
  const DVec3 from = stance_.feet[static_cast<std::size_t>(moving_)].position_m;
  const double ends_m = std::max(std::max(from.y, height_m), fixed_m_.y);
  for (const double part : {0.2, 0.4, 0.6, 0.8}) {
    const DVec3 at = from + part * (print.position_m - from);
    if (terrain_->HighestWithin(at.x, at.z, kHurdleRadiusM) > ends_m + kMaxHurdleM) {
      has_seen_heights_ = true;
      return false;
    }
  }
  return true;
}

std::optional<PlannedStep> StepPlanner::PlanExactStep(const Footprint& print,
                                                      const WalkStep& step) const {
  auto plan = PlanFootprint(library_, moving_, print, fixed_m_, stance_.heading_rad, stance_.vector,
                            {.is_walk = true, .after = stance_.last_group});
  if (!plan) return std::nullopt;
  const MotionGroup& group = library_.group(plan->group);
  const DVec3 wanted = RotateYaw(-print.heading_rad, print.position_m - fixed_m_);
  const auto applied_or = [&](ParameterName name, double otherwise) {
    const int l = group.FindParameter(name);
    return l < 0 ? otherwise : plan->applied.values[static_cast<std::size_t>(l)];
  };
  const bool strides = wanted.z > kForwardM;
  const double natural_x =
      outward_ * std::clamp(outward_ * wanted.x, profile_.width_m, profile_.stand_m);
  const double error_x = applied_or(ParameterName::kEndX, natural_x) - wanted.x;
  const double error_z = applied_or(ParameterName::kEndZ, 0.0) - wanted.z;
  const double error_m = std::sqrt(error_x * error_x + error_z * error_z);
  const double wanted_rad = print.heading_rad - stance_.heading_rad;
  const double natural_rad = NaturalTurn(group, plan->applied);
  const double turn_rad =
      std::clamp(wanted_rad, natural_rad - kMaxWalkTurnRad, natural_rad + kMaxWalkTurnRad);
  // If the library has climbing steps, a level step must not end at another height.
  const double error_y = applied_or(ParameterName::kEndY, 0.0) - GroundRise(wanted.y);
  if (is_strict_ && profile_.has_climbs && std::fabs(error_y) > kMaxErrorHeightM) {
    return std::nullopt;
  }
  const double reach = checks_ground_ ? kSlack : 1.0;
  if (error_m > reach * (strides && is_strict_ ? kMaxStepErrorM : kMaxPlantedErrorM) ||
      std::fabs(turn_rad - wanted_rad) >
          reach * (is_strict_ ? kMaxStepErrorRad : kMaxLooseErrorRad)) {
    return std::nullopt;
  }
  plan->max_extra_turn_rad = kMaxWalkTurnRad;
  // In most libraries, short and turning steps are the slowest, but people take such steps
  // quickly.
  const double climb_m =
      print.position_m.y - stance_.feet[static_cast<std::size_t>(moving_)].position_m.y;
  if (std::fabs(climb_m) <= kUnhurriedClimbM &&
      (wanted.z < kStrideM || std::fabs(wanted_rad) > kHurriedTurnRad)) {
    plan->pace.max_rate = kHurriedRate;
  }
  plan->most_residual_m = reach * kMaxPlantedErrorM;
  if (!strides || step.is_last) plan->root_m = step.root_m;
  return PlannedStep{.plan = *plan,
                     .moved = moving_,
                     .print = print,
                     .heading_rad = stance_.heading_rad + turn_rad,
                     .error_m = error_m,
                     .is_last = step.is_last};
}

}  // namespace stridewire
