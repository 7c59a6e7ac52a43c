#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Coordinate frame in which a movement starts: a point on the ground under the avatar, and a
/// heading. Poses of the movement are relative to it:
/// world = position_m + R_y(heading_rad) * local.
struct BaseFrame {
  DVec3 position_m = DVec3(0.0);
  double heading_rad = 0.0;  ///< Heading without wrapping: 2 pi is one full turn to the left.
};

/// Position and heading of a standing foot. The position is the point on the ground below the ball
/// of the foot.
struct Footprint {
  DVec3 position_m = DVec3(0.0);
  /// Direction from ankle to ball, minus the toe-out of that foot in the stand pose.
  double heading_rad = 0.0;
};

/// A requested footprint. Without `heading_rad`, the heading of the foot is that of the avatar when
/// the step begins.
struct FootprintRequest {
  DVec3 position_m = DVec3(0.0);
  std::optional<double> heading_rad;
};

/// Requests one step. The moving foot lands either relative to the fixed foot, or at a position in
/// the world (`at`).
struct StepRequest {
  /// Moving foot. Default: while walking, the foot that did not move last; from a stand, the foot
  /// that fits the request better.
  std::optional<Foot> foot;
  double length_m = 0.0;  ///< Forward distance between the feet at the end; 0: side by side.
  /// Sideways distance from the fixed to the moving foot, positive towards the side of the moving
  /// foot. Default: the width of the library's steps.
  std::optional<double> side_m;
  /// Height of the moving foot above the fixed foot at the end. Ignored if planted feet land on a
  /// Terrain, which then determines the height.
  double height_m = 0.0;
  double turn_rad = 0.0;  ///< Change of heading; positive turns left.
  /// Footprint of the moving foot in the world. It replaces length, side, height and turn.
  std::optional<FootprintRequest> at;
  /// True: the request is rejected at its start if the foot cannot land exactly at the requested
  /// place. Requires foot planting.
  bool exact_only = false;
  /// True: the avatar plays the nearest step of the library, however far it is from the request.
  /// False: the step is rejected if its errors exceed kMaxRequestErrorM or kMaxRequestErrorRad.
  bool allow_nearest = false;
};

struct JumpRequest {
  double length_m = 0.0;  ///< Forward distance.
  double height_m = 0.0;  ///< Height of the landing place above the start.
  double turn_rad = 0.0;  ///< Change of heading; positive turns left.
  /// True: the avatar plays the nearest jump, however far it is from the request. See StepRequest.
  bool allow_nearest = false;
};

/// Requests that the avatar stand still for `seconds`. If the avatar walks, it first brings its
/// feet together.
struct StandRequest {
  double seconds = 0.0;
};

/// Requests a walk to a place, with as many steps as necessary. Events of its steps have the id of
/// the request. When the avatar has arrived, a kFinished event of kind kStand with this id follows.
/// If the walk fails, a kRejected event contains the reason. If the walk is dropped in progress, a
/// kDropped event follows after its current step.
struct WalkRequest {
  /// Base frame at the end. y is ignored, because the ground determines it.
  DVec3 position_m = DVec3(0.0);
  double heading_rad = 0.0;        ///< Heading of the base frame at the end.
  std::vector<DVec3> waypoints_m;  ///< Points to pass in this order; at most kMaxWaypoints.
  /// Walking speed. It is met as closely as the library's steps allow (WalkSpeeds). Default:
  /// comfortable steps at a brisk pace.
  std::optional<double> speed_m_s;
};

/// Determines when a request begins, and whether it replaces earlier requests.
enum class Interrupt : std::uint8_t {
  kNone,  ///< The request begins after all queued requests.
  /// The request begins after the current step or jump. A current stand ends at once, and a walk
  /// ends after its current step. The queue is dropped.
  kAfterMovement,
  /// The request begins at once if both feet stand, and otherwise as soon as they have landed. A
  /// jump in progress continues to its landing. A requested stand waits for the end of the current
  /// step or jump if that movement ends with the feet together, or if the feet were together before
  /// it and none has left the ground yet. The queue is dropped.
  ///
  /// While more than 40 % of a swing remains, a requested step of the swinging foot redirects this
  /// foot to the new footprint. If feet are planted, a walk that begins with a step of this foot
  /// also redirects it, and a stand or jump shortens a step that would end with the feet apart.
  kNow,
};

struct MovementRequest {
  std::uint64_t id = 0;  ///< Chosen by the caller and repeated in events.
  std::variant<StepRequest, JumpRequest, StandRequest, WalkRequest> movement;
  Interrupt interrupt = Interrupt::kNone;
};

/// Starts, changes or ends a layer, a clip of the library that is played on top of movements.
struct LayerRequest {
  int layer = 0;  ///< Index in MotionLibrary::layers().
  /// True starts or changes the layer. False ends it; weight and speed are then ignored.
  bool enabled = true;
  double weight = 1.0;  ///< Factor for the joint weights of the clip, in (0, 1].
  /// Seconds over which weight and speed change to these values, in [0, kMaxLayerBlendS].
  double blend_s = 0.3;
  double speed = 1.0;  ///< Playback speed, kMinLayerSpeed to kMaxLayerSpeed; 1: as recorded.
};
inline constexpr double kMaxLayerBlendS = 10.0;
inline constexpr double kMinLayerSpeed = 0.1;
inline constexpr double kMaxLayerSpeed = 4.0;

/// Maximum errors of steps and jumps. If the place would be missed by more than kMaxRequestErrorM,
/// or the direction or the heading by more than kMaxRequestErrorRad, the step or jump is rejected
/// before it starts. With `allow_nearest`, the avatar plays the nearest step or jump instead.
inline constexpr double kMaxRequestErrorM = 0.2;
inline constexpr double kMaxRequestErrorRad = 1.0471975511965976;  ///< 60 degrees.

/// Limits on requests. They are far wider than the range of any library, so they reject only absurd
/// values.
inline constexpr double kMaxRequestLengthM =
    10.0;  ///< Maximum magnitude of lengths, sideways distances and heights.
inline constexpr double kMaxRequestTurnRad = 3.2;
inline constexpr double kMaxStandS = 3600.0;
/// Maximum magnitude of a coordinate of a goal, waypoint or footprint.
inline constexpr double kMaxWalkPositionM = 1e6;
inline constexpr double kMaxWalkHeadingRad = 1e4;  ///< Maximum magnitude of a heading.
inline constexpr double kMinWalkSpeedMPerS = 0.05;
inline constexpr double kMaxWalkSpeedMPerS = 5.0;
inline constexpr std::size_t kMaxWaypoints = 64;

/// Checks a request. Errors: kOutOfRange if a number is not finite or out of range, or if there are
/// too many waypoints; kInvalidArgument if both `exact_only` and `allow_nearest` are set;
/// kUnsupported if the library lacks steps of the requested foot, jumps or, for a walk, steps of
/// both feet. Error::where is "step", "jump", "walk_to" or "stand".
[[nodiscard]] Status ValidateRequest(const MotionLibrary& library, const MovementRequest& request);

/// Values of the parameters of a group, in the order of MotionGroup::parameters.
struct ParameterValues {
  std::array<double, kMaxParameters> values{};
  int count = 0;  ///< Number of values used.
};

}  // namespace stridewire
