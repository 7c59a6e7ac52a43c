// Worlds over real sockets: poses, events, limits, slow readers, and identical bytes for any number
// of shards.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>
#include <set>

#include "counted_memory.h"
#include "runtime/avatar/avatar_simulation.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/protocol/compact_codecs.h"
#include "stridewire/protocol/pose_batch_reader.h"
#include "test_library.h"
#include "test_server.h"

namespace stridewire {
namespace {

using namespace std::chrono_literals;
using protocol::AvatarId;
using protocol::EventType;
using protocol::PoseMode;
using protocol::Reply;
using protocol::StatusCode;
using server::Limit;
using server::ThreadMetrics;
using testing::ElementsAre;

double ResidentMiB() {
  std::ifstream statm("/proc/self/statm");
  double total = 0;
  double resident = 0;
  statm >> total >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / (1 << 20);
}

// ---- identical bytes

std::vector<protocol::RequestItem> Choreography(AvatarId avatar) {
  using namespace protocol;
  const double length_m = 0.3 + 0.02 * avatar;
  return {
      {.avatar = avatar, .request_id = 1, .movement = StepMovement{.length_m = length_m}},
      {.avatar = avatar, .request_id = 2, .movement = StepMovement{.length_m = 0.5}},
      {.avatar = avatar, .request_id = 3, .movement = StandMovement{0.1}},
      {.avatar = avatar, .request_id = 4, .movement = JumpMovement{.length_m = 0.7}},
      {.avatar = avatar,
       .request_id = 5,
       .movement = StepMovement{.foot = FootChoice::kLeft, .length_m = 0.2}},
  };
}

protocol::Placement Start(AvatarId avatar) {
  return {{3.0 * avatar, 0.0, -1.0 * avatar}, 0.3 * avatar};
}

// Avatars stand in a row, 1 m apart.
std::vector<protocol::SpawnItem> OnALine(AvatarId count) {
  std::vector<protocol::SpawnItem> items;
  for (AvatarId avatar = 1; avatar <= count; ++avatar) {
    items.push_back({.avatar = avatar, .start = {{static_cast<double>(avatar), 0.0, 0.0}, 0.0}});
  }
  return items;
}

// Encoded poses by avatar and by ticks since its first movement started.
using PoseStreams = std::map<AvatarId, std::map<std::uint64_t, std::vector<std::byte>>>;

PoseStreams PlayOnServer(int shards, int avatars, PoseMode mode) {
  server::Config config = TestConfig(shards);
  config.max_catch_up_ticks = 1000;  // late ticks must not lose time
  config.idle_motion = false;        // it depends on the tick in which the requests arrive
  config.limits.observer_backlog_ticks = 1000;
  TestServer server(config);
  RawClient client = server.Connect();
  PoseStreams streams;
  if (!client.SayHello()) return streams;
  const auto world = client.Join("stage");
  std::vector<protocol::SpawnItem> spawns;
  std::vector<protocol::RequestItem> requests;
  for (int i = 1; i <= avatars; ++i) {
    const auto avatar = static_cast<AvatarId>(i);
    spawns.push_back({avatar, Start(avatar)});
    std::ranges::copy(Choreography(avatar), std::back_inserter(requests));
  }
  client.Spawn(world->world, spawns);
  client.Observe(world->world, 1, mode);
  client.Send(protocol::Request{.seq = client.NextSeq(), .world = world->world, .items = requests});

  std::map<AvatarId, std::uint64_t> started;
  std::map<AvatarId, std::map<std::uint64_t, std::vector<std::byte>>> by_tick;
  std::size_t idle = 0;
  while (idle < static_cast<std::size_t>(avatars)) {
    const auto message = client.Receive();
    if (!message) break;
    if (const auto* events = std::get_if<protocol::Events>(&*message)) {
      for (const protocol::Event& event : events->events) {
        if (event.type == EventType::kStarted && event.request_id == 1) {
          started[event.avatar] = event.tick;
        }
        // Avatars that were idle before their request have an idle event as well.
        if (event.type == EventType::kIdle && started.contains(event.avatar)) ++idle;
      }
    } else if (const auto* batch = std::get_if<protocol::PoseBatch>(&*message)) {
      protocol::PoseBatchReader reader(*batch, nullptr);
      for (std::size_t i = 0; i < batch->avatars.size(); ++i) {
        const auto pose = reader.Next();
        by_tick[batch->avatars[i]][batch->info.tick].assign(pose.begin(), pose.end());
      }
    }
  }
  EXPECT_EQ(server.metrics().Sum(&ThreadMetrics::ticks_slipped), 0u);
  for (const auto& [avatar, tick] : started) {
    for (auto& [at, pose] : by_tick[avatar]) {
      if (at >= tick) streams[avatar][at - tick] = std::move(pose);
    }
  }
  return streams;
}

// Returns the same poses without a server.
PoseStreams PlayAlone(int avatars, PoseMode mode, const PoseStreams& like) {
  PoseStreams streams;
  for (int i = 1; i <= avatars; ++i) {
    const auto number = static_cast<AvatarId>(i);
    const protocol::Placement start = Start(number);
    AvatarSimulation avatar(MakeTestLibrary(), {start.position_m, start.heading_rad},
                            {.idle_motion = false, .stride_variation = true, .seed = number});
    const auto step = [&](double length_m) {
      return MovementRequest{1, StepRequest{.length_m = length_m}};
    };
    EXPECT_TRUE(avatar.Enqueue(step(0.3 + 0.02 * number)));
    EXPECT_TRUE(avatar.Enqueue(step(0.5)));
    EXPECT_TRUE(avatar.Enqueue({1, StandRequest{0.1}}));
    EXPECT_TRUE(avatar.Enqueue({1, JumpRequest{.length_m = 0.7}}));
    EXPECT_TRUE(avatar.Enqueue({1, StepRequest{.foot = Foot::kLeft, .length_m = 0.2}}));
    const std::uint64_t last = like.at(number).rbegin()->first;
    for (std::uint64_t tick = 0; tick <= last; ++tick) {
      avatar.Advance(1.0 / 60.0);
      const ConstPoseSpan pose = avatar.pose();
      std::vector<std::byte>& bytes = streams[number][tick];
      bytes.resize(protocol::PoseBytes(mode, pose.rotations.size()));
      EXPECT_TRUE(
          protocol::EncodePose(mode, pose.root_position_m, pose.rotations, bytes).has_value());
    }
  }
  return streams;
}

void ExpectSameWhereBothHave(const PoseStreams& a, const PoseStreams& b) {
  ASSERT_EQ(a.size(), b.size());
  for (const auto& [avatar, poses] : a) {
    std::size_t common = 0;
    for (const auto& [tick, pose] : poses) {
      const auto other = b.at(avatar).find(tick);
      if (other == b.at(avatar).end()) continue;  // the server missed this tick
      ++common;
      ASSERT_EQ(pose, other->second) << "avatar " << avatar << ", tick " << tick;
    }
    EXPECT_GE(common, 20u) << "avatar " << avatar;
  }
}

TEST(ServerWorld, SpreadsTheStartsOfALargeCommand) {
  server::Config config = TestConfig(2);
  config.limits.starts_per_tick = 16;
  TestServer server(config);
  auto [client, world] = server.Enter("crowd");
  std::vector<protocol::SpawnItem> spawns;
  for (AvatarId avatar = 1; avatar <= 48; ++avatar) spawns.push_back({avatar, Start(avatar)});
  ASSERT_TRUE(client.Spawn(world->world, spawns));
  const auto held = [&] { return server.metrics().Sum(Limit::kStartsPerTick); };
  const auto ask = [&](AvatarId count, int steps) {
    std::vector<protocol::RequestItem> items;
    for (AvatarId avatar = 1; avatar <= count; ++avatar) {
      for (int i = 0; i < steps; ++i) {
        items.push_back({.avatar = avatar,
                         .request_id = 1,
                         .movement = protocol::StepMovement{.length_m = 0.4}});
      }
    }
    const auto reply = client.Request(world->world, items);
    return reply ? reply->accepted : 0;
  };
  EXPECT_EQ(ask(16, 5), 80u);  // several movements of one avatar count as one start
  EXPECT_EQ(held(), 0u);
  EXPECT_EQ(ask(48, 1), 48u);
  std::uint64_t expected = 0;
  for (AvatarId avatar = 1; avatar <= 48; ++avatar) expected += server::StartTickOf(avatar, 3) > 0;
  EXPECT_EQ(held(), expected);
}

TEST(ServerWorld, SpreadsSpawnsOverTicks) {
  constexpr AvatarId kCrowd = 60;
  server::Config config = TestConfig(2);
  config.limits.spawns_per_tick = 4;
  TestServer server(config);
  auto [crowd, world] = server.Enter("crowd");
  auto [other, same_world] = server.Enter("other");
  std::vector<protocol::SpawnItem> spawns;
  for (AvatarId avatar = 1; avatar <= kCrowd; ++avatar) spawns.push_back({avatar, Start(avatar)});
  spawns.push_back({7, Start(7)});  // exists already
  const protocol::Seq spawn_seq = crowd.NextSeq();
  crowd.Send(protocol::Spawn{.seq = spawn_seq, .world = world->world, .items = spawns});
  // Later commands of the session are executed after the spawn.
  const protocol::Seq ask_seq = crowd.NextSeq();
  crowd.Send(protocol::Request{
      .seq = ask_seq,
      .world = world->world,
      .items = {{.avatar = kCrowd, .request_id = 1, .movement = protocol::StepMovement{}}}});
  const auto other_reply = other.Spawn(same_world->world, {{1000, Start(1)}});
  ASSERT_TRUE(other_reply);
  EXPECT_EQ(other_reply->accepted, 1u);
  std::vector<Reply> replies;
  while (replies.size() < 2) {
    const auto message = crowd.Receive();
    ASSERT_TRUE(message);
    if (const auto* reply = std::get_if<Reply>(&*message)) replies.push_back(*reply);
  }
  // The shards may finish at different ticks.
  if (replies[0].seq == ask_seq) std::swap(replies[0], replies[1]);
  EXPECT_EQ(replies[0].seq, spawn_seq);
  EXPECT_EQ(replies[0].accepted, kCrowd);
  ASSERT_EQ(replies[0].items.size(), spawns.size());
  for (std::uint32_t i = 0; i < spawns.size(); ++i) {
    EXPECT_EQ(replies[0].items[i].index, i);
    EXPECT_EQ(replies[0].items[i].code, i < kCrowd ? StatusCode::kOk : StatusCode::kAvatarExists);
  }
  EXPECT_EQ(replies[1].seq, ask_seq);
  EXPECT_EQ(replies[1].accepted, 1u);
  // In the first tick of each shard, the other client may have used a part of the limit.
  EXPECT_GE(server.metrics().Sum(Limit::kSpawnsPerTick), kCrowd + 1 - 2 * 4);
  EXPECT_LE(server.metrics().Sum(Limit::kSpawnsPerTick), kCrowd + 1 - 2 * 2);
}

TEST(ServerWorld, ProducesIdenticalBytesForAnyNumberOfShards) {
  constexpr int kAvatars = 6;
  const PoseStreams one = PlayOnServer(1, kAvatars, PoseMode::kFull);
  ASSERT_EQ(one.size(), static_cast<std::size_t>(kAvatars));
  // The bytes are also identical to those without a server.
  ExpectSameWhereBothHave(one, PlayAlone(kAvatars, PoseMode::kFull, one));
  for (const int shards : {2, 4}) {
    SCOPED_TRACE(shards);
    ExpectSameWhereBothHave(one, PlayOnServer(shards, kAvatars, PoseMode::kFull));
  }
  // Compact poses are encoded in batches with other avatars, which depend on the shards.
  const PoseStreams compact = PlayOnServer(1, kAvatars, PoseMode::kQuantised);
  ExpectSameWhereBothHave(compact, PlayOnServer(4, kAvatars, PoseMode::kQuantised));
}

// Each session receives only the detail that it requested, and other details are not encoded.
TEST(ServerWorld, SendsPosesInTheRequestedDetail) {
  using protocol::PoseDetail;
  TestServer server(TestConfig(2));
  RawClient client = server.Connect();
  RawClient other = server.Connect();
  ASSERT_TRUE(client.SayHello() && other.SayHello());
  const auto world = client.Join("w");
  ASSERT_TRUE(world && other.Join("w", protocol::Role::kObserver));
  const auto observe = [&](RawClient& who, PoseDetail detail, std::uint16_t every_n_ticks = 1) {
    who.Send(protocol::Observe{.seq = who.NextSeq(),
                               .world = world->world,
                               .subscription = 1 + static_cast<std::uint32_t>(detail),
                               .mode = PoseMode::kQuantised,
                               .avatars = {},
                               .every_n_ticks = every_n_ticks,
                               .with_events = false,
                               .detail = detail});
    return who.Await<protocol::Reply>()->code;
  };
  EXPECT_EQ(observe(other, PoseDetail::kAll), StatusCode::kOk);

  std::vector<std::int16_t> parents;
  for (const protocol::JointInfo& joint : world->skeleton.joints) parents.push_back(joint.parent);
  const auto codecs =
      protocol::CompactCodecs::Make(world->rotation_quantizations, parents, world->reduced_joints)
          .value();
  ASSERT_TRUE(client.Spawn(world->world, {{.avatar = 1}}));
  ASSERT_TRUE(client.Request(world->world, Steps(1, 40, 0.6)));
  constexpr std::array kDetails{PoseDetail::kAll, PoseDetail::kReduced, PoseDetail::kRoot};
  // Root poses are sent half as often.
  for (const PoseDetail detail : kDetails) {
    ASSERT_EQ(observe(client, detail, detail == PoseDetail::kRoot ? 2 : 1), StatusCode::kOk);
  }
  std::map<std::uint64_t, std::map<PoseMode, std::vector<Quat>>> seen;
  std::map<PoseMode, std::size_t> bytes;
  std::map<PoseMode, int> counts;
  while (counts[PoseMode::kCompactRoot] < 20) {
    const auto batch = client.Await<protocol::PoseBatch>();
    ASSERT_TRUE(batch);
    const PoseMode mode = batch->info.mode;
    if (batch->avatars.empty()) continue;  // from a shard without avatars
    ASSERT_NE(codecs.Find(mode), nullptr);
    EXPECT_EQ(mode == PoseMode::kCompactRoot ? batch->info.tick % 2 : 0, 0u);
    protocol::PoseBatchReader reader(*batch, codecs.Find(mode));
    bytes[mode] = std::max(bytes[mode], reader.Next().size());
    Vec3 root;
    std::vector<Quat>& rotations = seen[batch->info.tick][mode];
    rotations.resize(parents.size());
    ASSERT_TRUE(reader.Decode(root, rotations));
    ++counts[mode];
  }
  EXPECT_EQ(bytes[PoseMode::kCompactRoot], 18u);
  // The test skeleton has hardly any joints that could be omitted.
  EXPECT_LE(bytes[PoseMode::kCompactReduced], bytes[PoseMode::kCompact]);
  int compared = 0;
  for (const auto& [tick, modes] : seen) {
    if (modes.size() < 3) continue;
    ++compared;
    for (std::size_t j = 0; j < parents.size(); ++j) {
      const bool is_included =
          std::ranges::binary_search(world->reduced_joints, static_cast<std::uint16_t>(j));
      const Quat& reference = world->rotation_quantizations[j].reference;
      const Quat& all = modes.at(PoseMode::kCompact)[j];
      EXPECT_EQ(modes.at(PoseMode::kCompactReduced)[j], is_included ? all : reference) << j;
      EXPECT_EQ(modes.at(PoseMode::kCompactRoot)[j], j == 0 ? all : reference) << j;
    }
  }
  EXPECT_GT(compared, 10);
}

// Compares the poses that two observers of one avatar receive in the same ticks.
TEST(ServerWorld, SendsQuantisedPosesInCompactMode) {
  TestServer server(TestConfig(1));
  RawClient quantised = server.Connect();
  RawClient full = server.Connect();
  ASSERT_TRUE(quantised.SayHello() && full.SayHello());
  const auto world = quantised.Join("w");
  ASSERT_TRUE(world && full.Join("w", protocol::Role::kObserver));
  ASSERT_EQ(world->rotation_quantizations.size(), world->skeleton.joints.size());
  std::vector<std::int16_t> parents;
  for (const protocol::JointInfo& joint : world->skeleton.joints) parents.push_back(joint.parent);
  const auto codec = protocol::CompactCodec::Make(world->rotation_quantizations, parents).value();
  ASSERT_LT(codec.pose_bytes(), protocol::PoseBytes(PoseMode::kQuantised, parents.size()));

  ASSERT_TRUE(quantised.Spawn(world->world, {{.avatar = 1}}));
  ASSERT_TRUE(quantised.Request(world->world, Steps(1, 20, 0.6)));
  ASSERT_EQ(quantised.Observe(world->world, 1, PoseMode::kQuantised)->code, StatusCode::kOk);
  ASSERT_EQ(full.Observe(world->world, 1, PoseMode::kFull)->code, StatusCode::kOk);
  std::map<std::uint64_t, std::vector<Quat>> seen;
  std::size_t bytes = 0;
  while (seen.size() < 30) {
    const auto batch = quantised.Await<protocol::PoseBatch>();
    ASSERT_TRUE(batch);
    ASSERT_EQ(batch->info.mode, PoseMode::kCompact);
    ASSERT_THAT(batch->avatars, ElementsAre(1u));
    protocol::PoseBatchReader reader(*batch, &codec);
    bytes += reader.Next().size();
    Vec3 root;
    std::vector<Quat>& rotations = seen[batch->info.tick];
    rotations.resize(parents.size());
    ASSERT_TRUE(reader.Decode(root, rotations));
  }
  EXPECT_LE(bytes, 30 * codec.pose_bytes() + 200);
  int compared = 0;
  while (compared < 5) {
    const auto batch = full.Await<protocol::PoseBatch>();
    ASSERT_TRUE(batch);
    ASSERT_EQ(batch->info.mode, PoseMode::kFull);
    if (!seen.contains(batch->info.tick)) continue;
    ++compared;
    Vec3 root;
    std::vector<Quat> rotations(parents.size());
    ASSERT_TRUE(protocol::DecodePose(
        PoseMode::kFull, protocol::PoseBatchReader(*batch, nullptr).Next(), root, rotations));
    for (std::size_t j = 0; j < parents.size(); ++j) {
      // Each joint compensates the errors of its ancestors: up to two errors of 0.23 degrees.
      EXPECT_LE(AngleBetween(rotations[j], seen[batch->info.tick][j]), 0.009) << j;
    }
  }
}

// ---- subscriptions

TEST(ServerWorld, SendsPosesAsSubscribed) {
  TestServer server;
  auto [controller, world] = server.Enter("w");
  ASSERT_TRUE(controller.Spawn(world->world, {{.avatar = 1}, {.avatar = 2}, {.avatar = 3}}));

  RawClient watcher = server.Enter("w", protocol::Role::kObserver).first;
  ASSERT_EQ(watcher.Observe(world->world, 1, PoseMode::kQuantised, false, 4)->code,
            StatusCode::kOk);
  // A second subscription of the same mode adds no copies: one stream serves intervals 6 and 4.
  ASSERT_EQ(watcher.Observe(world->world, 2, PoseMode::kQuantised, false, 6)->code,
            StatusCode::kOk);
  std::map<std::pair<std::uint64_t, int>, int> seen;
  for (int i = 0; i < 40; ++i) {
    const auto message = watcher.Receive();
    ASSERT_TRUE(message);
    // An observer that did not request events receives none.
    ASSERT_FALSE(std::holds_alternative<protocol::Events>(*message));
    const auto* batch = std::get_if<protocol::PoseBatch>(&*message);
    if (batch == nullptr) continue;
    EXPECT_EQ(batch->info.mode, PoseMode::kCompact);
    EXPECT_EQ(batch->info.joint_count, 7);
    EXPECT_TRUE(batch->info.tick % 4 == 0 || batch->info.tick % 6 == 0);
    EXPECT_EQ((++seen[{batch->info.tick, batch->info.shard}]), 1);
    for (const AvatarId avatar : batch->avatars) {
      EXPECT_EQ(avatar % 2, batch->info.shard);
    }
  }
  // After the last subscription has ended, no poses are encoded.
  watcher.Send(protocol::StopObserving{.seq = watcher.NextSeq(), .subscription = 1});
  ASSERT_TRUE(watcher.Await<Reply>());
  watcher.Send(protocol::StopObserving{.seq = watcher.NextSeq(), .subscription = 2});
  ASSERT_TRUE(watcher.Await<Reply>());
  EXPECT_TRUE(Eventually([&] {
    const auto before = server.metrics().Sum(&ThreadMetrics::poses_encoded);
    std::this_thread::sleep_for(150ms);
    return server.metrics().Sum(&ThreadMetrics::poses_encoded) == before;
  }));
}

TEST(ServerWorld, FlagsDiscontinuities) {
  TestServer server(TestConfig(1));
  auto [client, world] = server.Enter("w");
  ASSERT_TRUE(client.Observe(world->world, 1, PoseMode::kFull));
  ASSERT_TRUE(client.Spawn(world->world, {{.avatar = 1}}));
  auto batch = client.Await<protocol::PoseBatch>();
  ASSERT_TRUE(batch);
  ASSERT_THAT(batch->avatars, ElementsAre(1u));
  EXPECT_EQ(batch->flags[0] & protocol::kPoseDiscontinuity, protocol::kPoseDiscontinuity);
  EXPECT_EQ(batch->flags[0] & protocol::kPoseStanding, protocol::kPoseStanding);
  batch = client.Await<protocol::PoseBatch>();
  ASSERT_TRUE(batch);
  EXPECT_EQ(batch->flags[0] & protocol::kPoseDiscontinuity, 0);

  // The removal of the last avatar causes one empty batch.
  client.Send(protocol::Remove{.seq = client.NextSeq(), .world = world->world, .avatars = {1}});
  do {
    batch = client.Await<protocol::PoseBatch>();
    ASSERT_TRUE(batch);
  } while (!batch->avatars.empty());
}

// A session that selects avatars receives exactly these from all shards, unless one of its
// subscriptions covers all avatars.
TEST(ServerWorld, SendsOnlySelectedAvatars) {
  TestServer server(TestConfig(2));
  auto [controller, world] = server.Enter("w");
  std::vector<protocol::SpawnItem> items;
  for (AvatarId avatar = 1; avatar <= 20; ++avatar)
    items.push_back({.avatar = avatar, .start = {}});
  ASSERT_EQ(controller.Spawn(world->world, items)->accepted, 20u);
  RawClient client = server.Enter("w", protocol::Role::kObserver).first;
  std::map<std::uint16_t, std::vector<AvatarId>> last;  // by shard
  const auto observe = [&](protocol::SubscriptionId id, std::vector<AvatarId> avatars) {
    client.Send(protocol::Observe{.seq = client.NextSeq(),
                                  .world = world->world,
                                  .subscription = id,
                                  .mode = PoseMode::kQuantised,
                                  .avatars = std::move(avatars)});
    const auto reply = client.Await<Reply>();
    return reply ? reply->code : StatusCode::kInternal;
  };
  // Receives batches until the last batch of each shard contains exactly these avatars.
  const auto shows = [&](std::vector<AvatarId> even, std::vector<AvatarId> odd) {
    for (int i = 0; i < 200; ++i) {
      const auto batch = client.Await<protocol::PoseBatch>();
      if (!batch) return false;
      last[batch->info.shard].assign(batch->avatars.begin(), batch->avatars.end());
      if (last[0] == even && last[1] == odd) return true;
    }
    return false;
  };
  ASSERT_EQ(observe(1, {4, 6, 99}), StatusCode::kOk);
  EXPECT_TRUE(shows({4, 6}, {}));
  ASSERT_EQ(observe(2, {6, 7, 2}), StatusCode::kOk);
  EXPECT_TRUE(shows({2, 4, 6}, {7}));
  EXPECT_GT(server.metrics().Sum(&ThreadMetrics::batches_composed), 0u);
  // One avatar is spawned later, another is removed.
  ASSERT_EQ(controller.Spawn(world->world, {{.avatar = 99, .start = {}}})->accepted, 1u);
  EXPECT_TRUE(shows({2, 4, 6}, {7, 99}));
  controller.Send(
      protocol::Remove{.seq = controller.NextSeq(), .world = world->world, .avatars = {7, 99, 4}});
  EXPECT_TRUE(shows({2, 6}, {}));
  client.Send(protocol::StopObserving{.seq = client.NextSeq(), .subscription = 1});
  ASSERT_EQ(client.Await<Reply>()->code, StatusCode::kOk);
  EXPECT_TRUE(shows({2, 6}, {}));
  // A subscription to all avatars.
  ASSERT_EQ(observe(3, {}), StatusCode::kOk);
  EXPECT_TRUE(shows({2, 6, 8, 10, 12, 14, 16, 18, 20}, {1, 3, 5, 9, 11, 13, 15, 17, 19}));
  client.Send(protocol::StopObserving{.seq = client.NextSeq(), .subscription = 3});
  ASSERT_EQ(client.Await<Reply>()->code, StatusCode::kOk);
  EXPECT_TRUE(shows({2, 6}, {}));
}

// A region moves along a row of avatars that stand 1 m apart.
TEST(ServerWorld, TracksAMovingRegion) {
  TestServer server(TestConfig(2));
  auto [controller, world] = server.Enter("w");
  ASSERT_EQ(controller.Spawn(world->world, OnALine(60))->accepted, 60u);

  RawClient player = server.Enter("w", protocol::Role::kObserver).first;
  std::set<AvatarId> inside;
  std::map<AvatarId, std::uint64_t> seen;  // tick of the last pose
  std::uint64_t last_number = 0;
  const auto take = [&](const protocol::Message& message) {
    if (const auto* events = std::get_if<protocol::Events>(&message)) {
      EXPECT_EQ(events->number, ++last_number);
      for (const protocol::Event& event : events->events) {
        const bool was_inside = inside.contains(event.avatar);
        EXPECT_EQ(event.type, was_inside ? EventType::kLeft : EventType::kEntered);
        if (was_inside) {
          inside.erase(event.avatar);
        } else {
          inside.insert(event.avatar);
        }
      }
    } else if (const auto* batch = std::get_if<protocol::PoseBatch>(&message)) {
      EXPECT_TRUE(batch->info.is_partial);
      EXPECT_FALSE(batch->avatars.empty());
      for (const AvatarId avatar : batch->avatars) seen[avatar] = batch->info.tick;
    }
  };
  const auto observe = [&](double x, bool replace, double radius_m = 5.4) {
    protocol::Observe asked{.seq = player.NextSeq(),
                            .world = world->world,
                            .subscription = 1,
                            .mode = PoseMode::kQuantised};
    asked.region = protocol::Region{{x, 0.0}, radius_m, 3.0, {}, {}};
    asked.replace = replace;
    player.Send(asked);
    const auto reply = player.Await<Reply>(take);
    return reply ? reply->code : StatusCode::kInternal;
  };
  const auto shows = [&](AvatarId first, AvatarId last) {
    std::set<AvatarId> expected;
    for (AvatarId avatar = first; avatar <= last; ++avatar) expected.insert(avatar);
    for (int i = 0; i < 300 && inside != expected; ++i) {
      const auto message = player.Receive();
      if (!message) break;
      take(*message);
    }
    EXPECT_EQ(inside, expected);
    // All avatars inside receive poses in later ticks.
    seen.clear();
    for (int i = 0; i < 300 && seen.size() < expected.size(); ++i) {
      const auto message = player.Receive();
      if (!message) break;
      take(*message);
    }
    return inside == expected && seen.size() >= expected.size();
  };
  EXPECT_EQ(observe(20.0, true), StatusCode::kNoSuchSubscription);
  ASSERT_EQ(observe(20.0, false), StatusCode::kOk);
  EXPECT_TRUE(shows(15, 25));
  EXPECT_EQ(observe(20.0, false), StatusCode::kSubscriptionExists);
  // Avatars behind the region stay members for another 3 m.
  ASSERT_EQ(observe(23.0, true), StatusCode::kOk);
  EXPECT_TRUE(shows(15, 28));
  ASSERT_EQ(observe(40.0, true), StatusCode::kOk);
  EXPECT_TRUE(shows(35, 45));
  EXPECT_NE(server.metrics().Text().find("stridewire_regions 1\n"), std::string::npos);
  // An avatar that is removed from the world leaves the region.
  controller.Send(
      protocol::Remove{.seq = controller.NextSeq(), .world = world->world, .avatars = {45, 44}});
  EXPECT_TRUE(shows(35, 43));
  // A region must be the only subscription of its world.
  player.Send(protocol::Observe{.seq = player.NextSeq(), .world = world->world, .subscription = 2});
  EXPECT_EQ(player.Await<Reply>(take)->code, StatusCode::kNotAllowed);
}

/// The poses that an observer of a region receives.
struct Heard {
  std::map<AvatarId, PoseMode> mode;  // of the last pose
  std::map<AvatarId, std::set<std::uint64_t>> ticks;
  std::map<AvatarId, int> entered;
  std::map<AvatarId, int> left;

