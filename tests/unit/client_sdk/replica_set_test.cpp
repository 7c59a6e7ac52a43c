#include "replica_set.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <utility>

#include "runtime/avatar/avatar_simulation.h"
#include "runtime/avatar/movement_record.h"
#include "runtime/library/pose_quantization.h"
#include "test_library.h"
#include "world_view.h"

namespace stridewire::client {
namespace {

using protocol::AvatarId;
using protocol::Movements;

constexpr double kTickS = 1.0 / 60.0;

struct CollectingSink : PoseSink {
  bool OnPose(AvatarId avatar, std::uint16_t, const PoseStamp& stamp,
              const AvatarReplica& replica) override {
    const ConstPoseSpan pose = replica.pose();
    Pose& kept = poses[avatar];
    kept.root_position_m = pose.root_position_m;
    kept.rotations.assign(pose.rotations.begin(), pose.rotations.end());
    stamps[avatar] = stamp;
    gone.erase(avatar);
    return continues && replica.movement() != nullptr;
  }
  void OnContinued(AvatarId avatar) override { ++continued[avatar]; }
  [[nodiscard]] std::vector<AvatarId> TakeEnded() override { return std::exchange(ended, {}); }
  void OnGone(AvatarId avatar) override { gone.insert(avatar); }
  [[nodiscard]] bool Wants(AvatarId avatar) const override { return avatar != unwanted; }
  [[nodiscard]] std::uint64_t EveryNTicks() const override { return every_n_ticks; }

