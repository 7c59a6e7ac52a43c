#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/prefetch.h"
#include "runtime/avatar/avatar_body.h"
#include "runtime/movement/movement.h"
#include "runtime/plan/request_plan.h"
#include "runtime/plan/transition_path.h"
#include "runtime/plan/walk_planner.h"
#include "runtime/pose/layer_stack.h"
#include "runtime/pose/soa_pose_evaluator.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/avatar.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// What has become of an avatar's movement in a call of Advance, for who shows the avatar elsewhere
/// (MovementRecord).
struct AvatarChange {
  bool needs_state = false;        ///< More than the rest tells: only the whole state does
  bool has_left = false;           ///< The movement before ended or gave way
  bool has_begun = false;          ///< One began, and goes on
  bool has_layers = false;         ///< Layers were asked for
  bool idle_changed = false;       ///< idle() is not what it was
  bool is_left_at_end = false;     ///< The one before ended, and did not give way
  bool is_redirected = false;      ///< The other began in mid-swing of the one before
  bool left_keeps_speed = false;   ///< How the one before was left (AvatarBody::CaptureBlendSource)
  bool begun_keeps_speed = false;  ///< How the other was joined (AvatarBody::BlendIn)
  double left_s = 0.0;             ///< When the one before was left, its own time

  bool operator==(const AvatarChange&) const = default;
};

/// An avatar: base frame, queue of requests, current movement, displayed pose.
///
/// Time is an argument; `Advance` is the only thing that moves it. Given library, start, requests
/// and the sizes of the steps in time, the poses are the same bytes on every machine. Not
/// thread-safe; one owner. After construction only `Enqueue` (its queue, up to kMaxQueue entries)
/// and `SetLayer` may allocate, and `Advance` room for events when a call has more than any before.
class AvatarSimulation {
 public:
  static constexpr int kMaxQueue = Avatar::kMaxQueue;
  static constexpr std::size_t kMaxEventsPerAdvance = Avatar::kMaxEventsPerAdvance;

  /// Stands at `start` in the library's stand pose.
  AvatarSimulation(std::shared_ptr<const MotionLibrary> library, const BaseFrame& start,
                   const AvatarOptions& options = {});

  /// A swing less than this part of which is left is not sent elsewhere.
  static constexpr double kLeastSwingLeft = 0.4;

  /// Checks and queues a request; one that takes over empties the queue first. Errors as
  /// ValidateRequest; kUnsupported also for a footprint that must be met where feet are not
  /// planted; kLimitExceeded: queue full.
  ///
  /// `start_delay_s` (0 or more): who just stands begins it no sooner than that from now, and who
  /// moves is not taken over before. What goes on from a movement is never held. One who is held
  /// already is not held longer.
  [[nodiscard]] Status Enqueue(const MovementRequest& request, double start_delay_s = 0.0);

  /// Drops what has not started; the current movement goes on to its end. Returns how many.
  int CancelQueue();

  /// Plays a layer over the movement, or ends it, from the next Advance on. Legs, root and all that
  /// movements do are bit by bit what they are without. Errors as LayerStack::Set.
  [[nodiscard]] Status SetLayer(const LayerRequest& request);

  /// Puts the avatar somewhere else at once, standing; queue dropped. Layers go on.
  void Teleport(const BaseFrame& start);

  /// Plants feet, or not, from the next movement that starts on; what is displayed goes on without
  /// a jump. A swing is not sent elsewhere meanwhile, and what waits in the queue for a footprint
  /// that must be met is rejected while it is off. kUnsupported: to be on, but this skeleton does
  /// not support foot planting.
  [[nodiscard]] Status SetFootPlanting(bool enabled);
  /// As last set; false where the library's legs can not.
  [[nodiscard]] bool foot_planting() const {
    return options_.foot_planting && body_.library->leg_rig().is_usable;
  }

  /// Changes the ground. Feet that stand stay where they are until their next step.
  void SetTerrain(std::shared_ptr<const Terrain> terrain) { options_.terrain = std::move(terrain); }

  /// Goes on by `dt_s` (> 0, at most 1 s): finishes and starts movements, updates the pose.
  /// Events of this call are in `events()` until the next.
  void Advance(double dt_s);

  /// The same for many avatars of one library, whose poses are evaluated together: several times as
  /// fast, and not a bit of any pose depends on who else is there.
  static void AdvanceAll(std::span<AvatarSimulation* const> avatars, double dt_s,
                         PlanScratch& scratch, SoaPoseEvaluator& evaluator);

