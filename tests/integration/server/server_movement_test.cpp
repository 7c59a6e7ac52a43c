// Observers in movement mode, over real sockets. They evaluate poses themselves and must get the
// same bytes as full poses. They also fetch their library in pieces.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <numeric>
#include <set>
#include <string>

#include "random.h"
#include "runtime/avatar/avatar_replica.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/protocol/pose_batch_reader.h"
#include "test_server.h"

namespace stridewire {
namespace {

using protocol::AvatarId;
using protocol::PoseMode;
using server::Limit;
using server::ThreadMetrics;

using PoseBytes = std::vector<std::byte>;
using PoseMap = std::map<std::pair<std::uint64_t, AvatarId>, PoseBytes>;  // by tick and avatar

// Evaluates movement records as protocol/STANDARD.md describes, without code of the client library.
class MovementReader {
 public:
  explicit MovementReader(std::shared_ptr<const MotionLibrary> library)
      : library_(std::move(library)), evaluator_(*library_), plan_scratch_(*library_) {}

  Status Apply(const protocol::Movements& message) {
    Shard& shard = shards_[message.shard];
    const std::uint64_t previous = message.states ? message.step : message.step - 1;
    const std::uint16_t part = message.states ? 0 : message.part;
    if (previous != shard.step || part != shard.parts_applied) {
      for (const auto& [avatar, replica] : shard.avatars) gone.insert(avatar);
      shard = {.step = previous, .parts_applied = part, .avatars = {}};
    }
    std::vector<AvatarId> due;
    for (std::size_t i = 0; i < message.avatars.size(); ++i) {
      const AvatarId avatar = message.avatars[i];
      if ((message.flags[i] & protocol::kMovementGone) != 0) {
        if (shard.avatars.erase(avatar) > 0) gone.insert(avatar);
        continue;
      }
      std::unique_ptr<AvatarReplica>& replica = shard.avatars[avatar];
      if (replica == nullptr && AvatarReplica::IsState(RecordOf(message, i))) {
        replica = std::make_unique<AvatarReplica>(library_);
      }
      if (replica == nullptr) {
        shard.avatars.erase(avatar);
        continue;
      }
      if (Status status = replica->Apply(RecordOf(message, i), plan_scratch_); !status)
        return status;
      due.push_back(avatar);
    }
    if (!message.states) {
      if (++shard.parts_applied < message.parts) return {};
      shard.parts_applied = 0;
      shard.step = message.step;
      due.clear();
      for (const auto& [avatar, replica] : shard.avatars) due.push_back(avatar);
    }
    std::vector<AvatarReplica*> replicas;
    for (const AvatarId avatar : due) replicas.push_back(shard.avatars.at(avatar).get());
    AvatarReplica::AdvanceAll(replicas, {.length_s = 1.0 / 60.0, .number = message.step},
                              evaluator_);
    if (message.states || message.more_steps == 0) {
      for (const AvatarId avatar : due) StorePose(message.tick, avatar, *shard.avatars.at(avatar));
    }
    return {};
  }

  [[nodiscard]] std::size_t avatar_count() const {
    std::size_t count = 0;
    for (const auto& [number, shard] : shards_) count += shard.avatars.size();
    return count;
  }

  PoseMap poses;
  std::set<AvatarId> gone;

 private:
  struct Shard {
    std::uint64_t step = 0;  // the last complete step
    std::uint16_t parts_applied = 0;
    std::map<AvatarId, std::unique_ptr<AvatarReplica>> avatars;
  };

  void StorePose(std::uint64_t tick, AvatarId avatar, const AvatarReplica& replica) {
    const ConstPoseSpan pose = replica.pose();
    PoseBytes bytes(protocol::PoseBytes(PoseMode::kFull, pose.rotations.size()));
    ASSERT_TRUE(protocol::EncodePose(PoseMode::kFull, pose.root_position_m, pose.rotations, bytes));
    poses[{tick, avatar}] = std::move(bytes);
    gone.erase(avatar);
  }

