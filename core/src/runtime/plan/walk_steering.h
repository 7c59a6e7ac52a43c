#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "runtime/library/locomotion_profile.h"
#include "runtime/plan/walk_planner.h"

namespace stridewire {

/// A step that WalkSteering proposes.
struct WalkStep {
  Footprint print;  ///< Target without a height. Its heading is that of the body after the step.
  DVec3 root_m = DVec3(0.0);  ///< Position of the body after the step if the avatar stops there.
  /// True if the footprint is at the goal, so that no alternative is acceptable.
  bool is_last = false;
};

/// Computes where the next steps of a walk should lead, on level ground and within the step lengths
/// of the LocomotionProfile. StepPlanner then checks which of these steps the library and the
/// ground permit.
///
/// The position of the body is derived from the fixed foot, as if the other foot stood beside it.
/// Each step moves the body by an equal part of the remaining distance. If the stand pose of the
/// library is a stride (LocomotionProfile::stands_in_stride), the feet end in the same stride at
/// the goal.
class WalkSteering {
 public:
  WalkSteering(const LocomotionProfile& profile, const WalkRequest& walk, const WalkStance& stance);

  /// Advances `next` past all waypoints that have been reached.
  void PassWaypoints(std::size_t& next) const;

  /// Returns true if both feet are on their footprints at the goal, and the heading of the body is
  /// that of the goal, within the tolerances.
  [[nodiscard]] bool HasArrived(double within_m, double within_rad) const;
  /// Returns true if the heading of the body is within 0.25 rad of that of the goal, and both feet
  /// are at the goal: within 1 mm and 0.002 rad or, after a step that was aimed at the goal
  /// (WalkStance::is_aimed), within 0.02 m and 0.5 rad.
  [[nodiscard]] bool IsCloseToGoal() const;
  /// Returns the remaining effort of the walk in metres, as if the other foot stood beside `moved`.
  /// It is the distance to the goal through the waypoints plus the turns, where a radian counts as
  /// 0.3 m. Close to the goal, it is at most the effort of stepping sideways.
  [[nodiscard]] double EffortM(Foot moved, std::size_t next_waypoint) const;
  /// Returns the distance between two positions of the body: those derived from the left and from
  /// the right foot. After a step, this is the distance by which the body moves in that step.
  [[nodiscard]] double BodiesApartM() const;

  /// Returns the feet that may step next. Usually, this is one foot. If the feet are together, as
  /// in a stand, and neither is at the goal, returns both, the preferred one first.
  [[nodiscard]] std::span<const Foot> FeetToMove(std::size_t next_waypoint);

  /// Returns the next step of a foot. `part` scales its length, and `bend_rad` turns its direction
  /// to the left.
  [[nodiscard]] WalkStep NextStep(Foot moving, std::size_t next_waypoint, double part,
                                  double bend_rad) const;

  /// Returns a step forward of comfortable length that turns by `turn_rad`, regardless of the goal.
  [[nodiscard]] WalkStep ComfortableStep(Foot moving, double turn_rad) const;

  /// Returns a step in place that turns by `turn_rad`.
  [[nodiscard]] WalkStep Pivot(Foot moving, double turn_rad) const;
  /// Returns true if one long step of this foot can reach the goal.
  [[nodiscard]] bool IsGoalNear(Foot moving, std::size_t next_waypoint) const;
  /// Returns the step that puts this foot on its footprint at the goal.
  [[nodiscard]] WalkStep StepToGoal(Foot moving) const;

  /// Returns the footprint of a foot at the goal.
  [[nodiscard]] Footprint GoalPrint(Foot foot) const;

 private:
  struct Body {
    DVec3 position_m = DVec3(0.0);
    double heading_rad = 0.0;
  };

  [[nodiscard]] const Footprint& At(Foot foot) const {
    return stance_.feet[static_cast<std::size_t>(foot)];
  }
  [[nodiscard]] DVec3 FootOffset(Foot foot, double width_m) const;
  [[nodiscard]] Body BodyOver(Foot fixed) const;
  [[nodiscard]] Body BodyNow() const;
  [[nodiscard]] bool IsWithin(Foot foot, double within_m, double within_rad) const;
  [[nodiscard]] bool IsAtGoal(Foot foot) const;
  [[nodiscard]] bool PrefersSideSteps(const Body& body, bool is_last_leg) const;
  [[nodiscard]] double DistanceM(DVec3 from, std::size_t next_waypoint, const DVec3& to) const;
  [[nodiscard]] double StepCount(Foot moving, double distance_m, bool is_last_leg) const;
  [[nodiscard]] bool PreferFootBehind(const Body& body, std::size_t next_waypoint);
  [[nodiscard]] double StepM() const;
  [[nodiscard]] double Bearing(const Body& body, std::size_t next_waypoint) const;
  [[nodiscard]] WalkStep Walk(const Body& body, Foot moving, std::size_t next_waypoint, double part,
                              double bend_rad) const;
  [[nodiscard]] WalkStep SideStep(const Body& body, Foot moving, double part,
                                  double bend_rad) const;
  [[nodiscard]] WalkStep StepTo(const Body& body, Foot moving) const;
  [[nodiscard]] WalkStep StepTowardsGoal(Foot moving, double part) const;

  const LocomotionProfile& profile_;
  const WalkRequest& walk_;
  const WalkStance& stance_;
  Body goal_;
  // Where the body should be before the last step. This differs from goal_ if the stand pose of the
  // library is a stride: the rear foot is then already on its footprint, and the last step moves
  // the front foot ahead.
  Body approach_;
  std::array<Foot, 2> feet_{};
};

}  // namespace stridewire
