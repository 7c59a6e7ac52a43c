#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement.h"

namespace stridewire {

/// One step: where the moving foot lands relative to the fixed one.
struct StepRequest {
  std::optional<Foot> foot;      ///< Left out: the other foot than last time.
  double length_m = 0.0;         ///< Forward distance between the feet at the end; 0 closes.
  std::optional<double> side_m;  ///< Fixed to moving foot, positive to the moving foot's own side.
  double height_m = 0.0;         ///< Moving above fixed foot at the end.
  double turn_rad = 0.0;         ///< Change of heading, left positive.
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

struct MovementRequest {
  std::uint64_t id = 0;  ///< The caller's; comes back in events.
  std::variant<StepRequest, JumpRequest, StandRequest> movement;
};

/// Limits on what may be asked for, far outside what any library spans: meaning, not taste.
inline constexpr double kMaxRequestLengthM = 10.0;
inline constexpr double kMaxStandS = 3600.0;

/// Parameter values by name order of the group they belong to; `count` = group's parameter count.
struct ParameterValues {
  std::array<double, kMaxParameters> values{};
  int count = 0;
};

enum class AvatarEventType : std::uint8_t {
  kStarted,     ///< A movement began: group, requested and applied parameters.
  kFootStrike,  ///< A foot landed: foot and where its ball is.
  kFinished,    ///< A movement ended: the new base frame. The commit point.
  kIdle,        ///< Queue empty and standing still.
  kRejected,    ///< A queued request turned out impossible when its turn came: `reason`.
};

struct AvatarEvent {
  AvatarEventType type = AvatarEventType::kIdle;
  std::uint64_t request_id = 0;  ///< 0: the avatar's own doing (closing step).
  MovementKind kind = MovementKind::kStand;
  int group = -1;
  double time_s = 0.0;           ///< Avatar time (seconds since it was made) at which it happened.
  ParameterValues requested;     ///< kStarted
  ParameterValues applied;       ///< kStarted: after clamping to what the examples span
  bool extrapolated = false;     ///< kStarted: applied lies outside the hull of the examples
  bool clamped = false;          ///< kStarted: applied differs from requested
  Foot foot = Foot::kLeft;       ///< kFootStrike
  Vec3 position_m = Vec3(0.0f);  ///< kFootStrike
  BaseFrame base;                ///< kFinished: base frame after the movement
  const char* reason = "";       ///< kRejected; static storage
};

/// An avatar: base frame, queue of requests, current movement, displayed pose.
///
/// Time is an argument; `Advance` is the only thing that moves it. Given library, start, requests
/// and the sizes of the steps in time, the poses are the same bytes on every machine. Not
/// thread-safe; one owner. After construction only `Enqueue` may allocate (its queue, up to
/// kMaxQueue entries).
class Avatar {
 public:
  static constexpr int kMaxQueue = 1024;
  static constexpr int kMaxEventsPerAdvance = 16;

  /// Stands at `start` in the library's stand pose.
  Avatar(std::shared_ptr<const MotionLibrary> library, const BaseFrame& start);

  /// Checks and queues a request. kOutOfRange: a number not finite or over its limit;
  /// kUnsupported: the library has no group for it; kLimitExceeded: queue full.
  [[nodiscard]] Status Enqueue(const MovementRequest& request);

  /// Drops what has not started; the current movement goes on to its end. Returns how many.
  int CancelQueue();

  /// Puts the avatar somewhere else at once, standing; queue dropped.
  void Teleport(const BaseFrame& start);

  /// Goes on by `dt_s` (> 0, at most 1 s): finishes and starts movements, updates the pose.
  /// Events of this call are in `events()` until the next.
  void Advance(double dt_s);

  [[nodiscard]] ConstPoseSpan pose() const { return pose_; }  ///< Displayed, in the world.
  [[nodiscard]] std::span<const AvatarEvent> events() const;
  [[nodiscard]] const BaseFrame& base() const { return base_; }
  [[nodiscard]] int queue_size() const;
  [[nodiscard]] bool idle() const;  ///< Standing, nothing queued.
  [[nodiscard]] const MotionLibrary& library() const { return *library_; }

  /// The movement under way, null while standing; valid until the next Advance.
  [[nodiscard]] const Movement* movement() const;
  [[nodiscard]] double movement_time_s() const { return movement_time_s_; }

 private:
  std::shared_ptr<const MotionLibrary> library_;
  BaseFrame base_;
  Pose pose_;
  double movement_time_s_ = 0.0;
};

}  // namespace stridewire