  void Take(const protocol::Message& message) {
    if (const auto* events = std::get_if<protocol::Events>(&message)) {
      for (const protocol::Event& event : events->events) {
        ++(event.type == EventType::kEntered ? entered : left)[event.avatar];
      }
    } else if (const auto* batch = std::get_if<protocol::PoseBatch>(&message)) {
      EXPECT_TRUE(batch->info.is_partial);
      for (const AvatarId avatar : batch->avatars) {
        mode[avatar] = batch->info.mode;
        // One pose per tick, for any number of levels of detail.
        EXPECT_TRUE(ticks[avatar].insert(batch->info.tick).second) << avatar;
      }
    }
  }
};

// Avatars in a row, 1 m apart: near ones with all joints in every tick, then reduced joints, then
// the root only.
TEST(ServerWorld, SendsEachRingInItsDetailAndInterval) {
  TestServer server(TestConfig(2));
  auto [controller, world] = server.Enter("w");
  ASSERT_EQ(controller.Spawn(world->world, OnALine(60))->accepted, 60u);
  RawClient player = server.Enter("w", protocol::Role::kObserver).first;
  Heard heard;
  const auto take = [&](const protocol::Message& message) { heard.Take(message); };
  protocol::Observe asked{.world = world->world,
                          .subscription = 1,
                          .mode = PoseMode::kQuantised,
                          .every_n_ticks = 4,
                          .detail = protocol::PoseDetail::kRoot};
  asked.region = protocol::Region{{0.0, 0.0}, 40.5, 3.0, {{10.5, 1}, {20.5, 2}}, {}};
  asked.region->ring_details = {protocol::PoseDetail::kAll, protocol::PoseDetail::kReduced};
  const auto observe = [&] {
    asked.seq = player.NextSeq();
    player.Send(asked);
    const auto reply = player.Await<Reply>(take);
    return reply ? reply->code : StatusCode::kInternal;
  };
  const auto hear = [&](int count) {
    for (int i = 0; i < count; ++i) {
      const auto message = player.Receive();
      ASSERT_TRUE(message);
      heard.Take(*message);
    }
  };
  const auto shows = [&](AvatarId first, AvatarId last, PoseMode mode) {
    for (AvatarId avatar = first; avatar <= last; ++avatar) {
      EXPECT_EQ(heard.mode[avatar], mode) << avatar;
    }
  };
  ASSERT_EQ(observe(), StatusCode::kOk);
  hear(100);
  heard.ticks.clear();
  hear(200);  // two shards: 3.5 batches per tick
  shows(1, 10, PoseMode::kCompact);
  shows(11, 20, PoseMode::kCompactReduced);
  shows(21, 40, PoseMode::kCompactRoot);
  EXPECT_EQ(heard.mode.size(), 40u);
  for (const auto& [avatar, ticks] : heard.ticks) {
    const std::uint64_t every = avatar <= 10 ? 1 : avatar <= 20 ? 2 : 4;
    for (const std::uint64_t tick : ticks) EXPECT_EQ(tick % every, 0u) << avatar;
    // The server may miss ticks, but always for all avatars of a shard.
    const auto due = std::ranges::count_if(heard.ticks[2 - avatar % 2],
                                           [&](std::uint64_t tick) { return tick % every == 0; });
    EXPECT_GE(due, 3) << avatar;
    EXPECT_NEAR(static_cast<double>(ticks.size()), static_cast<double>(due), 2.0) << avatar;
  }
  EXPECT_EQ(heard.entered.size(), 40u);

  // The region moves by 5 m. Avatars that are in another ring now neither enter nor leave.
  asked.region->centre_m.x = 5.0;
  asked.replace = true;
  ASSERT_EQ(observe(), StatusCode::kOk);
  hear(100);
  shows(1, 15, PoseMode::kCompact);
  shows(16, 25, PoseMode::kCompactReduced);
  shows(26, 45, PoseMode::kCompactRoot);
  // Without details of rings, the detail of the subscription applies everywhere.
  asked.region->ring_details.clear();
  ASSERT_EQ(observe(), StatusCode::kOk);
  hear(100);
  shows(1, 45, PoseMode::kCompactRoot);
  EXPECT_EQ(heard.entered.size(), 45u);
  for (const auto& [avatar, times] : heard.entered) EXPECT_EQ(times, 1) << avatar;
  EXPECT_TRUE(heard.left.empty());

  // Moving a region requires the same detail beyond its rings.
  asked.detail = protocol::PoseDetail::kReduced;
  EXPECT_EQ(observe(), StatusCode::kNoSuchSubscription);
}

// An avatar walks from ring to ring, to one whose poses are sent once per minute. Then it is
// removed.
TEST(ServerWorld, ReportsLeavingFromARingWithALongInterval) {
  TestServer server(TestConfig(2));
  auto [controller, world] = server.Enter("w");
  ASSERT_EQ(
      controller.Spawn(world->world, {{.avatar = 7, .start = {{0.0, 0.0, 1.9}, 0.0}}})->accepted,
      1u);
  RawClient player = server.Enter("w", protocol::Role::kObserver).first;
  Heard heard;
  const auto take = [&](const protocol::Message& message) { heard.Take(message); };
  protocol::Observe asked{.seq = player.NextSeq(),
                          .world = world->world,
                          .subscription = 1,
                          .mode = PoseMode::kQuantised,
                          .every_n_ticks = 3600,
                          .detail = protocol::PoseDetail::kRoot};
  asked.region = protocol::Region{{0.0, 0.0}, 40.0, 3.0, {{2.0, 1}, {2.3, 1}}, {}};
  asked.region->ring_details = {protocol::PoseDetail::kAll, protocol::PoseDetail::kReduced};
  player.Send(asked);
  ASSERT_EQ(player.Await<Reply>(take)->code, StatusCode::kOk);
  const auto hear_until = [&](auto&& condition) {
    while (!condition()) {
      const auto message = player.Receive();
      if (!message) return false;
      heard.Take(*message);
    }
    return true;
  };
  ASSERT_TRUE(hear_until([&] { return heard.entered[7] == 1 && heard.mode.contains(7); }));
  EXPECT_EQ(heard.mode[7], PoseMode::kCompact);
  ASSERT_TRUE(controller.Request(world->world, Steps(7, 3, 0.5)));
  for (int finished = 0; finished < 3;) {
    const auto events = controller.Await<protocol::Events>();
    ASSERT_TRUE(events);
    for (const protocol::Event& event : events->events) {
      finished += event.type == EventType::kFinished;
    }
  }
  controller.Send(
      protocol::Remove{.seq = controller.NextSeq(), .world = world->world, .avatars = {7}});
  EXPECT_TRUE(hear_until([&] { return heard.left[7] == 1; }));
  EXPECT_EQ(heard.entered[7], 1);
  EXPECT_EQ(heard.mode[7], PoseMode::kCompactReduced);
}

TEST(ServerWorld, SendsEventsToSubscribersAndControllers) {
  TestServer server;
  RawClient controller = server.Connect();
  RawClient other = server.Connect();
  RawClient watcher = server.Connect();
  ASSERT_TRUE(controller.SayHello());
  ASSERT_TRUE(other.SayHello());
  ASSERT_TRUE(watcher.SayHello());
  const auto world = controller.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(other.Join("w"));
  ASSERT_TRUE(watcher.Join("w", protocol::Role::kObserver));
  ASSERT_TRUE(watcher.Observe(world->world, 1, PoseMode::kFull, true));
  ASSERT_TRUE(controller.Spawn(world->world, {{.avatar = 4, .start = {{1, 2, 3}, 4}}}));
  for (RawClient* client : {&other, &watcher}) {
    const auto events = client->Await<protocol::Events>();
    ASSERT_TRUE(events);
    EXPECT_EQ(events->number, 1u);
    EXPECT_EQ(events->events[0].type, EventType::kSpawned);
    EXPECT_EQ(events->events[0].avatar, 4u);
    EXPECT_EQ(events->events[0].base, (protocol::Placement{{1, 2, 3}, 4}));
  }
}

TEST(ServerWorld, IsCreatedWhenJoinedAndRemovedWhenLeft) {
  server::Config config = TestConfig();
  config.open_worlds = false;
  config.worlds["known"] = {};
  TestServer server(config);
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  client.Send(protocol::JoinWorld{.seq = client.NextSeq(), .name = "unknown"});
  const auto refused = client.Await<Reply>();
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->code, StatusCode::kNoSuchWorld);
  const auto world = client.Join("known");
  ASSERT_TRUE(world);
  ASSERT_TRUE(client.Spawn(world->world, {{.avatar = 1}}));
  EXPECT_NE(server.metrics().Text().find("stridewire_worlds 1\n"), std::string::npos);
  client.Send(protocol::LeaveWorld{.seq = client.NextSeq(), .world = world->world});
  ASSERT_TRUE(client.Await<Reply>());
  EXPECT_TRUE(Eventually(
      [&] { return server.metrics().Text().find("stridewire_worlds 0\n") != std::string::npos; }));
  // Joining again creates another world.
  const auto again = client.Join("known");
  ASSERT_TRUE(again);
  EXPECT_NE(again->world, world->world);
}

// ---- limits

TEST(ServerLimits, AreEnforcedAndCounted) {
  server::Config config = TestConfig(2);
  config.limits.max_worlds = 2;
  config.limits.max_worlds_per_session = 2;
  config.limits.max_avatars_per_world = 3;
  config.limits.max_avatars = 4;
  config.limits.max_queue = 2;
  config.limits.max_subscriptions = 2;
  config.limits.max_named_avatars = 3;
  config.limits.max_sessions_per_address = 2;
  TestServer server(config);
  const auto reached = [&](Limit limit) { return server.metrics().Sum(limit); };
  auto [client, a] = server.Enter("a");
  const auto b = client.Join("b");
  ASSERT_TRUE(a && b);
  client.Send(protocol::JoinWorld{.seq = client.NextSeq(), .name = "c"});
  EXPECT_EQ(client.Await<Reply>()->code, StatusCode::kLimitReached);
  EXPECT_EQ(reached(Limit::kWorldsPerSession), 1u);

  auto spawned = client.Spawn(a->world, {{}, {}, {}, {}});
  ASSERT_TRUE(spawned);
  EXPECT_EQ(spawned->accepted, 3u);
  EXPECT_EQ(spawned->items[3].code, StatusCode::kLimitReached);
  EXPECT_EQ(reached(Limit::kAvatarsPerWorld), 1u);
  spawned = client.Spawn(b->world, {{}, {}});
  ASSERT_TRUE(spawned);
  EXPECT_EQ(spawned->accepted, 1u);
  EXPECT_EQ(reached(Limit::kAvatars), 1u);
  // Removing an avatar makes room for another.
  client.Send(protocol::Remove{.seq = client.NextSeq(), .world = a->world, .avatars = {1, 2}});
  ASSERT_TRUE(client.Await<Reply>());
  EXPECT_EQ(client.Spawn(b->world, {{}, {}})->accepted, 2u);

  const auto requested = client.Request(a->world, Steps(3, 8, 0.5));
  ASSERT_TRUE(requested);
  EXPECT_EQ(requested->accepted, 2u);
  ASSERT_EQ(requested->items.size(), 6u);
  EXPECT_EQ(requested->items[0].code, StatusCode::kQueueFull);
  EXPECT_EQ(reached(Limit::kQueue), 6u);

  ASSERT_EQ(client.Observe(a->world, 1, PoseMode::kFull)->code, StatusCode::kOk);
  client.Send(protocol::Observe{
      .seq = client.NextSeq(), .world = a->world, .subscription = 2, .avatars = {1, 2, 3, 4}});
  EXPECT_EQ(client.Await<Reply>()->code, StatusCode::kLimitReached);
  EXPECT_EQ(reached(Limit::kNamedAvatars), 1u);
  ASSERT_EQ(client.Observe(a->world, 2, PoseMode::kFull)->code, StatusCode::kOk);
  EXPECT_EQ(client.Observe(a->world, 3, PoseMode::kFull)->code, StatusCode::kLimitReached);
  EXPECT_EQ(reached(Limit::kSubscriptions), 1u);

  RawClient second = server.Connect();
  ASSERT_TRUE(second.SayHello());
  second.Send(protocol::JoinWorld{.seq = second.NextSeq(), .name = "c"});
  EXPECT_EQ(second.Await<Reply>()->code, StatusCode::kLimitReached);
  EXPECT_EQ(reached(Limit::kWorlds), 1u);

  RawClient third = server.Connect();
  third.Send(protocol::Hello{.client_name = "third"});
  const auto notice = third.Await<protocol::ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kLimitReached);
  EXPECT_EQ(reached(Limit::kSessionsPerAddress), 1u);
}

