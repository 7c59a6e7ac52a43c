#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"
#include "stridewire/runtime/pose.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

enum class AvatarEventType : std::uint8_t {
  /// A movement began. The event contains its group and its requested and applied parameters.
  kStarted,
  /// A foot touched the ground. The event contains the foot and the position of its ball.
  kFootStrike,
  kFinished,  ///< A movement ended. The event contains the new base frame.
  kIdle,      ///< The avatar stands still and its queue is empty.
  /// The avatar could not execute a request. The event contains the code and the reason and, if a
  /// step or jump is out of reach, the nearest one within reach. The avatar continues with the next
  /// request.
  kRejected,
  /// A request was dropped before it was completed. The event contains the outcome and the reason.
  kDropped,
};

/// How a request ended. The comments begin with the type of the event that reports the outcome.
enum class RequestOutcome : std::uint8_t {
  kNone,       ///< The request has not ended.
  kCompleted,  ///< kFinished: the movement was played to its end, or the walk has arrived.
  kRejected,   ///< kRejected: the avatar could not execute the request.
  kCancelled,  ///< kDropped: CancelQueue or Teleport dropped the request.
  /// kDropped or kFinished: a request with an interrupt dropped this request, or cut its movement
  /// short.
  kReplaced,
  kRemoved,  ///< kDropped: the avatar was removed.
};

/// A request that was dropped before it was completed.
struct DroppedRequest {
  std::uint64_t id = 0;
  RequestOutcome outcome = RequestOutcome::kNone;
};

/// Length, side, height and turn of a step or jump, as defined in StepRequest and JumpRequest.
struct StepMeasures {
  double length_m = 0.0;
  double side_m = 0.0;  ///< 0 for jumps.
  double height_m = 0.0;
  double turn_rad = 0.0;
};

/// Describes by how much a rejected step or jump would have missed its request. For steps with
/// `exact_only` the values are exact. For others, they are accurate to a few centimetres.
struct FootprintError {
  /// Nearest footprint within reach. For a jump: position and heading of the base frame after the
  /// nearest jump.
  Footprint nearest;
  double distance_m = 0.0;  ///< Distance from `nearest` to the requested place, >= 0.
  /// The larger of two angles: between the directions of the requested and the nearest path, and
  /// between the headings at their ends. With `exact_only`: only the latter. >= 0.
  double turn_rad = 0.0;
  /// Length, side, height and turn of the request, relative to the fixed foot (step) or to the
  /// start (jump).
  StepMeasures requested;
  StepMeasures reached;       ///< The same values of the nearest step or jump.
  bool is_footprint = false;  ///< The request was a step to a footprint.
};

/// Something that happened to an avatar during Advance. The type determines which fields are set.
struct AvatarEvent {
  AvatarEventType type = AvatarEventType::kIdle;
  /// Id of the request; 0 for a step that the avatar inserted itself.
  std::uint64_t request_id = 0;
  MovementKind kind = MovementKind::kStand;
  int group = -1;  ///< Index in MotionLibrary::groups(); -1 for a stand.
  /// Time of the event in seconds since the construction of the avatar.
  double time_s = 0.0;
  ParameterValues requested;  ///< kStarted: parameters as requested.
  /// kStarted: parameters after clamping to the hull of the examples, enlarged by 10 %.
  ParameterValues applied;
  bool extrapolated = false;  ///< kStarted: `applied` is outside the hull of the examples.
  /// kStarted: `applied` differs from `requested`, or the group lacks a requested parameter. False
  /// if planting nevertheless reaches the requested footprint exactly.
  bool clamped = false;
  bool is_cut_short = false;  ///< kFinished: another request interrupted the movement.
  /// kFootStrike: the foot that landed. kRejected with `missed`: the foot of the rejected step.
  Foot foot = Foot::kLeft;
  Vec3 position_m = Vec3(0.0f);              ///< kFootStrike: ball of that foot, in the world.
  BaseFrame base;                            ///< kFinished: base frame after the movement.
  ErrorCode code = ErrorCode::kUnsupported;  ///< kRejected
  /// kRejected, kDropped: one sentence. kIdle, kStarted of a stand: the reason why the feet are
  /// still apart; empty if they are together. Points to static storage.
  const char* reason = "";
  /// kRejected: set if the request was a step or jump that is out of reach.
  std::optional<FootprintError> missed;
  /// End of a walk (kFinished or kRejected): its mean speed without the first three and the last
  /// two steps. 0 if the walk had fewer than six steps.
  double speed_m_s = 0.0;
  /// How the request ended. For every accepted request, exactly one event has an outcome other than
  /// kNone. This is the last event with the id of the request.
  RequestOutcome outcome = RequestOutcome::kNone;
};

