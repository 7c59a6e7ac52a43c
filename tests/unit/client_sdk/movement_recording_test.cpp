#include "movement_recording.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "random_requests.h"
#include "runtime/avatar/movement_record.h"
#include "runtime/library/pose_quantization.h"
#include "stridewire/offline/open_library.h"
#include "world_view.h"

namespace stridewire::client {
namespace {

constexpr double kStepS = 1.0 / 60.0;

// More than a block of the encoder for poses with layers.
constexpr int kCrowd = 20;

/// A view that observes a crowd with random requests in movement mode, and records it. The
/// parameter is true if the world has compact poses.
class MovementRecordingTest : public testing::TestWithParam<bool> {
 protected:
  MovementRecordingTest()
      : crowd_(library_, kCrowd, 1),
        replicas_(library_, kStepS, kCrowd),
        view_(600, budget_, Recording()) {
    protocol::WorldInfo info;
    info.world = 1;
    info.library_hash = library_->hash();
    for (const Joint& joint : library_->skeleton().joints) {
      info.skeleton.joints.push_back(
          {joint.name, static_cast<std::int16_t>(joint.parent), joint.offset_m});
    }
    if (GetParam()) info.rotation_quantizations = ChoosePoseQuantization(*library_).joints;
    view_.SetInfo(info);
  }
  static PoseRecording Recording() { return {5.0, std::size_t{1} << 26}; }

  void Advance() {
    crowd_.Advance();
    ++tick_;
    protocol::Movements message{.world = 1,
                                .step = tick_,
                                .tick = tick_,
                                .server_time_s = kStepS * static_cast<double>(tick_)};
    protocol::AvatarId id = 0;
    for (const AvatarSimulation& avatar : crowd_.avatars()) {
      ++id;
      if (!AppendChange(avatar, message.records)) continue;
      message.avatars.push_back(id);
      message.flags.push_back(0);
      message.ends.push_back(static_cast<std::uint32_t>(message.records.size()));
    }
    ASSERT_TRUE(view_.Apply(message, replicas_, 1, counts_));
  }

  const CrowdPose& Recorded(double time_s) {
    view_.recording().SampleAll(time_s, [](protocol::AvatarId) { return true; }, recorded_);
    return recorded_;
  }

  std::shared_ptr<const MotionLibrary> library_ = OpenLibrary("builtin").value();
  DrawnCrowd crowd_;
  ReplicaSet replicas_;
  PoseBudget budget_{std::size_t{1} << 26, 0};
  WorldView view_;
  WorldView::Counts counts_;
  std::uint64_t tick_ = 0;
  CrowdPose recorded_;
};

TEST_P(MovementRecordingTest, EvaluatesTheOriginalPoses) {
  for (int i = 0; i < 500; ++i) Advance();
  CrowdPose live;
  DisplayCounts displayed;
  std::size_t equal = 0;
  std::size_t poses = 0;
  for (std::uint64_t tick = 220; tick <= tick_; ++tick) {
    const double time_s = kStepS * static_cast<double>(tick);
    view_.SampleAll(time_s, live, displayed);
    const CrowdPose& recorded = Recorded(time_s);
    ASSERT_EQ(recorded.avatars, live.avatars);
    EXPECT_EQ(recorded.flags, live.flags);
    for (std::size_t i = 0; i < live.avatars.size(); ++i) {
      double largest = 0.0;
      bool is_equal = true;
      for (std::size_t j = 0; j < live.joint_count; ++j) {
        const std::size_t at = i * live.joint_count + j;
        const double cosine = Dot(live.rotations[at], recorded.rotations[at]);
        largest = std::max(largest, 1.0 - std::fabs(cosine));
        is_equal &= live.rotations[at] == recorded.rotations[at];
      }
      // Poses with layers and poses without a movement are encoded.
      ASSERT_LT(largest, 1e-4) << "avatar " << live.avatars[i] << ", tick " << tick;
      equal += is_equal;
      ++poses;
    }
  }
  EXPECT_GT(equal, poses / 4);
  EXPECT_LT(equal, poses * 9 / 10);
}

TEST_P(MovementRecordingTest, RemovesMovementsWithTheirTicks) {
  for (int i = 0; i < 450; ++i) Advance();
  const std::size_t bytes = view_.recording().movements().bytes();
  EXPECT_GT(bytes, 0u);
  std::size_t most = 0;
  for (int i = 0; i < 900; ++i) {
    Advance();
    most = std::max(most, view_.recording().movements().bytes());
  }
  EXPECT_LT(most, 2 * bytes);
  view_.recording().Clear();
  EXPECT_EQ(view_.recording().movements().bytes(), 0u);
  EXPECT_TRUE(Recorded(kStepS * static_cast<double>(tick_)).avatars.empty());
  Advance();
  EXPECT_EQ(Recorded(kStepS * static_cast<double>(tick_)).avatars.size(),
            static_cast<std::size_t>(kCrowd));
}

INSTANTIATE_TEST_SUITE_P(Modes, MovementRecordingTest, testing::Bool());

}  // namespace
}  // namespace stridewire::client
