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

/// The messages as plain values. Encoding and decoding check the same things (Check): numbers are
/// finite, ids are not zero, counts are within limits.h and match, texts are short UTF-8. Whether
/// an avatar exists or a step is possible is for the server to say, item by item.
namespace stridewire::protocol {

using WorldId = std::uint32_t;         ///< Given by the server, never 0.
using AvatarId = std::uint32_t;    ///< Number within its world, never 0.
using SubscriptionId = std::uint32_t;  ///< Chosen by the client, unique in its session, never 0.
using RequestId = std::uint64_t;       ///< Chosen by the client; 0 is the avatar's own doing.

/// Number of a command in its session: 1, 2, 3, … (STATE_MACHINE.md, "Commands").
using Seq = std::uint64_t;

enum class Role : std::uint8_t { kController = 0, kObserver = 1 };
enum class FootChoice : std::uint8_t { kAuto = 0, kLeft = 1, kRight = 2 };
/// When a request begins, and what becomes of those before it.
enum class Interrupt : std::uint8_t {
  kNone = 0,  ///< After all that is queued.
  kAfterMovement =
      1,     ///< After the movement under way; the queue is dropped, a stand or walk ends.
  kNow = 2,  ///< As soon as feet allow; the queue is dropped.
};
enum class FootSide : std::uint8_t { kLeft = 0, kRight = 1 };
enum class MovementKind : std::uint8_t { kStepLeft = 0, kStepRight = 1, kJump = 2, kStand = 3 };

/// Frame of reference of an avatar: where it stands and where it faces.
struct Placement {
  DVec3 position_m = DVec3(0.0);
  double heading_rad = 0.0;  ///< About +Y, left positive, unwrapped.
  bool operator==(const Placement&) const = default;
};

// ---- client to server

struct Hello {
  static constexpr MessageType kType = MessageType::kHello;
  std::uint16_t protocol_min = kProtocolMin;  ///< 1 <= min <= max
  std::uint16_t protocol_max = kProtocolMax;
  std::string client_name;  ///< 1 to kMaxNameBytes, for logs.
  std::uint64_t features = 0;
  std::string auth_token;                ///< May be empty.
  std::vector<std::byte> resume_token;   ///< Empty: a new session. Else from Welcome.
  std::uint64_t last_events_number = 0;  ///< Resuming: Events::number last received.
  bool operator==(const Hello&) const = default;
};

struct JoinWorld {
  static constexpr MessageType kType = MessageType::kJoinWorld;
  Seq seq = 0;
  std::string name;  ///< 1 to kMaxNameBytes
  Role role = Role::kController;
  bool operator==(const JoinWorld&) const = default;
};

struct LeaveWorld {
  static constexpr MessageType kType = MessageType::kLeaveWorld;
  Seq seq = 0;
  WorldId world = 0;
  bool operator==(const LeaveWorld&) const = default;
};

struct SpawnItem {
  AvatarId avatar = 0;  ///< 0: the server chooses and tells in the reply.
  Placement start;
  bool operator==(const SpawnItem&) const = default;
};

struct Spawn {
  static constexpr MessageType kType = MessageType::kSpawn;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<SpawnItem> items;  ///< 1 to kMaxItems
  bool operator==(const Spawn&) const = default;
};

struct Remove {
  static constexpr MessageType kType = MessageType::kRemove;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<AvatarId> avatars;  ///< 1 to kMaxItems
  bool operator==(const Remove&) const = default;
};

/// Where a foot is to land, in the world.
struct Footprint {
  DVec3 position_m = DVec3(0.0);      ///< Of the ball of the foot, on the ground.
  std::optional<double> heading_rad;  ///< Absent: the server chooses.
  bool operator==(const Footprint&) const = default;
};

struct StepMovement {
  FootChoice foot = FootChoice::kAuto;  ///< kAuto: the other foot than last time.
  double length_m = 0.0;                ///< Forward distance between the feet at the end.
  std::optional<double> side_m;         ///< Fixed to moving foot, towards the moving foot's side.
  double height_m = 0.0;
  double turn_rad = 0.0;
  /// Lands here, if there is one; then length, side, height and turn are not sent.
  std::optional<Footprint> at;
  /// Only with `at` and kFeatureRefusals: rejected when it is about to start and `at` is out of reach.
  bool exact_only = false;
  bool operator==(const StepMovement&) const = default;
};

struct JumpMovement {
  double length_m = 0.0;
  double height_m = 0.0;
  double turn_rad = 0.0;
  bool operator==(const JumpMovement&) const = default;
};

struct StandMovement {
  double seconds = 0.0;
  bool operator==(const StandMovement&) const = default;
};

/// As many steps as it takes to a place. Only with kFeatureWalks. Its steps carry its request id; a
/// finished stand with that id says it has arrived, a rejected one why it can not.
struct WalkMovement {
  DVec3 position_m = DVec3(0.0);   ///< Of the base frame; the height is the ground's.
  double heading_rad = 0.0;        ///< Of the base frame.
  std::vector<DVec3> waypoints_m;  ///< Passed on the way, in order; at most kMaxWaypoints.
  std::optional<double> speed_m_s;
  bool operator==(const WalkMovement&) const = default;
};

struct RequestItem {
  AvatarId avatar = 0;   ///< Not 0.
  RequestId request_id = 0;  ///< Not 0; comes back in events.
  std::variant<StepMovement, JumpMovement, StandMovement, WalkMovement> movement;
  Interrupt interrupt = Interrupt::kNone;  ///< Another one only with kFeatureTakeovers.
  bool operator==(const RequestItem&) const = default;
};

/// Movements asked for, of one avatar or a whole crowd; an avatar may stand in it several times.
struct Request {
  static constexpr MessageType kType = MessageType::kRequest;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<RequestItem> items;  ///< 1 to kMaxItems
  bool operator==(const Request&) const = default;
};

/// Drops what has not started.
struct CancelQueue {
  static constexpr MessageType kType = MessageType::kCancelQueue;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<AvatarId> avatars;  ///< 1 to kMaxItems
  bool operator==(const CancelQueue&) const = default;
};

/// A place on the ground, seen from above.
struct GroundPlace {
  double x = 0.0;
  double z = 0.0;
  bool operator==(const GroundPlace&) const = default;
};

/// Heights at the corners of a grid, from `origin_m` on; bilinear between them.
struct HeightFieldInfo {
  GroundPlace origin_m;
  double cell_m = 0.0;
  std::uint16_t columns = 0;     ///< Along x, 2 to kMaxTerrainColumns.
  std::uint16_t rows = 0;        ///< Along z, 2 to kMaxTerrainColumns.
  std::vector<float> heights_m;  ///< Row by row, x fastest.
  bool operator==(const HeightFieldInfo&) const = default;
};

struct TerrainBoxInfo {
  GroundPlace min_m;
  GroundPlace max_m;
  double height_m = 0.0;  ///< Of the flat top.
  bool operator==(const TerrainBoxInfo&) const = default;
};

/// Ground of a world: the highest of its height field (0 beside it) and its boxes. Nothing: flat
/// at 0.
struct TerrainInfo {
  std::optional<HeightFieldInfo> height_field;
  std::vector<TerrainBoxInfo> boxes;  ///< Up to kMaxTerrainBoxes.
  bool operator==(const TerrainInfo&) const = default;
};

/// Gives a world another ground, or none. Only with kFeatureTerrain.
struct SetTerrain {
  static constexpr MessageType kType = MessageType::kSetTerrain;
  Seq seq = 0;
  WorldId world = 0;
  std::optional<TerrainInfo> terrain;  ///< Absent: flat at 0.
  bool operator==(const SetTerrain&) const = default;
};

/// Starts a clip of the library over what an avatar does, or ends it. Ranges are the server's to check,
/// item by item.
struct LayerItem {
  AvatarId avatar = 0;  ///< Not 0.
  std::string layer;        ///< One of WorldInfo::layers, 1 to kMaxNameBytes.
  bool is_off = false;      ///< Ends it; weight and speed then mean nothing.
  double weight = 1.0;      ///< Above 0, up to 1.
  double blend_s = 0.3;     ///< How long weight and speed take to get there: 0 to 10.
  double speed = 1.0;       ///< 0.1 to 4; 1: as recorded.
  bool operator==(const LayerItem&) const = default;
};

/// Only with kFeatureLayers.
struct SetLayers {
  static constexpr MessageType kType = MessageType::kSetLayers;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<LayerItem> items;  ///< 1 to kMaxItems
  bool operator==(const SetLayers&) const = default;
};

/// Feet stand still where they land, or are where the examples have them: each avatar's from the next movement on
/// that it begins. Only with kFeaturePlanting.
struct SetPlanting {
  static constexpr MessageType kType = MessageType::kSetPlanting;
  Seq seq = 0;
  WorldId world = 0;
  std::vector<AvatarId> avatars;  ///< At least one.
  bool is_off = false;
  bool operator==(const SetPlanting&) const = default;
};

/// Within `to_m` of a region's centre poses come every so many ticks.
struct RateRing {
  double to_m = 0.0;                ///< Above 0, and above that of the ring before.
  std::uint16_t every_n_ticks = 1;  ///< 1 to kMaxEveryNTicks
  bool operator==(const RateRing&) const = default;
};

/// A circle on the ground. Avatars whose root comes within its radius enter; they leave where they are further than
/// radius and `leave_m`.
struct Region {
  GroundPlace centre_m;
  double radius_m = 0.0;          ///< Above 0.
  std::optional<double> leave_m;  ///< At least 0; absent: the server chooses.
  std::vector<RateRing> rings;    ///< At most kMaxRateRings. Beyond them: Observe::every_n_ticks.
  /// In which detail poses come within each ring, beyond them Observe::detail; none: that everywhere. Of quantised
  /// poses only, and as Observe::detail with kFeatureDetail and kFeatureCompact.
  std::vector<PoseDetail> ring_details;
  bool operator==(const Region&) const = default;
};

struct Observe {
  static constexpr MessageType kType = MessageType::kObserve;
  Seq seq = 0;
  WorldId world = 0;
  SubscriptionId subscription = 0;  ///< Not 0.
  PoseMode mode = PoseMode::kFull;
  std::vector<AvatarId> avatars;  ///< Empty: all. Numbers nobody has yet may be among them.
  std::uint16_t every_n_ticks = 1;    ///< 1 to kMaxEveryNTicks
  bool with_events = false;           ///< Events of the world, too.
  /// Who is in it, instead of `avatars`, which is empty then. Only with kFeatureRegions.
  std::optional<Region> region;
  bool replace = false;  ///< Puts this region in place of that of the subscription of that number.
  /// Of quantised poses only. With kFeatureDetail and kFeatureCompact, else kAll.
  PoseDetail detail = PoseDetail::kAll;
  bool operator==(const Observe&) const = default;
};

struct StopObserving {
  static constexpr MessageType kType = MessageType::kStopObserving;
  Seq seq = 0;
  SubscriptionId subscription = 0;
  bool operator==(const StopObserving&) const = default;
};

struct Ping {
  static constexpr MessageType kType = MessageType::kPing;
  std::uint64_t nonce = 0;
  double time_s = 0.0;  ///< The client's clock; comes back in Pong.
  bool operator==(const Ping&) const = default;
};

/// Asks for a piece of the library of a world joined; LibraryPiece answers. A question, like InspectAvatar. Needs
/// kFeatureMovementMode.
struct FetchLibrary {
  static constexpr MessageType kType = MessageType::kFetchLibrary;
  std::uint64_t nonce = 0;   ///< Comes back in LibraryPiece.
  std::string hash;          ///< WorldInfo::library_hash
  std::uint64_t offset = 0;  ///< Where in its file
  std::uint32_t length = 0;  ///< 1 to kMaxPieceBytes; less may come
  bool operator==(const FetchLibrary&) const = default;
};

/// Asks what an avatar is doing; AvatarState answers. A question, like Ping: it changes nothing, and
/// what was under way when a connection broke is not answered. Needs kFeatureInspect.
struct InspectAvatar {
  static constexpr MessageType kType = MessageType::kInspectAvatar;
  std::uint64_t nonce = 0;  ///< Comes back in AvatarState.
  WorldId world = 0;
  AvatarId avatar = 0;
  bool operator==(const InspectAvatar&) const = default;
};

// ---- both ways

/// Last message of a connection, and the end of the session: it cannot be resumed. A server that
/// only wants the client to come back closes without it.
struct Goodbye {
  static constexpr MessageType kType = MessageType::kGoodbye;
  StatusCode code = StatusCode::kOk;
  std::string text;
  bool operator==(const Goodbye&) const = default;
};

// ---- server to client

struct ServerLimits {
  std::uint32_t max_control_bytes = static_cast<std::uint32_t>(kMaxControlBytes);
  std::uint32_t max_bulk_bytes = static_cast<std::uint32_t>(kMaxBulkBytes);
  std::uint32_t max_items = static_cast<std::uint32_t>(kMaxItems);
  std::uint32_t max_avatars_per_world = 0;
  std::uint32_t max_queue = 0;  ///< Requests waiting, per avatar.
  std::uint32_t reply_memory = kReplyCache;
  double idle_timeout_s = 0.0;   ///< A connection silent for longer is closed; 0: never.
  double resume_window_s = 0.0;  ///< How long a session waits for its client; 0: not at all.
  bool operator==(const ServerLimits&) const = default;
};

struct Welcome {
  static constexpr MessageType kType = MessageType::kWelcome;
  std::uint16_t protocol = kProtocolMax;  ///< The version both speak from now on.
  std::uint64_t features = 0;             ///< The client's features that the server has as well.
  std::uint64_t session = 0;              ///< Not 0.
  std::vector<std::byte> resume_token;    ///< For Hello after a lost connection; secret.
  bool resumed = false;                   ///< False: nothing is left of an earlier session.
  Seq last_seq = 0;                       ///< Last command done; 0 in a new session.
  double tick_hz = 60.0;                  ///< > 0
  std::string server_name;
  std::string server_version;
  ServerLimits limits;
  bool operator==(const Welcome&) const = default;
};

struct JointInfo {
  std::string name;          ///< Unique in its skeleton.
  std::int16_t parent = -1;  ///< Smaller than its own index; -1 for the root, which comes first.
  Vec3 offset_m = Vec3(0.0f);
  bool operator==(const JointInfo&) const = default;
};

struct EndSiteInfo {
  std::uint16_t joint = 0;
  Vec3 offset_m = Vec3(0.0f);
  bool operator==(const EndSiteInfo&) const = default;
};

struct LegInfo {
  std::int16_t hip = -1;  ///< Joint indices; -1: not known.
  std::int16_t knee = -1;
  std::int16_t ankle = -1;
  std::int16_t ball = -1;
  Vec3 ball_offset_m = Vec3(0.0f);
  Vec3 toe_tip_offset_m = Vec3(0.0f);
  bool operator==(const LegInfo&) const = default;
};

struct SkeletonInfo {
  std::vector<JointInfo> joints;  ///< 1 to kMaxJoints
  std::vector<EndSiteInfo> end_sites;
  std::array<LegInfo, 2> legs;  ///< Left, right.
  bool operator==(const SkeletonInfo&) const = default;
};

/// Describes a world joined; comes before the Reply to JoinWorld, and after Welcome with seq 0 for
/// each world a resumed session is in.
struct WorldInfo {
  static constexpr MessageType kType = MessageType::kWorldInfo;
  Seq seq = 0;
  WorldId world = 0;
  std::string name;
  Role role = Role::kController;
  std::uint64_t tick = 0;
  std::string library_hash;  ///< As `stridewire-library inspect` prints it.
  SkeletonInfo skeleton;
  std::vector<std::string> layers;  ///< Names for SetLayers; only with kFeatureLayers.
  /// One a joint, for compact poses; only with kFeatureCompact, else none.
  std::vector<RotationQuantization> rotation_codes;
  /// Those that PoseDetail::kFewer tells, growing, the root among them and of each its parent (CheckFewerJoints);
  /// only with kFeatureDetail and codes, else none.
  std::vector<std::uint16_t> fewer_joints;
  bool operator==(const WorldInfo&) const = default;
};

struct ReplyItem {
  std::uint32_t index = 0;  ///< Position in the command's items or avatars.
  AvatarId avatar = 0;
  RequestId request_id = 0;  ///< Only for Request.
  StatusCode code = StatusCode::kOk;
  std::string text;
  bool operator==(const ReplyItem&) const = default;
};

/// The answer to a command; every command has exactly one.
struct Reply {
  static constexpr MessageType kType = MessageType::kReply;
  Seq seq = 0;
  StatusCode code = StatusCode::kOk;  ///< Of the command as a whole.
  std::string text;
  std::uint32_t accepted = 0;    ///< How many of its items were done.
  std::vector<ReplyItem> items;  ///< Spawn: every item. Otherwise only those refused.
  bool operator==(const Reply&) const = default;
};

/// Flags of an avatar in a batch. Unknown bits are ignored.
inline constexpr std::uint8_t kPoseDiscontinuity = 1;  ///< Do not interpolate from the last pose.
inline constexpr std::uint8_t kPoseStanding = 2;       ///< Standing, nothing queued.
/// In a compact batch: this pose is quantised, since the world's codes cannot tell it.
inline constexpr std::uint8_t kPoseWide = 4;

/// What a batch says about itself. Nothing in it is a session's: a batch is encoded once and sent
/// to every observer of that world and mode.
struct PoseBatchInfo {
  WorldId world = 0;
  std::uint16_t shard = 0;
  std::uint16_t part = 0;  ///< A shard with more avatars than fit in a frame sends several parts.
  std::uint16_t parts = 1;
  std::uint64_t tick = 0;
  double server_time_s = 0.0;       ///< The server's clock at that tick.
  PoseMode mode = PoseMode::kFull;  ///< kFull, kQuantised or IsCompact
  std::uint16_t joint_count = 0;    ///< 1 to kMaxJoints
  bool is_partial = false;          ///< Who is not in it may be there all the same: of a region.
  bool operator==(const PoseBatchInfo&) const = default;
};

/// Poses of many avatars at one tick, as views into the frame it was decoded from (or, when it is
/// to be encoded, into the caller's arrays). Decoding checks that the sizes match; each pose is
/// checked when DecodePose reads it. Poses are displayed poses: root in the world.
struct PoseBatch {
  static constexpr MessageType kType = MessageType::kPoseBatch;
  PoseBatchInfo info;
  std::span<const AvatarId> avatars;  ///< 0 to kMaxItems, none 0
  std::span<const std::uint8_t> flags;    ///< One an avatar.
  std::span<const std::byte> poses;       ///< One after the other (PoseBatchReader).

