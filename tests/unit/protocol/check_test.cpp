#include "stridewire/protocol/check.h"

#include <functional>
#include <limits>

#include "protocol_testing.h"

namespace stridewire::protocol {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Hello GoodHello() { return {1, 1, "client", "", {}, 0}; }
JoinWorld GoodJoin() { return {1, "plaza", Role::kController}; }
Spawn GoodSpawn() { return {1, 2, {{0, {}}, {3, {}}}}; }
Request GoodRequest() {
  return {1, 2, {{1, 1, StepMovement{}}, {2, 2, JumpMovement{}}, {3, 3, StandMovement{}}}};
}
Observe GoodObserve() { return {1, 2, 3, PoseMode::kFull, {4}, 1, false}; }
Welcome GoodWelcome() {
  Welcome welcome;
  welcome.session = 1;
  return welcome;
}
WorldInfo GoodWorldInfo() {
  WorldInfo info{1, 2, "plaza", Role::kObserver, 0, "", {}};
  info.skeleton.joints = {{"a", -1, Vec3(0.0f)}, {"b", 0, Vec3(1.0f)}, {"c", 1, Vec3(1.0f)}};
  info.skeleton.end_sites = {{2, Vec3(1.0f)}};
  return info;
}
Reply GoodReply() { return {1, StatusCode::kOk, "", 1, {{0, 1, 1, StatusCode::kOk, ""}}}; }
AvatarState GoodState() {
  AvatarState state{.nonce = 1, .world = 2, .avatar = 3, .queue_size = 2};
  state.movement = {.kind = MovementKind::kStepLeft,
                    .group = 0,
                    .keytimes_s = {0.0, 0.1, 0.1, 0.5},
                    .generic_time = 3.0,
                    .weights = {0.5f, 0.5f},
                    .parameter_names = {2, 5},
                    .sites = {1.0f, 2.0f, 3.0f, 4.0f},
                    .landings = {{DVec3(1.0), 0.5, FootSide::kRight}}};
  state.layers = {{"wave"}, {"carry"}};
  state.queue = {{3, 1, StepMovement{}}, {3, 2, StandMovement{}}};
  return state;
}
Events GoodEvents() {
  Events events{1, 1, 1, std::vector<Event>(2)};
  for (Event& event : events.events) event.avatar = 1;
  return events;
}

/// Expects that the encoder rejects a message after `spoil`, names the field and writes nothing.
template <typename T>
void Refused(T message, const std::function<void(T&)>& spoil, ErrorCode code,
             std::string_view field, std::int64_t index = -1) {
  SCOPED_TRACE(field);
  const Status good = Check(message);
  ASSERT_TRUE(good) << Describe(good.error());
  spoil(message);
  std::vector<std::byte> frame(5, std::byte{7});
  const Status status = Encoder().Encode(message, frame);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, code) << Describe(status.error());
  EXPECT_EQ(status.error().where, field);
  if (index >= 0) {
    EXPECT_EQ(status.error().index, index);
  }
  EXPECT_EQ(frame, std::vector<std::byte>(5, std::byte{7}));
}

/// Tests all doubles that a field must not contain.
template <typename T>
void RefusedWhenNotFinite(const T& good, const std::function<double&(T&)>& field_of,
                          std::string_view field, std::int64_t index = -1) {
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    Refused<T>(good, [&](T& m) { field_of(m) = bad; }, ErrorCode::kOutOfRange, field, index);
  }
}

/// Tests all texts that a field must not contain.
template <typename T>
void RefusedTexts(const T& good, const std::function<std::string&(T&)>& field_of,
                  std::size_t max_bytes, bool may_be_empty, std::string_view field,
                  std::int64_t index = -1) {
  const auto refused = [&](const std::string& text, ErrorCode code) {
    Refused<T>(good, [&](T& m) { field_of(m) = text; }, code, field, index);
  };
  refused(std::string(max_bytes + 1, 'x'), ErrorCode::kLimitExceeded);
  refused("tab\t", ErrorCode::kMalformed);
  refused(std::string("a\0b", 3), ErrorCode::kMalformed);
  refused("\x7f", ErrorCode::kMalformed);
  refused("\xc2\x85", ErrorCode::kMalformed);  // C1 control character
  refused("\xff", ErrorCode::kMalformed);
  refused("\x80", ErrorCode::kMalformed);              // continuation byte without a start
  refused("\xc3", ErrorCode::kMalformed);              // incomplete
  refused("\xc0\xaf", ErrorCode::kMalformed);          // overlong
  refused("\xe0\x9f\x80", ErrorCode::kMalformed);      // overlong
  refused("\xf0\x8f\x80\x80", ErrorCode::kMalformed);  // overlong
  refused("\xed\xa0\x80", ErrorCode::kMalformed);      // surrogate
  refused("\xf4\x90\x80\x80", ErrorCode::kMalformed);  // past U+10FFFF
  refused("\xf5\x80\x80\x80", ErrorCode::kMalformed);
  if (!may_be_empty) refused("", ErrorCode::kMalformed);
  for (const std::string& fine : {std::string(max_bytes, 'x'), std::string("\xc3\xa4\xe2\x82\xac"),
                                  std::string("\xf0\x9f\x9a\xb6 ~")}) {
    T message = good;
    field_of(message) = fine;
    EXPECT_TRUE(Check(message)) << field << ": " << fine;
  }
}

TEST(Check, Hello) {
  Refused<Hello>(
      GoodHello(), [](Hello& m) { m.protocol_min = 0; }, ErrorCode::kOutOfRange,
      "Hello.protocol_min");
  Refused<Hello>(
      GoodHello(), [](Hello& m) { m.protocol_min = 2; }, ErrorCode::kOutOfRange,
      "Hello.protocol_min");
  RefusedTexts<Hello>(
      GoodHello(), [](Hello& m) -> std::string& { return m.client_name; }, kMaxNameBytes, false,
      "Hello.client_name");
  RefusedTexts<Hello>(
      GoodHello(), [](Hello& m) -> std::string& { return m.auth_token; }, kMaxAuthTokenBytes, true,
      "Hello.auth_token");
  for (const std::size_t bytes : {1u, 15u, 65u}) {
    Refused<Hello>(
        GoodHello(), [&](Hello& m) { m.resume_token.resize(bytes); }, ErrorCode::kLimitExceeded,
        "Hello.resume_token");
  }
}