TEST(ServerLimits, LimitTheNumberOfSessions) {
  server::Config config = TestConfig();
  config.limits.max_sessions = 1;
  TestServer server(config);
  RawClient first = server.Connect();
  ASSERT_TRUE(first.SayHello());
  RawClient second = server.Connect();
  second.Send(protocol::Hello{.client_name = "second"});
  const auto notice = second.Await<protocol::ErrorNotice>();
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kLimitReached);
  EXPECT_EQ(server.metrics().Sum(Limit::kSessions), 1u);
  // A session that ends makes room for another.
  first.Send(protocol::Goodbye{});
  ASSERT_TRUE(first.AwaitClose());
  EXPECT_TRUE(Eventually([&] {
    RawClient next = server.Connect();
    next.Send(protocol::Hello{.client_name = "next"});
    const auto answer = next.Receive();
    return answer && std::holds_alternative<protocol::Welcome>(*answer);
  }));
}

TEST(ServerLimits, LimitTheNumberOfHandshakes) {
  server::Config config = TestConfig();
  config.limits.max_handshakes = 2;
  TestServer server(config);
  const RawClient first = server.Connect();
  const RawClient second = server.Connect();
  RawClient third = server.Connect();
  EXPECT_TRUE(third.AwaitClose());
  EXPECT_EQ(server.metrics().Sum(Limit::kHandshakes), 1u);
}

