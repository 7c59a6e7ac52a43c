#pragma once

#include <optional>

#include "runtime/library/locomotion_profile.h"
#include "runtime/plan/request_plan.h"
#include "runtime/plan/walk_planner.h"
#include "runtime/plan/walk_steering.h"
#include "runtime/terrain/foot_support.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// Maximum distance between the end of the library's own step and the footprint. Planting
/// distributes this distance over the swing. For short steps, and for plans that are not strict
/// (StepPlanner::Plan), the maximum is kMaxPlantedErrorM.
inline constexpr double kMaxStepErrorM = 0.16;
/// Maximum error of the heading of the body after a step of a strict plan (StepPlanner::Plan).
/// Planting cannot change that heading.
inline constexpr double kMaxStepErrorRad = 0.015;
/// Steps that climb or descend by more than this are not played faster, even if they are short,
/// because people do not climb stairs faster if the treads are short.
inline constexpr double kUnhurriedClimbM = 0.08;

/// A step that can be blended from a group of the library, and where it ends.
struct PlannedStep {
  RequestPlan plan;
  Foot moved = Foot::kLeft;
  Footprint print;           ///< Where the moving foot lands.
  double heading_rad = 0.0;  ///< Heading of the body after the step.
  double error_m = 0.0;      ///< Distance from the end of the library's own step to `print`.
  bool is_last = false;      ///< True if the step leads to the foot's place at the goal.
};

/// Finds steps of the library for the footprints that a walk proposes, on ground that supports the
/// foot. Use a new planner for each step of a walk, because a planner checks the ground at no more
/// than kMaxWalkCandidates footprints.
class StepPlanner {
 public:
  /// If `checks_ground` is false, the ground determines only the height of a footprint, and not
  /// whether it can support the foot. The walk planner uses this to look ahead. A null terrain is
  /// level ground. All references must outlive the planner.
  StepPlanner(const MotionLibrary& library, const Terrain* terrain, const WalkStance& stance,
              bool checks_ground);

  /// Plans a step of a foot. Returns nullopt if the library has no such step that ends on suitable
  /// ground. A strict plan requires a step that planting has to correct only a little.
  std::optional<PlannedStep> Plan(Foot moving, const WalkStep& step, bool is_strict);

  /// Returns a step whose footprint is that of `planned`, rotated about the standing foot so that
  /// the foot has the heading of the body after the step. `planned` is the result of the last Plan.
  [[nodiscard]] WalkStep TurnedWith(const PlannedStep& planned) const;

  /// Returns true if both feet can stand at their footprints at the goal. Requires a terrain.
  [[nodiscard]] bool GoalIsGood(const WalkSteering& steering) const;

  /// True if the ground at a footprint of this step was too steep or too uneven.
  [[nodiscard]] bool has_seen_bad_ground() const { return has_seen_bad_ground_; }
  /// True if the ground at or before a footprint of this step was too high or too low.
  [[nodiscard]] bool has_seen_heights() const { return has_seen_heights_; }
  /// True if the planner may not check any further footprint.
  [[nodiscard]] bool is_exhausted() const { return candidates_ >= kMaxWalkCandidates; }

 private:
  struct Supported {
    Foot foot;
    Footprint print;
    FootSupport support;
  };

  Footprint Level(Footprint print) const;
  Footprint OnGround(Footprint print) const;
  // Returns true if an alternative footprint is still beside the other foot, not across it or far
  // behind it.
  bool KeepsApart(const Footprint& print) const;
  static bool Carries(const FootSupport& support);
  bool Carries(Foot foot, const Footprint& print) const;
  bool Carries(const Footprint& print);
  // Returns the support of the moving foot at a footprint. Keeps the last result, because several
  // checks need the support of the same footprint.
  const FootSupport& SupportAt(const Footprint& print);
  // Returns FootSupport::carried of a sole that may overhang the tread below it. Returns 0 if the
  // tread does not carry enough of the sole.
  double CarriedByTread(const Footprint& print);
  // Returns true if a footprint is on a tread that is shorter than the foot plus the room that it
  // needs in front of its toes and behind its heel.
  bool IsOnShortTread(const Footprint& print) const;
  // Returns true if the ground carries the sole or, on a short tread, enough of it.
  bool CarriesOrOverhangs(const Footprint& print);
  // Returns true if the ground does not rise abruptly right in front of the toes or behind the
  // heel. The slope of the ground up to there does not count as an abrupt rise.
  bool HasRoom(const Footprint& print) const;
  // Returns `print`. If its toes or heel would touch a riser and the tread has room, moves it
  // forward or backward. On a tread that is too short for the foot, moves it to where the tread
  // carries most of the sole.
  Footprint WithRoom(const Footprint& print);
  // Returns `print`. If the step would climb or descend too far (kEasyClimbM, kEasySlopeClimbM),
  // moves it back towards the standing foot: onto a tread in between or, if there is none and the
  // step is long, onto the ground in front of the edge.
  Footprint WithEasyClimb(const Footprint& print);
  // Returns true if the foot can stand at the footprint and reach it without a high swing.
  bool IsGood(const Footprint& print);
  // Plans the library's step to a footprint. Returns nullopt if the step misses the footprint by
  // more than planting can distribute over the swing.
  std::optional<PlannedStep> PlanExactStep(const Footprint& print, const WalkStep& step) const;

  const MotionLibrary& library_;
  const LocomotionProfile& profile_;
  const Terrain* terrain_;
  const WalkStance& stance_;
  bool checks_ground_;
  Foot moving_ = Foot::kLeft;
  double outward_ = 1.0;        // 1 if the left foot moves, -1 if the right foot does.
  DVec3 fixed_m_ = DVec3(0.0);  // Position of the standing foot.
  bool is_strict_ = true;
  int candidates_ = 0;
  bool has_seen_bad_ground_ = false;
  bool has_seen_heights_ = false;
  std::optional<Supported> supported_;  // Result of the last SupportAt.
};

}  // namespace stridewire
