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
#include "runtime/plan/request_error.h"
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

/// Changes of an avatar's movement during an Advance, from which movement records are derived.
/// Members with "left" refer to the previous movement, which ended or was interrupted.
struct AvatarChange {
  /// True if a change record cannot express the changes, so that the whole state must be sent.
  bool needs_state = false;
  bool has_left = false;      ///< True if the previous movement ended or was interrupted.
  bool has_begun = false;     ///< True if a movement began and is still in progress.
  bool has_layers = false;    ///< True if SetLayer was called.
  bool idle_changed = false;  ///< True if idle() has changed.
  /// True if the previous movement was completed, false if it was interrupted.
  bool is_left_at_end = false;
  /// True if the new movement began during the swing of the previous one.
  bool is_redirected = false;
  /// `keeps_speed` of the call of AvatarBody::CaptureBlendSource for the previous movement.
  bool left_keeps_speed = false;
  /// `keeps_speed` of the call of AvatarBody::BlendIn for the new movement.
  bool begun_keeps_speed = false;
  double left_s = 0.0;  ///< Time within the previous movement at which the avatar left it.

  bool operator==(const AvatarChange&) const = default;
};

/// Returns the reason of a kDropped event: a sentence without a full stop.
[[nodiscard]] const char* DropReason(RequestOutcome outcome);

/// Simulates one avatar: its base frame, queue of requests, current movement and displayed pose.
///
/// Time is an argument. The avatar moves only in Advance, AdvanceAll, AdvanceStates and Teleport.
/// The same library, start, options, calls and time steps give the same pose bytes on every
/// machine. Not thread-safe; one owner.
///
/// After construction, only these calls allocate: Enqueue, because the queue may grow to kMaxQueue
/// requests; calls that drop requests; SetLayer; the first Advance; and an Advance with many
/// events.
class AvatarSimulation {
 public:
  static constexpr int kMaxQueue = Avatar::kMaxQueue;
  static constexpr std::size_t kMaxEventsPerAdvance = Avatar::kMaxEventsPerAdvance;

  /// Creates an avatar that stands at `start` in the library's stand pose.
  AvatarSimulation(std::shared_ptr<const MotionLibrary> library, const BaseFrame& start,
                   const AvatarOptions& options = {});

  /// A swing is redirected only if more than this fraction of it remains.
  static constexpr double kLeastSwingLeft = 0.4;

  /// Validates and queues a request. A request with an interrupt replaces the queue. On error,
  /// nothing changes.
  ///
  /// Errors: those of ValidateRequest; kUnsupported if exact placement is requested while feet are
  /// not planted; kLimitExceeded if the queue is full, even if the request has an interrupt.
  ///
  /// `start_delay_s` (>= 0) delays the start. A standing avatar begins the request after this delay
  /// at the earliest, and a moving avatar is not interrupted earlier. If the request begins when
  /// another movement ends, it is not delayed. A delay of an earlier request is not extended.
  [[nodiscard]] Status Enqueue(const MovementRequest& request, double start_delay_s = 0.0);

  /// Drops the requests in the queue, including a walk in progress, and returns their number. The
  /// current movement continues to its end. The drop of a walk in progress is reported after its
  /// current step.
  int CancelQueue();

  /// Drops the queue and the request of the current movement. Call it only before removing or
  /// teleporting the avatar, because the movement itself continues.
  void DropAll(RequestOutcome outcome);

  /// Returns the requests that were dropped since the last Advance, and removes them from the list.
  /// The next Advance reports the remaining ones as events.
  [[nodiscard]] std::vector<DroppedRequest> TakeDropped() { return std::exchange(dropped_, {}); }

  /// Starts, changes or ends a layer with the next Advance. The legs and the root keep exactly the
  /// same bits as without layers. Errors are those of LayerStack::Set.
  [[nodiscard]] Status SetLayer(const LayerRequest& request);

  /// Moves the avatar to `start` at once. It then stands. Drops the current movement and the queue,
  /// and keeps the layers.
  void Teleport(const BaseFrame& start);

  /// Enables or disables foot planting from the next movement on, without a visible jump. Until
  /// that movement starts, swings are not redirected. While planting is disabled, queued requests
  /// for exact placement are rejected when they would start. Enabling it fails with kUnsupported if
  /// the skeleton does not support foot planting.
  [[nodiscard]] Status SetFootPlanting(bool enabled);
  /// The last setting. False if the skeleton does not support foot planting.
  [[nodiscard]] bool foot_planting() const {
    return options_.foot_planting && body_.library->leg_rig().is_usable;
  }