TEST(Check, Worlds) {
  Refused<JoinWorld>(
      GoodJoin(), [](JoinWorld& m) { m.seq = 0; }, ErrorCode::kOutOfRange, "JoinWorld.seq");
  RefusedTexts<JoinWorld>(
      GoodJoin(), [](JoinWorld& m) -> std::string& { return m.name; }, kMaxNameBytes, false,
      "JoinWorld.name");
  Refused<JoinWorld>(
      GoodJoin(), [](JoinWorld& m) { m.role = static_cast<Role>(2); }, ErrorCode::kMalformed,
      "JoinWorld.role");
  Refused<LeaveWorld>(
      {1, 2}, [](LeaveWorld& m) { m.seq = 0; }, ErrorCode::kOutOfRange, "LeaveWorld.seq");
  Refused<LeaveWorld>(
      {1, 2}, [](LeaveWorld& m) { m.world = 0; }, ErrorCode::kOutOfRange, "LeaveWorld.world");
}

TEST(Check, Spawn) {
  Refused<Spawn>(GoodSpawn(), [](Spawn& m) { m.seq = 0; }, ErrorCode::kOutOfRange, "Spawn.seq");
  Refused<Spawn>(GoodSpawn(), [](Spawn& m) { m.world = 0; }, ErrorCode::kOutOfRange, "Spawn.world");
  Refused<Spawn>(
      GoodSpawn(), [](Spawn& m) { m.items.clear(); }, ErrorCode::kMalformed, "Spawn.items");
  Refused<Spawn>(
      GoodSpawn(), [](Spawn& m) { m.items.resize(kMaxItems + 1); }, ErrorCode::kLimitExceeded,
      "Spawn.items");
  for (int k = 0; k < 3; ++k) {
    RefusedWhenNotFinite<Spawn>(
        GoodSpawn(), [k](Spawn& m) -> double& { return m.items[1].start.position_m[k]; },
        "Spawn.items.position_m", 1);
  }
  RefusedWhenNotFinite<Spawn>(
      GoodSpawn(), [](Spawn& m) -> double& { return m.items[0].start.heading_rad; },
      "Spawn.items.heading_rad", 0);
}

template <typename T>
void RefusesAvatarLists(const std::string& name) {
  const T good{1, 2, {3, 4}};
  Refused<T>(good, [](T& m) { m.seq = 0; }, ErrorCode::kOutOfRange, name + ".seq");
  Refused<T>(good, [](T& m) { m.world = 0; }, ErrorCode::kOutOfRange, name + ".world");
  Refused<T>(good, [](T& m) { m.avatars[1] = 0; }, ErrorCode::kOutOfRange, name + ".avatars", 1);
  Refused<T>(good, [](T& m) { m.avatars.clear(); }, ErrorCode::kMalformed, name + ".avatars");
  Refused<T>(
      good, [](T& m) { m.avatars.assign(kMaxItems + 1, 1); }, ErrorCode::kLimitExceeded,
      name + ".avatars");
}

TEST(Check, ListsOfAvatars) {
  RefusesAvatarLists<Remove>("Remove");
  RefusesAvatarLists<CancelQueue>("CancelQueue");
  RefusesAvatarLists<SetPlanting>("SetPlanting");
}

TEST(Check, Request) {
  const Request good = GoodRequest();
  Refused<Request>(good, [](Request& m) { m.seq = 0; }, ErrorCode::kOutOfRange, "Request.seq");
  Refused<Request>(good, [](Request& m) { m.world = 0; }, ErrorCode::kOutOfRange, "Request.world");
  Refused<Request>(
      good, [](Request& m) { m.items.clear(); }, ErrorCode::kMalformed, "Request.items");
  Refused<Request>(
      good, [](Request& m) { m.items.assign(kMaxItems + 1, m.items[0]); },
      ErrorCode::kLimitExceeded, "Request.items");
  Refused<Request>(
      good, [](Request& m) { m.items[2].avatar = 0; }, ErrorCode::kOutOfRange,
      "Request.items.avatar", 2);
  Refused<Request>(
      good, [](Request& m) { m.items[1].request_id = 0; }, ErrorCode::kOutOfRange,
      "Request.items.request_id", 1);
  Refused<Request>(
      good,
      [](Request& m) {
        std::get<StepMovement>(m.items[0].movement).foot = static_cast<FootChoice>(3);
      },
      ErrorCode::kMalformed, "Request.items.foot", 0);
  const auto step = [](Request& m) -> StepMovement& {
    return std::get<StepMovement>(m.items[0].movement);
  };
  const auto jump = [](Request& m) -> JumpMovement& {
    return std::get<JumpMovement>(m.items[1].movement);
  };
  using R = Request;
  RefusedWhenNotFinite<R>(
      good, [&](R& m) -> double& { return step(m).length_m; }, "Request.items.length_m", 0);
  RefusedWhenNotFinite<R>(
      good, [&](R& m) -> double& { return step(m).side_m.emplace(); }, "Request.items.side_m", 0);
  RefusedWhenNotFinite<R>(
      good, [&](R& m) -> double& { return step(m).height_m; }, "Request.items.height_m", 0);
  RefusedWhenNotFinite<R>(
      good, [&](R& m) -> double& { return step(m).turn_rad; }, "Request.items.turn_rad", 0);
  RefusedWhenNotFinite<R>(
      good, [&](R& m) -> double& { return jump(m).length_m; }, "Request.items.length_m", 1);
  RefusedWhenNotFinite<R>(
      good, [&](R& m) -> double& { return jump(m).height_m; }, "Request.items.height_m", 1);
  RefusedWhenNotFinite<R>(
      good, [&](R& m) -> double& { return jump(m).turn_rad; }, "Request.items.turn_rad", 1);
  RefusedWhenNotFinite<R>(
      good, [](R& m) -> double& { return std::get<StandMovement>(m.items[2].movement).seconds; },
      "Request.items.seconds", 2);
}

