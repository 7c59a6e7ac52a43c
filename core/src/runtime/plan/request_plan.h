#pragma once

#include <optional>

#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Where an avatar's feet are when a movement starts: left ball minus right ball in the heading
/// frame, metres.
struct FootState {
  DVec3 left_from_right_m = DVec3(0.0);

  /// Moving foot minus fixed foot.
  [[nodiscard]] DVec3 Vector(Foot moving) const {
    return moving == Foot::kLeft ? left_from_right_m : -left_from_right_m;
  }
};

/// A request turned into a group and parameters of that group.
struct RequestPlan {
  int group = -1;
  ParameterValues requested;       ///< What was asked, in the group's parameters
  ParameterValues applied;         ///< Nearest to it in the hull of the examples grown by 10 %
  bool extrapolated = false;       ///< `applied` lies outside the hull itself
  std::optional<Footprint> exact;  ///< Steps asked for by footprint: it, resolved
  double most_residual_m = 0.25;   ///< How far the library may miss it: eased into the swing
  std::optional<DVec3> root_m;     ///< Steps: where the root is to be at the end, seen from above
  std::optional<double> turn_rad;  ///< Steps: the change of heading asked for
  bool is_side_given = false;      ///< Steps: the request said how far aside
  bool clamped = false;            ///< `applied` differs from `requested` (by more than 1e-6)
  double distance_m = 0.0;  ///< How far the group is from what was asked; radians count 0.5 m
  double cost_m = 0.0;      ///< The same and how far outside the examples, and from the feet as are
};

/// Requests may reach this far beyond the examples (method: extrapolating 0.2 m costs 80 mm).
inline constexpr double kHullGrowth = 0.1;

/// The group that spans the step best, parameters clamped into its hull. The start, which the
/// avatar's feet dictate, is held harder than the end. What a group has no parameter for (turn, side,
/// height) counts as missed. Without a foot: the one other than `last_moved` unless the avatar is
/// `standing` and the other spans it better. Empty if the library has no step of that foot.
[[nodiscard]] std::optional<RequestPlan> PlanStep(const MotionLibrary& library,
                                                  const StepRequest& request, const FootState& feet,
                                                  Foot last_moved, bool standing);

/// The step of a foot to a place in the world: the request that says the same as seen from the foot
/// that stays, and what comes of it. `print.heading_rad` is near `heading_rad`, the body's.
[[nodiscard]] std::optional<RequestPlan> PlanFootprint(const MotionLibrary& library, Foot foot,
                                                       const Footprint& print, const DVec3& fixed_m,
                                                       double heading_rad, const FootState& feet);

/// The same for a jump.
[[nodiscard]] std::optional<RequestPlan> PlanJump(const MotionLibrary& library,
                                                  const JumpRequest& request);

}  // namespace stridewire