  /// AdvanceAll but for the poses, for who has them evaluated otherwise (SampleRun): pose() is none
  /// of now until UpdatePose. `eventful`: the places in `avatars` of those that are not quiet after
  /// it, growing.
  static void AdvanceStates(std::span<AvatarSimulation* const> avatars, double dt_s,
                            PlanScratch& scratch, std::vector<std::uint32_t>* eventful = nullptr);
  /// Evaluates pose().
  void UpdatePose();
  /// The same for many avatars of one library together.
  static void UpdatePoses(std::span<AvatarSimulation* const> avatars, SoaPoseEvaluator& evaluator);

  /// Displayed, in the world.
  [[nodiscard]] ConstPoseSpan pose() const { return body_.DisplayedPose(); }
  [[nodiscard]] const LayerStack& layers() const { return body_.layers; }
  /// What is displayed and what comes after it follow from. Until the next Advance, Teleport or
  /// SetLayer it is that of pose().
  [[nodiscard]] const AvatarBody& body() const { return body_; }
  /// What changed in the last Advance, and by Teleport and SetLayer before it.
  [[nodiscard]] const AvatarChange& change() const { return change_; }
  /// Of who stands: what begins next may keep the speed there was, if it begins at once.
  [[nodiscard]] bool keeps_speed() const { return moved_until_s_ == time_s_; }
  [[nodiscard]] std::span<const AvatarEvent> events() const { return events_; }
  [[nodiscard]] const BaseFrame& base() const { return base_; }
  [[nodiscard]] int queue_size() const { return static_cast<int>(queue_.size() - queue_head_); }
  /// Standing, nothing queued.
  [[nodiscard]] bool idle() const { return !is_moving_ && !is_in_stand_ && queue_size() == 0; }
  [[nodiscard]] const MotionLibrary& library() const { return *body_.library; }

  /// The movement under way, null while standing; valid until the next Advance.
  [[nodiscard]] const Movement* movement() const { return is_moving_ ? &body_.movement : nullptr; }
  [[nodiscard]] double movement_time_s() const { return movement_time_s_; }
  /// Seconds since it was made.
  [[nodiscard]] double time_s() const { return time_s_; }
  /// Another number whenever a movement begins or ends or the avatar is put elsewhere. As long as
  /// it stays, all that is displayed but layers follows from movement() and its time, or stands
  /// still.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  /// Moving without layers, and nothing has happened in the last Advance: events() and change()
  /// tell nothing. Of who is quiet, time_s(), revision(), movement_time_s() and idle() lie in one
  /// cache line.
  [[nodiscard]] bool is_event_free() const { return movement_time_s_ < next_event_s_; }
  /// For who asks many: that line is read soon.
  void PrefetchTickState() const { PrefetchBytes(&time_s_, kCacheLineBytes); }
  /// The kStarted event of the movement or requested stand under way, null while just standing.
  [[nodiscard]] const AvatarEvent* started() const {
    return is_moving_ || is_in_stand_ ? &started_ : nullptr;
  }
  /// What has not started, in order.
  [[nodiscard]] std::span<const MovementRequest> queue() const {
    return std::span(queue_).subspan(queue_head_);
  }

 private:
  static constexpr const char* kNeedsPlanting = "exact placement requires foot planting";

  // Scratch memory for Advance, which handles a single avatar. The first call allocates it. Copies
  // of the avatar allocate their own.
  class OwnScratch {
   public:
    OwnScratch() = default;
    OwnScratch(const OwnScratch&) {}
    OwnScratch(OwnScratch&&) noexcept = default;
    OwnScratch& operator=(const OwnScratch&) { return *this; }
    OwnScratch& operator=(OwnScratch&&) noexcept = default;
    ~OwnScratch() = default;
    [[nodiscard]] PlanScratch& Get(const MotionLibrary& library);

   private:
    std::unique_ptr<PlanScratch> scratch_;
  };