  /// One of a full or quantised batch.
  [[nodiscard]] std::span<const std::byte> pose(std::size_t i) const {
    const std::size_t bytes = PoseBytes(info.mode, info.joint_count);
    return poses.subspan(i * bytes, bytes);
  }
};

/// Bytes of each pose of a compact batch that is not wide, 0 if there is none. Empty: the batch's size is not that of
/// so many poses.
[[nodiscard]] std::optional<std::size_t> CompactPoseBytes(const PoseBatch& batch);

enum class EventType : std::uint8_t {
  kAccepted = 0,    ///< A request was queued.
  kStarted = 1,     ///< kind, group, requested, applied, extrapolated, clamped
  kFootStrike = 2,  ///< foot, position_m
  kFinished = 3,    ///< base: the new base frame. The commit point.
  kIdle = 4,        ///< Queue empty and standing; base
  kRejected = 5,    ///< A request turned out impossible: code, reason
  kSpawned = 6,     ///< base
  kRemoved = 7,
  kEntered = 8,  ///< The region this session observes. Only with kFeatureRegions.
  kLeft = 9,     ///< That region, or the world. The same.
};

/// Values by parameter name: 0 start_x_m, 1 start_y_m, 2 start_z_m, 3 end_x_m, 4 end_y_m,
/// 5 end_z_m, 6 turn_rad, 7 length_m, 8 height_m.
struct ParameterSet {
  std::array<std::uint8_t, kMaxParameters> names{};
  std::array<double, kMaxParameters> values{};
  std::uint8_t count = 0;  ///< Entries past it are zero.
  bool operator==(const ParameterSet&) const = default;
};

struct Event {
  EventType type = EventType::kAccepted;
  AvatarId avatar = 0;
  RequestId request_id = 0;  ///< 0: the avatar's own doing.
  MovementKind kind = MovementKind::kStand;
  std::int16_t group = -1;
  std::uint64_t tick = 0;
  double time_s = 0.0;  ///< On the server's clock, as PoseBatchInfo::server_time_s.
  ParameterSet requested;
  ParameterSet applied;
  bool extrapolated = false;
  bool clamped = false;
  FootSide foot = FootSide::kLeft;
  DVec3 position_m = DVec3(0.0);
  Placement base;
  StatusCode code = StatusCode::kOk;
  std::string reason;
  bool cut_short = false;  ///< Finished: another request took over before its end.
  bool operator==(const Event&) const = default;
};

/// What happened in a world, in order.
struct Events {
  static constexpr MessageType kType = MessageType::kEvents;
  WorldId world = 0;
  std::uint64_t number = 0;  ///< 1, 2, 3, … in the session; 0 without kFeatureEventReplay.
  std::uint64_t tick = 0;
  std::vector<Event> events;  ///< 1 to kMaxItems
  bool operator==(const Events&) const = default;
};

/// Tells a slow observer what it did not get, counted since it joined the world.
struct Lagging {
  static constexpr MessageType kType = MessageType::kLagging;
  WorldId world = 0;
  std::uint64_t dropped_batches = 0;
  std::uint64_t dropped_events = 0;
  bool operator==(const Lagging&) const = default;
};

/// Something wrong that is no command's answer. After a fatal one the server closes.
struct ErrorNotice {
  static constexpr MessageType kType = MessageType::kError;
  StatusCode code = StatusCode::kInternal;
  std::string text;
  bool fatal = false;
  Seq seq = 0;  ///< The command it was about, 0 if none.
  bool operator==(const ErrorNotice&) const = default;
};

struct Pong {
  static constexpr MessageType kType = MessageType::kPong;
  std::uint64_t nonce = 0;
  double time_s = 0.0;  ///< From Ping.
  double server_time_s = 0.0;
  std::uint64_t tick = 0;
  bool operator==(const Pong&) const = default;
};

/// Where a foot of the movement under way is about to stand.
struct Landing {
  FootSide foot = FootSide::kLeft;
  DVec3 position_m = DVec3(0.0);  ///< Of its ball, on the ground
  double heading_rad = 0.0;       ///< As a Footprint's
  bool operator==(const Landing&) const = default;
};

/// A layer an avatar plays.
struct PlayingLayer {
  std::string layer;       ///< One of WorldInfo::layers
  double weight = 0.0;     ///< Now
  double time_s = 0.0;     ///< In its clip
  double speed = 1.0;      ///< Now
  bool is_ending = false;  ///< On its way out
  bool operator==(const PlayingLayer&) const = default;
};

/// What an avatar does just now. A requested stand has no group, keytimes or weights.
struct CurrentMovement {
  RequestId request_id = 0;
  MovementKind kind = MovementKind::kStand;
  std::int16_t group = -1;
  double started_s = 0.0;          ///< On the server's clock.
  std::vector<double> keytimes_s;  ///< From its start, the first 0; at most kMaxKeytimes.
  double generic_time = 0.0;       ///< 0 to keytimes - 1 (paper, Eq. (3)).
  double ease_out_s = 0.0;         ///< How long the difference pose lasts.
  ParameterSet requested;
  ParameterSet applied;
  bool extrapolated = false;
  bool clamped = false;
  std::vector<float> weights;                 ///< [example], at most kMaxWeights.
  std::vector<std::uint8_t> parameter_names;  ///< As in ParameterSet.
  std::vector<float> sites;       ///< [example][parameter]: where the examples lie; may be empty.
  std::vector<Landing> landings;  ///< Of feet not there yet; at most kMaxLandings.
  bool operator==(const CurrentMovement&) const = default;
};

/// The answer to InspectAvatar.
struct AvatarState {
  static constexpr MessageType kType = MessageType::kAvatarState;
  std::uint64_t nonce = 0;
  WorldId world = 0;
  AvatarId avatar = 0;
  StatusCode code = StatusCode::kOk;  ///< If not kOk, nothing below `text` is set.
  std::string text;
  std::uint64_t tick = 0;
  double server_time_s = 0.0;
  Placement base;
  std::optional<CurrentMovement> movement;
  std::uint32_t queue_size = 0;
  std::vector<RequestItem> queue;    ///< The first kMaxInspectedRequests of it.
  bool is_planting_off = false;      ///< As SetPlanting left it.
  std::vector<PlayingLayer> layers;  ///< At most kMaxPlayingLayers, those above later.
  bool operator==(const AvatarState&) const = default;
};

/// The ground of a world joined: after WorldInfo if it has one (after Welcome of a resumed session
/// always), and whenever it changes. Only with kFeatureTerrain.
struct WorldTerrain {
  static constexpr MessageType kType = MessageType::kWorldTerrain;
  WorldId world = 0;
  std::optional<TerrainInfo> terrain;  ///< Absent: flat at 0.
  bool operator==(const WorldTerrain&) const = default;
};

/// Flag of an avatar in Movements, beside kPoseDiscontinuity: it is gone, and has no record.
inline constexpr std::uint8_t kMovementGone = 4;

/// What avatars of a shard begin, for who evaluates their poses (STANDARD.md, "Movement records"). Avatars go on in steps of
/// one tick; every step has a message, in order, with the changes in it. Other messages have the states after a step, of avatars
/// that the receiver knows nothing of yet.
struct Movements {
  static constexpr MessageType kType = MessageType::kMovements;
  WorldId world = 0;
  std::uint16_t shard = 0;
  std::uint16_t part = 0;
  std::uint16_t parts = 1;
  std::uint16_t more_steps = 0;  ///< That follow until poses of `tick` are to be shown.
  std::uint64_t step =
      0;  ///< Of this shard's avatars; one more each. A gap: what is known is no more.
  std::uint64_t tick = 0;
  double server_time_s = 0.0;         ///< The server's clock at that tick.
  bool states = false;                ///< After `step`, which came before; else the changes in it.
  std::vector<AvatarId> avatars;  ///< 0 to kMaxItems, none 0
  std::vector<std::uint8_t> flags;    ///< One an avatar.
  std::vector<std::uint32_t>
      ends;  ///< Where in `records` each one's ends; it begins where the one before ends.
  std::vector<std::byte> records;
  bool operator==(const Movements&) const = default;

