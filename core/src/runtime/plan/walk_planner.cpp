#include "runtime/plan/walk_planner.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/check.h"
#include "base/trig.h"
#include "runtime/library/contact_keytimes.h"
#include "runtime/library/locomotion_profile.h"
#include "runtime/plan/foot_planner.h"
#include "runtime/plan/walk_steering.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

// A foot within this distance and angle of its footprint at the goal has arrived.
constexpr double kArrivedM = 0.002;
constexpr double kArrivedRad = 0.004;
// The same tolerances without planting. In this case feet land wherever the blend puts them.
constexpr double kRoughlyArrivedM = 0.15;
constexpr double kRoughlyArrivedRad = 0.25;

// Maximum distance between the library's own step and the footprint, which planting distributes
// over the swing. For small steps, and for steps that were chosen by comparison, the maximum is
// kMaxPlantedErrorM. Each metre between both limits has the cost kErrorWeight.
constexpr double kMaxErrorM = 0.16;
constexpr double kErrorWeight = 0.35;
// Maximum difference in height, for libraries with climbing steps.
constexpr double kMaxErrorHeightM = 0.08;
// Maximum error of the heading of the body after the step, which planting cannot change.
constexpr double kMaxErrorRad = 0.015;
constexpr double kMaxLooseErrorRad = 0.5;
// Steps of walks may turn this much more or less than the library's own steps. If the limit were
// kMaxExtraTurnRad, libraries without steps that turn on the spot would need ten steps for a
// half-turn.
constexpr double kMaxWalkTurnRad = 0.6;
// When the planner looks ahead, the limits on distances and angles above apply as they are. For the
// next step itself they are multiplied by kSlack, because feet do not land exactly as predicted.
constexpr double kSlack = 1.05;
// After a step that is not longer than this, the body is above both feet.
constexpr double kForwardM = 0.2;

// Steps that are shorter than kStrideM or turn by more than kHurriedTurnRad are played fast. Steps
// that climb or descend by more than kUnhurriedClimbM are not, because people do not take stairs
// faster if their treads are short.
constexpr double kStrideM = 0.35;
constexpr double kHurriedTurnRad = 0.25;
constexpr double kUnhurriedClimbM = 0.08;
// The pace of other steps if no speed was requested. People who walk to a goal take 100 to 110
// steps per minute.
constexpr PlaybackPace kBriskPace{.max_rate = 1.4, .long_s = 0.68, .shortened_s = 0.6};

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
// Maximum height of an obstacle along a swing, above both ends of the swing.
constexpr double kMaxHurdleM = 0.25;
constexpr double kHurdleRadiusM = 0.06;

// Steps are compared by the sum of efforts (WalkSteering::EffortM) and costs, in metres. This is
// the weight of the effort that remains after the first step. It is added to the effort that
// remains after both steps. Without it, the walk could postpone its progress for ever.
constexpr double kFirstWeight = 0.2;
// Cost per metre that the body moves. It makes the walk turn in place rather than in a wide curve.
constexpr double kPathWeight = 0.15;
// Cost of a step without progress.
constexpr double kIdleStepM = 0.1;
// Cost of a step after which the other foot cannot continue.
constexpr double kDeadEndM = 1.0;
// Cost of arriving with another heading, per radian. It exceeds the effort of a turn, so that the
// walk continues if the library can turn further.
constexpr double kMissWeight = 0.6;
// Expected duration of a step, for looking ahead.
constexpr double kExpectedStepS = 0.6;

// Radii of the rings of eight alternative footprints around the desired one, closest first.
constexpr std::array<double, 6> kRingsM{0.04, 0.08, 0.12, 0.16, 0.22, 0.28};

// Steps that would climb or descend by more than kEasyClimbM are shortened to fractions of their
// length, so that avatars do not skip treads of stairs. This applies if the shorter step still
// leads onto ground that is at least kLeastClimbM higher or lower than the standing foot.
constexpr double kEasyClimbM = 0.18;
// Replaces kEasyClimbM on slopes, where the y component of the ground normal is at most
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

