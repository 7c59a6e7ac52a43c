// A view that evaluates movements only when they are sampled must display the same motion as one
// that evaluates them in every tick.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <utility>

#include "random_requests.h"
#include "runtime/avatar/movement_record.h"
#include "stridewire/offline/open_library.h"
#include "world_view.h"

namespace stridewire::client {
namespace {

constexpr double kIntervalS = 1.0 / 60.0;
constexpr int kAvatars = 24;

/// A client with a view of the crowd.
struct Viewer {
  Viewer(const std::shared_ptr<const MotionLibrary>& library, WorldView::Evaluation evaluation)
      : replicas(library, kIntervalS, kAvatars),
        view(64, budget, PoseRecording(5.0, std::size_t{1} << 26), evaluation) {
    protocol::WorldInfo info;
    info.world = 1;
    for (const Joint& joint : library->skeleton().joints) {
      info.skeleton.joints.push_back(
          {joint.name, static_cast<std::int16_t>(joint.parent), joint.offset_m});
    }
    view.SetInfo(info);
  }
  void Receive(const protocol::Movements& message, std::uint64_t every_n_ticks) {
    ASSERT_TRUE(view.Apply(message, replicas, every_n_ticks, counts));
  }
  const CrowdPose& Sample(double time_s) {
    view.SampleAll(time_s, crowd, displayed);
    return crowd;
  }