  std::map<AvatarId, Pose> poses;
  std::map<AvatarId, PoseStamp> stamps;
  std::set<AvatarId> gone;
  AvatarId unwanted = 0;
  std::uint64_t every_n_ticks = 1;
  bool continues = false;
  std::map<AvatarId, int> continued;
  std::vector<AvatarId> ended;
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

TEST(ReplicaSet, EvaluatesOnlyTicksThatTheSinkNeeds) {
  Server server(5);
  CollectingSink sink;
  ReplicaSet replicas(server.library(), kTickS, 100);
  sink.every_n_ticks = 5;
  const Movements first = server.Step();
  ASSERT_NE(first.tick % 5, 0u);
  ASSERT_TRUE(replicas.Apply(first, sink));
  EXPECT_TRUE(sink.poses.empty());
  bool is_first = true;
  for (int i = 0; i < 600; ++i) {
    if (i % 60 == 59) sink.every_n_ticks = i % 180 == 179 ? 1 : 2 + i % 4;
    const Movements message = server.Step();
    ASSERT_TRUE(replicas.Apply(message, sink));
    const bool has_poses = message.tick % sink.every_n_ticks == 0;
    ASSERT_EQ(server.CountEqualPoses(sink), has_poses ? 5 : 0) << "step " << i;
    if (!has_poses) continue;
    EXPECT_EQ(sink.stamps[1].discontinuity, std::exchange(is_first, false)) << "step " << i;
  }
}

TEST(ReplicaSet, AdvancesAvatarsThatTheSinkHasContinued) {
  Server server(5);
  CollectingSink sink;
  sink.continues = true;
  ReplicaSet replicas(server.library(), kTickS, 100);
  int continued = 0;
  for (int i = 0; i < 300; ++i) {
    if (i % 7 == 0) sink.ended = {2, 4};
    sink.continued.clear();
    const Movements message = server.Step(i % 10 == 9 ? 1 : 0);
    ASSERT_TRUE(replicas.Apply(message, sink));
    if (message.more_steps > 0) continue;
    continued += static_cast<int>(sink.continued.size());
    ASSERT_EQ(server.CountEqualPoses(sink), 5 - static_cast<int>(sink.continued.size()));
    for (const AvatarId avatar : message.avatars) EXPECT_FALSE(sink.continued.contains(avatar));
    if (i % 7 != 0) continue;
    EXPECT_FALSE(sink.continued.contains(2));
    EXPECT_FALSE(sink.continued.contains(4));
  }
  EXPECT_GT(continued, 1000);
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

TEST(ReplicaSet, DiscardsAllAvatarsOfAShardAfterAnInvalidRecord) {
  for (const bool states : {false, true}) {
    Server server(3);
    CollectingSink sink;
    ReplicaSet replicas(server.library(), kTickS, 100);
    ASSERT_TRUE(replicas.Apply(server.Step(), sink));
    Movements message = states ? server.States() : server.Step();
    message.records.assign(1, std::byte{0xff});
    message.avatars = {2};
    message.flags = {0};
    message.ends = {1};
    EXPECT_FALSE(replicas.Apply(message, sink));
    EXPECT_EQ(replicas.avatar_count(), 0u);
    EXPECT_EQ(sink.gone, (std::set<AvatarId>{1, 2, 3}));
    sink.gone.clear();
    for (int i = 0; i < 5; ++i) ASSERT_TRUE(replicas.Apply(server.Step(), sink));
    EXPECT_EQ(server.CountEqualPoses(sink), 0);
    ASSERT_TRUE(replicas.Apply(server.States(), sink));
    ASSERT_TRUE(replicas.Apply(server.Step(), sink));
    EXPECT_EQ(server.CountEqualPoses(sink), 3);
  }
}

protocol::WorldInfo DescribeWorld(const MotionLibrary& library) {
  protocol::WorldInfo info;
  for (const Joint& joint : library.skeleton().joints) {
    info.skeleton.joints.push_back(
        {joint.name, static_cast<std::int16_t>(joint.parent), joint.offset_m});
  }
  return info;
}

// Returns the largest distance of a root between the view and its recording, over all times.
double LargestRecordedErrorM(WorldView& view, double from_s, double to_s, std::size_t avatars) {
  CrowdPose live;
  CrowdPose recorded;
  DisplayCounts held;
  double largest_m = 0.0;
  for (double time_s = from_s; time_s <= to_s; time_s += 0.25) {
    view.SampleAll(time_s, live, held);
    view.recording().SampleAll(time_s, [](AvatarId) { return true; }, recorded);
    EXPECT_EQ(live.avatars.size(), avatars);
    EXPECT_EQ(recorded.avatars, live.avatars);
    EXPECT_EQ(recorded.flags, live.flags);
    for (std::size_t i = 0; i < recorded.avatars.size(); ++i) {
      const Vec3 error_m = recorded.roots_m[i] - live.roots_m[i];
      largest_m = std::fmax(largest_m, std::sqrt(glm::dot(error_m, error_m)));
    }
  }
  return largest_m;
}

TEST(WorldView, RecordsEvaluatedPoses) {
  constexpr std::size_t kAvatars = 20;
  for (const bool is_compact : {true, false}) {
    Server server(kAvatars);
    protocol::WorldInfo info = DescribeWorld(*server.library());
    if (is_compact) info.rotation_quantizations = ChoosePoseQuantization(*server.library()).joints;
    PoseBudget budget{std::size_t{1} << 30, 0};
    WorldView view(512, budget, PoseRecording(1e9, std::size_t{1} << 30));
    view.SetInfo(info);
    ReplicaSet replicas(server.library(), kTickS, 100);
    WorldView::Counts counts;
    for (int i = 0; i < 100; ++i) {
      ASSERT_TRUE(view.Apply(server.Step(), replicas, 1, counts));
    }
    EXPECT_EQ(view.recording().first_time_s(), 1.0);
    EXPECT_EQ(view.recording().last_time_s(), 100.0);
    const double error_m = LargestRecordedErrorM(view, 1.0, 100.0, kAvatars);
    EXPECT_LT(error_m, 1e-6);
  }
}

TEST(WorldView, RecordsEvaluatedPosesOfDueTicksAndWithinItsLimit) {
  Server server(5);
  PoseBudget budget{std::size_t{1} << 30, 0};
  WorldView view(512, budget, PoseRecording(10.0, std::size_t{1} << 30));
  view.SetInfo(DescribeWorld(*server.library()));
  ReplicaSet replicas(server.library(), kTickS, 100);
  WorldView::Counts counts;
  for (int i = 0; i < 101; ++i) ASSERT_TRUE(view.Apply(server.Step(), replicas, 4, counts));
  // A tick takes 1 s in these messages, and every fourth one is recorded.
  EXPECT_EQ(view.recording().last_time_s(), 100.0);
  EXPECT_EQ(view.recording().first_time_s(), 92.0);

  WorldView other(512, budget);
  other.SetInfo(DescribeWorld(*server.library()));
  ASSERT_TRUE(other.Apply(server.States(), replicas, 1, counts));
  EXPECT_EQ(other.recording().bytes(), 0u);
}

}  // namespace
}  // namespace stridewire::client