TEST(ServerLimits, LimitItemsPerSecond) {
  server::Config config = TestConfig();
  config.limits.requests_per_s = 1;
  config.limits.request_burst = 10;
  TestServer server(config);
  auto [client, world] = server.Enter("w");
  ASSERT_EQ(client.Spawn(world->world, {{.avatar = 1}})->code, StatusCode::kOk);
  EXPECT_EQ(client.Request(world->world, Steps(1, 8, 0.5))->code, StatusCode::kOk);
  const auto refused = client.Request(world->world, Steps(1, 9, 0.5));
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->code, StatusCode::kLimitReached);
  EXPECT_EQ(refused->accepted, 0u);
  EXPECT_EQ(server.metrics().Sum(Limit::kRequestsPerSecond), 1u);
}

TEST(ServerLimits, MessagesPerSecondDelayAClientWithoutLosingMessages) {
  server::Config config = TestConfig();
  config.limits.messages_per_s = 100;
  TestServer server(config);
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  constexpr std::uint64_t kPings = 150;
  for (std::uint64_t i = 1; i <= kPings; ++i) client.Send(protocol::Ping{.nonce = i});
  for (std::uint64_t i = 1; i <= kPings; ++i) {
    const auto pong = client.Await<protocol::Pong>();
    ASSERT_TRUE(pong);
    EXPECT_EQ(pong->nonce, i);
  }
  EXPECT_GT(server.metrics().Sum(Limit::kMessagesPerSecond), 0u);
}