  ReplicaSet replicas;
  PoseBudget budget{std::size_t{1} << 28, 0};
  WorldView view;
  WorldView::Counts counts;
  DisplayCounts displayed;
  CrowdPose crowd;
};

bool IsSame(ConstPoseSpan a, ConstPoseSpan b) {
  return a.root_position_m == b.root_position_m &&
         std::memcmp(a.rotations.data(), b.rotations.data(), a.rotations.size_bytes()) == 0;
}

class SampledMovementTest : public testing::Test {
 protected:
  /// Advances the crowd by one tick and returns the message of the tick.
  protocol::Movements Step() {
    crowd_.Advance();
    ++tick_;
    protocol::Movements message = Empty();
    message.step = message.tick;
    protocol::AvatarId id = 0;
    for (const AvatarSimulation& avatar : crowd_.avatars()) {
      ++id;
      if (AppendChange(avatar, message.records)) Add(message, id, 0);
    }
    return message;
  }
  protocol::Movements States() {
    protocol::Movements message = Empty();
    message.states = true;
    protocol::AvatarId id = 0;
    for (const AvatarSimulation& avatar : crowd_.avatars()) {
      AppendState(avatar, message.records);
      Add(message, ++id, 0);
    }
    return message;
  }
  void Advance(std::uint64_t every_n_ticks = 1) {
    const protocol::Movements message = Step();
    every_tick_.Receive(message, every_n_ticks);
    when_sampled_.Receive(message, every_n_ticks);
  }
  /// Compares the displayed poses of a tick.
  void ExpectSamePoses(std::uint64_t tick) {
    const double time_s = kIntervalS * static_cast<double>(tick);
    const CrowdPose& expected = every_tick_.Sample(time_s);
    const CrowdPose& actual = when_sampled_.Sample(time_s);
    ASSERT_EQ(actual.avatars, expected.avatars);
    EXPECT_EQ(actual.flags, expected.flags);
    for (std::size_t i = 0; i < actual.avatars.size(); ++i) {
      EXPECT_TRUE(IsSame(PoseOf(actual, i), PoseOf(expected, i)))
          << "avatar " << actual.avatars[i] << ", tick " << tick;
    }
  }
  /// Compares all stored poses, which reads the poses of ticks after they were sampled.
  void ExpectSameHistories() {
    for (protocol::AvatarId avatar = 1; avatar <= kAvatars; ++avatar) {
      const PoseHistory* expected = every_tick_.view.Find(avatar);
      const PoseHistory* actual = when_sampled_.view.Find(avatar);
      ASSERT_TRUE(expected != nullptr && actual != nullptr);
      ASSERT_EQ(actual->size(), expected->size());
      for (std::size_t i = 0; i < expected->size(); ++i) {
        const PoseStamp& stamp = expected->stamp(i);
        EXPECT_EQ(actual->stamp(i).tick, stamp.tick);
        EXPECT_EQ(actual->stamp(i).time_s, stamp.time_s);
        EXPECT_EQ(actual->stamp(i).standing, stamp.standing);
        EXPECT_EQ(actual->stamp(i).discontinuity, stamp.discontinuity);
        EXPECT_EQ(actual->stamp(i).segment, stamp.segment);
        EXPECT_TRUE(IsSame({actual->root_position_m(i), actual->rotations(i)},
                           {expected->root_position_m(i), expected->rotations(i)}))
            << "avatar " << avatar << ", tick " << stamp.tick;
      }
    }
  }
  /// Compares the recorded poses of a time before now. The recordings contain the last 5 s.
  void ExpectSameRecordings(double ago_s) {
    const auto all = [](protocol::AvatarId) { return true; };
    CrowdPose expected;
    CrowdPose actual;
    every_tick_.view.recording().SampleAll(now_s() - ago_s, all, expected);
    when_sampled_.view.recording().SampleAll(now_s() - ago_s, all, actual);
    ASSERT_EQ(actual.avatars, expected.avatars) << tick_;
    EXPECT_EQ(actual.flags, expected.flags) << tick_;
    double distance_m = 0.0;
    EXPECT_LT(LargestTurn(actual, expected, distance_m), 3e-3) << tick_;
    EXPECT_LT(distance_m, 1e-5) << tick_;
  }
  static ConstPoseSpan PoseOf(const CrowdPose& crowd, std::size_t i) {
    return {crowd.roots_m[i],
            std::span(crowd.rotations).subspan(i * crowd.joint_count, crowd.joint_count)};
  }
  /// Returns the largest angle between rotations of two poses of the crowd, and sets the largest
  /// distance between roots.
  static double LargestTurn(const CrowdPose& a, const CrowdPose& b, double& distance_m) {
    double turn_rad = 0.0;
    for (std::size_t i = 0; i < a.rotations.size(); ++i) {
      const double cosine = std::fabs(static_cast<double>(Dot(a.rotations[i], b.rotations[i])));
      turn_rad = std::max(turn_rad, 2.0 * std::acos(std::min(cosine, 1.0)));
    }
    for (std::size_t i = 0; i < a.roots_m.size(); ++i) {
      const Vec3 apart_m = a.roots_m[i] - b.roots_m[i];
      distance_m = std::max(distance_m, std::sqrt(static_cast<double>(glm::dot(apart_m, apart_m))));
    }
    return turn_rad;
  }
  [[nodiscard]] double now_s() const { return kIntervalS * static_cast<double>(tick_); }
  [[nodiscard]] protocol::Movements Empty() const {
    return {.world = 1, .tick = tick_, .server_time_s = now_s()};
  }

  std::shared_ptr<const MotionLibrary> library_ = OpenLibrary("builtin").value();
  std::uint64_t tick_ = 0;
  DrawnCrowd crowd_{library_, kAvatars, 1};
  Viewer every_tick_{library_, WorldView::Evaluation::kEveryTick};
  Viewer when_sampled_{library_, WorldView::Evaluation::kWhenSampled};

