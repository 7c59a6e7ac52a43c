#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/base/rotation_quantization.h"
#include "stridewire/protocol/frame.h"
#include "stridewire/protocol/limits.h"
#include "stridewire/protocol/pose_codec.h"
#include "stridewire/protocol/status_code.h"

/// The messages of the protocol as plain structs. STANDARD.md defines their fields.
///
/// Encoder and decoder run the same checks (check.h): numbers are finite, ids are not 0, counts
/// match and are within limits.h, and texts are short UTF-8. The server alone checks whether an
/// avatar exists or a step is possible, and it replies item by item.
namespace stridewire::protocol {

using WorldId = std::uint32_t;   ///< Assigned by the server, never 0.
using AvatarId = std::uint32_t;  ///< Unique within its world, never 0.
/// Chosen by the client; unique within its session, never 0.
using SubscriptionId = std::uint32_t;
using RequestId = std::uint64_t;  ///< Chosen by the client. 0: a step that the server inserted.

/// Sequence number of a command in its session: 1, 2, 3, ... (STATE_MACHINE.md, "Commands").
using Seq = std::uint64_t;

/// Permissions of a session in a world. Only controllers may command avatars.
enum class Role : std::uint8_t { kController = 0, kObserver = 1 };
/// Moving foot of a requested step. kAuto is the foot that did not move last.
enum class FootChoice : std::uint8_t { kAuto = 0, kLeft = 1, kRight = 2 };
/// Time at which a request begins. All values except kNone also drop the queue.
enum class Interrupt : std::uint8_t {
  kNone = 0,  ///< The request begins after all queued requests.
  /// The request begins after the current movement. Drops the queue; a stand or walk ends.
  kAfterMovement = 1,
  kNow = 2,  ///< The request begins as soon as the feet allow it. Drops the queue.
};
/// A foot of an avatar.
enum class FootSide : std::uint8_t { kLeft = 0, kRight = 1 };
/// Kind of a movement that an avatar executes.
enum class MovementKind : std::uint8_t { kStepLeft = 0, kStepRight = 1, kJump = 2, kStand = 3 };

/// Base frame of an avatar: its position and horizontal rotation.
struct Placement {
  DVec3 position_m = DVec3(0.0);
  double heading_rad = 0.0;  ///< Rotation about +Y, positive to the left, not wrapped.
  bool operator==(const Placement&) const = default;
};

// ---- client to server

/// First message of a connection.
struct Hello {
  static constexpr MessageType kType = MessageType::kHello;
  /// Lowest version that the client supports; at least 1, at most protocol_max.
  std::uint16_t protocol_min = kProtocolVersion;
  std::uint16_t protocol_max = kProtocolVersion;
  std::string client_name;  ///< Name of the client for the server's log, 1 to kMaxNameBytes.
  std::string auth_token;   ///< Secret that a server may require; may be empty.
  std::vector<std::byte>
      /// Token from Welcome, to resume a session. Empty: the client requests a new session.
      resume_token;
  /// When resuming: number of the last received Events message.
  std::uint64_t last_events_number = 0;
  bool operator==(const Hello&) const = default;
};

/// Joins a world. The server answers with WorldInfo and a Reply.
struct JoinWorld {
  static constexpr MessageType kType = MessageType::kJoinWorld;
  Seq seq = 0;
  std::string name;  ///< 1 to kMaxNameBytes
  Role role = Role::kController;
  bool operator==(const JoinWorld&) const = default;
};

/// Leaves a world and ends its subscriptions.
struct LeaveWorld {
  static constexpr MessageType kType = MessageType::kLeaveWorld;
  Seq seq = 0;
  WorldId world = 0;
  bool operator==(const LeaveWorld&) const = default;
};

/// An avatar to spawn.
struct SpawnItem {
  /// Id of the new avatar. 0: the server chooses an id and returns it in the Reply.
  AvatarId avatar = 0;
  Placement start;
  bool operator==(const SpawnItem&) const = default;
};

/// Spawns avatars.
struct Spawn {
  static constexpr MessageType kType = MessageType::kSpawn;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<SpawnItem> items;  ///< 1 to kMaxItems
  bool operator==(const Spawn&) const = default;
};

/// Removes avatars.
struct Remove {
  static constexpr MessageType kType = MessageType::kRemove;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<AvatarId> avatars;  ///< 1 to kMaxItems
  bool operator==(const Remove&) const = default;
};

/// Target of a foot in the world.
struct Footprint {
  DVec3 position_m = DVec3(0.0);      ///< Position of the ball of the foot.
  std::optional<double> heading_rad;  ///< Heading of the foot. Absent: the server chooses it.
  bool operator==(const Footprint&) const = default;
};

/// A requested step, either by parameters or to a footprint.
struct StepMovement {
  FootChoice foot = FootChoice::kAuto;
  double length_m = 0.0;  ///< Forward distance between the feet at the end.
  /// Sideways distance from the fixed to the moving foot, positive towards the moving foot's side.
  std::optional<double> side_m;
  double height_m = 0.0;  ///< Height of the moving foot above the fixed foot at the end.
  double turn_rad = 0.0;  ///< Change of heading.
  /// Target of the foot. If present, length, side, height and turn are not encoded.
  std::optional<Footprint> at;
  /// Only with `at`. True: if `at` is out of reach when the step is about to start, the step is
  /// rejected.
  bool exact_only = false;
  bool operator==(const StepMovement&) const = default;
};

/// A requested jump with both feet.
struct JumpMovement {
  double length_m = 0.0;
  double height_m = 0.0;
  double turn_rad = 0.0;
  bool operator==(const JumpMovement&) const = default;
};

/// A request to stand.
struct StandMovement {
  double seconds = 0.0;  ///< Duration.
  bool operator==(const StandMovement&) const = default;
};

/// A request to walk to a position. Events of its steps carry its request id. The walk ends with a
/// finished stand of that id when the avatar has arrived, or with a rejected event.
struct WalkMovement {
  DVec3 position_m = DVec3(0.0);   ///< Destination of the base frame. The terrain gives its height.
  double heading_rad = 0.0;        ///< Heading of the base frame at the destination.
  std::vector<DVec3> waypoints_m;  ///< Positions to pass, in this order; at most kMaxWaypoints.
  std::optional<double> speed_m_s;  ///< Walking speed. Absent: the server chooses it.
  bool operator==(const WalkMovement&) const = default;
};

/// One requested movement of one avatar.
struct RequestItem {
  AvatarId avatar = 0;       ///< Not 0.
  RequestId request_id = 0;  ///< Chosen by the client, not 0. Events repeat it.
  std::variant<StepMovement, JumpMovement, StandMovement, WalkMovement> movement;
  Interrupt interrupt = Interrupt::kNone;
  bool operator==(const RequestItem&) const = default;
};

/// Requests movements of one or more avatars. An avatar may appear several times and executes its
/// movements in order.
struct Request {
  static constexpr MessageType kType = MessageType::kRequest;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<RequestItem> items;  ///< 1 to kMaxItems
  bool operator==(const Request&) const = default;
};

/// Drops all requests of the avatars that have not started.
struct CancelQueue {
  static constexpr MessageType kType = MessageType::kCancelQueue;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<AvatarId> avatars;  ///< 1 to kMaxItems
  bool operator==(const CancelQueue&) const = default;
};

/// Horizontal position in metres.
struct GroundPoint {
  double x = 0.0;
  double z = 0.0;
  bool operator==(const GroundPoint&) const = default;
};

/// Heights on a regular grid, interpolated bilinearly. The height outside the grid is 0.
struct HeightFieldInfo {
  GroundPoint origin_m;          ///< Position of the first sample.
  double cell_m = 0.0;           ///< Distance between neighbouring samples.
  std::uint16_t columns = 0;     ///< Number of samples along x, 2 to kMaxTerrainColumns.
  std::uint16_t rows = 0;        ///< Number of samples along z, 2 to kMaxTerrainColumns.
  std::vector<float> heights_m;  ///< Heights of columns * rows samples; x varies fastest.
  bool operator==(const HeightFieldInfo&) const = default;
};

/// A block with vertical sides and a flat top.
struct TerrainBoxInfo {
  GroundPoint min_m;
  GroundPoint max_m;
  double height_m = 0.0;  ///< World height of the top.
  bool operator==(const TerrainBoxInfo&) const = default;
};

/// Terrain of a world. Its height at a point is the maximum of the height field and of all boxes
/// there.
struct TerrainInfo {
  std::optional<HeightFieldInfo> height_field;
  std::vector<TerrainBoxInfo> boxes;  ///< Boxes on the ground, at most kMaxTerrainBoxes.
  bool operator==(const TerrainInfo&) const = default;
};

/// Replaces the terrain of a world.
struct SetTerrain {
  static constexpr MessageType kType = MessageType::kSetTerrain;
  Seq seq = 0;
  WorldId world = 0;
  std::optional<TerrainInfo> terrain;  ///< The new terrain. Absent: flat at y = 0.
  bool operator==(const SetTerrain&) const = default;
};

/// Starts, changes or ends a layer of an avatar. The server checks the ranges item by item.
struct LayerItem {
  AvatarId avatar = 0;    ///< Not 0.
  std::string layer;      ///< Name of the layer, one of WorldInfo::layers; 1 to kMaxNameBytes.
  bool fade_out = false;  ///< Fades the layer out and ends it. `weight` and `speed` are ignored.
  double weight = 1.0;    ///< Weight of the layer, above 0 and at most 1.
  double blend_s = 0.3;   ///< Time until weight and speed reach their new values, 0 to 10.
  double speed = 1.0;     ///< Playback speed, 0.1 to 4. 1 plays as recorded.
  bool operator==(const LayerItem&) const = default;
};

/// Starts, changes and ends layers: clips that play over the current movement.
struct SetLayers {
  static constexpr MessageType kType = MessageType::kSetLayers;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<LayerItem> items;  ///< 1 to kMaxItems
  bool operator==(const SetLayers&) const = default;
};

/// Enables or disables foot planting from the next movement of each avatar on. With planting, feet
/// stand still where they land. Without it, they move as in the examples.
struct SetPlanting {
  static constexpr MessageType kType = MessageType::kSetPlanting;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<AvatarId> avatars;  ///< 1 to kMaxItems
  bool enabled = true;
  bool operator==(const SetPlanting&) const = default;
};

/// Within `to_m` of a region's centre, the server sends poses every `every_n_ticks` ticks.
struct RateRing {
  /// Outer radius. It must be above 0 and above the outer radius of the previous ring.
  double to_m = 0.0;
  std::uint16_t every_n_ticks = 1;  ///< 1 to kMaxEveryNTicks
  bool operator==(const RateRing&) const = default;
};

/// A circle on the ground. An avatar enters when its root comes within `radius_m` of the centre and
/// leaves at a distance of `radius_m` + `leave_m`.
struct Region {
  GroundPoint centre_m;
  double radius_m = 0.0;  ///< Above 0.
  /// Additional radius at which avatars leave, at least 0. Absent: the server chooses it.
  std::optional<double> leave_m;
  std::vector<RateRing>
      /// Rings from the inside out, at most kMaxRateRings. Beyond them Observe::every_n_ticks
      /// applies.
      rings;
  /// Detail of each ring, or empty to use Observe::detail everywhere. Needs PoseMode::kQuantised.
  std::vector<PoseDetail> ring_details;
  bool operator==(const Region&) const = default;
};

/// Starts a subscription to poses, or moves the region of one.
struct Observe {
  static constexpr MessageType kType = MessageType::kObserve;
  Seq seq = 0;
  WorldId world = 0;
  SubscriptionId subscription = 0;  ///< Not 0.
  PoseMode mode = PoseMode::kFull;  ///< Requested mode: kFull, kQuantised or kMovement.
  /// Ids to observe, also of avatars that do not exist yet. Empty: all avatars.
  std::vector<AvatarId> avatars;
  std::uint16_t every_n_ticks = 1;  ///< 1 to kMaxEveryNTicks
  bool with_events = false;         ///< True: the session also receives the events of the world.
  /// Observes the avatars inside this region. `avatars` must then be empty.
  std::optional<Region> region;
  bool replace = false;  ///< Replaces the region of the existing subscription with this id.
  /// Detail of kQuantised poses. It must be kAll in other modes.
  PoseDetail detail = PoseDetail::kAll;
  bool operator==(const Observe&) const = default;
};

/// Ends a subscription.
struct StopObserving {
  static constexpr MessageType kType = MessageType::kStopObserving;
  Seq seq = 0;
  SubscriptionId subscription = 0;
  bool operator==(const StopObserving&) const = default;
};

/// Measures the round-trip time and keeps the connection alive.
struct Ping {
  static constexpr MessageType kType = MessageType::kPing;
  std::uint64_t nonce = 0;
  double time_s = 0.0;  ///< Time on the client's clock. Pong repeats it.
  bool operator==(const Ping&) const = default;
};

/// Requests a piece of the library of a joined world. The server answers with LibraryPiece. Like
/// InspectAvatar, it is a query without a sequence number.
struct FetchLibrary {
  static constexpr MessageType kType = MessageType::kFetchLibrary;
  std::uint64_t nonce = 0;   ///< LibraryPiece repeats it.
  std::string hash;          ///< WorldInfo::library_hash
  std::uint64_t offset = 0;  ///< Position in the file, in bytes.
  /// Requested number of bytes, 1 to kMaxPieceBytes. The server may send fewer.
  std::uint32_t length = 0;
  bool operator==(const FetchLibrary&) const = default;
};

/// Queries what an avatar is doing. The answer is AvatarState. A query changes nothing, and the
/// server does not answer it if the connection is lost.
struct InspectAvatar {
  static constexpr MessageType kType = MessageType::kInspectAvatar;
  std::uint64_t nonce = 0;  ///< AvatarState repeats it.
  WorldId world = 0;
  AvatarId avatar = 0;
  bool operator==(const InspectAvatar&) const = default;
};

// ---- both ways

/// Ends the connection and the session, which cannot be resumed. A server closes the connection
/// without Goodbye if the client should reconnect.
struct Goodbye {
  static constexpr MessageType kType = MessageType::kGoodbye;
  StatusCode code = StatusCode::kOk;
  std::string text;
  bool operator==(const Goodbye&) const = default;
};

// ---- server to client

/// Limits of the server. A client must not exceed them.
struct ServerLimits {
  std::uint32_t max_control_bytes = static_cast<std::uint32_t>(kMaxControlBytes);
  std::uint32_t max_bulk_bytes = static_cast<std::uint32_t>(kMaxBulkBytes);
  std::uint32_t max_items = static_cast<std::uint32_t>(kMaxItems);
  std::uint32_t max_avatars_per_world = 0;
  std::uint32_t max_queue = 0;  ///< Queued requests per avatar.
  /// Number of replies that the server stores per session.
  std::uint32_t reply_memory = kReplyCache;
  /// The server closes a connection on which it receives nothing for this time. 0: never.
  double idle_timeout_s = 0.0;
  /// Time for which the server keeps a session without a connection. 0: it cannot be resumed.
  double resume_window_s = 0.0;
  bool operator==(const ServerLimits&) const = default;
};

/// Accepts a Hello.
struct Welcome {
  static constexpr MessageType kType = MessageType::kWelcome;
  std::uint16_t protocol = kProtocolVersion;  ///< Protocol version of the connection.
  std::uint64_t session = 0;                  ///< Not 0.
  /// Secret with which Hello resumes the session after a lost connection.
  std::vector<std::byte> resume_token;
  bool resumed = false;  ///< True if the previous session continues, false if the session is new.
  /// Last command that the server has accepted; 0 for a new session.
  Seq last_seq = 0;
  double tick_hz = 60.0;  ///< Above 0.
  std::string server_name;
  std::string server_version;
  ServerLimits limits;
  bool operator==(const Welcome&) const = default;
};

/// A joint of a skeleton.
struct JointInfo {
  std::string name;  ///< Unique in the skeleton.
  /// Index of the parent, smaller than the joint's own index. -1 for the root, which is joint 0.
  std::int16_t parent = -1;
  Vec3 offset_m = Vec3(0.0f);  ///< Position relative to the parent.
  bool operator==(const JointInfo&) const = default;
};

/// The end of a chain of joints, for example a fingertip.
struct EndSiteInfo {
  std::uint16_t joint = 0;
  Vec3 offset_m = Vec3(0.0f);  ///< Position relative to `joint`.
  bool operator==(const EndSiteInfo&) const = default;
};

/// Joint indices of a leg. -1: the library does not define the joint.
struct LegInfo {
  std::int16_t hip = -1;
  std::int16_t knee = -1;
  std::int16_t ankle = -1;
  std::int16_t ball = -1;
  Vec3 ball_offset_m = Vec3(0.0f);     ///< The ball of the foot, relative to joint `ball`.
  Vec3 toe_tip_offset_m = Vec3(0.0f);  ///< The tip of the toes, relative to joint `ball`.
  bool operator==(const LegInfo&) const = default;
};

/// Skeleton of all avatars of a world.
struct SkeletonInfo {
  std::vector<JointInfo> joints;  ///< 1 to kMaxJoints
  std::vector<EndSiteInfo> end_sites;
  std::array<LegInfo, 2> legs;  ///< Left leg, then right leg.
  bool operator==(const SkeletonInfo&) const = default;
};

/// Describes a joined world. Precedes the Reply to JoinWorld. After a resume the server sends one
/// with seq 0 for each joined world.
struct WorldInfo {
  static constexpr MessageType kType = MessageType::kWorldInfo;
  Seq seq = 0;
  WorldId world = 0;
  std::string name;
  Role role = Role::kController;
  std::uint64_t tick = 0;
  std::string library_hash;  ///< XXH3-128 of the library's payload in hexadecimal digits.
  SkeletonInfo skeleton;
  std::vector<std::string> layers;  ///< Names of the layers, for SetLayers.
  /// Quantization of each joint in compact poses.
  std::vector<RotationQuantization> rotation_codes;
  /// Joints of PoseDetail::kReduced in ascending order (CheckReducedJoints).
  std::vector<std::uint16_t> reduced_joints;
  bool operator==(const WorldInfo&) const = default;
};

/// Result of one item of a command.
struct ReplyItem {
  std::uint32_t index = 0;  ///< Index in the command's list of items or avatars.
  AvatarId avatar = 0;
  RequestId request_id = 0;  ///< Id of the request. Only in the Reply to a Request.
  StatusCode code = StatusCode::kOk;
  std::string text;
  bool operator==(const ReplyItem&) const = default;
};

/// Answers a command. Every command has exactly one Reply.
struct Reply {
  static constexpr MessageType kType = MessageType::kReply;
  Seq seq = 0;
  StatusCode code = StatusCode::kOk;  ///< Result of the command as a whole.
  std::string text;
  std::uint32_t accepted = 0;    ///< Number of items that were executed.
  std::vector<ReplyItem> items;  ///< Spawn: every item. Other commands: refused items only.
  bool operator==(const Reply&) const = default;
};

/// Flag of an avatar in a batch: do not interpolate from its previous pose. Receivers ignore
/// unknown flags.
inline constexpr std::uint8_t kPoseDiscontinuity = 1;
/// Flag of an avatar in a batch: it stands and its queue is empty.
inline constexpr std::uint8_t kPoseStanding = 2;
/// Flag of an avatar in a compact batch: its pose is outside the range of the world's quantization
/// and has the layout of PoseMode::kQuantised.
inline constexpr std::uint8_t kPoseUncompressed = 4;

/// Header of a batch. It contains nothing about a session, because the server encodes a batch once
/// and sends it to every observer of that world and mode.
struct PoseBatchInfo {
  WorldId world = 0;
  std::uint16_t shard = 0;
  std::uint16_t part = 0;  ///< Below `parts`.
  /// Number of frames of this batch. It is above 1 if the avatars of the shard do not fit in one
  /// frame.
  std::uint16_t parts = 1;
  std::uint64_t tick = 0;
  double server_time_s = 0.0;       ///< Server time of the tick.
  PoseMode mode = PoseMode::kFull;  ///< Mode of the poses: kFull, kQuantised or a compact mode.
  std::uint16_t joint_count = 0;    ///< 1 to kMaxJoints
  bool is_partial = false;          ///< True if an avatar that is not in the batch may still exist.
  bool operator==(const PoseBatchInfo&) const = default;
};

/// Poses of many avatars at one tick. Borrows its arrays: from the frame it was decoded from, or
/// from the caller of the encoder. Decoding checks the sizes of the arrays, and DecodePose checks
/// each pose. Root positions and rotations are in world space.
struct PoseBatch {
  static constexpr MessageType kType = MessageType::kPoseBatch;
  PoseBatchInfo info;
  std::span<const AvatarId> avatars;    ///< Ids of the avatars, at most kMaxItems, none of them 0.
  std::span<const std::uint8_t> flags;  ///< Flags of each avatar.
  /// Encoded poses, one after the other; see PoseBatchReader.
  std::span<const std::byte> poses;

