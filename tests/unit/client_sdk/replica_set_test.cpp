#include "replica_set.h"

#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <set>

#include "runtime/avatar/avatar_simulation.h"
#include "runtime/avatar/movement_record.h"
#include "test_library.h"

namespace stridewire::client {
namespace {

using protocol::AvatarId;
using protocol::Movements;

constexpr double kTickS = 1.0 / 60.0;

struct Screen : PoseSink {
  void Show(AvatarId avatar, std::uint16_t, const PoseStamp& stamp, ConstPoseSpan pose) override {
    Pose& kept = shown[avatar];
    kept.root_position_m = pose.root_position_m;
    kept.rotations.assign(pose.rotations.begin(), pose.rotations.end());
    stamps[avatar] = stamp;
    gone.erase(avatar);
  }
  void Gone(AvatarId avatar) override { gone.insert(avatar); }
  [[nodiscard]] bool Wants(AvatarId avatar) const override { return avatar != unwanted; }

  std::map<AvatarId, Pose> shown;
  std::map<AvatarId, PoseStamp> stamps;
  std::set<AvatarId> gone;
  AvatarId unwanted = 0;
};

// A shard of avatars that always walk, and what it would send.
class Server {
 public:
  explicit Server(AvatarId count) {
    for (AvatarId i = 1; i <= count; ++i) {
      avatars_.emplace(i, AvatarSimulation(library_, {DVec3(i, 0.0, 0.0), 0.1 * i}));
    }
  }

  Movements Step(std::uint16_t more_steps = 0) {
    ++step_;
    Movements message = Empty();
    message.more_steps = more_steps;
    for (auto& [number, avatar] : avatars_) {
      if (avatar.queue_size() == 0) {
        EXPECT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = 0.3 + 0.05 * number}}));
      }
      avatar.Advance(kTickS);
      if (AppendChange(avatar, message.records)) Add(message, number, 0);
    }
    return message;
  }
  Movements States() const {
    Movements message = Empty();
    message.states = true;
    for (const auto& [number, avatar] : avatars_) {
      AppendState(avatar, message.records);
      Add(message, number, 0);
    }
    return message;
  }
  Movements Empty() const {
    return {.world = 1,
            .shard = 3,
            .step = step_,
            .tick = 1000 + step_,
            .server_time_s = static_cast<double>(step_)};
  }
  static void Add(Movements& message, AvatarId number, std::uint8_t flags) {
    message.avatars.push_back(number);
    message.flags.push_back(flags);
    message.ends.push_back(static_cast<std::uint32_t>(message.records.size()));
  }

  // How many of those on the screen are what they should be.
  int Same(const Screen& screen) const {
    int same = 0;
    for (const auto& [number, avatar] : avatars_) {
      const auto shown = screen.shown.find(number);
      if (shown == screen.shown.end() || screen.gone.contains(number)) continue;
      if (screen.stamps.at(number).tick != 1000 + step_) continue;
      const ConstPoseSpan pose = avatar.pose();
      EXPECT_EQ(std::memcmp(shown->second.rotations.data(), pose.rotations.data(),
                            pose.rotations.size_bytes()),
                0);
      EXPECT_EQ(shown->second.root_position_m, pose.root_position_m);
      ++same;
    }
    return same;
  }

  [[nodiscard]] std::shared_ptr<const MotionLibrary> library() const { return library_; }

 private:
  std::shared_ptr<const MotionLibrary> library_ = MakeTestLibrary();
  std::map<AvatarId, AvatarSimulation> avatars_;
  std::uint64_t step_ = 0;
};

TEST(ReplicaSet, ShowsFromTheStatesOn) {
  Server server(5);
  Screen screen;
  ReplicaSet view(server.library(), kTickS, 100);
  for (int i = 0; i < 30; ++i) (void)server.Step();
  ASSERT_TRUE(view.Take(server.Step(), screen));
  EXPECT_EQ(view.avatar_count(), 0u);
  ASSERT_TRUE(view.Take(server.States(), screen));
  EXPECT_EQ(server.Same(screen), 5);
  EXPECT_TRUE(screen.stamps[1].discontinuity);
  for (int i = 0; i < 200; ++i) {
    ASSERT_TRUE(view.Take(server.Step(), screen));
    ASSERT_EQ(server.Same(screen), 5);
  }
  EXPECT_FALSE(screen.stamps[1].discontinuity);
}

TEST(ReplicaSet, StepsOfOneTickAreShownOnceAndPartsWaitForEachOther) {
  Server server(5);
  Screen screen;
  ReplicaSet view(server.library(), kTickS, 100);
  ASSERT_TRUE(view.Take(server.Step(), screen));  // all are new: states
  ASSERT_EQ(server.Same(screen), 5);
  const std::uint64_t before = screen.stamps[1].tick;
  ASSERT_TRUE(view.Take(server.Step(1), screen));
  EXPECT_EQ(screen.stamps[1].tick, before);
  Movements first = server.Step();
  Movements second = server.Empty();
  first.parts = second.parts = 2;
  second.part = 1;
  ASSERT_TRUE(view.Take(first, screen));
  EXPECT_EQ(screen.stamps[1].tick, before);
  ASSERT_TRUE(view.Take(second, screen));
  EXPECT_EQ(server.Same(screen), 5);
}

TEST(ReplicaSet, KnowsNobodyBehindAGapUntilStatesCome) {
  Server server(5);
  Screen screen;
  ReplicaSet view(server.library(), kTickS, 100);
  ASSERT_TRUE(view.Take(server.Step(), screen));
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(view.Take(server.Step(), screen));
  (void)server.Step();
  ASSERT_TRUE(view.Take(server.Step(), screen));
  EXPECT_EQ(view.avatar_count(), 0u);
  EXPECT_EQ(screen.gone.size(), 5u);
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(view.Take(server.Step(), screen));
  EXPECT_EQ(server.Same(screen), 0);
  ASSERT_TRUE(view.Take(server.States(), screen));
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(view.Take(server.Step(), screen));
    ASSERT_EQ(server.Same(screen), 5);
  }
  // A part that is missing is a gap, too.
  Movements half = server.Step();
  half.parts = 2;
  half.part = 1;
  ASSERT_TRUE(view.Take(half, screen));
  EXPECT_EQ(view.avatar_count(), 0u);
}

TEST(ReplicaSet, LeavesOutWhoIsGoneNotWantedOrOneTooMany) {
  Server server(5);
  Screen screen;
  screen.unwanted = 2;
  ReplicaSet view(server.library(), kTickS, 3);
  ASSERT_TRUE(view.Take(server.Step(), screen));
  EXPECT_EQ(view.avatar_count(), 3u);  // 1, 3, 4
  Movements message = server.Step();
  Server::Add(message, 3, protocol::kMovementGone);
  Server::Add(message, 5, protocol::kMovementGone);
  ASSERT_TRUE(view.Take(message, screen));
  EXPECT_EQ(view.avatar_count(), 2u);
  EXPECT_EQ(screen.gone, std::set<AvatarId>{3});
}

TEST(ReplicaSet, ARecordThatIsNoneIsRefused) {
  Server server(2);
  Screen screen;
  ReplicaSet view(server.library(), kTickS, 100);
  Movements message = server.Step();
  message.records.pop_back();
  --message.ends.back();
  const Status status = view.Take(message, screen);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kMalformed);
}

}  // namespace
}  // namespace stridewire::client
