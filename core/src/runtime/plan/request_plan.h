#pragma once

#include <cstddef>
#include <optional>

#include "runtime/movement/movement.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Relative position of an avatar's feet when a movement starts: left ball minus right ball in the
/// heading frame, in metres.
struct FootState {
  DVec3 left_from_right_m = DVec3(0.0);

  /// Returns the vector from the fixed foot to the moving foot.
  [[nodiscard]] DVec3 Vector(Foot moving) const {
    return moving == Foot::kLeft ? left_from_right_m : -left_from_right_m;
  }
};

/// Target of a step or jump.
struct RequestTarget {
  /// Steps: vector from the fixed to the moving foot at the end, in the heading after the step.
  /// Jumps: path of the base frame, in the heading before the jump.
  DVec3 vector_m = DVec3(0.0);
  double turn_rad = 0.0;  ///< Change of heading.
};

/// A request translated to a group of the library and parameters of that group.
struct RequestPlan {
  int group = -1;
  ParameterValues requested;  ///< Parameters of the group that correspond to the request.
  RequestTarget target;       ///< Without a requested side, `vector_m.x` is that of the feet now.
  /// The point in the hull of the examples, grown by 10 %, that is nearest to `requested`.
  ParameterValues applied;
  bool extrapolated = false;       ///< True if `applied` is outside the hull itself.
  std::optional<Footprint> exact;  ///< Footprint requested by a step.
  /// Largest error of the footprint that planting distributes over the swing.
  double most_residual_m = 0.25;
  std::optional<DVec3> root_m;     ///< Steps: position of the root at the end, seen from above.
  std::optional<double> turn_rad;  ///< Steps: the requested change of heading.
  /// Steps: largest turn in addition to that of the examples, to meet `turn_rad`.
  double max_extra_turn_rad = kMaxExtraTurnRad;
  bool is_side_given = false;  ///< Steps: true if the request specified the side.
  bool is_varied = true;       ///< Steps: true if the step may deviate (see StrideVariation).
  /// Largest playback speed. The movement is played as fast as is needed to shorten it to
  /// kQuickStepS.
  double max_rate = 1.0;
  /// True if `applied` differs from `requested` by more than 1e-6.
  bool clamped = false;
  /// Distance of `applied` from `requested` in metres; a radian counts as 0.5 m.
  double distance_m = 0.0;
  /// Value of `distance_m` plus costs for extrapolation and for the positions of the feet.
  double cost_m = 0.0;
};

/// Requests may extrapolate this far beyond the examples. Extrapolating by 0.2 m costs 80 mm of
/// accuracy.
inline constexpr double kHullGrowth = 0.1;

/// Largest distance between the end of a library's step and a footprint beside the other foot, or
/// at the goal of a walk, that planting may distribute over the swing. Libraries without steps in
/// place can only close their feet and turn on the spot in this way.
inline constexpr double kMaxPlantedErrorM = 0.6;

/// Limits for steps of avatars in a hurry. In captures, the quickest steps of people who turn, stop
/// or walk briskly take 0.4 to 0.5 s.
inline constexpr double kQuickStepS = 0.5;
inline constexpr double kHurriedRate = 1.6;

/// Plans a step in the group that spans it best, with parameters clamped to its hull. The start,
/// which is given by the feet, has a larger weight than the end. A requested value (turn, side,
/// height) for which a group has no parameter counts as missed. If the request does not name a
/// foot, it is the foot other than `last_moved`, unless the avatar is `standing` and `last_moved`
/// fits better. If `after` is given, only groups that may follow that group are considered
/// (MayFollow). Returns nullopt if the library has no such step of that foot.
[[nodiscard]] std::optional<RequestPlan> PlanStep(const MotionLibrary& library,
                                                  const StepRequest& request, const FootState& feet,
                                                  Foot last_moved, bool standing,
                                                  std::optional<std::size_t> after = std::nullopt);

/// Returns true if a movement of group `to` may follow one of group `from`: their
/// Transition::distance_m is at most 0.15 m, or at most 1.5 times the distance of `to` from the
/// stand. After a stand, whose index is the number of groups, every movement is possible.
[[nodiscard]] bool MayFollow(const MotionLibrary& library, std::size_t from, std::size_t to);

/// Origin of a footprint: a request, or a walk, which can choose another one if no step fits.
enum class FootprintUse { kRequested, kWalk };

/// Plans a step to a footprint in world space, by translating it to a request relative to the foot
/// that stays, which is at `fixed_m`. `print.heading_rad` must be unwrapped to be close to
/// `heading_rad`, the heading of the body.
[[nodiscard]] std::optional<RequestPlan> PlanFootprint(const MotionLibrary& library, Foot foot,
                                                       const Footprint& print, const DVec3& fixed_m,
                                                       double heading_rad, const FootState& feet,
                                                       FootprintUse use);

/// Plans a jump.
[[nodiscard]] std::optional<RequestPlan> PlanJump(const MotionLibrary& library,
                                                  const JumpRequest& request);

/// Returns the change of heading that a movement of a group produces without an extra turn. Groups
/// without a turn parameter turn by what their examples turn on average, weighted by the distance
/// from them.
[[nodiscard]] double NaturalTurn(const MotionGroup& group, const ParameterValues& values);

}  // namespace stridewire