  /// Bytes of the i-th pose of a full or quantised batch.
  [[nodiscard]] std::span<const std::byte> pose(std::size_t i) const {
    const std::size_t bytes = PoseBytes(info.mode, info.joint_count);
    return poses.subspan(i * bytes, bytes);
  }
};

/// Computes the size of each compressed pose of a compact batch; 0 if all poses are uncompressed.
/// Empty if the size of the batch does not match its flags.
[[nodiscard]] std::optional<std::size_t> CompactPoseBytes(const PoseBatch& batch);

/// Type of an event. The comments list the fields of Event that the type uses.
enum class EventType : std::uint8_t {
  kAccepted = 0,    ///< Uses request_id. The server has queued the request.
  kStarted = 1,     ///< Uses request_id, kind, group, requested, applied, extrapolated, clamped.
  kFootStrike = 2,  ///< Uses request_id, foot, position_m.
  kFinished = 3,    ///< Uses request_id, kind, base (the new base frame), cut_short.
  kIdle = 4,        ///< Uses base. The avatar stands and its queue is empty.
  kRejected = 5,    ///< Uses request_id, code, reason. The avatar could not execute the request.
  kSpawned = 6,     ///< base
  kRemoved = 7,
  kEntered = 8,  ///< The avatar has entered the region that this session observes.
  kLeft = 9,     ///< The avatar has left the observed region or the world.
};

/// Parameters of a movement. The names are 0 start_x_m, 1 start_y_m, 2 start_z_m, 3 end_x_m,
/// 4 end_y_m, 5 end_z_m, 6 turn_rad, 7 length_m, 8 height_m.
struct ParameterSet {
  std::array<std::uint8_t, kMaxParameters> names{};
  std::array<double, kMaxParameters> values{};
  std::uint8_t count = 0;  ///< Number of valid entries. All further entries are 0.
  bool operator==(const ParameterSet&) const = default;
};

/// Something that happened to an avatar.
struct Event {
  EventType type = EventType::kAccepted;
  AvatarId avatar = 0;
  RequestId request_id = 0;  ///< Id of the request. 0: a step that the server inserted.
  MovementKind kind = MovementKind::kStand;
  std::int16_t group = -1;
  std::uint64_t tick = 0;
  double time_s = 0.0;  ///< Server time of the tick.
  ParameterSet requested;
  ParameterSet applied;
  bool extrapolated = false;
  bool clamped = false;
  FootSide foot = FootSide::kLeft;
  DVec3 position_m = DVec3(0.0);
  Placement base;
  StatusCode code = StatusCode::kOk;
  std::string reason;
  bool cut_short = false;  ///< Another request interrupted the movement.
  bool operator==(const Event&) const = default;
};

/// Events of a world in chronological order.
struct Events {
  static constexpr MessageType kType = MessageType::kEvents;
  WorldId world = 0;
  std::uint64_t number = 0;  ///< Consecutive number of the message in the session, starting with 1.
  std::uint64_t tick = 0;
  std::vector<Event> events;  ///< 1 to kMaxItems
  bool operator==(const Events&) const = default;
};

/// Reports how much the server has dropped for a slow reader since it joined the world.
struct Lagging {
  static constexpr MessageType kType = MessageType::kLagging;
  WorldId world = 0;
  std::uint64_t dropped_batches = 0;
  std::uint64_t dropped_events = 0;
  bool operator==(const Lagging&) const = default;
};

/// Reports an error outside of a Reply. After a fatal error the server closes the connection.
struct ErrorNotice {
  static constexpr MessageType kType = MessageType::kError;
  StatusCode code = StatusCode::kInternal;
  std::string text;
  bool fatal = false;
  Seq seq = 0;  ///< Command that caused the error, or 0.
  bool operator==(const ErrorNotice&) const = default;
};

/// Answers a Ping.
struct Pong {
  static constexpr MessageType kType = MessageType::kPong;
  std::uint64_t nonce = 0;
  double time_s = 0.0;  ///< Client time, copied from Ping.
  double server_time_s = 0.0;
  std::uint64_t tick = 0;
  bool operator==(const Pong&) const = default;
};

/// Planned landing of a foot in the current movement.
struct Landing {
  FootSide foot = FootSide::kLeft;
  DVec3 position_m = DVec3(0.0);  ///< Position of the ball of the foot.
  double heading_rad = 0.0;       ///< Heading of the foot.
  bool operator==(const Landing&) const = default;
};

/// A layer that an avatar plays.
struct PlayingLayer {
  std::string layer;       ///< Name of the layer, one of WorldInfo::layers.
  double weight = 0.0;     ///< Current weight.
  double time_s = 0.0;     ///< Position in the clip in seconds.
  double speed = 1.0;      ///< Current playback speed.
  bool is_ending = false;  ///< The layer fades out.
  bool operator==(const PlayingLayer&) const = default;
};

/// The movement that an avatar executes. A requested stand has no group, keytimes or weights.
struct CurrentMovement {
  RequestId request_id = 0;
  MovementKind kind = MovementKind::kStand;
  std::int16_t group = -1;
  double started_s = 0.0;  ///< Server time of the start.
  /// Keytimes relative to the start; the first is 0. At most kMaxKeytimes.
  std::vector<double> keytimes_s;
  /// Generic time, 0 to the number of keytimes - 1 (paper, Eq. (3)).
  double generic_time = 0.0;
  /// Time after the start at which the difference pose has faded out.
  double ease_out_s = 0.0;
  ParameterSet requested;
  ParameterSet applied;
  bool extrapolated = false;
  bool clamped = false;
  std::vector<float> weights;  ///< Weight of each example of the group, at most kMaxWeights.
  std::vector<std::uint8_t>
      parameter_names;  ///< Parameters of the group; names as in ParameterSet.
  /// Parameters of the examples, example by example. May be empty.
  std::vector<float> sites;
  /// Landings of the feet that are still in the air, at most kMaxLandings.
  std::vector<Landing> landings;
  bool operator==(const CurrentMovement&) const = default;
};

/// Answers InspectAvatar.
struct AvatarState {
  static constexpr MessageType kType = MessageType::kAvatarState;
  std::uint64_t nonce = 0;
  WorldId world = 0;
  AvatarId avatar = 0;
  /// Result of the query. If it is not kOk, only `text` follows.
  StatusCode code = StatusCode::kOk;
  std::string text;
  std::uint64_t tick = 0;
  double server_time_s = 0.0;
  Placement base;
  std::optional<CurrentMovement> movement;
  std::uint32_t queue_size = 0;
  std::vector<RequestItem> queue;  ///< The first kMaxInspectedRequests queued requests.
  bool planting_enabled = true;    ///< See SetPlanting.
  /// Layers that the avatar plays, at most kMaxPlayingLayers. Later layers are on top.
  std::vector<PlayingLayer> layers;
  bool operator==(const AvatarState&) const = default;
};

/// Terrain of a joined world. The server sends it after WorldInfo if the world has a terrain,
/// always after a resume, and whenever the terrain changes.
struct WorldTerrain {
  static constexpr MessageType kType = MessageType::kWorldTerrain;
  WorldId world = 0;
  std::optional<TerrainInfo> terrain;  ///< The terrain. Absent: flat at y = 0.
  bool operator==(const WorldTerrain&) const = default;
};

/// Flag of an avatar in Movements, besides kPoseDiscontinuity: the avatar is gone and has no
/// record.
inline constexpr std::uint8_t kMovementGone = 4;

/// Movement records of one shard, for clients that evaluate poses themselves (STANDARD.md,
/// "Movement records"). The avatars of a shard advance in steps of one tick. The server sends the
/// changes of every step in order, and the complete states of avatars that the client does not know
/// yet.
struct Movements {
  static constexpr MessageType kType = MessageType::kMovements;
  WorldId world = 0;
  std::uint16_t shard = 0;
  std::uint16_t part = 0;   ///< Below `parts`.
  std::uint16_t parts = 1;  ///< Number of messages that contain the changes of this step.
  /// Number of steps that follow before the poses of `tick` are displayed.
  std::uint16_t more_steps = 0;
  std::uint64_t step = 0;  ///< Step number of the shard. A gap makes all its avatars unknown.
  std::uint64_t tick = 0;
  double server_time_s = 0.0;  ///< Server time of the tick.
  /// True: the records are states after `step`. False: the records are changes in `step`.
  bool states = false;
  std::vector<AvatarId> avatars;    ///< Ids of the avatars, at most kMaxItems, none of them 0.
  std::vector<std::uint8_t> flags;  ///< Flags of each avatar.
  std::vector<std::uint32_t> ends;  ///< End of each avatar's record in `records`, in bytes.
  std::vector<std::byte> records;
  bool operator==(const Movements&) const = default;