TEST(Check, Observe) {
  const Observe good = GoodObserve();
  Refused<Observe>(good, [](Observe& m) { m.seq = 0; }, ErrorCode::kOutOfRange, "Observe.seq");
  Refused<Observe>(good, [](Observe& m) { m.world = 0; }, ErrorCode::kOutOfRange, "Observe.world");
  Refused<Observe>(
      good, [](Observe& m) { m.subscription = 0; }, ErrorCode::kOutOfRange, "Observe.subscription");
  Refused<Observe>(
      good, [](Observe& m) { m.mode = static_cast<PoseMode>(3); }, ErrorCode::kMalformed,
      "Observe.mode");
  Refused<Observe>(
      good, [](Observe& m) { m.detail = static_cast<PoseDetail>(3); }, ErrorCode::kMalformed,
      "Observe.detail");
  Refused<Observe>(
      good, [](Observe& m) { m.detail = PoseDetail::kRoot; }, ErrorCode::kUnsupported,
      "Observe.detail");
  Refused<Observe>(
      good, [](Observe& m) { m.avatars[0] = 0; }, ErrorCode::kOutOfRange, "Observe.avatars", 0);
  Refused<Observe>(
      good, [](Observe& m) { m.avatars.assign(kMaxItems + 1, 1); }, ErrorCode::kLimitExceeded,
      "Observe.avatars");
  for (const int ticks : {0, 3601, 65535}) {
    Refused<Observe>(
        good, [&](Observe& m) { m.every_n_ticks = static_cast<std::uint16_t>(ticks); },
        ErrorCode::kOutOfRange, "Observe.every_n_ticks");
  }
  Observe rings = good;
  rings.mode = PoseMode::kQuantised;
  rings.avatars.clear();
  rings.region = Region{{1.0, 2.0}, 30.0, std::nullopt, {{8.0, 1}, {20.0, 2}}, {}};
  rings.region->ring_details = {PoseDetail::kAll, PoseDetail::kRoot};
  Refused<Observe>(
      rings, [](Observe& m) { m.region->ring_details.pop_back(); }, ErrorCode::kMalformed,
      "Observe.region.ring_details", 1);
  Refused<Observe>(
      rings, [](Observe& m) { m.region->rings.clear(); }, ErrorCode::kMalformed,
      "Observe.region.ring_details", 2);
  Refused<Observe>(
      rings, [](Observe& m) { m.region->ring_details[1] = static_cast<PoseDetail>(3); },
      ErrorCode::kMalformed, "Observe.region.ring_details", 1);
  for (const PoseMode mode : {PoseMode::kFull, PoseMode::kMovement}) {
    Refused<Observe>(
        rings, [&](Observe& m) { m.mode = mode; }, ErrorCode::kUnsupported,
        "Observe.region.ring_details");
  }
  Refused<StopObserving>(
      {1, 2}, [](StopObserving& m) { m.seq = 0; }, ErrorCode::kOutOfRange, "StopObserving.seq");
  Refused<StopObserving>(
      {1, 2}, [](StopObserving& m) { m.subscription = 0; }, ErrorCode::kOutOfRange,
      "StopObserving.subscription");
}

TEST(Check, PingPongGoodbyeErrorLagging) {
  RefusedWhenNotFinite<Ping>({}, [](Ping& m) -> double& { return m.time_s; }, "Ping.time_s");
  RefusedWhenNotFinite<Pong>({}, [](Pong& m) -> double& { return m.time_s; }, "Pong.time_s");
  RefusedWhenNotFinite<Pong>(
      {}, [](Pong& m) -> double& { return m.server_time_s; }, "Pong.server_time_s");
  RefusedTexts<Goodbye>(
      {}, [](Goodbye& m) -> std::string& { return m.text; }, kMaxTextBytes, true, "Goodbye.text");
  RefusedTexts<ErrorNotice>(
      {}, [](ErrorNotice& m) -> std::string& { return m.text; }, kMaxTextBytes, true, "Error.text");
  Refused<Lagging>(
      {1, 0, 0}, [](Lagging& m) { m.world = 0; }, ErrorCode::kOutOfRange, "Lagging.world");
}

TEST(Check, Welcome) {
  const Welcome good = GoodWelcome();
  Refused<Welcome>(
      good, [](Welcome& m) { m.protocol = 0; }, ErrorCode::kOutOfRange, "Welcome.protocol");
  Refused<Welcome>(
      good, [](Welcome& m) { m.session = 0; }, ErrorCode::kOutOfRange, "Welcome.session");
  for (const std::size_t bytes : {15u, 65u}) {
    Refused<Welcome>(
        good, [&](Welcome& m) { m.resume_token.resize(bytes); }, ErrorCode::kLimitExceeded,
        "Welcome.resume_token");
  }
  for (const double hz : {0.0, -60.0, kNaN, kInfinity}) {
    Refused<Welcome>(
        good, [&](Welcome& m) { m.tick_hz = hz; }, ErrorCode::kOutOfRange, "Welcome.tick_hz");
  }
  for (const double seconds : {-1.0, kNaN, kInfinity}) {
    Refused<Welcome>(
        good, [&](Welcome& m) { m.limits.idle_timeout_s = seconds; }, ErrorCode::kOutOfRange,
        "Welcome.limits.idle_timeout_s");
    Refused<Welcome>(
        good, [&](Welcome& m) { m.limits.resume_window_s = seconds; }, ErrorCode::kOutOfRange,
        "Welcome.limits.resume_window_s");
  }
  RefusedTexts<Welcome>(
      good, [](Welcome& m) -> std::string& { return m.server_name; }, kMaxNameBytes, true,
      "Welcome.server_name");
  RefusedTexts<Welcome>(
      good, [](Welcome& m) -> std::string& { return m.server_version; }, kMaxNameBytes, true,
      "Welcome.server_version");
}