TEST(ServerLimits, PendingCommandsDelayFurtherCommands) {
  server::Config config = TestConfig();
  config.limits.max_pending_commands = 4;
  TestServer server(config);
  auto [client, world] = server.Enter("w");
  ASSERT_TRUE(client.Spawn(world->world, {{.avatar = 1}}));
  constexpr int kCommands = 40;
  for (int i = 0; i < kCommands; ++i) {
    client.Send(
        protocol::CancelQueue{.seq = client.NextSeq(), .world = world->world, .avatars = {1}});
  }
  for (int i = 0; i < kCommands; ++i) {
    const auto reply = client.Await<Reply>();
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->accepted, 1u);
  }
  EXPECT_GT(server.metrics().Sum(Limit::kPendingCommands), 0u);
}

// ---- memory

TEST(ServerMemory, MatchesTheDocumentedSizeOfAnAvatar) {
  const auto library = OpenLibrary("builtin");
  ASSERT_TRUE(library);
  auto world = std::make_shared<server::World>();
  world->library = *library;
  server::AvatarBudget budget(10'000, 10'000);
  ThreadMetrics metrics;
  const server::TickClock clock(server::TickClock::Clock::time_point{}, 60.0);
  server::WorldShard shard({.world = world, .clock = clock, .budget = budget, .metrics = metrics});
  constexpr std::size_t kAvatars = 1000;
  const std::size_t before = counted_memory::LiveBytes();
  server::SpawnPart spawn;
  server::RequestPart walk;
  for (std::uint32_t i = 0; i < kAvatars; ++i) {
    ASSERT_EQ(budget.Reserve(*world), server::AvatarBudget::Verdict::kOk);
    spawn.items.push_back({i, {.avatar = i + 1}});
    for (const protocol::RequestItem& step : Steps(i + 1, 8, 0.5)) walk.items.push_back({i, step});
  }
  const std::size_t parts = counted_memory::LiveBytes() - before;
  EXPECT_EQ(shard.Execute({.world = world, .part = spawn}, 1).accepted, kAvatars);
  const std::size_t standing = counted_memory::LiveBytes() - before - parts;
  EXPECT_EQ(shard.Execute({.world = world, .part = walk}, 1).accepted, 8 * kAvatars);
  for (std::uint64_t tick = 1; tick < 30; ++tick) shard.Advance(tick, 1);
  const std::size_t walking = counted_memory::LiveBytes() - before - parts;
  std::printf("an avatar of %d joints: %zu bytes standing, %zu walking with 8 requests queued\n",
              (*library)->skeleton().joint_count(), standing / kAvatars, walking / kAvatars);
  EXPECT_LT(walking / kAvatars, 11u << 10);
}

