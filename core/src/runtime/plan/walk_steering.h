#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "runtime/plan/walk_planner.h"
#include "runtime/library/locomotion_profile.h"

namespace stridewire {

/// Where a foot is to land next.
struct WalkStep {
  Footprint print;            ///< Without a height; its heading is that of the body after the step
  DVec3 root_m = DVec3(0.0);  ///< Where the body is then, for who does not stride on
  bool is_last = false;       ///< It is a place of the goal's own: exactly there or not at all
};

/// Where a walk leads from where the feet stand, on level ground and with feet that go anywhere within a
/// box: the planner tries what of it the library and the ground allow.
///
/// The body is taken to be where the foot that stays has it, as if the other stood beside it. A step
/// moves it on by one part of the way left, in equal parts.
class WalkSteering {
 public:
  WalkSteering(const LocomotionProfile& gait, const WalkRequest& walk, const WalkStance& stance);

  /// Counts waypoints on that have been reached.
  void PassWaypoints(std::size_t& next) const;

  /// Both feet stand as the goal has them.
  [[nodiscard]] bool IsThere(double within_m, double within_rad) const;
  /// The way left by the waypoints, and the heading.
  [[nodiscard]] double LeftM(std::size_t next_waypoint) const;
  [[nodiscard]] double LeftRad() const;

  /// The feet that may go next, the better first.
  [[nodiscard]] std::span<const Foot> Feet(std::size_t next_waypoint);

  /// The next step of a foot: `part` of it, on a course bent to the left by `bend_rad`.
  [[nodiscard]] WalkStep Next(Foot moving, std::size_t next_waypoint, double part,
                              double bend_rad) const;

  /// Where a foot stands at the goal.
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
  [[nodiscard]] bool IsAtGoal(Foot foot, double within_m, double within_rad) const;
  [[nodiscard]] bool Shifts(const Body& body, bool is_last_leg) const;
  [[nodiscard]] double StepM() const;
  [[nodiscard]] double Bearing(const Body& body, std::size_t next_waypoint) const;
  [[nodiscard]] WalkStep Walk(const Body& body, Foot moving, std::size_t next_waypoint, double part,
                              double bend_rad) const;
  [[nodiscard]] WalkStep Shift(const Body& body, Foot moving, double part, double bend_rad) const;
  [[nodiscard]] WalkStep Land(const Body& body, Foot moving) const;
  [[nodiscard]] WalkStep LandAtGoal(Foot moving) const;
  [[nodiscard]] WalkStep LandNearer(Foot moving, double part) const;

  const LocomotionProfile& gait_;
  const WalkRequest& walk_;
  const WalkStance& stance_;
  Body goal_;
  std::array<Foot, 2> feet_{};
};

}  // namespace stridewire