// A variation of the step towards the goal: shorter, or towards either side.
struct Variation {
  double part;      // Fraction of the full step length.
  double bend_rad;  // Change of the walking direction; positive is left.
};
constexpr std::array<Variation, 11> kVariations{{{1.0, 0.0},
                                                 {0.75, 0.0},
                                                 {0.5, 0.0},
                                                 {1.0, 0.5},
                                                 {1.0, -0.5},
                                                 {0.7, 0.9},
                                                 {0.7, -0.9},
                                                 {0.3, 0.0},
                                                 {0.6, 1.4},
                                                 {0.6, -1.4},
                                                 {0.15, 0.0}}};
// Turns of comfortable steps, which do not depend on the goal.
constexpr std::array<double, 5> kComfortableTurnsRad{0.0, 0.3, -0.3, 0.6, -0.6};

// Turns of steps in place.
constexpr std::array<double, 2> kPivotTurnsRad{0.8, -0.8};

// Within this distance of the goal, the ground there is checked again, because it may have changed.
constexpr double kGoalInSightM = 1.5;

// A walk makes progress if its remaining effort decreases by at least this.
constexpr double kProgressM = 0.02;

// A step that the library contains, and its result.
struct PlannedStep {
  RequestPlan plan;
  Foot moved = Foot::kLeft;
  Footprint print;
  double heading_rad = 0.0;  // Heading of the body after the step.
  double error_m = 0.0;      // Distance that planting distributes over the swing.
  bool is_last = false;      // True if the step leads to the foot's place at the goal.
};

class StepPlanner {
 public:
  // If `checks_ground` is false, the ground determines only the height of a footprint, and not
  // whether it can support the foot. The planner uses this to look ahead.
  StepPlanner(const MotionLibrary& library, const Terrain* terrain, const WalkStance& stance,
              bool checks_ground)
      : library_(library),
        profile_(library.locomotion_profile()),
        terrain_(terrain),
        stance_(stance),
        checks_ground_(checks_ground) {}