TEST(Check, WorldInfo) {
  using W = WorldInfo;
  const W good = GoodWorldInfo();
  Refused<W>(good, [](W& m) { m.world = 0; }, ErrorCode::kOutOfRange, "WorldInfo.world");
  RefusedTexts<W>(
      good, [](W& m) -> std::string& { return m.name; }, kMaxNameBytes, false, "WorldInfo.name");
  RefusedTexts<W>(
      good, [](W& m) -> std::string& { return m.library_hash; }, kMaxNameBytes, true,
      "WorldInfo.library_hash");
  Refused<W>(
      good, [](W& m) { m.role = static_cast<Role>(9); }, ErrorCode::kMalformed, "WorldInfo.role");
  Refused<W>(
      good, [](W& m) { m.skeleton.joints.clear(); }, ErrorCode::kMalformed,
      "WorldInfo.skeleton.joints");
  Refused<W>(
      good, [](W& m) { m.skeleton.joints.resize(kMaxJoints + 1); }, ErrorCode::kLimitExceeded,
      "WorldInfo.skeleton.joints");
  Refused<W>(
      good, [](W& m) { m.skeleton.end_sites.resize(257); }, ErrorCode::kLimitExceeded,
      "WorldInfo.skeleton.end_sites");
  RefusedTexts<W>(
      good, [](W& m) -> std::string& { return m.skeleton.joints[1].name; }, kMaxNameBytes, false,
      "WorldInfo.skeleton.joints.name", 1);
  Refused<W>(
      good, [](W& m) { m.skeleton.joints[2].name = m.skeleton.joints[0].name; },
      ErrorCode::kMalformed, "WorldInfo.skeleton.joints.name");
  Refused<W>(
      good, [](W& m) { m.skeleton.joints[0].parent = 0; }, ErrorCode::kOutOfRange,
      "WorldInfo.skeleton.joints.parent", 0);
  for (const int parent : {-2, -1, 2, 3}) {
    Refused<W>(
        good, [&](W& m) { m.skeleton.joints[2].parent = static_cast<std::int16_t>(parent); },
        ErrorCode::kOutOfRange, "WorldInfo.skeleton.joints.parent", 2);
  }
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Refused<W>(
      good, [&](W& m) { m.skeleton.joints[1].offset_m.y = nan; }, ErrorCode::kOutOfRange,
      "WorldInfo.skeleton.joints.offset_m", 1);
  Refused<W>(
      good, [](W& m) { m.skeleton.end_sites[0].joint = 3; }, ErrorCode::kOutOfRange,
      "WorldInfo.skeleton.end_sites.joint", 0);
  Refused<W>(
      good, [&](W& m) { m.skeleton.end_sites[0].offset_m.z = nan; }, ErrorCode::kOutOfRange,
      "WorldInfo.skeleton.end_sites.offset_m", 0);
  for (std::int16_t LegInfo::* joint :
       {&LegInfo::hip, &LegInfo::knee, &LegInfo::ankle, &LegInfo::ball}) {
    for (const int bad : {-2, 3}) {
      Refused<W>(
          good, [&](W& m) { m.skeleton.legs[1].*joint = static_cast<std::int16_t>(bad); },
          ErrorCode::kOutOfRange, "WorldInfo.skeleton.right_leg");
    }
  }
  Refused<W>(
      good, [&](W& m) { m.skeleton.legs[0].ball_offset_m.x = nan; }, ErrorCode::kOutOfRange,
      "WorldInfo.skeleton.left_leg.ball_offset_m");
  Refused<W>(
      good, [&](W& m) { m.skeleton.legs[1].toe_tip_offset_m.x = nan; }, ErrorCode::kOutOfRange,
      "WorldInfo.skeleton.right_leg.toe_tip_offset_m");
  W with_codes = good;
  with_codes.rotation_quantizations.resize(good.skeleton.joints.size());
  with_codes.rotation_quantizations[0].smallest_three_bits = 12;
  ASSERT_TRUE(Check(with_codes));
  Refused<W>(
      with_codes, [](W& m) { m.rotation_quantizations.pop_back(); }, ErrorCode::kShapeMismatch,
      "WorldInfo.rotation_quantizations");
  Refused<W>(
      with_codes, [&](W& m) { m.rotation_quantizations[1].step.y = nan; }, ErrorCode::kOutOfRange,
      "WorldInfo.rotation_quantizations.step", 1);
  Refused<W>(
      with_codes, [](W& m) { m.rotation_quantizations[0].smallest_three_bits = 0; },
      ErrorCode::kMalformed, "WorldInfo.rotation_quantizations", 0);
  Refused<W>(
      with_codes, [](W& m) { m.rotation_quantizations.resize(kMaxJoints + 1); },
      ErrorCode::kLimitExceeded, "WorldInfo.rotation_quantizations");
  W with_fewer = with_codes;
  with_fewer.reduced_joints = {0, 1};
  EXPECT_TRUE(Check(with_fewer));
  Refused<W>(
      with_fewer, [](W& m) { m.rotation_quantizations.clear(); }, ErrorCode::kShapeMismatch,
      "WorldInfo.reduced_joints");
  Refused<W>(
      with_fewer, [](W& m) { m.reduced_joints.resize(m.skeleton.joints.size() + 1); },
      ErrorCode::kShapeMismatch, "WorldInfo.reduced_joints");
  const auto last = static_cast<std::uint16_t>(good.skeleton.joints.size());
  for (const std::vector<std::uint16_t>& wrong :
       {std::vector<std::uint16_t>{1}, {0, 0}, {0, last}, {0, 1, 1}}) {
    Refused<W>(
        with_fewer, [&](W& m) { m.reduced_joints = wrong; }, ErrorCode::kMalformed,
        "WorldInfo.reduced_joints");
  }
}

TEST(Check, Reply) {
  const Reply good = GoodReply();
  Refused<Reply>(good, [](Reply& m) { m.seq = 0; }, ErrorCode::kOutOfRange, "Reply.seq");
  RefusedTexts<Reply>(
      good, [](Reply& m) -> std::string& { return m.text; }, kMaxTextBytes, true, "Reply.text");
  RefusedTexts<Reply>(
      good, [](Reply& m) -> std::string& { return m.items[0].text; }, kMaxReasonBytes, true,
      "Reply.items.text", 0);
  Refused<Reply>(
      good, [](Reply& m) { m.items[0].index = kMaxItems; }, ErrorCode::kOutOfRange,
      "Reply.items.index", 0);
  Refused<Reply>(
      good, [](Reply& m) { m.items.resize(kMaxItems + 1); }, ErrorCode::kLimitExceeded,
      "Reply.items");
}