  std::shared_ptr<const MotionLibrary> library_;
  ReplicaEvaluator evaluator_;
  FootPlanScratch plan_scratch_;
  std::map<std::uint16_t, Shard> shards_;
};

// The test must evaluate the crowd as fast as the server, which also sends full poses.
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr std::size_t kLargeCrowd = 80;
#else
constexpr std::size_t kLargeCrowd = 400;
#endif

server::Config BuiltinConfig(int shards) {
  server::Config config = TestConfig(shards);
  config.library = "builtin";
  config.max_catch_up_ticks = 1000;
  config.limits.observer_backlog_ticks = 1000;
  // The session of the crowd reads nothing for a long time, especially with sanitizers.
  config.limits.write_timeout_s = 3600.0;
  config.limits.idle_timeout_s = 3600.0;
  return config;
}

// A session that receives both poses and movements of a world.
class DualObserver {
 public:
  DualObserver(TestServer& server, const std::string& world, int receive_buffer_bytes = 0)
      : client_(server.Connect(receive_buffer_bytes)), evaluated_(OpenLibrary("builtin").value()) {
    EXPECT_TRUE(client_.SayHello());
    world_ = client_.Join(world, protocol::Role::kObserver)->world;
  }

  void Observe(PoseMode mode, protocol::SubscriptionId id,
               const std::vector<AvatarId>& avatars = {}) {
    client_.Send(protocol::Observe{.seq = client_.NextSeq(),
                                   .world = world_,
                                   .subscription = id,
                                   .mode = mode,
                                   .avatars = avatars});
  }
  void ObserveRegion(double x, double radius_m, bool replace = false) {
    client_.Send(protocol::Observe{
        .seq = client_.NextSeq(),
        .world = world_,
        .subscription = 9,
        .mode = PoseMode::kMovement,
        .region = protocol::Region{.centre_m = {x, 0.0}, .radius_m = radius_m, .leave_m = 3.0},
        .replace = replace});
  }
  void StopObserving(protocol::SubscriptionId id) {
    client_.Send(protocol::StopObserving{.seq = client_.NextSeq(), .subscription = id});
  }

  // Receives messages until `is_enough` returns true.
  template <typename IsEnough>
  void ReceiveUntil(IsEnough&& is_enough) {
    while (!is_enough()) {
      const auto message = client_.Receive();
      ASSERT_TRUE(message);
      if (const auto* movements = std::get_if<protocol::Movements>(&*message)) {
        const Status taken = evaluated_.Apply(*movements);
        ASSERT_TRUE(taken) << Describe(taken.error());
        states_ += movements->states;
        for (const AvatarId avatar : movements->avatars) ++message_counts_[avatar];
      } else if (const auto* batch = std::get_if<protocol::PoseBatch>(&*message)) {
        protocol::PoseBatchReader reader(*batch, nullptr);
        for (const AvatarId avatar : batch->avatars) {
          const auto pose = reader.Next();
          full_[{batch->info.tick, avatar}].assign(pose.begin(), pose.end());
        }
        last_tick_ = batch->info.tick;
      } else if (const auto* events = std::get_if<protocol::Events>(&*message)) {
        for (const protocol::Event& event : events->events) {
          if (event.type == protocol::EventType::kEntered) inside_.insert(event.avatar);
          if (event.type == protocol::EventType::kLeft) inside_.erase(event.avatar);
        }
      }
    }
  }

  // Compares all poses that were received in both ways. Returns their number.
  int Compare() const { return CompareWith(full_); }
  int CompareWith(const PoseMap& others) const {
    int compared = 0;
    for (const auto& [key, bytes] : evaluated_.poses) {
      const auto full = others.find(key);
      if (full == others.end()) continue;
      EXPECT_TRUE(full->second == bytes) << "tick " << key.first << ", avatar " << key.second;
      ++compared;
    }
    return compared;
  }

  RawClient& client() { return client_; }
  const MovementReader& evaluated() const { return evaluated_; }
  const PoseMap& full() const { return full_; }
  int states() const { return states_; }
  const std::map<AvatarId, int>& message_counts() const { return message_counts_; }
  std::uint64_t last_tick() const { return last_tick_; }
  /// The members of the observed region, according to events.
  const std::set<AvatarId>& inside() const { return inside_; }

 private:
  RawClient client_;
  protocol::WorldId world_ = 0;
  MovementReader evaluated_;
  PoseMap full_;
  int states_ = 0;
  std::map<AvatarId, int> message_counts_;
  std::set<AvatarId> inside_;
  std::uint64_t last_tick_ = 0;
};

class Crowd {
 public:
  Crowd(TestServer& server, const std::string& world, std::size_t size)
      : client_(server.Connect()), size_(size) {
    EXPECT_TRUE(client_.SayHello());
    world_ = client_.Join(world)->world;
    std::vector<protocol::SpawnItem> spawns;
    for (AvatarId i = 1; i <= size; ++i) spawns.push_back({i, {DVec3(2.0 * i, 0.0, 0.0), 0.1}});
    EXPECT_EQ(client_.Spawn(world_, spawns)->accepted, size);
    Walk();
  }