  // Plans a step of a foot. Returns nullopt if the library has no such step that ends on suitable
  // ground. A strict plan requires little correction by planting.
  std::optional<PlannedStep> Plan(Foot moving, const WalkStep& step, bool is_strict) {
    moving_ = moving;
    is_strict_ = is_strict;
    outward_ = moving == Foot::kLeft ? 1.0 : -1.0;
    fixed_m_ = stance_.feet[static_cast<std::size_t>(OtherFoot(moving))].position_m;
    Footprint wanted{step.print.position_m,
                     UnwrapAngle(step.print.heading_rad, stance_.heading_rad)};
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

  // Returns the step with its footprint rotated about the standing foot, so that the foot has the
  // heading of the body after the step.
  [[nodiscard]] WalkStep TurnedWith(const PlannedStep& planned) const {
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

  // Returns true if both feet can stand at their footprints at the goal.
  bool GoalIsGood(const WalkSteering& steering) {
    double heights_m[2];
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const Footprint print = OnGround(steering.GoalPrint(foot));
      if (!Carries(foot, print)) return false;
      heights_m[static_cast<std::size_t>(foot)] = print.position_m.y;
    }
    return std::fabs(heights_m[0] - heights_m[1]) <= kMaxWalkClimbM;
  }

  [[nodiscard]] bool has_seen_bad_ground() const { return has_seen_bad_ground_; }
  [[nodiscard]] bool has_seen_heights() const { return has_seen_heights_; }
  [[nodiscard]] bool is_exhausted() const { return candidates_ >= kMaxWalkCandidates; }

 private:
  static constexpr double kPi = 3.14159265358979323846;

  Footprint Level(Footprint print) const {
    print.position_m.y = fixed_m_.y;
    return print;
  }
  Footprint OnGround(Footprint print) const {
    print.position_m.y = terrain_->HeightAt(print.position_m.x, print.position_m.z);
    return print;
  }

  // Returns true if an alternative footprint is still beside the other foot, not across it or far
  // behind it.
  bool KeepsApart(const Footprint& print) const {
    const DVec3 v = RotateYaw(-print.heading_rad, print.position_m - fixed_m_);
    return outward_ * v.x >= 0.08 && outward_ * v.x <= profile_.stand_m + 0.3 &&
           v.z <= profile_.longest_m && v.z >= -std::max(profile_.back_m, 0.15);
  }

  static bool Carries(const FootSupport& support) {
    return support.normal.y >= kLeastWalkNormalY && support.carried >= kLeastCarried &&
           support.gap_m <= kDeepestGapM && support.rise_m <= kHighestRiseM;
  }
  bool Carries(Foot foot, const Footprint& print) const {
    return Carries(SupportOf(*terrain_, library_.leg_rig().side(foot), print));
  }
  bool Carries(const Footprint& print) { return Carries(SupportAt(print)); }

  // Returns the support of the moving foot. Remembers it, because several checks need the support
  // of the same footprint.
  const FootSupport& SupportAt(const Footprint& print) {
    if (!supported_ || supported_->foot != moving_ ||
        supported_->print.position_m != print.position_m ||
        supported_->print.heading_rad != print.heading_rad) {
      supported_ =
          Supported{moving_, print, SupportOf(*terrain_, library_.leg_rig().side(moving_), print)};
    }
    return supported_->support;
  }

  // Returns the carried fraction of a sole that may overhang the tread below it. Returns 0 if the
  // tread does not carry enough of the sole.
  [[nodiscard]] double CarriedByTread(const Footprint& print) {
    const FootSupport& whole = SupportAt(print);
    if (whole.rise_m > kHighestRiseM) return 0.0;
    Sole bearing = SoleOf(library_.leg_rig().side(moving_));
    bearing.heel_m *= kBearingHeel;
    bearing.toe_m *= kBearingToes;
    const FootSupport support =
        SupportOf(*terrain_, print.position_m.x, print.position_m.z, print.heading_rad, bearing);
    return Carries(support) ? whole.carried : 0.0;
  }

  // Returns true if a footprint is on a tread that is too short for the foot and the room that the
  // foot needs in front of its toes and behind its heel.
  [[nodiscard]] bool IsOnShortTread(const Footprint& print) const {
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

  // Returns true if the ground carries the sole or, on a short tread, enough of it.
  [[nodiscard]] bool CarriesOrOverhangs(const Footprint& print) {
    return Carries(print) || (CarriedByTread(print) > 0.0 && IsOnShortTread(print));
  }

  // Returns true if the ground does not rise abruptly right in front of the toes or behind the
  // heel. The slope of the ground up to there does not count as an abrupt rise.
  bool HasRoom(const Footprint& print) const {
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

  // Returns the footprint, moved forward or backward if its toes or heel would touch a riser and
  // the tread has room for that. On a tread that is too short for the foot, moves the footprint to
  // where the tread carries most of the sole.
  Footprint WithRoom(const Footprint& print) {
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

  // Returns the footprint. If the step would climb or descend more than is easy, moves the
  // footprint back towards the standing foot: onto a tread in between or, if there is none and the
  // step is long, to the ground in front of the edge.
  Footprint WithEasyClimb(const Footprint& print) {
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

  bool IsGood(const Footprint& print) {
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

  // Plans the library's step to a footprint. Returns nullopt if the step misses the footprint by
  // more than planting can distribute over the swing.
  std::optional<PlannedStep> PlanExactStep(const Footprint& print, const WalkStep& step) const {
    auto plan = PlanFootprint(library_, moving_, print, fixed_m_, stance_.heading_rad,
                              stance_.vector, FootprintUse::kWalk);
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
    if (error_m > reach * (strides && is_strict_ ? kMaxErrorM : kMaxPlantedErrorM) ||
        std::fabs(turn_rad - wanted_rad) >
            reach * (is_strict_ ? kMaxErrorRad : kMaxLooseErrorRad)) {
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

  const MotionLibrary& library_;
  const LocomotionProfile& profile_;
  const Terrain* terrain_;
  const WalkStance& stance_;
  bool checks_ground_;
  Foot moving_ = Foot::kLeft;
  double outward_ = 1.0;
  DVec3 fixed_m_ = DVec3(0.0);
  bool is_strict_ = true;
  int candidates_ = 0;
  bool has_seen_bad_ground_ = false;
  bool has_seen_heights_ = false;
  struct Supported {
    Foot foot;
    Footprint print;
    FootSupport support;
  };
  std::optional<Supported> supported_;  // Result of the last SupportAt.
};

WalkStance After(const WalkStance& stance, const PlannedStep& step) {
  WalkStance after = stance;
  after.feet[static_cast<std::size_t>(step.moved)] = step.print;
  after.heading_rad = step.heading_rad;
  after.last_moved = step.moved;
  after.vector.left_from_right_m =
      RotateYaw(-step.heading_rad, after.feet[0].position_m - after.feet[1].position_m);
  after.last_step_s = kExpectedStepS;
  after.is_aimed[static_cast<std::size_t>(step.moved)] = step.is_last;
  return after;
}

// Compares steps by the remaining effort of the walk, after the step itself and after the following
// step of the other foot.
class StepComparison {
 public:
  StepComparison(const MotionLibrary& library, const Terrain* terrain, const WalkRequest& walk,
                 std::size_t next_waypoint, double effort_m)
      : library_(library),
        terrain_(terrain),
        walk_(walk),
        next_waypoint_(next_waypoint),
        effort_m_(effort_m) {}

  // Compares a step with the best one so far.
  void Consider(StepPlanner& planner, const WalkStance& stance, Foot moving, const WalkStep& step) {
    const auto planned = PlanTurned(planner, moving, step);
    if (!planned) return;
    const double score_m = ScoreM(stance, *planned);
    if (score_m >= best_m_) return;
    best_m_ = score_m;
    best_ = planned;
  }
  // Returns true if the walk makes progress with this step, or with this step and the next one. A
  // foot may take its place at the goal only if the other foot can follow.
  [[nodiscard]] bool LeadsOn(const WalkStance& stance, const PlannedStep& step) const {
    const LocomotionProfile& profile = library_.locomotion_profile();
    const WalkStance after = After(stance, step);
    const WalkSteering steering(profile, walk_, after);
    if (HasArrived(steering)) return MissCostM(after) < kProgressM;
    if (!step.is_last && steering.EffortM(step.moved, next_waypoint_) < effort_m_ - kProgressM) {
      return true;
    }
    const auto second = NextStep(steering, after, OtherFoot(step.moved));
    if (!second) return false;
    const WalkStance last = After(after, *second);
    const WalkSteering last_steering(profile, walk_, last);
    return HasArrived(last_steering) ||
           last_steering.EffortM(second->moved, next_waypoint_) + ErrorCostM(*second) <
               effort_m_ - kProgressM;
  }
  [[nodiscard]] const std::optional<PlannedStep>& best() const { return best_; }

 private:
  // Plans a step. If the body turns by another angle than requested, the footprint turns with it.
  static std::optional<PlannedStep> PlanTurned(StepPlanner& planner, Foot moving,
                                               const WalkStep& step) {
    if (planner.is_exhausted()) return std::nullopt;
    auto planned = planner.Plan(moving, step, false);
    if (planned && !step.is_last && planned->heading_rad != planned->print.heading_rad) {
      planned = planner.Plan(moving, planner.TurnedWith(*planned), false);
    }
    return planned;
  }

  [[nodiscard]] double ScoreM(const WalkStance& stance, const PlannedStep& first) const {
    const LocomotionProfile& profile = library_.locomotion_profile();
    double score_m = ErrorCostM(first);
    const WalkStance after = After(stance, first);
    const WalkSteering steering(profile, walk_, after);
    const double first_effort_m = steering.EffortM(first.moved, next_waypoint_);
    score_m += kFirstWeight * first_effort_m + kPathWeight * steering.BodiesApartM();
    if (first_effort_m > effort_m_ - kProgressM) score_m += kIdleStepM;
    if (HasArrived(steering)) return score_m + MissCostM(after);
    const Foot other = OtherFoot(first.moved);
    const auto second = NextStep(steering, after, other);
    if (!second) return score_m + first_effort_m + kDeadEndM;
    score_m += ErrorCostM(*second);
    const WalkStance last = After(after, *second);
    const WalkSteering last_steering(profile, walk_, last);
    if (HasArrived(last_steering)) return score_m + MissCostM(last);
    return score_m + last_steering.EffortM(other, next_waypoint_);
  }

  [[nodiscard]] std::optional<PlannedStep> NextStep(const WalkSteering& steering,
                                                    const WalkStance& stance, Foot moving) const {
    StepPlanner planner(library_, terrain_, stance, false);
    return PlanTurned(planner, moving, steering.NextStep(moving, next_waypoint_, 1.0, 0.0));
  }
  [[nodiscard]] bool HasArrived(const WalkSteering& steering) const {
    return next_waypoint_ >= walk_.waypoints_m.size() && steering.IsCloseToGoal();
  }
  [[nodiscard]] double MissCostM(const WalkStance& arrived) const {
    return kMissWeight * std::fabs(WrapAngle(arrived.heading_rad - walk_.heading_rad));
  }
  static double ErrorCostM(const PlannedStep& step) {
    return kErrorWeight * std::max(0.0, step.error_m - kMaxErrorM);
  }

  const MotionLibrary& library_;
  const Terrain* terrain_;
  const WalkRequest& walk_;
  std::size_t next_waypoint_;
  double effort_m_;  // Effort before the step.
  std::optional<PlannedStep> best_;
  double best_m_ = HUGE_VAL;
};

// Returns a step in place that turns the body towards the heading at the goal. Returns nullopt if
// the library has none.
std::optional<PlannedStep> TurnAtGoal(StepPlanner& planner, const WalkStance& stance,
                                      const WalkRequest& walk, const WalkSteering& steering) {
  const auto miss_rad = [&](double heading_rad) {
    return std::fabs(WrapAngle(heading_rad - walk.heading_rad));
  };
  for (const Foot foot : {OtherFoot(stance.last_moved), stance.last_moved}) {
    auto planned = planner.Plan(foot, steering.StepToGoal(foot), true);
    if (planned && miss_rad(planned->heading_rad) < miss_rad(stance.heading_rad) - kMaxErrorRad) {
      return planned;
    }
  }
  return std::nullopt;
}

// Returns the step that the steering proposes, if the library has it. Otherwise, compares
// variations of that step, comfortable steps and steps in place.
std::optional<PlannedStep> ChooseStep(StepPlanner& planner, StepComparison& comparison,
                                      const WalkStance& stance, WalkSteering& steering,
                                      std::size_t next_waypoint) {
  const std::span<const Foot> feet = steering.FeetToMove(next_waypoint);
  for (const Foot moving : feet) {
    const WalkStep step = steering.NextStep(moving, next_waypoint, 1.0, 0.0);
    const auto planned = planner.Plan(moving, step, true);
    if (planned && comparison.LeadsOn(stance, *planned)) return planned;
  }
  for (const Foot moving : feet) {
    const auto consider = [&](const WalkStep& step) {
      comparison.Consider(planner, stance, moving, step);
    };
    for (const Variation& variation : kVariations) {
      consider(steering.NextStep(moving, next_waypoint, variation.part, variation.bend_rad));
    }
    for (const double turn_rad : kComfortableTurnsRad) {
      consider(steering.ComfortableStep(moving, turn_rad));
    }
    for (const double turn_rad : kPivotTurnsRad) consider(steering.Pivot(moving, turn_rad));
    if (steering.IsGoalNear(moving, next_waypoint)) consider(steering.StepToGoal(moving));
  }
  return comparison.best();
}

WalkDecision Reject(const char* reason) {
  WalkDecision decision;
  decision.outcome = WalkOutcome::kRefused;
  decision.reason = reason;
  return decision;
}

}  // namespace

void WalkPace::Add(const DVec3& position_m, double time_s) {
  Mark mark{.path_m = 0.0, .time_s = time_s};
  if (marks_ > 0) {
    const DVec3 moved_m = position_m - position_m_;
    mark.path_m = last_.back().path_m + std::sqrt(moved_m.x * moved_m.x + moved_m.z * moved_m.z);
  }
  if (marks_ == kStartSteps) started_ = mark;
  std::ranges::rotate(last_, last_.begin() + 1);
  last_.back() = mark;
  position_m_ = position_m;
  ++marks_;
}

double WalkPace::mean_m_s() const {
  if (marks_ <= kStartSteps + kStopSteps + 1) return 0.0;
  const Mark& ended = last_.front();
  return (ended.path_m - started_.path_m) / (ended.time_s - started_.time_s);
}

WalkDecision PlanWalkStep(const MotionLibrary& library, const Terrain* terrain,
                          const WalkRequest& walk, const WalkStance& stance,
                          WalkProgress& progress) {
  STRIDEWIRE_CHECK(progress.next_waypoint <= walk.waypoints_m.size());
  STRIDEWIRE_CHECK(progress.steps >= 0 && progress.steps <= kMaxWalkSteps);
  WalkSteering steering(library.locomotion_profile(), walk, stance);
  const std::size_t waypoint_before = progress.next_waypoint;
  steering.PassWaypoints(progress.next_waypoint);
  const double arrived_m = stance.is_exact ? kArrivedM : kRoughlyArrivedM;
  const double arrived_rad = stance.is_exact ? kArrivedRad : kRoughlyArrivedRad;
  const bool is_last_leg = progress.next_waypoint >= walk.waypoints_m.size();
  if (is_last_leg && steering.HasArrived(arrived_m, arrived_rad)) return {};

  const bool is_close = is_last_leg && steering.IsCloseToGoal();
  const double effort_m = steering.EffortM(stance.last_moved, progress.next_waypoint);
  if (effort_m < progress.least_effort_m - kProgressM ||
      progress.next_waypoint != waypoint_before) {
    progress.least_effort_m = effort_m;
    progress.steps_without = 0;
  } else if (++progress.steps_without >=
             (progress.is_detour ? kMaxDetourSteps : kMaxStepsWithout)) {
    if (is_close) return {};
    return Reject(progress.is_detour ? "the walk makes no progress towards its goal"
                                     : "the library has no step that leads closer to the goal");
  }
  if (++progress.steps > kMaxWalkSteps) {
    return Reject("the walk needs more than 10000 steps");
  }

  StepPlanner planner(library, terrain, stance, true);
  const bool checks_goal =
      terrain != nullptr && (progress.steps == 1 || (is_last_leg && effort_m < kGoalInSightM));
  if (checks_goal && !planner.GoalIsGood(steering)) {
    return Reject("the ground at the goal is too steep or too uneven to stand on");
  }
  StepComparison comparison(library, terrain, walk, progress.next_waypoint, effort_m);
  std::optional<PlannedStep> step;
  if (is_close) {
    step = TurnAtGoal(planner, stance, walk, steering);
    if (!step) return {};
  } else {
    step = ChooseStep(planner, comparison, stance, steering, progress.next_waypoint);
  }
  if (planner.has_seen_bad_ground() || planner.has_seen_heights()) progress.is_detour = true;
  if (step) {
    const double climb_m =
        step->print.position_m.y - stance.feet[static_cast<std::size_t>(step->moved)].position_m.y;
    if (!walk.speed_m_s && step->plan.pace.max_rate == 1.0 &&
        std::fabs(climb_m) <= kUnhurriedClimbM) {
      step->plan.pace = kBriskPace;
    }
    progress.is_aimed[static_cast<std::size_t>(step->moved)] = step->is_last;
    return {.outcome = WalkOutcome::kStep, .plan = step->plan};
  }
  if (planner.has_seen_heights()) {
    return Reject("the ground ahead is too high or too low to step on");
  }
  if (planner.has_seen_bad_ground()) {
    return Reject("the ground ahead is too steep or too uneven for a foot");
  }
  return Reject("the library has no step towards the goal");
}

}  // namespace stridewire