  [[nodiscard]] std::span<const std::byte> record(std::size_t i) const {
    const std::size_t begin = i == 0 ? 0 : ends[i - 1];
    return std::span(records).subspan(begin, ends[i] - begin);
  }
};

/// The answer to FetchLibrary.
struct LibraryPiece {
  static constexpr MessageType kType = MessageType::kLibraryPiece;
  std::uint64_t nonce = 0;
  StatusCode code = StatusCode::kOk;  ///< If not kOk, nothing below `text` is set but `hash`.
  std::string text;
  std::string hash;
  std::uint64_t total_bytes = 0;  ///< Of the file.
  std::uint64_t offset = 0;
  std::vector<std::byte> bytes;  ///< At most kMaxPieceBytes; none at the end of the file.
  bool operator==(const LibraryPiece&) const = default;
};

using Message =
    std::variant<Hello, JoinWorld, LeaveWorld, Spawn, Remove, Request, CancelQueue, Observe,
                 StopObserving, Ping, InspectAvatar, Goodbye, Welcome, WorldInfo, Reply, PoseBatch,
                 Events, Lagging, ErrorNotice, Pong, AvatarState, SetTerrain, WorldTerrain,
                 SetLayers, SetPlanting, FetchLibrary, Movements, LibraryPiece>;

}  // namespace stridewire::protocol
