// Observers that evaluate the poses themselves, over real sockets: the same bytes as in full poses, by whatever way they came
// to know of the avatars; and their library, fetched piece by piece.

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
#include "test_server.h"

namespace stridewire {
namespace {

using protocol::AvatarId;
using protocol::PoseMode;
using server::Limit;
using server::ThreadMetrics;

using PoseBytes = std::vector<std::byte>;
using Shown = std::map<std::pair<std::uint64_t, AvatarId>, PoseBytes>;  // by tick and avatar

// Evaluates movement records as protocol/STANDARD.md describes, without code of the client library.
class MovementReader {
 public:
  explicit MovementReader(std::shared_ptr<const MotionLibrary> library)
      : library_(std::move(library)), evaluator_(*library_, 1) {}

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
      if (replica == nullptr && AvatarReplica::IsState(message.record(i))) {
        replica = std::make_unique<AvatarReplica>(library_);
      }
      if (replica == nullptr) {
        shard.avatars.erase(avatar);
        continue;
      }
      if (Status status = replica->Apply(message.record(i)); !status) return status;
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
    AvatarReplica::AdvanceAll(replicas, 1.0 / 60.0, evaluator_);
    if (message.states || message.more_steps == 0) {
      for (const AvatarId avatar : due) Show(message.tick, avatar, *shard.avatars.at(avatar));
    }
    return {};
  }

  [[nodiscard]] std::size_t avatar_count() const {
    std::size_t count = 0;
    for (const auto& [number, shard] : shards_) count += shard.avatars.size();
    return count;
  }

  Shown shown;
  std::set<AvatarId> gone;

 private:
  struct Shard {
    std::uint64_t step = 0;  // the last complete step
    std::uint16_t parts_applied = 0;
    std::map<AvatarId, std::unique_ptr<AvatarReplica>> avatars;
  };

  void Show(std::uint64_t tick, AvatarId avatar, const AvatarReplica& replica) {
    const ConstPoseSpan pose = replica.pose();
    PoseBytes bytes(protocol::PoseBytes(PoseMode::kFull, pose.rotations.size()));
    ASSERT_TRUE(protocol::EncodePose(PoseMode::kFull, pose.root_position_m, pose.rotations, bytes));
    shown[{tick, avatar}] = std::move(bytes);
    gone.erase(avatar);
  }

  std::shared_ptr<const MotionLibrary> library_;
  SoaPoseEvaluator evaluator_;
  std::map<std::uint16_t, Shard> shards_;
};

// Who evaluates a crowd has to be as fast as the server, which sends its poses as well.
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
  // Nobody reads what the crowd's own session is told, and sanitizers take their time.
  config.limits.write_timeout_s = 3600.0;
  config.limits.idle_timeout_s = 3600.0;
  return config;
}