  /// Replaces the terrain. Standing feet keep their positions until their next step.
  void SetTerrain(std::shared_ptr<const Terrain> terrain) { options_.terrain = std::move(terrain); }

  /// Advances time by `dt_s` in (0, 1] seconds: finishes and starts movements, and updates the
  /// pose. The events of this call are available from events() until the next call. The first call
  /// allocates scratch memory. For many avatars, use AdvanceAll.
  void Advance(double dt_s);

  /// Advances many avatars of one library and evaluates their poses together. This is several times
  /// as fast as Advance for each of them. No bit of a pose depends on the other avatars.
  static void AdvanceAll(std::span<AvatarSimulation* const> avatars, double dt_s,
                         PlanScratch& scratch, SoaPoseEvaluator& evaluator);

  /// Like AdvanceAll, but without poses, for callers that evaluate poses themselves (SampleRun).
  /// pose() is outdated until UpdatePose is called. `eventful` receives the indices in `avatars` of
  /// those that are not event-free afterwards (is_event_free), in increasing order.
  static void AdvanceStates(std::span<AvatarSimulation* const> avatars, double dt_s,
                            PlanScratch& scratch, std::vector<std::uint32_t>* eventful = nullptr);
  /// Evaluates pose().
  void UpdatePose();
  /// Evaluates pose() for many avatars of one library together.
  static void UpdatePoses(std::span<AvatarSimulation* const> avatars, SoaPoseEvaluator& evaluator);

  /// Displayed pose in world space.
  [[nodiscard]] ConstPoseSpan pose() const { return body_.DisplayedPose(); }
  [[nodiscard]] const LayerStack& layers() const { return body_.layers; }
  /// All data on which the displayed pose and the next movement depend. It corresponds to pose()
  /// until the next Advance, Teleport or SetLayer.
  [[nodiscard]] const AvatarBody& body() const { return body_; }
  /// Returns the changes of the last Advance, including those by Teleport and SetLayer since the
  /// previous Advance.
  [[nodiscard]] const AvatarChange& change() const { return change_; }
  /// True if a movement that begins now continues with the velocity of the previous one.
  [[nodiscard]] bool keeps_speed() const { return moved_until_s_ == time_s_; }
  [[nodiscard]] std::span<const AvatarEvent> events() const { return events_; }
  [[nodiscard]] const BaseFrame& base() const { return base_; }
  [[nodiscard]] int queue_size() const { return static_cast<int>(queue_.size() - queue_head_); }
  /// True if the avatar stands, possibly with idle motion, no requested stand is in progress, and
  /// the queue is empty.
  [[nodiscard]] bool idle() const { return !is_moving_ && !is_in_stand_ && queue_size() == 0; }
  [[nodiscard]] const MotionLibrary& library() const { return *body_.library; }

  /// The current movement, or null while standing. Valid until the next Advance.
  [[nodiscard]] const Movement* movement() const { return is_moving_ ? &body_.movement : nullptr; }
  /// The movement that determines the displayed pose: the current movement or, while standing, the
  /// idle motion. Null if the avatar stands without idle motion. Valid until the next Advance.
  [[nodiscard]] const Movement* displayed_movement() const {
    return is_moving_ || is_idling_ ? &body_.movement : nullptr;
  }
  [[nodiscard]] double movement_time_s() const { return movement_time_s_; }
  /// Seconds since construction.
  [[nodiscard]] double time_s() const { return time_s_; }
  /// A number that changes whenever a movement or idle motion starts or ends, and on Teleport.
  /// While it stays the same, displayed_movement() and movement_time_s() determine the displayed
  /// pose before layers are applied.
  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  /// True if the avatar moves or idles without layers, the last Advance produced neither events nor
  /// a change(), and no call since then has scheduled an event.
  [[nodiscard]] bool is_event_free() const { return movement_time_s_ < next_event_s_; }
  /// Prefetches the cache line that is_event_free(), time_s(), revision() and movement_time_s()
  /// read, for callers that check many avatars.
  void PrefetchTickState() const { PrefetchBytes(&time_s_, kCacheLineBytes); }
  /// The kStarted event of the current movement or requested stand. Null if the avatar stands
  /// without a request.
  [[nodiscard]] const AvatarEvent* started() const {
    return is_moving_ || is_in_stand_ ? &started_ : nullptr;
  }
  /// The requests in the queue, in order. A request leaves the queue when it starts. Only a walk
  /// stays at the head of the queue until it ends.
  [[nodiscard]] std::span<const MovementRequest> queue() const {
    return std::span(queue_).subspan(queue_head_);
  }

 private:
  static constexpr const char* kNeedsPlanting = "exact placement requires foot planting";

