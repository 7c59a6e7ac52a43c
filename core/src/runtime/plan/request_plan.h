#pragma once

#include <algorithm>
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
  /// Steps: vector from the fixed to the moving foot at the end, relative to the heading after the
  /// step. Jumps: displacement of the base frame, relative to the heading before the jump.
  DVec3 vector_m = DVec3(0.0);
  double turn_rad = 0.0;  ///< Change of heading.
};

/// Limits for steps of avatars in a hurry: minimum duration in seconds, and maximum playback speed.
/// In captures, the quickest steps of people who turn, stop or walk briskly take 0.4 to 0.5 s.
inline constexpr double kQuickStepS = 0.5;
inline constexpr double kHurriedRate = 1.6;

/// Determines how fast a movement is played if it would take long.
struct PlaybackPace {
  double max_rate = 1.0;        ///< Maximum playback speed; 1 is that of the examples.
  double long_s = kQuickStepS;  ///< Movements up to this duration are not played faster.
  /// Duration to which longer movements are shortened, if `max_rate` allows it.
  double shortened_s = kQuickStepS;

  /// Returns the playback speed of a movement whose examples take `duration_s`.
  [[nodiscard]] double RateOf(double duration_s) const {
    return duration_s > long_s ? std::clamp(duration_s / shortened_s, 1.0, max_rate) : 1.0;
  }
};

/// A request expressed as a group of the library and parameters of that group.
struct RequestPlan {
  int group = -1;
  ParameterValues requested;  ///< Parameters of the group that correspond to the request.
  /// Target of the request. If no side was requested, `vector_m.x` is the current sideways distance
  /// between the feet.
  RequestTarget target;
  /// The point closest to `requested` in the hull of the examples, enlarged by 10 % (kHullGrowth).
  /// Distances are weighted as in `distance_m`.
  ParameterValues applied;
  bool extrapolated = false;       ///< True if `applied` is outside the original hull.
  std::optional<Footprint> exact;  ///< Footprint requested by a step.
  /// Planting distributes a horizontal error of at most this distance over the swing.
  double most_residual_m = 0.25;
  std::optional<DVec3> root_m;     ///< Steps: horizontal position of the root at the end.
  std::optional<double> turn_rad;  ///< Steps: the requested change of heading.
  /// Steps: maximum turn in addition to that of the examples, to meet `turn_rad`.
  double max_extra_turn_rad = kMaxExtraTurnRad;
  bool is_side_given = false;  ///< Steps: true if the request specified the side.
  bool is_varied = true;       ///< Steps: true if the step may be varied (see StrideVariation).
  PlaybackPace pace;
  /// True if a parameter of `applied` differs from `requested` by more than 1e-6, or if the group
  /// lacks a parameter that the request needs.
  bool clamped = false;
  /// Weighted distance between `applied` and `requested` in metres, plus the weighted errors of
  /// requested parameters that the group lacks. The weights depend on the parameter and the
  /// request.
  double distance_m = 0.0;
  /// `distance_m` plus costs for extrapolation, for the positions of the feet and, in libraries
  /// with generated groups, for captured groups without an example nearby.
  double cost_m = 0.0;
};

/// Requests may be outside the hull of the examples by this fraction of its size. The fraction is
/// small, because extrapolated movements are inaccurate.
inline constexpr double kHullGrowth = 0.1;

/// Maximum distance between the end of a library's step and its footprint that planting may
/// distribute over the swing. It applies to steps of walks, and to steps that bring a foot beside
/// the other one. In libraries without steps in place, such corrections are the only way to bring
/// the feet together and to turn on the spot.
inline constexpr double kMaxPlantedErrorM = 0.6;

/// Plans a step in the group that covers it best, with parameters clamped to the hull of the group.
/// The positions of the feet determine the start parameters. If a group has no parameter for the
/// turn, the height or the side, its steps count as straight, as level, or as wide as the stand
/// pose.
///
/// If the request does not specify a foot, the foot other than `last_moved` moves. If the avatar is
/// `standing` and `last_moved` fits better, that foot moves. If `after` is set, only groups that
/// may follow that group are considered (MayFollow). Returns nullopt if the library has no such
/// step of that foot.
[[nodiscard]] std::optional<RequestPlan> PlanStep(const MotionLibrary& library,
                                                  const StepRequest& request, const FootState& feet,
                                                  Foot last_moved, bool standing,
                                                  std::optional<std::size_t> after = std::nullopt);

/// Returns true if a movement of group `to` may follow one of group `from`. Their
/// Transition::distance_m must be at most 0.15 m, or at most 1.5 times that from the stand to `to`.
/// Also returns true if `from` is the stand, whose index is the number of groups, or if the library
/// contains no transitions.
[[nodiscard]] bool MayFollow(const MotionLibrary& library, std::size_t from, std::size_t to);

/// Origin of a footprint. A walk can choose another footprint if no step fits; a request cannot.
struct FootprintOrigin {
  bool is_walk = false;
  /// In a walk: the group of the previous movement, or the number of groups after a stand. In
  /// libraries with generated groups, a group costs more if its movements start far from the pose
  /// in which the previous movement ends (MotionLibrary::FindTransition).
  std::optional<std::size_t> after;
};

/// Plans a step to a footprint in world space, by converting it to a request relative to the fixed
/// foot, whose position is `fixed_m`. `print.heading_rad` must be unwrapped to be close to
/// `heading_rad`, the heading of the body.
[[nodiscard]] std::optional<RequestPlan> PlanFootprint(const MotionLibrary& library, Foot foot,
                                                       const Footprint& print, const DVec3& fixed_m,
                                                       double heading_rad, const FootState& feet,
                                                       const FootprintOrigin& origin);

/// Plans a jump.
[[nodiscard]] std::optional<RequestPlan> PlanJump(const MotionLibrary& library,
                                                  const JumpRequest& request);

/// Returns the change of heading of a movement without an extra turn. In groups without a turn
/// parameter, this is the weighted mean turn of the examples. The weight of an example is inversely
/// proportional to the squared distance of its parameters from `values`.
[[nodiscard]] double NaturalTurn(const MotionGroup& group, const ParameterValues& values);

}  // namespace stridewire