  void Walk() {
    std::vector<protocol::RequestItem> walk;
    for (AvatarId avatar = 1; avatar <= size_; ++avatar) {
      std::ranges::copy(Steps(avatar, 60, 0.3 + 0.004 * avatar), std::back_inserter(walk));
    }
    EXPECT_TRUE(client_.Request(world_, walk));
  }
  // Interrupts some avatars in the middle of a step, and lets some wave.
  void Interrupt(AvatarId avatar) {
    EXPECT_TRUE(client_.Request(world_, {{.avatar = avatar,
                                          .request_id = 7,
                                          .movement = protocol::StepMovement{.length_m = 0.6},
                                          .interrupt = protocol::Interrupt::kNow}}));
    client_.Send(protocol::SetLayers{
        .seq = client_.NextSeq(), .world = world_, .items = {{avatar, "wave"}}});
    client_.Send(protocol::SetPlanting{
        .seq = client_.NextSeq(), .world = world_, .avatars = {avatar}, .enabled = false});
    ASSERT_TRUE(client_.Await<protocol::Reply>());
    ASSERT_TRUE(client_.Await<protocol::Reply>());
  }
  void Spawn(AvatarId avatar) {
    EXPECT_EQ(client_.Spawn(world_, {{avatar, {DVec3(0.0), 0.0}}})->accepted, 1u);
    EXPECT_TRUE(client_.Request(world_, Steps(avatar, 20, 0.5)));
  }
  void Teleport(AvatarId avatar) {
    EXPECT_EQ(
        client_.Spawn(world_, {{.avatar = avatar, .start = {DVec3(-3.0), 1.0}, .teleport = true}})
            ->accepted,
        1u);
    EXPECT_TRUE(client_.Request(world_, Steps(avatar, 20, 0.4)));
  }
  void Remove(AvatarId avatar) {
    client_.Send(protocol::Remove{.seq = client_.NextSeq(), .world = world_, .avatars = {avatar}});
    ASSERT_TRUE(client_.Await<protocol::Reply>());
  }