  void AddEvent(const AvatarEvent& event);
  // Times are sums of ticks: a hold of whole ticks ends with the last of them.
  [[nodiscard]] bool IsStartDelayed() const { return time_s_ + 1e-6 < start_not_before_s_; }
  [[nodiscard]] const MotionGroup& group() const { return body_.group(); }
  [[nodiscard]] FootState MeasureFeet() const;
  void AdvanceState(double dt_s, PlanScratch& scratch);
  // Nothing happens in an Advance: it moves time only.
  [[nodiscard]] bool StaysEventFree(double dt_s) const {
    return movement_time_s_ + dt_s < next_event_s_;
  }
  [[nodiscard]] double NextEventTime() const;
  void AdvanceEventfully(double dt_s, PlanScratch& scratch);
  void PrefetchState() const;
  [[nodiscard]] bool BringsFeetTogether(const RequestPlan& plan) const;
  [[nodiscard]] bool StartNext(PlanScratch& scratch);
  void StartWalkStep(PlanScratch& scratch);
  void StartTransitionPath(PlanScratch& scratch);
  void StartInserted(const RequestPlan& plan, PlanScratch& scratch);
  std::uint64_t PopQueue();
  [[nodiscard]] double RiseAhead(const StepRequest& step) const;
  [[nodiscard]] std::optional<RequestPlan> PlanRequest(const MovementRequest& request) const;
  void StartPlan(const RequestPlan& plan, std::uint64_t request_id, PlanScratch& scratch);
  void PlanMovement(const RequestPlan& plan, double swing_part, PlanScratch& scratch);
  void BeginMovement(const RequestPlan& plan, std::uint64_t request_id);
  [[nodiscard]] bool PlanRequested(const MovementRequest& request, const RequestPlan& plan,
                                   double swing_part, PlanScratch& scratch);
  [[nodiscard]] FootprintError NearestInReach(const Footprint& asked, const FootprintError& missed,
                                              double swing_part, PlanScratch& scratch);
  [[nodiscard]] FootprintError LandingErrorFrom(const Footprint& asked);
  [[nodiscard]] double MovementEnd() const;
  [[nodiscard]] double LandingTime() const;
  [[nodiscard]] bool RedirectsSwing() const;
  void RedirectSwing(PlanScratch& scratch);
  void SwitchPlanting();
  void CaptureBlendSource(double time_s);
  void RecordLeaving(double time_s, bool is_redirected);
  void FinishMovement(double at_s);
  void KeepToLine(const DVec3& line_m);
  void FinishStand();
  [[nodiscard]] DVec3 StandingPosition(Foot foot) const;
  [[nodiscard]] Vec3 LandingBall(Foot foot) const;
  [[nodiscard]] double StrikeTime() const;
  void ReportFootStrikes(double before_s, double after_s);

  // All that an uneventful tick asks, in one cache line.
  alignas(kCacheLineBytes) double time_s_ = 0.0;  // avatar time
  double movement_time_s_ = 0.0;
  double next_event_s_ = -1.0;  // movement time; until then nothing happens
  std::uint64_t revision_ = 0;
  // One of: a movement under way, a requested stand, or just standing.
  bool is_moving_ = false;
  bool is_in_stand_ = false;
  bool is_idle_reported_ = false;
  bool was_idle_ = false;            // after the Advance before
  bool is_walking_ = false;          // a step left the feet apart: close before standing
  bool interrupts_ = false;          // the request at the queue's head does not wait for the end
  bool is_exact_ = false;            // the step under way lands where it was sent
  int inserted_steps_ = 0;           // of our own in a row, the movement under way included
  double start_not_before_s_ = 0.0;  // avatar time
  double moved_until_s_ = -1.0;      // avatar time

  AvatarOptions options_;
  BaseFrame base_;
  AvatarBody body_;
  AvatarChange change_;           // of the last Advance
  AvatarChange next_change_;      // told with the next
  std::uint64_t request_id_ = 0;  // of the movement or stand under way
  double stand_left_s_ = 0.0;
  AvatarEvent started_;
  double ground_rise_m_ = 0.0;  // how much higher the base will be after the movement
  // What is put back when a movement that was planned is not played. Has its size from the first
  // request on that may be refused.
  struct SavedState {
    Movement movement;
    Pose pose;
  };
  std::vector<SavedState> saved_;  // one, or none before; an avatar can be copied

  FootState stand_feet_;  // of the library's stand pose
  FootState feet_;
  Foot last_moved_ = Foot::kRight;
  std::size_t last_group_ = 0;  // of the movement before; as many as there are groups: a stand
  WalkProgress walk_;           // of the walk at the queue's head
  std::vector<MovementRequest> queue_;  // live from queue_head_ on
  std::size_t queue_head_ = 0;
  std::vector<AvatarEvent> events_;
  OwnScratch own_scratch_;
};

}  // namespace stridewire
