#pragma once

#include <array>
#include <vector>

#include "corpus/figure.h"

namespace stridewire::test {

/// A place where a foot stands, and the times at which it lands and lifts.
struct Footprint {
  DVec3 ball_m = DVec3(0.0);
  double yaw_rad = 0.0;
  double land_s = -1e9;
  double lift_s = 1e9;
};

/// The point midway between the feet at a time.
struct Waypoint {
  double time_s = 0.0;
  DVec3 ground_m = DVec3(0.0);
  double yaw_rad = 0.0;
};

/// Footprints and timing of a walk or run. `begin_s` and `end_s` bound the part that is recorded.
struct Gait {
  std::array<std::vector<Footprint>, 2> prints;  ///< By foot, sorted by time.
  std::vector<Waypoint> path;                    ///< Sorted by time.
  double smooth_s = 0.4;                         ///< The pelvis averages the path over this time.
  double lift_m = 0.1;                           ///< Height of a swing above its footprints.
  double roll_rad = 0.0;  ///< Pitch of the foot when it leaves the ground; 0 keeps it flat.
  double heel_rad = 0.0;  ///< Upward pitch of a foot that lands with the heel; 0 lands flat.
  double flight_s = 0.0;  ///< Runs: time with both feet in the air; the pelvis follows a parabola.
  double step_s = 0.6;    ///< Time from one step to the next.
  double begin_s = 0.0;
  double end_s = 0.0;
};

/// A walk of a number of steps. The motion may begin or end in the middle of a longer walk.
struct WalkOptions {
  int steps = 6;
  int first_foot = 0;     ///< 0: left.
  double length_m = 0.6;  ///< Distance between successive footprints; negative walks backward.
  /// If not 0, the figure walks sideways: distance that a foot moves in its step; positive is left.
  double side_m = 0.0;
  double turn_rad = 0.0;  ///< Turn per step.
  double step_s = 0.6;
  double support_s = 0.15;  ///< Time with both feet on the ground.
  double lift_m = 0.1;
  double heel_rad = 0.0;   ///< Pitch with which the heel lands first, for steps ahead.
  bool starts = true;      ///< Begins standing; otherwise within the walk.
  bool stops = true;       ///< Ends standing; otherwise within the walk.
  double stand_s = 1.0;    ///< Standing time before and after the steps.
  double cut_share = 0.0;  ///< Share of the previous and next step that is recorded, below 0.5.
  DVec3 start_m = DVec3(0.0);
  double heading_rad = 0.0;
  double slope_x = 0.0;  ///< Rise of the floor per metre along x.
  double slope_z = 0.0;  ///< Rise of the floor per metre along z.
  /// Height difference of each footprint from the one before it, by index of the step. Missing
  /// values are 0.
  std::vector<double> rises_m;
};

[[nodiscard]] Gait PlanWalk(const Figure& figure, const WalkOptions& options);

struct RunOptions {
  int steps = 8;
  double length_m = 1.0;
  double step_s = 0.35;
  double contact_s = 0.22;  ///< Time for which a foot is on the ground, less than `step_s`.
};

[[nodiscard]] Gait PlanRun(const Figure& figure, const RunOptions& options);

/// A foot that lands with the heel is flat after this time.
inline constexpr double kHeelS = 0.1;

/// Computes the poses of a gait. Balls of flat feet do not move, and no ankle is out of reach.
[[nodiscard]] FigureMotion RenderGait(const Figure& figure, const Gait& gait, double fps);

}  // namespace stridewire::test