TEST(Check, PoseBatch) {
  using B = PoseBatch;
  static const std::vector<AvatarId> avatars = {1, 2};
  static const std::vector<AvatarId> with_zero = {1, 0};
  static const std::vector<AvatarId> too_many(kMaxItems + 1, 1);
  static const std::vector<std::uint8_t> flags = {0, 0};
  static const std::vector<std::byte> poses(2 * PoseBytes(PoseMode::kQuantised, 3));
  const B good{{1, 0, 0, 1, 0, 0.0, PoseMode::kQuantised, 3}, avatars, flags, poses};
  Refused<B>(good, [](B& m) { m.info.world = 0; }, ErrorCode::kOutOfRange, "PoseBatch.world");
  Refused<B>(good, [](B& m) { m.info.parts = 0; }, ErrorCode::kOutOfRange, "PoseBatch.parts");
  Refused<B>(good, [](B& m) { m.info.part = 1; }, ErrorCode::kOutOfRange, "PoseBatch.part");
  Refused<B>(
      good, [](B& m) { m.info.parts = kMaxBatchParts + 1; }, ErrorCode::kOutOfRange,
      "PoseBatch.parts");
  RefusedWhenNotFinite<B>(
      good, [](B& m) -> double& { return m.info.server_time_s; }, "PoseBatch.server_time_s");
  Refused<B>(
      good, [](B& m) { m.info.mode = static_cast<PoseMode>(6); }, ErrorCode::kMalformed,
      "PoseBatch.mode");
  Refused<B>(
      good, [](B& m) { m.info.mode = PoseMode::kMovement; }, ErrorCode::kUnsupported,
      "PoseBatch.mode");
  for (const int joints : {0, 257}) {
    Refused<B>(
        good, [&](B& m) { m.info.joint_count = static_cast<std::uint16_t>(joints); },
        ErrorCode::kOutOfRange, "PoseBatch.joint_count");
  }
  Refused<B>(
      good, [](B& m) { m.avatars = with_zero; }, ErrorCode::kOutOfRange, "PoseBatch.avatars", 1);
  Refused<B>(
      good, [](B& m) { m.avatars = too_many; }, ErrorCode::kLimitExceeded, "PoseBatch.avatars");
  Refused<B>(
      good, [](B& m) { m.flags = m.flags.first(1); }, ErrorCode::kShapeMismatch, "PoseBatch.flags");
  Refused<B>(
      good, [](B& m) { m.poses = m.poses.first(m.poses.size() - 1); }, ErrorCode::kShapeMismatch,
      "PoseBatch.poses");
  Refused<B>(
      good, [](B& m) { m.info.mode = PoseMode::kFull; }, ErrorCode::kShapeMismatch,
      "PoseBatch.poses");

  // The second pose is uncompressed; the first can have any length.
  static const std::vector<std::uint8_t> one_wide = {kPoseStanding, kPoseUncompressed};
  static const std::vector<std::uint8_t> all_wide = {kPoseUncompressed, kPoseUncompressed};
  const std::size_t wide = PoseBytes(PoseMode::kQuantised, 3);
  const auto compact = [&](const std::vector<std::uint8_t>& of, std::size_t bytes) {
    return B{
        {1, 0, 0, 1, 0, 0.0, PoseMode::kCompact, 3}, avatars, of, std::span(poses).first(bytes)};
  };
  EXPECT_EQ(CompactPoseBytes(compact(one_wide, wide + 20)), 20u);
  EXPECT_EQ(CompactPoseBytes(compact(all_wide, 2 * wide)), 0u);
  EXPECT_EQ(CompactPoseBytes(compact(flags, 40)), 20u);
  EXPECT_TRUE(Check(compact(one_wide, wide + 20)));
  for (const B& bad : {compact(one_wide, wide - 1), compact(all_wide, 2 * wide - 1),
                       compact(all_wide, wide), compact(flags, 41)}) {
    const Status status = Check(bad);
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::kShapeMismatch);
    EXPECT_EQ(status.error().where, "PoseBatch.poses");
  }
}

TEST(Check, InspectAvatar) {
  using I = InspectAvatar;
  Refused<I>({1, 2, 3}, [](I& m) { m.world = 0; }, ErrorCode::kOutOfRange, "InspectAvatar.world");
  Refused<I>({1, 2, 3}, [](I& m) { m.avatar = 0; }, ErrorCode::kOutOfRange, "InspectAvatar.avatar");
}

TEST(Check, AvatarState) {
  using S = AvatarState;
  const S good = GoodState();
  Refused<S>(good, [](S& m) { m.world = 0; }, ErrorCode::kOutOfRange, "AvatarState.world");
  Refused<S>(good, [](S& m) { m.avatar = 0; }, ErrorCode::kOutOfRange, "AvatarState.avatar");
  RefusedTexts<S>(
      good, [](S& m) -> std::string& { return m.text; }, kMaxReasonBytes, true, "AvatarState.text");
  RefusedWhenNotFinite<S>(
      good, [](S& m) -> double& { return m.server_time_s; }, "AvatarState.server_time_s");
  RefusedWhenNotFinite<S>(
      good, [](S& m) -> double& { return m.base.heading_rad; }, "AvatarState.base_heading_rad");
  Refused<S>(
      good, [](S& m) { m.queue_size = 1; }, ErrorCode::kShapeMismatch, "AvatarState.queue", 1);
  Refused<S>(
      good,
      [](S& m) {
        m.queue_size = 100;
        m.queue.resize(kMaxInspectedRequests + 1, m.queue[0]);
      },
      ErrorCode::kLimitExceeded, "AvatarState.queue");
  Refused<S>(
      good, [](S& m) { m.queue[1].request_id = 0; }, ErrorCode::kOutOfRange,
      "AvatarState.queue.request_id", 1);
}

TEST(Check, ExactOnlyExcludesAllowNearest) {
  Request message{1, 1, {{1, 1, StepMovement{.at_m = DVec3(0.0), .exact_only = true}}}};
  EXPECT_TRUE(Check(message).has_value());
  auto& step = std::get<StepMovement>(message.items[0].movement);
  step.at_m.reset();
  EXPECT_TRUE(Check(message).has_value());
  step.allow_nearest = true;
  const Status status = Check(message);
  ASSERT_FALSE(status.has_value());
  EXPECT_EQ(status.error().code, ErrorCode::kMalformed);
  EXPECT_EQ(status.error().where, "Request.items.exact_only");
  EXPECT_STREQ(status.error().text, "exact_only excludes allow_nearest");
  step.exact_only = false;
  EXPECT_TRUE(Check(message).has_value());
}