// ---- slow readers

TEST(ServerSlowReader, DoesNotIncreaseMemoryOrDelayOthers) {
  server::Config config = TestConfig(2);
  config.tick_hz = 240.0;  // a higher rate makes the test shorter
  config.limits.socket_send_buffer_bytes = 64 << 10;
  TestServer server(config);
  auto [controller, world] = server.Enter("w");
  std::vector<protocol::SpawnItem> crowd(200);
  ASSERT_EQ(controller.Spawn(world->world, crowd)->accepted, 200u);
  std::vector<protocol::RequestItem> walk;
  for (AvatarId avatar = 1; avatar <= 200; ++avatar) {
    std::ranges::copy(Steps(avatar, 40, 0.4), std::back_inserter(walk));
  }
  ASSERT_EQ(controller.Request(world->world, walk)->accepted, walk.size());

  RawClient good = server.Connect();
  RawClient stuck = server.Connect(4096);
  ASSERT_TRUE(good.SayHello());
  ASSERT_TRUE(stuck.SayHello());
  ASSERT_TRUE(good.Join("w", protocol::Role::kObserver));
  ASSERT_TRUE(stuck.Join("w", protocol::Role::kObserver));
  ASSERT_TRUE(good.Observe(world->world, 1, PoseMode::kQuantised));
  ASSERT_TRUE(stuck.Observe(world->world, 1, PoseMode::kFull, true));

  // One observer reads and the other does not. Memory is measured early and late.
  const auto read_until_dropped = [&](std::uint64_t dropped) {
    std::uint64_t last_tick = 0;
    while (server.metrics().Sum(&ThreadMetrics::batches_dropped) < dropped) {
      const auto batch = good.Await<protocol::PoseBatch>();
      if (!batch) break;
      last_tick = std::max(last_tick, batch->info.tick);
    }
    return last_tick;
  };
  const std::uint64_t early_tick = read_until_dropped(50);
  ASSERT_GE(server.metrics().Sum(&ThreadMetrics::batches_dropped), 50u);
  const std::size_t early_bytes = counted_memory::LiveBytes();
  const double early_mib = ResidentMiB();
  const std::uint64_t late_tick = read_until_dropped(800);
  ASSERT_GE(server.metrics().Sum(&ThreadMetrics::batches_dropped), 800u);
  const std::size_t late_bytes = counted_memory::LiveBytes();
  std::printf(
      "a stuck observer lost %llu batches; heap %.2f -> %.2f MiB, resident %.1f -> %.1f "
      "MiB, longest tick %.2f ms, %llu missed\n",
      static_cast<unsigned long long>(server.metrics().Sum(&ThreadMetrics::batches_dropped)),
      static_cast<double>(early_bytes) / (1 << 20), static_cast<double>(late_bytes) / (1 << 20),
      early_mib, ResidentMiB(),
      1e3 *
          std::max(server.metrics().shard(0).tick.max_s(), server.metrics().shard(1).tick.max_s()),
      static_cast<unsigned long long>(server.metrics().Sum(&ThreadMetrics::ticks_missed)));
  // 800 full batches of 100 avatars have 10 MB. Events are limited by control_buffer_bytes.
  EXPECT_LT(late_bytes, early_bytes + config.limits.control_buffer_bytes + (std::size_t{1} << 20));
  EXPECT_GT(late_tick, early_tick);

  // When it reads again, it receives the number of lost batches and current poses.
  std::uint64_t dropped = 0;
  std::uint64_t newest = 0;
  while (dropped == 0 || newest < late_tick) {
    const auto message = stuck.Receive();
    ASSERT_TRUE(message);
    if (const auto* lagging = std::get_if<protocol::Lagging>(&*message)) {
      dropped = lagging->dropped_batches;
    } else if (const auto* batch = std::get_if<protocol::PoseBatch>(&*message)) {
      newest = std::max(newest, batch->info.tick);
    }
  }
  EXPECT_GT(dropped, 0u);
}