  // Scratch memory for Advance, which handles a single avatar. The first call allocates it. Copies
  // of the avatar allocate their own memory.
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

  // A step that replaces the current step of the same foot while it is in progress.
  struct Redirection {
    RequestPlan plan;
    MovementRequest request;     // The requested step, or one that the avatar plans itself.
    bool is_inserted = false;    // True if the avatar plans the step itself.
    bool ends_interrupt = true;  // False if the interrupting request starts after this step.
  };

  void AddEvent(const AvatarEvent& event);
  void AddDroppedEvents();
  void DropQueue(RequestOutcome outcome);
  void ClearQueue();
  void EndDroppedWalk();
  // True if the current movement is a step of the walk at the head of the queue.
  [[nodiscard]] bool IsWalkInProgress() const {
    return is_moving_ && is_walk_step_ && walk_outcome_ == RequestOutcome::kNone;
  }
  // Returns the outcome of the current movement's request if the movement ends now. kNone if the
  // request continues or if there is none.
  [[nodiscard]] RequestOutcome MovementOutcome(bool is_cut_short) const {
    if (is_walk_step_ || request_id_ == 0) return RequestOutcome::kNone;
    return is_cut_short ? RequestOutcome::kReplaced : RequestOutcome::kCompleted;
  }
  // time_s_ is a rounded sum of ticks. Without the margin, a delay of whole ticks could last one
  // tick longer.
  [[nodiscard]] bool IsStartDelayed() const { return time_s_ + 1e-6 < start_not_before_s_; }
  [[nodiscard]] const MotionGroup& group() const { return body_.group(); }
  [[nodiscard]] FootState MeasureFeet() const;
  void AdvanceState(double dt_s, PlanScratch& scratch);
  // True if nothing but time changes in an Advance of `dt_s`.
  [[nodiscard]] bool StaysEventFree(double dt_s) const {
    return movement_time_s_ + dt_s < next_event_s_;
  }
  [[nodiscard]] double NextEventTime() const;
  void AdvanceEventfully(double dt_s, PlanScratch& scratch);
  void PrefetchState() const;
  [[nodiscard]] std::optional<RequestPlan> PlanClosingStep() const;
  [[nodiscard]] std::optional<RequestPlan> PlanPlantedClosingStep(Foot foot) const;
  [[nodiscard]] DVec3 PlaceBeside(Foot fixed) const;
  [[nodiscard]] bool HasGroundBeside(Foot fixed) const;
  [[nodiscard]] const char* WhyFeetAreApart() const;
  [[nodiscard]] bool StartNext(PlanScratch& scratch);
  [[nodiscard]] WalkDecision PlanNextWalkStep(WalkProgress& progress) const;
  void StartWalkStep(PlanScratch& scratch);
  void StartTransitionPath(bool is_hurried, PlanScratch& scratch);
  void StartInserted(const RequestPlan& plan, PlanScratch& scratch);
  std::uint64_t PopQueue();
  [[nodiscard]] double RiseAhead(const StepRequest& step) const;
  [[nodiscard]] FootprintRequest FootprintOf(const StepRequest& step) const;
  [[nodiscard]] std::optional<RequestPlan> PlanRequest(const MovementRequest& request) const;
  void StartPlan(const RequestPlan& plan, std::uint64_t request_id, PlanScratch& scratch);
  void PlanMovement(const RequestPlan& plan, double start_phase, PlanScratch& scratch);
  void BeginMovement(const RequestPlan& plan, std::uint64_t request_id);
  [[nodiscard]] bool PlanRequested(const MovementRequest& request, const RequestPlan& plan,
                                   double start_phase, PlanScratch& scratch);
  [[nodiscard]] LandingConditions landing_conditions() const {
    return {body_.plants_feet, options_.terrain != nullptr};
  }
  [[nodiscard]] RequestError PlannedError(const RequestPlan& plan) const {
    return ErrorOf(*body_.library, plan, feet_, landing_conditions());
  }
  void RejectOutOfReach(const MovementRequest& request, const RequestPlan& plan);
  [[nodiscard]] FootprintError NearestInReach(const Footprint& asked, const FootprintError& missed,
                                              double start_phase, PlanScratch& scratch);
  [[nodiscard]] FootprintError LandingErrorFrom(const Footprint& asked);
  [[nodiscard]] double MovementEnd() const;
  [[nodiscard]] double LandingTime() const;
  [[nodiscard]] bool LandsWithFeetApart() const;
  [[nodiscard]] double StepPhase() const;
  [[nodiscard]] std::optional<Redirection> PlanRedirection(double phase);
  [[nodiscard]] std::optional<Redirection> PlanEarlyLanding(double phase) const;
  [[nodiscard]] bool IsAheadOfSwing(const Footprint& print, double phase) const;
  [[nodiscard]] bool Redirect(PlanScratch& scratch);
  void SwitchPlanting();
  void CaptureBlendSource(double time_s);
  void RecordLeaving(double time_s, bool is_redirected);
  void FinishMovement(double at_s);
  void KeepToLine(const DVec3& line_m);
  void FinishStand();
  void AdvanceIdleMotion(double by_s, PlanScratch& scratch);
  void BeginIdleMotion(double left_s, PlanScratch& scratch);
  void EndIdleMotion();
  [[nodiscard]] DVec3 StandingPosition(Foot foot) const;
  [[nodiscard]] bool IsTwisted(Foot foot) const;
  [[nodiscard]] Vec3 LandingBall(Foot foot) const;
  [[nodiscard]] double StrikeTime() const;
  void ReportFootStrikes(double before_s, double after_s);