TEST(Check, Footprints) {
  Request good = GoodRequest();
  good.items[0].movement = StepMovement{.at_m = DVec3(1.0, 2.0, 3.0), .heading_rad = 0.5};
  const auto step = [](Request& m) -> StepMovement& {
    return std::get<StepMovement>(m.items[0].movement);
  };
  RefusedWhenNotFinite<Request>(
      good, [&](Request& m) -> double& { return step(m).at_m->z; }, "Request.items.at_m");
  RefusedWhenNotFinite<Request>(
      good, [&](Request& m) -> double& { return *step(m).heading_rad; },
      "Request.items.heading_rad");
}

TEST(Check, Walks) {
  Request good = GoodRequest();
  good.items[0].movement = WalkMovement{DVec3(1.0, 2.0, 3.0), 0.5, {DVec3(1.0)}, 1.0};
  const auto walk = [](Request& m) -> WalkMovement& {
    return std::get<WalkMovement>(m.items[0].movement);
  };
  RefusedWhenNotFinite<Request>(
      good, [&](Request& m) -> double& { return walk(m).at_m.z; }, "Request.items.at_m");
  RefusedWhenNotFinite<Request>(
      good, [&](Request& m) -> double& { return walk(m).heading_rad; },
      "Request.items.heading_rad");
  RefusedWhenNotFinite<Request>(
      good, [&](Request& m) -> double& { return walk(m).waypoints_m[0].x; },
      "Request.items.waypoints_m");
  RefusedWhenNotFinite<Request>(
      good, [&](Request& m) -> double& { return *walk(m).speed_m_s; }, "Request.items.speed_m_s");
  Refused<Request>(
      good, [&](Request& m) { walk(m).waypoints_m.resize(kMaxWaypoints + 1); },
      ErrorCode::kLimitExceeded, "Request.items.waypoints_m", 0);
}

TEST(Check, Layers) {
  using L = SetLayers;
  const L good{1, 2, {{41, "wave"}, {42, "carry", true}}};
  constexpr auto kRange = ErrorCode::kOutOfRange;
  Refused<L>(good, [](L& m) { m.seq = 0; }, kRange, "SetLayers.seq");
  Refused<L>(good, [](L& m) { m.world = 0; }, kRange, "SetLayers.world");
  Refused<L>(good, [](L& m) { m.items.clear(); }, ErrorCode::kMalformed, "SetLayers.items");
  Refused<L>(good, [](L& m) { m.items[1].avatar = 0; }, kRange, "SetLayers.items.avatar", 1);
  Refused<L>(
      good, [](L& m) { m.items[1].layer.clear(); }, ErrorCode::kMalformed, "SetLayers.items.layer",
      1);
  Refused<L>(
      good, [](L& m) { m.items[0].layer.assign(65, 'a'); }, ErrorCode::kLimitExceeded,
      "SetLayers.items.layer", 0);
  RefusedWhenNotFinite<L>(
      good, [](L& m) -> double& { return m.items[0].weight; }, "SetLayers.items.weight");
  RefusedWhenNotFinite<L>(
      good, [](L& m) -> double& { return m.items[0].blend_s; }, "SetLayers.items.blend_s");
  RefusedWhenNotFinite<L>(
      good, [](L& m) -> double& { return m.items[0].speed; }, "SetLayers.items.speed");
}

TEST(Check, Movements) {
  using M = Movements;
  const M good{.world = 2,
               .avatars = {41, 42, 43},
               .flags = {0, kMovementGone, 1},
               .ends = {4, 4, 10},
               .records = std::vector<std::byte>(10)};
  constexpr auto kRange = ErrorCode::kOutOfRange;
  constexpr auto kShape = ErrorCode::kShapeMismatch;
  EXPECT_EQ(RecordOf(good, 0).size(), 4u);
  EXPECT_EQ(RecordOf(good, 1).size(), 0u);
  EXPECT_EQ(RecordOf(good, 2).data(), good.records.data() + 4);
  Refused<M>(good, [](M& m) { m.world = 0; }, kRange, "Movements.world");
  Refused<M>(good, [](M& m) { m.part = 1; }, kRange, "Movements.part");
  Refused<M>(good, [](M& m) { m.parts = 0; }, kRange, "Movements.parts");
  RefusedWhenNotFinite<M>(
      good, [](M& m) -> double& { return m.server_time_s; }, "Movements.server_time_s");
  Refused<M>(good, [](M& m) { m.avatars[1] = 0; }, kRange, "Movements.avatars", 1);
  Refused<M>(good, [](M& m) { m.flags.pop_back(); }, kShape, "Movements.flags", 2);
  Refused<M>(good, [](M& m) { m.ends.pop_back(); }, kShape, "Movements.ends", 2);
  Refused<M>(good, [](M& m) { m.ends[1] = 3; }, kRange, "Movements.ends", 1);
  Refused<M>(good, [](M& m) { m.records.pop_back(); }, kShape, "Movements.records", 9);
  Refused<M>(
      good,
      [](M& m) {
        m.ends[2] = 4 + kMaxRecordBytes + 1;
        m.records.resize(m.ends[2]);
      },
      kRange, "Movements.ends", 2);
}

TEST(Check, LibraryPieces) {
  using F = FetchLibrary;
  const F asked{1, "0f1e", 0, 1};
  constexpr auto kRange = ErrorCode::kOutOfRange;
  Refused<F>(asked, [](F& m) { m.length = 0; }, kRange, "FetchLibrary.length", 0);
  Refused<F>(asked, [](F& m) { m.length = (1u << 20) + 1; }, kRange, "FetchLibrary.length");
  Refused<F>(asked, [](F& m) { m.offset = 1u << 30; }, kRange, "FetchLibrary.offset");
  RefusedTexts<F>(
      asked, [](F& m) -> std::string& { return m.hash; }, kMaxNameBytes, false,
      "FetchLibrary.hash");
  using P = LibraryPiece;
  const P piece{.hash = "0f1e", .total_bytes = 8, .offset = 5, .bytes = std::vector<std::byte>(3)};
  Refused<P>(piece, [](P& m) { m.bytes.resize(4); }, kRange, "LibraryPiece.offset", 5);
  Refused<P>(piece, [](P& m) { m.offset = 9; }, kRange, "LibraryPiece.offset", 9);
  Refused<P>(
      piece, [](P& m) { m.total_bytes = kMaxLibraryBytes + 1; }, kRange,
      "LibraryPiece.total_bytes");
  Refused<P>(
      piece,
      [](P& m) {
        m.total_bytes = kMaxLibraryBytes;
        m.bytes.resize(kMaxPieceBytes + 1);
      },
      ErrorCode::kLimitExceeded, "LibraryPiece.bytes");
  RefusedTexts<P>(
      piece, [](P& m) -> std::string& { return m.text; }, kMaxReasonBytes, true,
      "LibraryPiece.text");
}

