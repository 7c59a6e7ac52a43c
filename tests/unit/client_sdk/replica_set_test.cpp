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

struct CollectingSink : PoseSink {
  void OnPose(AvatarId avatar, std::uint16_t, const PoseStamp& stamp, ConstPoseSpan pose) override {
    Pose& kept = poses[avatar];
    kept.root_position_m = pose.root_position_m;
    kept.rotations.assign(pose.rotations.begin(), pose.rotations.end());
    stamps[avatar] = stamp;
    gone.erase(avatar);
  }
  void OnGone(AvatarId avatar) override { gone.insert(avatar); }
  [[nodiscard]] bool Wants(AvatarId avatar) const override { return avatar != unwanted; }

  std::map<AvatarId, Pose> poses;
  std::map<AvatarId, PoseStamp> stamps;
  std::set<AvatarId> gone;
  AvatarId unwanted = 0;
};

// Simulates a shard of walking avatars and produces its messages.
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

  // Counts the current poses in the sink, and expects them to be equal.
  int CountEqualPoses(const CollectingSink& sink) const {
    int same = 0;
    for (const auto& [number, avatar] : avatars_) {
      const auto poses = sink.poses.find(number);
      if (poses == sink.poses.end() || sink.gone.contains(number)) continue;
      if (sink.stamps.at(number).tick != 1000 + step_) continue;
      const ConstPoseSpan pose = avatar.pose();
      EXPECT_EQ(std::memcmp(poses->second.rotations.data(), pose.rotations.data(),
                            pose.rotations.size_bytes()),
                0);
      EXPECT_EQ(poses->second.root_position_m, pose.root_position_m);
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

TEST(ReplicaSet, EvaluatesAvatarsAfterTheirStates) {
  Server server(5);
  CollectingSink sink;
  ReplicaSet replicas(server.library(), kTickS, 100);
  for (int i = 0; i < 30; ++i) (void)server.Step();
  ASSERT_TRUE(replicas.Apply(server.Step(), sink));
  EXPECT_EQ(replicas.avatar_count(), 0u);
  ASSERT_TRUE(replicas.Apply(server.States(), sink));
  EXPECT_EQ(server.CountEqualPoses(sink), 5);
  EXPECT_TRUE(sink.stamps[1].discontinuity);
  for (int i = 0; i < 200; ++i) {
    ASSERT_TRUE(replicas.Apply(server.Step(), sink));
    ASSERT_EQ(server.CountEqualPoses(sink), 5);
  }
  EXPECT_FALSE(sink.stamps[1].discontinuity);
}

TEST(ReplicaSet, EmitsPosesAfterTheLastStepAndPart) {
  Server server(5);
  CollectingSink sink;
  ReplicaSet replicas(server.library(), kTickS, 100);
  ASSERT_TRUE(replicas.Apply(server.Step(), sink));  // contains states, because all avatars are new
  ASSERT_EQ(server.CountEqualPoses(sink), 5);
  const std::uint64_t before = sink.stamps[1].tick;
  ASSERT_TRUE(replicas.Apply(server.Step(1), sink));
  EXPECT_EQ(sink.stamps[1].tick, before);
  Movements first = server.Step();
  Movements second = server.Empty();
  first.parts = second.parts = 2;
  second.part = 1;
  ASSERT_TRUE(replicas.Apply(first, sink));
  EXPECT_EQ(sink.stamps[1].tick, before);
  ASSERT_TRUE(replicas.Apply(second, sink));
  EXPECT_EQ(server.CountEqualPoses(sink), 5);
}

TEST(ReplicaSet, ForgetsAvatarsAfterAGapUntilTheirStates) {
  Server server(5);
  CollectingSink sink;
  ReplicaSet replicas(server.library(), kTickS, 100);
  ASSERT_TRUE(replicas.Apply(server.Step(), sink));
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(replicas.Apply(server.Step(), sink));
  (void)server.Step();
  ASSERT_TRUE(replicas.Apply(server.Step(), sink));
  EXPECT_EQ(replicas.avatar_count(), 0u);
  EXPECT_EQ(sink.gone.size(), 5u);
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(replicas.Apply(server.Step(), sink));
  EXPECT_EQ(server.CountEqualPoses(sink), 0);
  ASSERT_TRUE(replicas.Apply(server.States(), sink));
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(replicas.Apply(server.Step(), sink));
    ASSERT_EQ(server.CountEqualPoses(sink), 5);
  }
  // A missing part is a gap as well.
  Movements half = server.Step();
  half.parts = 2;
  half.part = 1;
  ASSERT_TRUE(replicas.Apply(half, sink));
  EXPECT_EQ(replicas.avatar_count(), 0u);
}

TEST(ReplicaSet, IgnoresGoneUnwantedAndExcessAvatars) {
  Server server(5);
  CollectingSink sink;
  sink.unwanted = 2;
  ReplicaSet replicas(server.library(), kTickS, 3);
  ASSERT_TRUE(replicas.Apply(server.Step(), sink));
  EXPECT_EQ(replicas.avatar_count(), 3u);  // avatars 1, 3 and 4
  Movements message = server.Step();
  Server::Add(message, 3, protocol::kMovementGone);
  Server::Add(message, 5, protocol::kMovementGone);
  ASSERT_TRUE(replicas.Apply(message, sink));
  EXPECT_EQ(replicas.avatar_count(), 2u);
  EXPECT_EQ(sink.gone, std::set<AvatarId>{3});
}

TEST(ReplicaSet, RejectsAnInvalidRecord) {
  Server server(2);
  CollectingSink sink;
  ReplicaSet replicas(server.library(), kTickS, 100);
  Movements message = server.Step();
  message.records.pop_back();
  --message.ends.back();
  const Status status = replicas.Apply(message, sink);
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kMalformed);
}

}  // namespace
}  // namespace stridewire::client
