#include "sample_messages.h"

#include <cmath>
#include <utility>

#include "base/check.h"
#include "base/trig.h"

namespace stridewire::protocol {
namespace {

std::vector<std::byte> Token(int bytes) {
  std::vector<std::byte> token;
  for (int i = 0; i < bytes; ++i) token.push_back(static_cast<std::byte>(i * 7 + 1));
  return token;
}

SkeletonInfo Skeleton() {
  SkeletonInfo skeleton;
  const auto add = [&](const char* name, std::int16_t parent, Vec3 offset_m) {
    skeleton.joints.push_back({name, parent, offset_m});
  };
  add("Hips", -1, Vec3(0.0f));
  add("LeftUpLeg", 0, Vec3(0.0625f, -0.03125f, 0.0f));
  add("LeftLeg", 1, Vec3(0.0f, -0.4375f, 0.0f));
  add("LeftFoot", 2, Vec3(0.0f, -0.4375f, 0.0f));
  add("RightUpLeg", 0, Vec3(-0.0625f, -0.03125f, 0.0f));
  add("RightLeg", 4, Vec3(0.0f, -0.4375f, 0.0f));
  add("RightFoot", 5, Vec3(0.0f, -0.4375f, 0.0f));
  add("Kopf_\xc3\xa4", 0, Vec3(0.0f, 0.5f, 0.0f));
  skeleton.end_sites = {{3, Vec3(0.0f, -0.0625f, 0.1875f)}, {7, Vec3(0.0f, 0.25f, 0.0f)}};
  skeleton.legs[0] = {1, 2, 3, 3, Vec3(0.0f, -0.0625f, 0.125f), Vec3(0.0f, -0.0625f, 0.1875f)};
  skeleton.legs[1] = {4, 5, 6, -1, Vec3(0.0f, -0.0625f, 0.125f), Vec3(0.0f, -0.0625f, 0.1875f)};
  return skeleton;
}

// Root and hips use "smallest three"; knees and left ankle rotate about one axis; the head is
// fixed.
std::vector<RotationQuantization> RotationCodes() {
  std::vector<RotationQuantization> codes(8);
  codes[0].smallest_three_bits = 11;
  codes[1].smallest_three_bits = 13;
  codes[4].smallest_three_bits = 15;
  for (const std::size_t knee : {2u, 5u}) {
    codes[knee].reference = Quat(0.9375f, 0.34798527f, 0.0f, 0.0f);
    codes[knee].low = Vec3(-0.4375f, 0.0f, 0.0f);
    codes[knee].step = Vec3(0x1p-12f, 0x1p-8f, 0x1p-8f);
    codes[knee].bits = {12, 0, 0};
    codes[knee].least_w = 0.75f;
  }
  codes[3] = codes[2];
  codes[3].bits[2] = 1;
  codes[6].low = Vec3(-0.25f, -0.125f, -0.0625f);
  codes[6].step = Vec3(0x1p-10f, 0x1p-10f, 0x1p-16f);
  codes[6].bits = {9, 8, 13};
  codes[6].least_w = 0.875f;
  codes[7].reference = YawRotation(-0.25);
  codes[7].step = Vec3(0x1p-7f);
  codes[7].least_w = 0.984375f;
  return codes;
}

// Indices of all joints except feet and head.
const std::vector<std::uint16_t> kReducedJoints = {0, 1, 2, 4, 5};

// Poses within the range of the rotation codes. Only the second pose is outside: its left knee
// rotates about another axis.
struct CompactArrays {
  PoseBatchInfo info{3, 1, 2, 4, 123'456, 2057.6, PoseMode::kCompact, 8};
  std::vector<AvatarId> avatars = {1, 1001, 2001};
  std::vector<std::uint8_t> flags = {kPoseStanding, kPoseUncompressed, kPoseDiscontinuity};
  std::vector<std::byte> poses;

  explicit CompactArrays(PoseMode mode) {
    info.mode = mode;
    // In this mode a pose contains only its root, which always fits.
    if (mode == PoseMode::kCompactRoot) flags[1] = 0;
    const CompactCodec& codec = *SampleCodecs().Find(mode);
    const std::vector<RotationQuantization> codes = RotationCodes();
    CompactCodec::Block block;
    for (int a = 0; a < 3; ++a) {
      std::vector<Quat> rotations;
      for (std::size_t j = 0; j < codes.size(); ++j) {
        const double angle = 0.7 * a + 0.45 * static_cast<double>(j);
        Vec3 v(Sin(angle), Cos(1.3 * angle), Sin(0.4 + 2.1 * angle));
        if (codes[j].smallest_three_bits == 0) {
          v *= 0.25f;
          for (int c = 0; c < 3; ++c) {
            if (codes[j].bits[static_cast<std::size_t>(c)] < 8) v[c] = 0.0f;
          }
          if (j == 6) v = Vec3(v.x, 0.4f * v.y, 0.2f * v.z);
          if (a == 1 && j == 2) v.y = 0.25f;
        }
        rotations.push_back(
            Normalise(codes[j].reference * Quat(static_cast<float>(Cos(0.3 * a)), v.x, v.y, v.z)));
      }
      block.Add(Vec3(-1.5f * static_cast<float>(a), 0.9375f, 70'000.25f), rotations);
    }
    codec.Encode(block);
    for (std::size_t a = 0; a < 3; ++a) {
      STRIDEWIRE_CHECK(block.fits(a) == ((flags[a] & kPoseUncompressed) == 0));
      const std::size_t begin = poses.size();
      if (block.fits(a)) {
        poses.resize(begin + codec.pose_bytes());
        block.CopyBytes(a, std::span(poses).subspan(begin));
        continue;
      }
      poses.resize(begin + PoseBytes(PoseMode::kQuantised, 8));
      Vec3 root_position_m;
      std::vector<Quat> rotations(8);
      block.Get(a, root_position_m, rotations);
      STRIDEWIRE_CHECK(EncodePose(PoseMode::kQuantised, root_position_m, rotations,
                                  std::span(poses).subspan(begin)));
    }
  }

  [[nodiscard]] PoseBatch view() const { return {info, avatars, flags, poses}; }
};

/// Arrays of a batch. The rotations cover every dropped component and both signs.
struct BatchArrays {
  PoseBatchInfo info;
  std::vector<AvatarId> avatars;
  std::vector<std::uint8_t> flags;
  std::vector<std::byte> poses;

  BatchArrays(PoseMode mode, std::uint16_t joint_count, int avatar_count) {
    info = {3, 1, 2, 4, 123'456, 2057.6, mode, joint_count};
    const std::size_t bytes = PoseBytes(mode, joint_count);
    poses.resize(bytes * static_cast<std::size_t>(avatar_count));
    for (int a = 0; a < avatar_count; ++a) {
      avatars.push_back(static_cast<AvatarId>(a * 1000 + 1));
      flags.push_back(static_cast<std::uint8_t>(a % 4));
      std::vector<Quat> rotations;
      for (int j = 0; j < joint_count; ++j) {
        const double angle = 0.7 * a + 0.45 * j;
        const double x = Sin(angle), y = Cos(1.3 * angle), z = Sin(0.4 + 2.1 * angle),
                     w = Cos(angle);
        const double length = std::sqrt(x * x + y * y + z * z + w * w);
        rotations.push_back(Quat(static_cast<float>(w / length), static_cast<float>(x / length),
                                 static_cast<float>(y / length), static_cast<float>(z / length)));
      }
      const Vec3 root(1.5f * static_cast<float>(a), 0.9375f, -2.0f + 0.25f * static_cast<float>(a));
      STRIDEWIRE_CHECK(
          EncodePose(mode, root, rotations,
                     std::span(poses).subspan(bytes * static_cast<std::size_t>(a), bytes)));
    }
  }

  [[nodiscard]] PoseBatch view() const { return {info, avatars, flags, poses}; }
};

ParameterSet Parameters(std::initializer_list<std::pair<int, double>> values) {
  ParameterSet set;
  for (const auto& [name, value] : values) {
    set.names[set.count] = static_cast<std::uint8_t>(name);
    set.values[set.count] = value;
    ++set.count;
  }
  return set;
}

std::vector<Event> EveryEvent() {
  std::vector<Event> events;
  for (int type = 0; type <= static_cast<int>(EventType::kRemoved); ++type) {
    Event event;
    event.type = static_cast<EventType>(type);
    event.avatar = 7;
    event.request_id =
        type == static_cast<int>(EventType::kIdle) ? 0 : 900 + static_cast<RequestId>(type);
    event.tick = 6000 + static_cast<std::uint64_t>(type);
    event.time_s = 100.0 + 0.25 * type;
    switch (event.type) {
      case EventType::kStarted:
        event.kind = MovementKind::kStepRight;
        event.group = 1;
        event.requested = Parameters({{2, -0.5}, {5, 0.9}});
        event.applied = Parameters({{2, -0.5}, {5, 0.75}});
        event.extrapolated = true;
        event.clamped = true;
        break;
      case EventType::kFootStrike:
        event.kind = MovementKind::kStepRight;
        event.foot = FootSide::kRight;
        event.position_m = DVec3(-0.125, 0.0, 3.5);
        break;
      case EventType::kFinished:
      case EventType::kIdle:
      case EventType::kSpawned: event.base = {DVec3(1.0, 0.0, 3.25), -6.5}; break;
      case EventType::kRejected:
        event.kind = MovementKind::kJump;
        event.code = StatusCode::kNoMovement;
        event.reason = "the library has no jump";
        break;
      case EventType::kAccepted:
      case EventType::kRemoved:
      case EventType::kEntered:
      case EventType::kLeft: break;
    }
    events.push_back(event);
  }
  return events;
}

}  // namespace

const CompactCodecs& SampleCodecs() {
  static const CompactCodecs codecs = [] {
    std::vector<std::int16_t> parents;
    for (const JointInfo& joint : Skeleton().joints) parents.push_back(joint.parent);
    return CompactCodecs::Make(RotationCodes(), parents, kReducedJoints).value();
  }();
  return codecs;
}

std::vector<SampleMessage> SampleMessages() {
  static const BatchArrays full(PoseMode::kFull, 8, 3);
  static const BatchArrays quantised(PoseMode::kQuantised, 8, 3);
  static const BatchArrays nobody(PoseMode::kQuantised, 31, 0);
  static const CompactArrays compact(PoseMode::kCompact);
  static const CompactArrays fewer(PoseMode::kCompactReduced);
  static const CompactArrays root(PoseMode::kCompactRoot);

  std::vector<SampleMessage> samples;
  const auto add = [&](const char* name, Message message) {
    samples.push_back({name, std::move(message)});
  };
  add("hello", Hello{1, 3, "game-server \xe2\x9c\x93", "", {}, 0});
  add("hello_resume", Hello{1, 1, "game-server", "eyJhbGciOiJFZERTQSJ9", Token(32), 512});
  add("join_world", JoinWorld{1, "plaza", Role::kObserver});
  add("leave_world", LeaveWorld{9, 3});
  add("spawn", Spawn{2, 3, {{0, {DVec3(0.0), 0.0}}, {41, {DVec3(1.5, 0.25, -2.0), 1.75}}}});
  add("remove", Remove{8, 3, {41, 42, 4'000'000'000u}});
  {
    Request request{3, 3, {}};
    request.items.push_back({41, 1001, StepMovement{FootChoice::kAuto, 0.625, {}, 0.0, 0.0}});
    request.items.push_back({41, 1002, StepMovement{FootChoice::kLeft, 0.5, 0.125, 0.15, -0.3}});
    request.items.push_back({41, 1003, StepMovement{FootChoice::kRight, 0.0, 0.0, 0.0, 0.0}});
    request.items.push_back({42, 1004, JumpMovement{0.875, 0.125, 0.5}});
    request.items.push_back({43, 18'446'744'073'709'551'615u, StandMovement{1.5}});
    add("request", request);
    Request crowd{4, 3, {}};
    for (AvatarId a = 1; a <= 100; ++a) {
      crowd.items.push_back(
          {a, 5000 + a, StepMovement{FootChoice::kAuto, 0.5 + a / 512.0, {}, 0, 0}});
    }
    add("request_crowd", crowd);
  }
  add("cancel_queue", CancelQueue{5, 3, {41}});
  add("observe_all", Observe{6, 3, 1, PoseMode::kQuantised, {}, 1, true});
  add("observe_some", Observe{7, 3, 2, PoseMode::kFull, {41, 42}, 6, false});
  {
    Observe region{19, 3, 4, PoseMode::kQuantised, {}, 12, false};
    region.region = Region{{-12.5, 40.0}, 30.0, 4.0, {{8.0, 1}, {20.0, 3}}};
    add("observe_region", region);
    region.seq = 20;
    region.region = Region{{-11.75, 40.0}, 30.0, std::nullopt, {}};
    region.replace = true;
    add("observe_region_moved", region);
  }
  {
    Observe afar{22, 3, 6, PoseMode::kQuantised, {}, 4, false};
    afar.detail = PoseDetail::kReduced;
    add("observe_fewer", afar);
    afar.seq = 23;
    afar.detail = PoseDetail::kRoot;
    afar.region = Region{{-12.5, 40.0}, 60.0, 4.0, {{8.0, 1}, {20.0, 2}}};
    afar.region->ring_details = {PoseDetail::kAll, PoseDetail::kReduced};
    add("observe_ring_details", afar);
  }
  add("stop_observing", StopObserving{10, 2});
  add("ping", Ping{0x0123456789abcdefu, 12.5});
  add("inspect_avatar", InspectAvatar{0x0123456789abcdefu, 3, 41});
  add("goodbye", Goodbye{StatusCode::kShuttingDown, "the server is going down"});
  add("welcome", Welcome{1, 77, Token(32), true, 3, 60.0, "stridewired", "0.1.0",
                         ServerLimits{65536, 1 << 22, 4096, 10'000, 64, 1024, 30.0, 60.0}});
  add("world_info", WorldInfo{1, 3, "plaza", Role::kController, 123'000,
                              "0f1e2d3c4b5a69788796a5b4c3d2e1f0", Skeleton()});
  add("reply_ok", Reply{6, StatusCode::kOk, "", 1, {}});
  add("reply_items", Reply{2,
                           StatusCode::kOk,
                           "one of three was refused",
                           2,
                           {{0, 44, 0, StatusCode::kOk, ""},
                            {1, 41, 0, StatusCode::kAvatarExists, "avatar 41 lives already"},
                            {2, 45, 1002, StatusCode::kOk, ""}}});
  add("pose_batch_full", full.view());
  add("pose_batch_quantised", quantised.view());
  add("pose_batch_empty", nobody.view());
  PoseBatch partial = quantised.view();
  partial.info.is_partial = true;
  add("pose_batch_partial", partial);
  add("events", Events{3, 513, 6010, EveryEvent()});
  {
    Event entered{.type = EventType::kEntered, .avatar = 41, .tick = 123'456, .time_s = 2057.6};
    Event left = entered;
    left.type = EventType::kLeft;
    left.avatar = 42;
    add("events_regions", Events{3, 514, 123'456, {entered, left}});
  }
  add("lagging", Lagging{3, 1200, 4});
  add("error", ErrorNotice{StatusCode::kBadSequence, "seq 12 leaves a gap after 9", true, 12});
  add("pong", Pong{0x0123456789abcdefu, 12.5, 2057.625, 123'457});
  {
    AvatarState state{.nonce = 0x0123456789abcdefu,
                      .world = 3,
                      .avatar = 41,
                      .tick = 123'457,
                      .server_time_s = 2057.625,
                      .base = {DVec3(1.0, 0.0, 3.25), -6.5},
                      .queue_size = 20};
    state.movement = {.request_id = 1001,
                      .kind = MovementKind::kStepRight,
                      .group = 1,
                      .started_s = 2057.25,
                      .keytimes_s = {0.0, 0.125, 0.5, 0.625},
                      .generic_time = 1.75,
                      .ease_out_s = 0.2,
                      .requested = Parameters({{2, -0.5}, {5, 0.875}}),
                      .applied = Parameters({{2, -0.5}, {5, 0.75}}),
                      .extrapolated = true,
                      .clamped = true,
                      .weights = {0.625f, 0.5f, -0.125f},
                      .parameter_names = {2, 5},
                      .sites = {-0.5f, 0.5f, -0.25f, 0.25f, -0.75f, 0.75f},
                      .landings = {{FootSide::kRight, DVec3(0.125, 0.0, 1.5), -0.25}}};
    state.layers = {{"wave", 0.75, 1.25, 1.0, false}, {"carry", 0.125, 0.5, 1.5, true}};
    state.queue.push_back({41, 1002, StepMovement{FootChoice::kLeft, 0.5, 0.125, 0.15, -0.3}});
    state.queue.push_back({41, 1003, StandMovement{1.5}});
    add("avatar_state", state);
    state.movement.reset();
    state.queue.clear();
    state.queue_size = 0;
    state.layers.clear();
    state.planting_enabled = false;
    add("avatar_state_unplanted", state);
    add("avatar_state_refused", AvatarState{.nonce = 2,
                                            .world = 3,
                                            .avatar = 99,
                                            .code = StatusCode::kNoSuchAvatar,
                                            .text = "no avatar of that number"});
  }
  {
    Request request{11, 3, {}};
    StepMovement step{.foot = FootChoice::kLeft, .at = Footprint{DVec3(1.5, 0.25, -2.0), -0.75}};
    request.items.push_back({41, 1005, step});
    step = {.at = Footprint{DVec3(0.0), std::nullopt}};
    request.items.push_back({42, 1006, step});
    request.items.push_back({42, 1007, StepMovement{FootChoice::kAuto, 0.625, {}, 0.0, 0.0, {}}});
    add("request_footprints", request);

    Request walks{14, 3, {}};
    walks.items.push_back(
        {41, 1008,
         WalkMovement{DVec3(3.0, 0.0, -5.5), 1.5, {{1.0, 0.0, -2.0}, {3.0, 0.25, -4.0}}, 1.25}});
    walks.items.push_back({42, 1009, WalkMovement{DVec3(0.0), 0.0, {}, std::nullopt}});
    add("request_walks", walks);

    Request takeovers{15, 3, {}};
    takeovers.items.push_back({41, 1010, StepMovement{.length_m = 0.5}, Interrupt::kNow});
    takeovers.items.push_back({42, 1011, JumpMovement{1.0, 0.0, 0.0}, Interrupt::kAfterMovement});
    add("request_takeovers", takeovers);

    Request refusals{18, 3, {}};
    step = {.foot = FootChoice::kRight,
            .at = Footprint{DVec3(0.5, 0.0, 1.25), 0.25},
            .exact_only = true};
    refusals.items.push_back({41, 1012, step});
    step.at->heading_rad.reset();
    refusals.items.push_back({42, 1013, step, Interrupt::kNow});
    add("request_refusals", refusals);

    TerrainInfo terrain;
    terrain.height_field =
        HeightFieldInfo{{-1.5, 2.0}, 0.25, 3, 2, {0.0f, 0.125f, 0.25f, -0.5f, 0.0625f, 1.5f}};
    terrain.boxes = {{{0.0, 1.0}, {2.0, 3.5}, 0.5}, {{-4.0, -4.0}, {-3.5, -3.0}, -0.25}};
    add("set_terrain", SetTerrain{12, 3, terrain});
    add("set_terrain_flat", SetTerrain{13, 3, std::nullopt});
    TerrainInfo boxes;
    for (int b = 0; b < 20; ++b)
      boxes.boxes.push_back({{0.0, 0.5 * b}, {1.0, 0.5 * b + 0.5}, 0.125 * b});
    add("world_terrain", WorldTerrain{3, terrain});
    add("set_layers", SetLayers{16,
                                3,
                                {{41, "wave", false, 0.75, 0.5, 1.25},
                                 {42, "carry"},
                                 {41, "wave", true, 1.0, 0.0, 1.0}}});
    add("set_planting", SetPlanting{19, 3, {41, 42}, true});
    add("set_planting_off", SetPlanting{20, 3, {41}, false});
    add("observe_movements", Observe{21, 3, 4, PoseMode::kMovement, {}, 1, false});
    add("fetch_library",
        FetchLibrary{0x0123456789abcdefu, "0f1e2d3c4b5a69788796a5b4c3d2e1f0", 1 << 20, 1 << 16});
    add("library_piece",
        LibraryPiece{0x0123456789abcdefu, StatusCode::kOk, "", "0f1e2d3c4b5a69788796a5b4c3d2e1f0",
                     4'200'000, 1 << 20, Token(40)});
    add("library_piece_refused", LibraryPiece{.nonce = 2,
                                              .code = StatusCode::kNotJoined,
                                              .text = "no world joined has that library",
                                              .hash = "0f1e2d3c4b"});
    add("movements", Movements{3,
                               1,
                               0,
                               2,
                               1,
                               7654,
                               123'457,
                               2057.625,
                               false,
                               {41, 42, 44},
                               {1, 4, 0},
                               {24, 24, 50},
                               Token(50)});
    add("movements_states",
        Movements{3, 1, 0, 1, 0, 7654, 123'457, 2057.625, true, {43}, {0}, {16}, Token(16)});
    add("movements_none", Movements{.world = 3, .shard = 1, .step = 7655, .tick = 123'458});
    WorldInfo with_layers{17,           3,          "plaza",          Role::kController, 123'000,
                          "0f1e2d3c4b", Skeleton(), {"wave", "carry"}};
    add("world_info_layers", with_layers);
    WorldInfo with_codes = with_layers;
    with_codes.rotation_codes = RotationCodes();
    add("world_info_compact", with_codes);
    add("pose_batch_compact", compact.view());
    with_codes.reduced_joints = kReducedJoints;
    add("world_info_detail", with_codes);
    add("pose_batch_fewer", fewer.view());
    add("pose_batch_root", root.view());
    add("world_terrain_boxes", WorldTerrain{3, boxes});
    add("world_terrain_flat", WorldTerrain{3, std::nullopt});
  }
  return samples;
}

}  // namespace stridewire::protocol