TEST(Check, Terrain) {
  using T = SetTerrain;
  T good{1, 2, TerrainInfo{}};
  good.terrain->height_field = HeightFieldInfo{{0, 0}, 0.5, 2, 3, std::vector<float>(6)};
  good.terrain->boxes = {{{0, 0}, {1, 1}, 0.5}, {{0, 0}, {1, 1}, 0.5}};
  constexpr auto kRange = ErrorCode::kOutOfRange;
  Refused<T>(good, [](T& m) { m.seq = 0; }, kRange, "SetTerrain.seq");
  Refused<T>(good, [](T& m) { m.world = 0; }, kRange, "SetTerrain.world");
  Refused<WorldTerrain>(
      {1, good.terrain}, [](WorldTerrain& m) { m.world = 0; }, kRange, "WorldTerrain.world");
  RefusedWhenNotFinite<T>(
      good, [](T& m) -> double& { return m.terrain->height_field->origin_m.z; },
      "SetTerrain.terrain.height_field.origin_m.z");
  for (const double cell_m : {0.0, -1.0, kNaN, kInfinity}) {
    Refused<T>(
        good, [&](T& m) { m.terrain->height_field->cell_m = cell_m; }, kRange,
        "SetTerrain.terrain.height_field.cell_m");
  }
  Refused<T>(
      good, [](T& m) { m.terrain->height_field->columns = 1; }, kRange,
      "SetTerrain.terrain.height_field.columns", 1);
  Refused<T>(
      good, [](T& m) { m.terrain->height_field->rows = 1025; }, kRange,
      "SetTerrain.terrain.height_field.rows", 1025);
  Refused<T>(
      good, [](T& m) { m.terrain->height_field->heights_m.pop_back(); }, ErrorCode::kShapeMismatch,
      "SetTerrain.terrain.height_field.heights_m", 5);
  Refused<T>(
      good,
      [](T& m) { m.terrain->height_field->heights_m[4] = std::numeric_limits<float>::infinity(); },
      kRange, "SetTerrain.terrain.height_field.heights_m", 4);
  RefusedWhenNotFinite<T>(
      good, [](T& m) -> double& { return m.terrain->boxes[1].height_m; },
      "SetTerrain.terrain.boxes.height_m");
  Refused<T>(
      good, [](T& m) { m.terrain->boxes[1].max_m.x = 0.0; }, kRange, "SetTerrain.terrain.boxes", 1);
  Refused<T>(
      good, [](T& m) { m.terrain->boxes.resize(kMaxTerrainBoxes + 1, m.terrain->boxes[0]); },
      ErrorCode::kLimitExceeded, "SetTerrain.terrain.boxes");
}

TEST(Check, AvatarStateLandingsAndLayers) {
  using S = AvatarState;
  const S good = GoodState();
  Refused<S>(
      good, [](S& m) { m.movement->landings.resize(3); }, ErrorCode::kLimitExceeded,
      "AvatarState.movement.landings");
  Refused<S>(
      good, [](S& m) { m.movement->landings[0].foot = static_cast<FootSide>(2); },
      ErrorCode::kMalformed, "AvatarState.movement.landings.foot", 0);
  RefusedWhenNotFinite<S>(
      good, [](S& m) -> double& { return m.movement->landings[0].position_m.y; },
      "AvatarState.movement.landings.position_m", 0);
  RefusedWhenNotFinite<S>(
      good, [](S& m) -> double& { return m.movement->landings[0].heading_rad; },
      "AvatarState.movement.landings.heading_rad", 0);
  Refused<S>(
      good, [](S& m) { m.layers.resize(5, m.layers[0]); }, ErrorCode::kLimitExceeded,
      "AvatarState.layers");
  RefusedTexts<S>(
      good, [](S& m) -> std::string& { return m.layers[1].layer; }, kMaxNameBytes, false,
      "AvatarState.layers.layer", 1);
  RefusedWhenNotFinite<S>(
      good, [](S& m) -> double& { return m.layers[1].weight; }, "AvatarState.layers.weight", 1);
  RefusedWhenNotFinite<S>(
      good, [](S& m) -> double& { return m.layers[1].time_s; }, "AvatarState.layers.time_s", 1);
  RefusedWhenNotFinite<S>(
      good, [](S& m) -> double& { return m.layers[1].speed; }, "AvatarState.layers.speed", 1);
}

TEST(Check, AvatarStateMovement) {
  using S = AvatarState;
  const S good = GoodState();
  Refused<S>(
      good, [](S& m) { m.movement->kind = static_cast<MovementKind>(4); }, ErrorCode::kMalformed,
      "AvatarState.movement.kind");
  Refused<S>(
      good, [](S& m) { m.movement->group = -2; }, ErrorCode::kOutOfRange,
      "AvatarState.movement.group");
  RefusedWhenNotFinite<S>(
      good, [](S& m) -> double& { return m.movement->started_s; },
      "AvatarState.movement.started_s");
  const std::vector<std::vector<double>> bad_keytimes = {
      {0.1, 0.2, 0.3, 0.4}, {0.0, 0.2, 0.1, 0.4}, {0.0, 0.1, 0.2, kNaN}};
  for (const auto& keytimes_s : bad_keytimes) {
    Refused<S>(
        good, [&](S& m) { m.movement->keytimes_s = keytimes_s; }, ErrorCode::kOutOfRange,
        "AvatarState.movement.keytimes_s");
  }
  Refused<S>(
      good, [](S& m) { m.movement->keytimes_s.assign(10, 0.0); }, ErrorCode::kLimitExceeded,
      "AvatarState.movement.keytimes_s");
  for (const double generic_time : {-0.1, 3.1, kNaN}) {
    Refused<S>(
        good, [&](S& m) { m.movement->generic_time = generic_time; }, ErrorCode::kOutOfRange,
        "AvatarState.movement.generic_time");
  }
  for (const double ease_out_s : {-0.1, kInfinity}) {
    Refused<S>(
        good, [&](S& m) { m.movement->ease_out_s = ease_out_s; }, ErrorCode::kOutOfRange,
        "AvatarState.movement.ease_out_s");
  }
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Refused<S>(
      good, [&](S& m) { m.movement->weights[1] = nan; }, ErrorCode::kOutOfRange,
      "AvatarState.movement.weights", 1);
  Refused<S>(
      good, [&](S& m) { m.movement->weights.assign(kMaxWeights + 1, 0.0f); },
      ErrorCode::kLimitExceeded, "AvatarState.movement.weights");
  Refused<S>(
      good, [](S& m) { m.movement->parameter_names = {2, 9}; }, ErrorCode::kMalformed,
      "AvatarState.movement.parameter_names", 9);
  Refused<S>(
      good, [](S& m) { m.movement->parameter_names = {2, 2}; }, ErrorCode::kMalformed,
      "AvatarState.movement.parameter_names", 2);
  Refused<S>(
      good, [](S& m) { m.movement->sites.pop_back(); }, ErrorCode::kShapeMismatch,
      "AvatarState.movement.sites", 3);
  Refused<S>(
      good, [&](S& m) { m.movement->sites[2] = nan; }, ErrorCode::kOutOfRange,
      "AvatarState.movement.sites", 2);
}