/// Describes a kRejected or kDropped event in one sentence of at most 200 bytes, for example "the
/// footprint is out of reach: the left foot reaches (0.1, 0, 1.25) m heading 0 rad, 0.5 m and 3.5
/// degrees off", or "the step is out of reach: requested length 1 m; nearest length 0.66 m, 0.34 m
/// and 0 degrees off".
[[nodiscard]] std::string DescribeRejection(const AvatarEvent& event);

/// Methods to continue smoothly from the previously displayed pose when a movement begins.
enum class BlendKind : std::uint8_t {
  /// The difference pose fades out with an initial velocity of zero (Semancik et al., Eq. (5)), so
  /// joint velocities may change abruptly.
  kCubic,
  /// The difference pose starts to fade with its current velocity, so joint velocities are
  /// continuous (Bollo, "Inertialization", GDC 2018).
  kInertialization,
};

struct AvatarOptions {
  /// True: the weights of a movement are corrected when it starts, so that the parameters measured
  /// on it equal the applied parameters (Section 4 of the paper).
  bool run_time_correction = true;
  /// True: feet stand still where they land. False: feet follow the blended pose and may slide.
  bool foot_planting = true;
  BlendKind blend = BlendKind::kInertialization;
  /// True: standing avatars settle into the library's stand pose, breathe, sway and shift their
  /// weight. Their feet do not move. If false, or if feet are not planted, avatars stand still in
  /// the last pose of their last movement.
  bool idle_motion = true;
  /// True: the duration and the pose of steps vary slightly, like the steps of people. Steps meet
  /// their parameters and footprints as accurately as without variation. Steps with `exact_only` do
  /// not vary. The default is false, because each avatar needs a different `seed`.
  bool stride_variation = false;
  /// Determines the starting point in the loop of the idle motion, and the variation of steps, so
  /// that avatars of a crowd do not move in unison.
  std::uint64_t seed = 0;
  /// Ground on which the feet land. Null: level ground at the avatar's height. A request with a
  /// height then moves the avatar up or down.
  std::shared_ptr<const Terrain> terrain;
};

class AvatarSimulation;

/// A character that plays requests one after the other. Its state consists of a base frame, a queue
/// of requests, the current movement and the displayed pose.
///
/// Time passes only in Advance. The same library, start, requests and time steps give the same pose
/// bytes on every machine. Not thread-safe; avatars share nothing but the library and the terrain,
/// so different avatars may be advanced by different threads.
class Avatar {
 public:
  static constexpr int kMaxQueue = 1024;
  /// Maximum number of events per Advance, not counting events of requests that were dropped since
  /// the previous Advance.
  static constexpr std::size_t kMaxEventsPerAdvance = 16;

  /// Creates an avatar that stands at `start` in the library's stand pose. `library` must not be
  /// null.
  Avatar(std::shared_ptr<const MotionLibrary> library, const BaseFrame& start,
         const AvatarOptions& options = {});
  ~Avatar();
  Avatar(Avatar&&) noexcept;
  Avatar& operator=(Avatar&&) noexcept;

  /// Validates and queues a request. A request with an interrupt replaces the queue. On error,
  /// nothing changes.
  ///
  /// Errors: those of ValidateRequest; kUnsupported if exact placement is requested while feet are
  /// not planted; kLimitExceeded if the queue contains kMaxQueue requests, even if the request has
  /// an interrupt.
  [[nodiscard]] Status Enqueue(const MovementRequest& request);