  // All data that an event-free tick reads is in one cache line.
  alignas(kCacheLineBytes) double time_s_ = 0.0;  // Avatar time.
  double movement_time_s_ = 0.0;
  double next_event_s_ = -1.0;  // Movement time before which no event can happen; -1 if unknown.
  std::uint64_t revision_ = 0;
  // At most one of these is true: a movement is in progress, or a requested stand is in progress.
  bool is_moving_ = false;
  bool is_in_stand_ = false;
  bool is_idling_ = false;         // True while body_.movement is the settle or idle motion.
  bool is_settled_ = false;        // True if the avatar stands in the stand pose.
  bool is_idle_reported_ = false;  // True if a kIdle event was sent since the last request.
  bool was_idle_ = false;          // Value of idle() after the previous Advance.
  // True if the last step left the feet apart, so that a step which brings them together must
  // precede a stand.
  bool is_walking_ = false;
  // True if the request at the head of the queue does not wait for the end of the movement.
  bool interrupts_ = false;
  // True until the avatar has tried to redirect the current step for the interrupting request.
  bool may_redirect_ = false;
  bool is_exact_ = false;      // True if the current step leads to a requested footprint.
  bool is_walk_step_ = false;  // True if the current or last movement is a step of a walk.
  // Outcome of a walk that was dropped during its current step, else kNone. It is reported when the
  // step ends.
  RequestOutcome walk_outcome_ = RequestOutcome::kNone;
  bool is_stand_cut_short_ = false;  // True if a request has ended the current stand early.
  // Number of successive steps that the avatar inserted, including the current movement.
  int inserted_steps_ = 0;
  std::uint64_t movement_number_ = 0;  // Number of movements that have begun.
  double start_not_before_s_ = 0.0;    // Avatar time before which no queued request may start.
  // Avatar time at which the last movement ended, if the next one can keep its velocity; else -1.
  double moved_until_s_ = -1.0;

  AvatarOptions options_;
  BaseFrame base_;
  AvatarBody body_;
  AvatarChange change_;           // Changes during the last Advance.
  AvatarChange next_change_;      // Changes since the last Advance. The next Advance reports them.
  std::uint64_t request_id_ = 0;  // Request id of the current movement or stand.
  double stand_left_s_ = 0.0;     // Remaining time of the current requested stand.
  AvatarEvent started_;           // The last kStarted event.
  // Height of the base frame after the movement minus its height before the movement.
  double ground_rise_m_ = 0.0;
  // State that is restored if a planned movement is rejected. The first request for exact placement
  // allocates it.
  struct SavedState {
    Movement movement;
    Pose pose;
  };
  // Contains at most one element. It is a vector so that an avatar can be copied.
  std::vector<SavedState> saved_;

  FootState stand_feet_;  // Relative position of the feet in the library's stand pose.
  FootState feet_;        // Relative position of the feet when the last movement ended.
  Foot last_moved_ = Foot::kRight;
  // Group of the previous movement. After a stand, the number of groups.
  std::size_t last_group_ = 0;
  WalkProgress walk_;   // Progress of the walk at the head of the queue.
  WalkPace walk_pace_;  // Speed of the walk at the head of the queue.
  // The queue consists of the elements from index queue_head_ on.
  std::vector<MovementRequest> queue_;
  std::size_t queue_head_ = 0;
  std::vector<AvatarEvent> events_;
  std::size_t max_events_ = kMaxEventsPerAdvance;  // Limit on the size of events_ in this Advance.
  std::vector<DroppedRequest> dropped_;  // Requests that were dropped since the last Advance.
  OwnScratch own_scratch_;
};

}  // namespace stridewire
