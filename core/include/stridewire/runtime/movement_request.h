#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Where a movement starts: a point on the ground that carries the avatar and a heading. The poses of
/// a movement are relative to it: world = position_m + R_y(heading_rad) * local.
struct BaseFrame {
  DVec3 position_m = DVec3(0.0);
  double heading_rad = 0.0;  ///< Not wrapped: 2 pi is one full turn to the left.
};

/// The place where a foot stands: the point of the ground below the ball of the foot.
struct Footprint {
  DVec3 position_m = DVec3(0.0);
  /// Direction from heel to ball, minus the toe-out of that foot in the stand pose.
  double heading_rad = 0.0;
};

/// A footprint asked for. Without a heading: that of the avatar when the step begins.
struct FootprintRequest {
  DVec3 position_m = DVec3(0.0);
  std::optional<double> heading_rad;
};

/// One step: where the moving foot lands relative to the fixed one.
struct StepRequest {
  std::optional<Foot> foot;      ///< Left out: the other foot than last time.
  double length_m = 0.0;         ///< Forward distance between the feet at the end; 0 closes.
  std::optional<double> side_m;  ///< Fixed to moving foot, positive to the moving foot's own side.
  double height_m = 0.0;         ///< Moving above fixed foot at the end.
  double turn_rad = 0.0;         ///< Change of heading, left positive.
  /// Instead of all of these: where the moving foot lands in the world.
  std::optional<FootprintRequest> at;
  /// Only with `at`: if that is out of reach when the step is about to start, it is rejected instead of landing
  /// as near as it can.
  bool exact_only = false;
};

struct JumpRequest {
  double length_m = 0.0;
  double height_m = 0.0;
  double turn_rad = 0.0;
};

/// Stands for a while; a walking avatar closes its feet first.
struct StandRequest {
  double seconds = 0.0;
};

/// A walk to a place in as many steps as it takes (walk_planner.h). Its steps carry the request's id; a
/// finished stand with that id says that it has arrived, a rejected one why it can not.
struct WalkRequest {
  DVec3 position_m = DVec3(0.0);    ///< Of the base frame; y is the ground's, whatever it says
  double heading_rad = 0.0;         ///< Of the base frame
  std::vector<DVec3> waypoints_m;   ///< Passed on the way, in order; at most kMaxWaypoints
  std::optional<double> speed_m_s;  ///< As near as the library's steps come to it
};

/// When a request begins, and what becomes of those before it.
enum class Interrupt : std::uint8_t {
  kNone,           ///< After all that is queued
  kAfterMovement,  ///< After the movement under way; what is queued is dropped, a stand or walk ends
  /// At once if both feet stand, else when they have landed; what is queued is dropped. A step of the foot
  /// that swings takes it to its own footprint, if there is swing enough left (AvatarSimulation::kLeastSwingLeft). Who
  /// is to stand finishes the movement first.
  kNow,
};

struct MovementRequest {
  std::uint64_t id = 0;  ///< The caller's; comes back in events.
  std::variant<StepRequest, JumpRequest, StandRequest, WalkRequest> movement;
  Interrupt interrupt = Interrupt::kNone;
};

/// Starts, changes or ends one of the library's layer clips on top of the movement.
struct LayerRequest {
  int layer = 0;         ///< Index in MotionLibrary::layers().
  bool enabled = true;   ///< False ends the layer; weight and speed are then ignored.
  double weight = 1.0;   ///< (0, 1]; multiplies the joint mask of the clip.
  double blend_s = 0.3;  ///< Seconds until weight and speed are reached, [0, kMaxLayerBlendS].
  double speed = 1.0;    ///< Playback speed, [kMinLayerSpeed, kMaxLayerSpeed]; 1 is as recorded.
};
inline constexpr double kMaxLayerBlendS = 10.0;
inline constexpr double kMinLayerSpeed = 0.1;
inline constexpr double kMaxLayerSpeed = 4.0;

/// Limits on what may be asked for, far outside what any library spans: meaning, not taste.
inline constexpr double kMaxRequestLengthM = 10.0;  ///< Lengths, sides and heights, either sign.
inline constexpr double kMaxRequestTurnRad = 3.2;
inline constexpr double kMaxStandS = 3600.0;
inline constexpr double kMaxWalkPositionM =
    1e6;  ///< Each coordinate of goals, waypoints, footprints.
inline constexpr double kMaxWalkHeadingRad = 1e4;  ///< Of goals and footprints.
inline constexpr double kMinWalkSpeedMPerS = 0.05;
inline constexpr double kMaxWalkSpeedMPerS = 5.0;
inline constexpr std::size_t kMaxWaypoints = 64;

/// kOutOfRange: a number not finite or beyond its limit; kInvalidArgument: nothing is there that must be
/// met; kUnsupported: the library has no movement of that kind.
[[nodiscard]] Status ValidateRequest(const MotionLibrary& library, const MovementRequest& request);

/// Parameter values in the order of the group they belong to; `count` = its parameter count.
struct ParameterValues {
  std::array<double, kMaxParameters> values{};
  int count = 0;
};

}  // namespace stridewire