 private:
  RawClient client_;
  protocol::WorldId world_ = 0;
  std::size_t size_;
};

TEST(ServerMovement, MatchesFullPoses) {
  TestServer server(BuiltinConfig(2));
  Crowd crowd(server, "w", 40);
  DualObserver both(server, "w");
  both.Observe(PoseMode::kFull, 1);
  both.Observe(PoseMode::kMovement, 2);
  both.ReceiveUntil([&] { return both.evaluated().poses.size() > 40 * 60; });
  for (const AvatarId avatar : {3u, 4u, 9u, 12u}) crowd.Interrupt(avatar);
  crowd.Remove(7);
  crowd.Teleport(8);
  both.ReceiveUntil([&] { return both.evaluated().poses.size() > 40 * 200; });
  const int compared = both.Compare();
  std::printf("%d poses compared, %d messages of states\n", compared, both.states());
  EXPECT_GT(compared, 40 * 190);
  EXPECT_EQ(both.evaluated().avatar_count(), 39u);
  EXPECT_EQ(both.evaluated().gone.size(), 1u);
  EXPECT_TRUE(both.evaluated().gone.contains(7));
  // A session that observes later first receives states.
  Crowd more(server, "w2", 1);
  DualObserver other(server, "w2");
  other.Observe(PoseMode::kMovement, 2);
  other.ReceiveUntil([&] { return other.evaluated().poses.size() > 30; });
  EXPECT_EQ(other.evaluated().avatar_count(), 1u);
}

TEST(ServerMovement, SendsOnlySelectedAvatars) {
  TestServer server(BuiltinConfig(2));
  Crowd crowd(server, "w", 40);
  DualObserver both(server, "w");
  both.Observe(PoseMode::kFull, 1);
  both.Observe(PoseMode::kMovement, 2, {3, 4, 9, 100});
  const auto pose_count_of = [&](AvatarId avatar) {
    return std::ranges::count_if(both.evaluated().poses,
                                 [&](const auto& item) { return item.first.second == avatar; });
  };
  both.ReceiveUntil([&] { return pose_count_of(3) > 60 && pose_count_of(4) > 60; });
  EXPECT_EQ(both.evaluated().avatar_count(), 3u);
  // More avatars: one is known already, and one does not exist yet.
  both.Observe(PoseMode::kMovement, 5, {9, 12, 41});
  both.ReceiveUntil([&] { return pose_count_of(12) > 30; });
  EXPECT_EQ(both.evaluated().avatar_count(), 4u);
  crowd.Spawn(41);
  both.ReceiveUntil([&] { return pose_count_of(41) > 30; });
  for (const AvatarId avatar : {3u, 9u, 13u}) crowd.Interrupt(avatar);
  EXPECT_TRUE(both.evaluated().gone.empty());
  both.StopObserving(2);
  both.ReceiveUntil([&] { return both.evaluated().gone.size() == 2; });
  EXPECT_TRUE(both.evaluated().gone.contains(3) && both.evaluated().gone.contains(4));
  EXPECT_EQ(both.evaluated().avatar_count(), 3u);
  const auto before = pose_count_of(9);
  const auto of_3 = pose_count_of(3);
  both.ReceiveUntil([&] { return pose_count_of(9) > before + 60; });
  EXPECT_EQ(pose_count_of(3), of_3);
  // Subscribe again while the avatar is moving.
  both.Observe(PoseMode::kMovement, 6, {3});
  both.ReceiveUntil([&] { return pose_count_of(3) > of_3 + 30; });
  EXPECT_GT(both.Compare(), 60 + 60 + 60 + 60 + 30 + 30);
  for (const auto& [avatar, count] : both.message_counts()) {
    EXPECT_TRUE(avatar == 3 || avatar == 4 || avatar == 9 || avatar == 12 || avatar == 41 ||
                avatar == 100)
        << avatar << " was in " << count << " messages";
  }
}

// 40 avatars walk away from a row at z = 0 with distances of 2 m. They leave the region by walking,
// or because the region moves along the row.
TEST(ServerMovement, TracksAMovingRegion) {
  TestServer server(BuiltinConfig(2));
  Crowd crowd(server, "w", 40);
  DualObserver watcher(server, "w");
  watcher.Observe(PoseMode::kFull, 1);
  DualObserver player(server, "w");
  player.ObserveRegion(20.0, 6.0);
  const auto pose_count_of = [&](AvatarId avatar) {
    return std::ranges::count_if(player.evaluated().poses,
                                 [&](const auto& item) { return item.first.second == avatar; });
  };
  const auto receives_members_only = [&] {
    return player.evaluated().avatar_count() == player.inside().size() &&
           std::ranges::none_of(player.inside(), [&](AvatarId avatar) {
             return !pose_count_of(avatar) || player.evaluated().gone.contains(avatar);
           });
  };
  player.ReceiveUntil([&] { return pose_count_of(10) > 20 && receives_members_only(); });
  EXPECT_GE(player.inside().size(), 4u);
  EXPECT_LE(player.inside().size(), 9u);
  for (int step = 1; step <= 10; ++step) {
    player.ObserveRegion(20.0 + 4.0 * step, 6.0, /*replace=*/true);
    const std::uint64_t from = player.evaluated().poses.rbegin()->first.first;
    player.ReceiveUntil([&] { return player.evaluated().poses.rbegin()->first.first > from + 10; });
  }
  // After 60 m, all previous members have left, as have avatars that have walked more than 9 m.
  player.ReceiveUntil(
      [&] { return player.evaluated().gone.contains(10) && receives_members_only(); });
  EXPECT_FALSE(player.inside().contains(10));
  EXPECT_GT(player.message_counts().size(), 15u);
  for (const auto& [avatar, count] : player.message_counts()) {
    EXPECT_TRUE(avatar >= 5 && avatar <= 37) << avatar << " was in " << count << " messages";
  }
  const std::uint64_t until = player.evaluated().poses.rbegin()->first.first;
  watcher.ReceiveUntil([&] { return watcher.last_tick() >= until; });
  EXPECT_GT(player.CompareWith(watcher.full()), 300);
}

TEST(ServerMovement, SendsStatesOfALargeCrowdInPortions) {
  TestServer server(BuiltinConfig(2));
  Crowd crowd(server, "w", kLargeCrowd);
  DualObserver both(server, "w");
  both.Observe(PoseMode::kFull, 1);
  for (const protocol::SubscriptionId id : {2u, 3u}) {
    both.Observe(PoseMode::kMovement, id);
    const std::size_t before = both.evaluated().poses.size();
    both.ReceiveUntil([&] {
      return both.evaluated().poses.size() > before + kLargeCrowd * 40 &&
             both.evaluated().avatar_count() == kLargeCrowd;
    });
    both.StopObserving(id);
    std::uint64_t from = both.last_tick();
    both.ReceiveUntil([&] { return both.last_tick() > from + 20; });
  }
  EXPECT_GT(both.states(), static_cast<int>(kLargeCrowd) / 50);  // 400 states are some 500 KB
  EXPECT_GT(both.Compare(), static_cast<int>(kLargeCrowd) * 70);
}

class ServerMovementOf : public testing::TestWithParam<bool> {};  // selected avatars only
INSTANTIATE_TEST_SUITE_P(AllOrNamed, ServerMovementOf, testing::Bool());

TEST_P(ServerMovementOf, RestartsASlowReaderWithNewStates) {
  server::Config config = BuiltinConfig(1);
  config.limits.socket_send_buffer_bytes = 16 << 10;
  config.limits.control_buffer_bytes = 64 << 10;
  TestServer server(config);
  Crowd crowd(server, "w", kLargeCrowd);
  DualObserver both(server, "w", 16 << 10);
  both.Observe(PoseMode::kFull, 1);
  std::vector<AvatarId> all_but_one(kLargeCrowd);
  std::iota(all_but_one.begin(), all_but_one.end(), 1u);
  all_but_one.pop_back();
  both.Observe(PoseMode::kMovement, 2, GetParam() ? all_but_one : std::vector<AvatarId>());
  const std::size_t watched = GetParam() ? all_but_one.size() : kLargeCrowd;
  both.ReceiveUntil([&] { return both.evaluated().avatar_count() == watched; });
  const int states = both.states();
  // Does not read until movements were dropped.
  for (AvatarId avatar = 1; server.metrics().Sum(Limit::kObserverBacklog) == 0; ++avatar) {
    crowd.Interrupt(1 + avatar % kLargeCrowd);
  }
  const std::size_t before = both.evaluated().poses.size();
  both.ReceiveUntil([&] { return both.states() > states; });
  both.ReceiveUntil([&] { return both.evaluated().poses.size() > before + kLargeCrowd * 60; });
  EXPECT_GT(server.metrics().Sum(&ThreadMetrics::batches_dropped), 0u);
  // On a busy machine, more may be dropped in the meantime.
  both.ReceiveUntil([&] { return both.evaluated().avatar_count() == watched; });
  EXPECT_GT(both.Compare(), static_cast<int>(kLargeCrowd) * 30);
}

TEST(ServerMovement, SendsItsLibraryInPieces) {
  TestServer server(BuiltinConfig(1));
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello());
  const auto builtin = OpenLibrary("builtin").value();
  client.Send(protocol::FetchLibrary{1, builtin->hash(), 0, 1000});
  EXPECT_EQ(client.Await<protocol::LibraryPiece>()->code, protocol::StatusCode::kNotJoined);
  const auto world = client.Join("w");
  ASSERT_TRUE(world);
  ASSERT_EQ(world->library_hash, builtin->hash());
  std::vector<std::byte> file;
  for (std::uint64_t nonce = 2;; ++nonce) {
    client.Send(protocol::FetchLibrary{nonce, world->library_hash, file.size(), 1 << 20});
    const auto piece = client.Await<protocol::LibraryPiece>();
    ASSERT_TRUE(piece);
    ASSERT_EQ(piece->code, protocol::StatusCode::kOk);
    EXPECT_EQ(piece->nonce, nonce);
    EXPECT_EQ(piece->offset, file.size());
    EXPECT_EQ(piece->total_bytes, builtin->bytes().size());
    file.insert(file.end(), piece->bytes.begin(), piece->bytes.end());
    if (file.size() >= piece->total_bytes || piece->bytes.empty()) break;
  }
  ASSERT_EQ(file.size(), builtin->bytes().size());
  EXPECT_EQ(std::memcmp(file.data(), builtin->bytes().data(), file.size()), 0);
  EXPECT_EQ(MotionLibrary::FromBytes(file).value()->hash(), world->library_hash);
  client.Send(protocol::FetchLibrary{99, world->library_hash, file.size() + 1, 1});
  EXPECT_EQ(client.Await<protocol::LibraryPiece>()->code, protocol::StatusCode::kOutOfRange);
}

}  // namespace
}  // namespace stridewire