// One session that takes poses and movements of the same world.
class BothWays {
 public:
  BothWays(TestServer& server, const std::string& world, int receive_buffer_bytes = 0)
      : client_(server.Connect(receive_buffer_bytes)), told_(OpenLibrary("builtin").value()) {
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

  // Takes what comes until `is_enough`.
  template <typename IsEnough>
  void TakeUntil(IsEnough&& is_enough) {
    while (!is_enough()) {
      const auto message = client_.Receive();
      ASSERT_TRUE(message);
      if (const auto* movements = std::get_if<protocol::Movements>(&*message)) {
        const Status taken = told_.Apply(*movements);
        ASSERT_TRUE(taken) << Describe(taken.error());
        states_ += movements->states;
        for (const AvatarId avatar : movements->avatars) ++told_of_[avatar];
      } else if (const auto* batch = std::get_if<protocol::PoseBatch>(&*message)) {
        for (std::size_t i = 0; i < batch->avatars.size(); ++i) {
          const auto pose = batch->pose(i);
          full_[{batch->info.tick, batch->avatars[i]}].assign(pose.begin(), pose.end());
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

  // Compares where both are; how many that were.
  int Compare() const { return CompareWith(full_); }
  int CompareWith(const Shown& others) const {
    int compared = 0;
    for (const auto& [key, bytes] : told_.shown) {
      const auto full = others.find(key);
      if (full == others.end()) continue;
      EXPECT_TRUE(full->second == bytes) << "tick " << key.first << ", avatar " << key.second;
      ++compared;
    }
    return compared;
  }

  RawClient& client() { return client_; }
  const MovementReader& told() const { return told_; }
  const Shown& full() const { return full_; }
  int states() const { return states_; }
  const std::map<AvatarId, int>& told_of() const { return told_of_; }
  std::uint64_t last_tick() const { return last_tick_; }
  /// The region it observes has them, as it was told.
  const std::set<AvatarId>& inside() const { return inside_; }

 private:
  RawClient client_;
  protocol::WorldId world_ = 0;
  MovementReader told_;
  Shown full_;
  int states_ = 0;
  std::map<AvatarId, int> told_of_;
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
  // Sends some elsewhere in mid-step, and lets some wave.
  void Stir(AvatarId avatar) {
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
  void Remove(AvatarId avatar) {
    client_.Send(protocol::Remove{.seq = client_.NextSeq(), .world = world_, .avatars = {avatar}});
    ASSERT_TRUE(client_.Await<protocol::Reply>());
  }

 private:
  RawClient client_;
  protocol::WorldId world_ = 0;
  std::size_t size_;
};

TEST(ServerMovement, ShowsTheBytesOfFullPoses) {
  TestServer server(BuiltinConfig(2));
  Crowd crowd(server, "w", 40);
  BothWays both(server, "w");
  both.Observe(PoseMode::kFull, 1);
  both.Observe(PoseMode::kMovement, 2);
  both.TakeUntil([&] { return both.told().shown.size() > 40 * 60; });
  for (const AvatarId avatar : {3u, 4u, 9u, 12u}) crowd.Stir(avatar);
  crowd.Remove(7);
  both.TakeUntil([&] { return both.told().shown.size() > 40 * 200; });
  const int compared = both.Compare();
  std::printf("%d poses compared, %d messages of states\n", compared, both.states());
  EXPECT_GT(compared, 40 * 190);
  EXPECT_EQ(both.told().avatar_count(), 39u);
  EXPECT_EQ(both.told().gone.size(), 1u);
  EXPECT_TRUE(both.told().gone.contains(7));
  // Later ones are told by those who are there.
  Crowd more(server, "w2", 1);
  BothWays other(server, "w2");
  other.Observe(PoseMode::kMovement, 2);
  other.TakeUntil([&] { return other.told().shown.size() > 30; });
  EXPECT_EQ(other.told().avatar_count(), 1u);
}

TEST(ServerMovement, TellsOfThoseNamedAlone) {
  TestServer server(BuiltinConfig(2));
  Crowd crowd(server, "w", 40);
  BothWays both(server, "w");
  both.Observe(PoseMode::kFull, 1);
  both.Observe(PoseMode::kMovement, 2, {3, 4, 9, 100});
  const auto shown_of = [&](AvatarId avatar) {
    return std::ranges::count_if(both.told().shown,
                                 [&](const auto& item) { return item.first.second == avatar; });
  };
  both.TakeUntil([&] { return shown_of(3) > 60 && shown_of(4) > 60; });
  EXPECT_EQ(both.told().avatar_count(), 3u);
  // More of them, one of whom is known, and one who is not there yet.
  both.Observe(PoseMode::kMovement, 5, {9, 12, 41});
  both.TakeUntil([&] { return shown_of(12) > 30; });
  EXPECT_EQ(both.told().avatar_count(), 4u);
  crowd.Spawn(41);
  both.TakeUntil([&] { return shown_of(41) > 30; });
  for (const AvatarId avatar : {3u, 9u, 13u}) crowd.Stir(avatar);
  EXPECT_TRUE(both.told().gone.empty());
  both.StopObserving(2);
  both.TakeUntil([&] { return both.told().gone.size() == 2; });
  EXPECT_TRUE(both.told().gone.contains(3) && both.told().gone.contains(4));
  EXPECT_EQ(both.told().avatar_count(), 3u);
  const auto before = shown_of(9);
  const auto of_3 = shown_of(3);
  both.TakeUntil([&] { return shown_of(9) > before + 60; });
  EXPECT_EQ(shown_of(3), of_3);
  // Once more from the middle of what it does.
  both.Observe(PoseMode::kMovement, 6, {3});
  both.TakeUntil([&] { return shown_of(3) > of_3 + 30; });
  EXPECT_GT(both.Compare(), 60 + 60 + 60 + 60 + 30 + 30);
  for (const auto& [avatar, count] : both.told_of()) {
    EXPECT_TRUE(avatar == 3 || avatar == 4 || avatar == 9 || avatar == 12 || avatar == 41 ||
                avatar == 100)
        << avatar << " was told of " << count << " times";
  }
}

// 40 who walk away from a row at z = 0, 2 m from each other: they leave by themselves, or as the region moves along the row.
TEST(ServerMovement, TellsOfThoseInARegionThatMoves) {
  TestServer server(BuiltinConfig(2));
  Crowd crowd(server, "w", 40);
  BothWays watcher(server, "w");
  watcher.Observe(PoseMode::kFull, 1);
  BothWays player(server, "w");
  player.ObserveRegion(20.0, 6.0);
  const auto shown_of = [&](AvatarId avatar) {
    return std::ranges::count_if(player.told().shown,
                                 [&](const auto& item) { return item.first.second == avatar; });
  };
  const auto is_told_of_those_inside = [&] {
    return player.told().avatar_count() == player.inside().size() &&
           std::ranges::none_of(player.inside(), [&](AvatarId avatar) {
             return !shown_of(avatar) || player.told().gone.contains(avatar);
           });
  };
  player.TakeUntil([&] { return shown_of(10) > 20 && is_told_of_those_inside(); });
  EXPECT_GE(player.inside().size(), 4u);
  EXPECT_LE(player.inside().size(), 9u);
  for (int step = 1; step <= 10; ++step) {
    player.ObserveRegion(20.0 + 4.0 * step, 6.0, /*replace=*/true);
    const std::uint64_t from = player.told().shown.rbegin()->first.first;
    player.TakeUntil([&] { return player.told().shown.rbegin()->first.first > from + 10; });
  }
  // 60 m along: all of before are out, with those who have walked further than 9 m.
  player.TakeUntil([&] { return player.told().gone.contains(10) && is_told_of_those_inside(); });
  EXPECT_FALSE(player.inside().contains(10));
  EXPECT_GT(player.told_of().size(), 15u);
  for (const auto& [avatar, count] : player.told_of()) {
    EXPECT_TRUE(avatar >= 5 && avatar <= 37) << avatar << " was told of " << count << " times";
  }
  const std::uint64_t until = player.told().shown.rbegin()->first.first;
  watcher.TakeUntil([&] { return watcher.last_tick() >= until; });
  EXPECT_GT(player.CompareWith(watcher.full()), 300);
}

TEST(ServerMovement, ALargeCrowdIsToldBitByBitAndAnotherSubscriptionBeginsAnew) {
  TestServer server(BuiltinConfig(2));
  Crowd crowd(server, "w", kLargeCrowd);
  BothWays both(server, "w");
  both.Observe(PoseMode::kFull, 1);
  for (const protocol::SubscriptionId id : {2u, 3u}) {
    both.Observe(PoseMode::kMovement, id);
    const std::size_t before = both.told().shown.size();
    both.TakeUntil([&] {
      return both.told().shown.size() > before + kLargeCrowd * 40 &&
             both.told().avatar_count() == kLargeCrowd;
    });
    both.StopObserving(id);
    std::uint64_t from = both.last_tick();
    both.TakeUntil([&] { return both.last_tick() > from + 20; });
  }
  EXPECT_GT(both.states(), static_cast<int>(kLargeCrowd) / 50);  // 400 states are some 500 KB
  EXPECT_GT(both.Compare(), static_cast<int>(kLargeCrowd) * 70);
}

class ServerMovementOf : public testing::TestWithParam<bool> {};  // of named ones
INSTANTIATE_TEST_SUITE_P(AllOrNamed, ServerMovementOf, testing::Bool());

TEST_P(ServerMovementOf, WhoReadsTooSlowlyIsToldAnew) {
  server::Config config = BuiltinConfig(1);
  config.limits.socket_send_buffer_bytes = 16 << 10;
  config.limits.control_buffer_bytes = 64 << 10;
  TestServer server(config);
  Crowd crowd(server, "w", kLargeCrowd);
  BothWays both(server, "w", 16 << 10);
  both.Observe(PoseMode::kFull, 1);
  std::vector<AvatarId> all_but_one(kLargeCrowd);
  std::iota(all_but_one.begin(), all_but_one.end(), 1u);
  all_but_one.pop_back();
  both.Observe(PoseMode::kMovement, 2, GetParam() ? all_but_one : std::vector<AvatarId>());
  const std::size_t watched = GetParam() ? all_but_one.size() : kLargeCrowd;
  both.TakeUntil([&] { return both.told().avatar_count() == watched; });
  const int states = both.states();
  // Reads nothing until movements were dropped.
  for (AvatarId avatar = 1; server.metrics().Sum(Limit::kObserverBacklog) == 0; ++avatar) {
    crowd.Stir(1 + avatar % kLargeCrowd);
  }
  const std::size_t before = both.told().shown.size();
  both.TakeUntil([&] { return both.states() > states; });
  both.TakeUntil([&] { return both.told().shown.size() > before + kLargeCrowd * 60; });
  EXPECT_GT(server.metrics().Sum(&ThreadMetrics::batches_dropped), 0u);
  // On a busy machine more is dropped meanwhile, and told anew.
  both.TakeUntil([&] { return both.told().avatar_count() == watched; });
  EXPECT_GT(both.Compare(), static_cast<int>(kLargeCrowd) * 30);
}

TEST(ServerMovement, NeedsItsFeature) {
  TestServer server(BuiltinConfig(1));
  RawClient client = server.Connect();
  ASSERT_TRUE(client.SayHello(~protocol::kFeatureMovementMode));
  const auto world = client.Join("w");
  ASSERT_TRUE(world);
  const auto reply = client.Observe(world->world, 1, PoseMode::kMovement);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->code, protocol::StatusCode::kUnsupported);
  client.Send(protocol::FetchLibrary{1, world->library_hash, 0, 1000});
  const auto error = client.Await<protocol::ErrorNotice>();
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code, protocol::StatusCode::kUnexpectedMessage);
}

TEST(ServerMovement, GivesOutItsLibraryPieceByPiece) {
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