  /// Bytes of the i-th avatar's record.
  [[nodiscard]] std::span<const std::byte> record(std::size_t i) const {
    const std::size_t begin = i == 0 ? 0 : ends[i - 1];
    return std::span(records).subspan(begin, ends[i] - begin);
  }
};

/// Answers FetchLibrary.
struct LibraryPiece {
  static constexpr MessageType kType = MessageType::kLibraryPiece;
  std::uint64_t nonce = 0;
  /// Result of the request. If it is not kOk, only `text` and `hash` follow.
  StatusCode code = StatusCode::kOk;
  std::string text;
  std::string hash;
  std::uint64_t total_bytes = 0;  ///< Size of the library file.
  std::uint64_t offset = 0;
  /// Content of the piece, at most kMaxPieceBytes. Empty at the end of the file.
  std::vector<std::byte> bytes;
  bool operator==(const LibraryPiece&) const = default;
};

/// Any message.
using Message =
    std::variant<Hello, JoinWorld, LeaveWorld, Spawn, Remove, Request, CancelQueue, Observe,
                 StopObserving, Ping, InspectAvatar, Goodbye, Welcome, WorldInfo, Reply, PoseBatch,
                 Events, Lagging, ErrorNotice, Pong, AvatarState, SetTerrain, WorldTerrain,
                 SetLayers, SetPlanting, FetchLibrary, Movements, LibraryPiece>;

}  // namespace stridewire::protocol