TEST(Check, Events) {
  using E = Events;
  const E good = GoodEvents();
  Refused<E>(good, [](E& m) { m.world = 0; }, ErrorCode::kOutOfRange, "Events.world");
  Refused<E>(good, [](E& m) { m.events.clear(); }, ErrorCode::kMalformed, "Events.events");
  Refused<E>(
      good, [](E& m) { m.events.resize(kMaxItems + 1, m.events[0]); }, ErrorCode::kLimitExceeded,
      "Events.events");
  Refused<E>(
      good, [](E& m) { m.events[1].type = static_cast<EventType>(10); }, ErrorCode::kMalformed,
      "Events.events.type", 1);
  Refused<E>(
      good, [](E& m) { m.events[1].avatar = 0; }, ErrorCode::kOutOfRange, "Events.events.avatar",
      1);
  Refused<E>(
      good, [](E& m) { m.events[1].kind = static_cast<MovementKind>(4); }, ErrorCode::kMalformed,
      "Events.events.kind", 1);
  Refused<E>(
      good, [](E& m) { m.events[1].group = -2; }, ErrorCode::kOutOfRange, "Events.events.group", 1);
  Refused<E>(
      good, [](E& m) { m.events[1].foot = static_cast<FootSide>(2); }, ErrorCode::kMalformed,
      "Events.events.foot", 1);
  RefusedWhenNotFinite<E>(
      good, [](E& m) -> double& { return m.events[1].time_s; }, "Events.events.time_s", 1);
  for (int k = 0; k < 3; ++k) {
    RefusedWhenNotFinite<E>(
        good, [k](E& m) -> double& { return m.events[1].position_m[k]; },
        "Events.events.position_m", 1);
    RefusedWhenNotFinite<E>(
        good, [k](E& m) -> double& { return m.events[1].base.position_m[k]; },
        "Events.events.base_position_m", 1);
  }
  RefusedWhenNotFinite<E>(
      good, [](E& m) -> double& { return m.events[1].base.heading_rad; },
      "Events.events.base_heading_rad", 1);
  RefusedTexts<E>(
      good, [](E& m) -> std::string& { return m.events[1].reason; }, kMaxReasonBytes, true,
      "Events.events.reason", 1);
  using Parameters = std::vector<ParameterValue>;
  const auto parameters = [&](Parameters Event::* list, std::string_view field) {
    const auto with = [&](auto change) {
      return [=](E& m) {
        Parameters& values = m.events[0].*list;
        values = {{.value = 1.0, .name = 2}, {.value = 2.0, .name = 5}};
        change(values);
      };
    };
    E fine = good;
    with([](Parameters&) {})(fine);
    EXPECT_TRUE(Check(fine));
    Refused<E>(good, with([](Parameters& s) { s.resize(kMaxParameters + 1); }),
               ErrorCode::kLimitExceeded, field, 0);
    Refused<E>(good, with([](Parameters& s) { s[1].name = kParameterNames; }),
               ErrorCode::kMalformed, field, 0);
    Refused<E>(good, with([](Parameters& s) { s[1].name = s[0].name; }), ErrorCode::kMalformed,
               field, 0);
    Refused<E>(good, with([](Parameters& s) { s[1].value = kNaN; }), ErrorCode::kOutOfRange, field,
               0);
  };
  parameters(&Event::requested, "Events.events.requested");
  parameters(&Event::applied, "Events.events.applied");
}

TEST(Encoder, RejectsAPayloadOverItsCap) {
  Encoder encoder({256, 1024});
  std::vector<std::byte> frame;
  Request request{1, 1, {{1, 1, StepMovement{}}}};
  ASSERT_TRUE(encoder.Encode(request, frame));
  const auto before = frame;
  request.items.assign(100, request.items[0]);
  const Status status = encoder.Encode(request, frame);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kLimitExceeded);
  EXPECT_EQ(status.error().where, "Request");
  EXPECT_EQ(frame, before);
}

TEST(Encoder, EncodesTheLargestCrowd) {
  Request request{1, 1, {}};
  Spawn spawn{2, 1, {}};
  Reply reply{2, StatusCode::kOk, "", 65'536, {}};
  for (AvatarId a = 1; a <= kMaxItems; ++a) {
    request.items.push_back(
        {a, 1'000'000 + a, StepMovement{FootChoice::kLeft, 0.1, 0.2, 0.3, 0.4}});
    spawn.items.push_back({a, {DVec3(1.0, 2.0, 3.0), 4.0}});
    reply.items.push_back({a - 1, a, 1'000'000 + a, StatusCode::kQueueFull, "the queue is full"});
  }
  for (const Message& message : {Message(request), Message(spawn), Message(reply)}) {
    const auto frame = EncodeOrFail(message);
    const auto decoded = Decode(frame, TypeOf(message));
    ASSERT_TRUE(decoded) << Describe(decoded.error());
    EXPECT_TRUE(SameMessage(*decoded, message));
  }
}

}  // namespace
}  // namespace stridewire::protocol
