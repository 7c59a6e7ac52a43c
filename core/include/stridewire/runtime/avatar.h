#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement.h"
#include "stridewire/runtime/movement_request.h"
#include "stridewire/runtime/request_plan.h"

namespace stridewire {

enum class AvatarEventType : std::uint8_t {
  kStarted,     ///< A movement began: group, requested and applied parameters.
  kFootStrike,  ///< A foot landed: foot and where its ball is.
  kFinished,    ///< A movement ended: the new base frame. The commit point.
  kIdle,        ///< Queue empty and standing still.
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
};

struct AvatarOptions {
  /// Movements start with corrected parameters (CorrectParameters), so that they have those applied.
  bool run_time_correction = true;
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
  Avatar(std::shared_ptr<const MotionLibrary> library, const BaseFrame& start,
         const AvatarOptions& options = {});

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
  [[nodiscard]] std::span<const AvatarEvent> events() const {
    return std::span(events_).first(event_count_);
  }
  [[nodiscard]] const BaseFrame& base() const { return base_; }
  [[nodiscard]] int queue_size() const { return static_cast<int>(queue_.size() - queue_head_); }
  /// Standing, nothing queued.
  [[nodiscard]] bool idle() const { return !is_moving_ && !is_in_stand_ && queue_size() == 0; }
  [[nodiscard]] const MotionLibrary& library() const { return *library_; }

  /// The movement under way, null while standing; valid until the next Advance.
  [[nodiscard]] const Movement* movement() const { return is_moving_ ? &movement_ : nullptr; }
  [[nodiscard]] double movement_time_s() const { return movement_time_s_; }
  /// The kStarted event of the movement or requested stand under way, null while just standing.
  [[nodiscard]] const AvatarEvent* started() const {
    return is_moving_ || is_in_stand_ ? &started_ : nullptr;
  }
  /// What has not started, in order.
  [[nodiscard]] std::span<const MovementRequest> queue() const {
    return std::span(queue_).subspan(queue_head_);
  }

 private:
  void AddEvent(const AvatarEvent& event);
  [[nodiscard]] const MotionGroup& group() const { return library_->group(movement_.group); }
  [[nodiscard]] FootState MeasureFeet() const;
  void Evaluate(double time_s);
  [[nodiscard]] bool BringsFeetTogether(const RequestPlan& plan) const;
  [[nodiscard]] bool StartNext();
  void StartPlan(const RequestPlan& plan, std::uint64_t request_id);
  void FinishMovement();
  void FinishStand();
  void ReportFootStrikes(double before_s, double after_s);

  std::shared_ptr<const MotionLibrary> library_;
  AvatarOptions options_;
  BaseFrame base_;
  Pose pose_;
  double time_s_ = 0.0;  // avatar time

  // One of: a movement under way, a requested stand, or just standing.
  bool is_moving_ = false;
  bool is_in_stand_ = false;
  bool is_idle_reported_ = false;
  bool is_walking_ = false;       // a step left the feet apart: close before anything but a step
  int closing_steps_ = 0;         // of our own in a row, the movement under way included
  std::uint64_t request_id_ = 0;  // of the movement or stand under way
  double stand_left_s_ = 0.0;
  AvatarEvent started_;
  Movement movement_;
  double movement_time_s_ = 0.0;
  double ground_rise_m_ = 0.0;  // how much higher the base will be after the movement
  GridCache cache_;
  std::vector<double> weight_scratch_;

  FootState stand_feet_;  // of the library's stand pose
  FootState feet_;
  Foot last_moved_ = Foot::kRight;
  std::vector<MovementRequest> queue_;  // live from queue_head_ on
  std::size_t queue_head_ = 0;
  std::array<AvatarEvent, kMaxEventsPerAdvance> events_{};
  std::size_t event_count_ = 0;
};

}  // namespace stridewire