TEST(ServerSlowReader, IsDisconnectedAfterTheWriteTimeout) {
  server::Config config = TestConfig(1);
  config.limits.write_timeout_s = 0.2;
  config.limits.socket_send_buffer_bytes = 4096;
  TestServer server(config);
  RawClient client = server.Connect(4096);
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(client.Spawn(world->world, std::vector<protocol::SpawnItem>(500)));
  ASSERT_TRUE(client.Observe(world->world, 1, PoseMode::kFull));
  EXPECT_TRUE(Eventually([&] { return server.metrics().Sum(Limit::kWriteTimeout) == 1; }));
  EXPECT_TRUE(
      Eventually([&] { return server.metrics().Sum(&ThreadMetrics::sessions_detached) == 1; }));
}

TEST(ServerSlowReader, DelaysItsOwnCommandsWhileRepliesAreUnread) {
  server::Config config = TestConfig(1);
  config.limits.control_buffer_bytes = 64 << 10;
  config.limits.socket_send_buffer_bytes = 4096;
  config.limits.messages_per_s = 1'000'000;
  TestServer server(config);
  RawClient client = server.Connect(4096);
  ASSERT_TRUE(client.SayHello());
  const std::size_t before = counted_memory::LiveBytes();
  // Pongs accumulate until the server pauses reading. The last pings stay in socket buffers.
  constexpr int kPings = 100'000;
  std::thread sender([&] {
    for (int i = 1; i <= kPings; ++i) {
      client.Send(protocol::Ping{.nonce = static_cast<std::uint64_t>(i)});
    }
  });
  std::this_thread::sleep_for(300ms);
  EXPECT_LT(counted_memory::LiveBytes(), before + (std::size_t{1} << 20));
  std::uint64_t next = 1;
  RawClient* reader = &client;
  while (next <= kPings) {
    const auto pong = reader->Await<protocol::Pong>();
    ASSERT_TRUE(pong);
    ASSERT_EQ(pong->nonce, next);
    ++next;
  }
  sender.join();
}