 private:
  static void Add(protocol::Movements& message, protocol::AvatarId id, std::uint8_t flags) {
    message.avatars.push_back(id);
    message.flags.push_back(flags);
    message.ends.push_back(static_cast<std::uint32_t>(message.records.size()));
  }
};

TEST_F(SampledMovementTest, DisplaysTheSamePosesAtTicks) {
  for (std::uint64_t i = 0; i < 900; ++i) {
    Advance();
    if (i < 4) continue;
    // A page also samples times between ticks.
    if (i % 2 == 0) when_sampled_.Sample(now_s() - 2.3 * kIntervalS);
    ASSERT_NO_FATAL_FAILURE(ExpectSamePoses(tick_ - i % 3));
    if (i % 97 == 0) {
      ASSERT_NO_FATAL_FAILURE(ExpectSameHistories());
    }
  }
}

TEST_F(SampledMovementTest, KeepsTheSamePosesWithoutBeingSampled) {
  for (int i = 0; i < 200; ++i) Advance();
  ASSERT_NO_FATAL_FAILURE(ExpectSameHistories());
}

// A page that was hidden displays the crowd as it is now, so poses before and after it belong to
// different segments.
TEST_F(SampledMovementTest, ChangesSegmentsIfDisplayedPosesAreNoLongerStored) {
  const auto newest_segment = [](WorldView& view, protocol::AvatarId avatar) {
    const PoseHistory* history = view.Find(avatar);
    return history->stamp(history->size() - 1).segment;
  };
  for (const int hidden_ticks : {100, 300, 470}) {
    for (int i = 0; i < 100; ++i) {
      Advance();
      every_tick_.Sample(now_s() - 2.3 * kIntervalS);
      when_sampled_.Sample(now_s() - 2.3 * kIntervalS);
    }
    std::map<std::pair<Viewer*, protocol::AvatarId>, std::uint32_t> before;
    const auto for_each = [&](const auto& callback) {
      for (Viewer* viewer : {&every_tick_, &when_sampled_}) {
        viewer->Sample(now_s() - 2.3 * kIntervalS);
        for (protocol::AvatarId avatar = 1; avatar <= kAvatars; ++avatar) callback(viewer, avatar);
      }
    };
    for_each([&](Viewer* viewer, protocol::AvatarId avatar) {
      before[{viewer, avatar}] = newest_segment(viewer->view, avatar);
    });
    for (int i = 0; i < hidden_ticks; ++i) Advance();
    for_each([&](Viewer* viewer, protocol::AvatarId avatar) {
      EXPECT_NE(newest_segment(viewer->view, avatar), (before[{viewer, avatar}]))
          << "avatar " << avatar << ", " << hidden_ticks << " ticks";
    });
  }
}

TEST_F(SampledMovementTest, DisplaysTheSamePosesOfSomeTicks) {
  for (std::uint64_t i = 0; i < 600; ++i) {
    Advance(3);
    if (i < 9) continue;
    ASSERT_NO_FATAL_FAILURE(ExpectSamePoses((tick_ / 3 - i % 2) * 3));
  }
}

TEST_F(SampledMovementTest, DisplaysContinuousMotionBetweenTicks) {
  constexpr int kParts = 8;
  for (const std::uint64_t every_n_ticks : {1, 3}) {
    double largest_rad = 0.0;
    double largest_m = 0.0;
    double expected_rad = 0.0;
    double expected_m = 0.0;
    CrowdPose before;
    CrowdPose expected_before;
    for (int i = 0; i < 600; ++i) {
      Advance(every_n_ticks);
      if (i < 10) continue;
      for (int part = 0; part < kParts; ++part) {
        const double time_s = now_s() - kIntervalS * (6 - static_cast<double>(part) / kParts);
        const CrowdPose& expected = every_tick_.Sample(time_s);
        const CrowdPose& actual = when_sampled_.Sample(time_s);
        EXPECT_EQ(actual.flags, expected.flags);
        if (!before.avatars.empty()) {
          largest_rad = std::max(largest_rad, LargestTurn(actual, before, largest_m));
          expected_rad = std::max(expected_rad, LargestTurn(expected, expected_before, expected_m));
        }
        before = actual;
        expected_before = expected;
      }
    }
    EXPECT_LT(largest_rad, 1.1 * expected_rad) << every_n_ticks;
    EXPECT_LT(largest_m, 1.1 * expected_m) << every_n_ticks;
  }
}

TEST_F(SampledMovementTest, DisplaysTheSameMotionIfMessagesAreLate) {
  double distance_m = 0.0;
  double turn_rad = 0.0;
  std::vector<protocol::Movements> late;
  for (int i = 0; i < 900; ++i) {
    late.push_back(Step());
    // Messages sometimes arrive 4 ticks late.
    if (i % 50 < 46 && i % 170 >= 3) {
      for (const protocol::Movements& message : late) {
        every_tick_.Receive(message, 1);
        when_sampled_.Receive(message, 1);
      }
      late.clear();
    }
    if (i < 10) continue;
    const double time_s = now_s() - 1.4 * kIntervalS;
    const CrowdPose& expected = every_tick_.Sample(time_s);
    const CrowdPose& actual = when_sampled_.Sample(time_s);
    ASSERT_EQ(actual.avatars, expected.avatars);
    EXPECT_EQ(actual.flags, expected.flags);
    turn_rad = std::max(turn_rad, LargestTurn(actual, expected, distance_m));
  }
  EXPECT_EQ(when_sampled_.displayed.extrapolated, every_tick_.displayed.extrapolated);
  EXPECT_GT(when_sampled_.displayed.extrapolated, 1000u);
  EXPECT_LT(turn_rad, 0.06);
  EXPECT_LT(distance_m, 0.002);
  ASSERT_NO_FATAL_FAILURE(ExpectSameHistories());
}

TEST_F(SampledMovementTest, RecordsTheSamePoses) {
  for (int i = 0; i < 900; ++i) {
    Advance();
    when_sampled_.Sample(now_s() - 1.4 * kIntervalS);
    if (i % 10 != 0) continue;
    if (i == 300) {
      for (Viewer* viewer : {&every_tick_, &when_sampled_}) viewer->view.recording().Clear();
      Advance();
    }
    ASSERT_NO_FATAL_FAILURE(ExpectSameRecordings(0.01 * (i % 300)));
  }
  // Movements that last longer than the recordings.
  for (int i = 0; i < 600; ++i) {
    ++tick_;
    protocol::Movements message = Empty();
    message.step = tick_;
    every_tick_.Receive(message, 1);
    when_sampled_.Receive(message, 1);
    if (i % 10 != 0) continue;
    ASSERT_NO_FATAL_FAILURE(ExpectSameRecordings(0.02 * (i % 200)));
  }
}

TEST_F(SampledMovementTest, RecordsTheSamePosesAfterAServerRestart) {
  for (int i = 0; i < 1000; ++i) Advance();
  // The tick numbers of the new server are lower.
  tick_ = 0;
  const auto library = OpenLibrary("builtin").value();
  for (Viewer* viewer : {&every_tick_, &when_sampled_}) {
    viewer->replicas = ReplicaSet(library, kIntervalS, kAvatars);
    viewer->view.ClearPoses();
    viewer->view.recording().Clear();
    viewer->Receive(States(), 1);
  }
  // Movements that last longer than the recordings.
  for (int i = 0; i < 600; ++i) {
    ++tick_;
    protocol::Movements message = Empty();
    message.step = tick_;
    every_tick_.Receive(message, 1);
    when_sampled_.Receive(message, 1);
    when_sampled_.Sample(now_s() - 1.4 * kIntervalS);
    if (i % 10 != 0) continue;
    ASSERT_NO_FATAL_FAILURE(ExpectSameRecordings(0.0));
  }
}

TEST_F(SampledMovementTest, KeepsPosesIfTheLibraryOrTheReplicasChange) {
  for (int i = 0; i < 40; ++i) {
    Advance();
    when_sampled_.Sample(now_s() - 1.4 * kIntervalS);
  }
  const auto same_library = OpenLibrary("builtin").value();
  for (Viewer* viewer : {&every_tick_, &when_sampled_}) {
    viewer->replicas = ReplicaSet(same_library, kIntervalS, kAvatars);
    viewer->view.Break();
    viewer->Receive(States(), 1);
  }
  for (int i = 0; i < 20; ++i) {
    Advance();
    ASSERT_NO_FATAL_FAILURE(ExpectSamePoses(tick_ - 1));
  }
  ASSERT_NO_FATAL_FAILURE(ExpectSameHistories());
}

}  // namespace
}  // namespace stridewire::client