  /// Drops the requests in the queue, including a walk in progress, and returns their number. The
  /// next Advance reports them, except the walk, which ends with its current step and is reported
  /// then.
  int CancelQueue();

  /// Starts, changes or ends a layer with the next Advance. Errors: kNotFound if the layer does not
  /// exist, kOutOfRange if a number is not finite or out of range, kLimitExceeded if another layer
  /// would have to start while four layers are playing.
  [[nodiscard]] Status SetLayer(const LayerRequest& request);

  /// Moves the avatar to `start` at once. It then stands. Drops the current movement and the queue,
  /// and keeps the layers.
  void Teleport(const BaseFrame& start);

  /// Enables or disables foot planting from the next movement on. Enabling it fails with
  /// kUnsupported if the library's skeleton does not support foot planting.
  [[nodiscard]] Status SetFootPlanting(bool enabled);

  /// Replaces the terrain. Standing feet keep their positions until their next step.
  void SetTerrain(std::shared_ptr<const Terrain> terrain);

  /// Advances time by `dt_s` in (0, 1] seconds: finishes and starts movements, and updates the
  /// pose. The first call allocates scratch memory. In an AvatarCrowd, the avatars share scratch
  /// memory.
  void Advance(double dt_s);

  /// Displayed pose in world space. Valid until the next call that is not const.
  [[nodiscard]] ConstPoseSpan pose() const;
  /// Events of the last Advance, in order. Valid until the next Advance.
  [[nodiscard]] std::span<const AvatarEvent> events() const;
  /// Base frame of the current movement or stand.
  [[nodiscard]] const BaseFrame& base() const;
  /// Number of requests that have not started, plus 1 while a walk is in progress.
  [[nodiscard]] int queue_size() const;
  /// True if the queue is empty and no movement or requested stand is in progress.
  [[nodiscard]] bool idle() const;
  [[nodiscard]] bool foot_planting() const;
  [[nodiscard]] const MotionLibrary& library() const;
  /// Seconds since construction.
  [[nodiscard]] double time_s() const;

 private:
  friend class AvatarCrowd;
  std::unique_ptr<AvatarSimulation> simulation_;
};

/// Advances many avatars of one library together. This is several times as fast as advancing them
/// one by one. Every pose has the same bytes as if its avatar had been advanced alone. The crowd
/// contains only scratch memory, not the avatars.
class AvatarCrowd {
 public:
  explicit AvatarCrowd(std::shared_ptr<const MotionLibrary> library);
  ~AvatarCrowd();
  AvatarCrowd(AvatarCrowd&&) noexcept;
  AvatarCrowd& operator=(AvatarCrowd&&) noexcept;

  /// Advances each avatar like Avatar::Advance. All avatars must use the library that was passed to
  /// the constructor, and none may be listed twice.
  void Advance(std::span<Avatar* const> avatars, double dt_s);

 private:
  struct Scratch;
  std::unique_ptr<Scratch> scratch_;
};

/// Range of the speeds at which the avatars of a library walk straight ahead on level ground.
struct WalkSpeeds {
  double slowest_m_s = 0.0;
  double fastest_m_s = 0.0;  ///< 0: unknown, because a measured walk had too few steps.

  /// Speeds outside the range by at most this fraction count as inside, because strides vary.
  static constexpr double kTolerance = 0.05;

  /// Returns `speed_m_s` if the library can walk at this speed, otherwise the nearest end of the
  /// range. If the range is unknown, returns 0.
  [[nodiscard]] double Nearest(double speed_m_s) const;
  /// Returns true if the range is known and `speed_m_s` is outside it by more than the fraction
  /// kTolerance.
  [[nodiscard]] bool IsOutside(double speed_m_s) const;
};

/// Measures the range of walking speeds by simulating a fast and a slow walk of a few metres. The
/// same library gives the same values on every machine.
[[nodiscard]] WalkSpeeds MeasureWalkSpeeds(const std::shared_ptr<const MotionLibrary>& library);

}  // namespace stridewire