TEST(ServerDrain, EndsEvenIfAClientDoesNotRead) {
  server::Config config = TestConfig(2);
  config.drain_timeout_s = 0.3;
  TestServer server(config);
  RawClient client = server.Connect(4096);
  ASSERT_TRUE(client.SayHello());
  const auto world = client.Join("w");
  ASSERT_TRUE(world);
  ASSERT_TRUE(client.Spawn(world->world, std::vector<protocol::SpawnItem>(500)));
  ASSERT_TRUE(client.Observe(world->world, 1, PoseMode::kFull));
  EXPECT_TRUE(server.DrainAndJoin());
}

TEST(ServerDrain, AnswersPendingCommands) {
  TestServer server;
  auto [client, world] = server.Enter("w");
  ASSERT_TRUE(client.Spawn(world->world, {{.avatar = 1}}));
  client.Send(
      protocol::Request{.seq = client.NextSeq(), .world = world->world, .items = Steps(1, 4, 0.5)});
  // The command is accepted, but it is executed in the next tick.
  const auto received = [&] { return server.metrics().Sum(&ThreadMetrics::messages_received); };
  ASSERT_TRUE(Eventually([&] { return received() >= 4; }));
  server.server().Drain();
  bool is_answered = false;
  std::optional<protocol::ErrorNotice> notice =
      client.Await<protocol::ErrorNotice>([&](const protocol::Message& message) {
        is_answered |= std::holds_alternative<Reply>(message);
      });
  ASSERT_TRUE(notice);
  EXPECT_EQ(notice->code, StatusCode::kShuttingDown);
  EXPECT_TRUE(is_answered);
}

}  // namespace
}  // namespace stridewire
