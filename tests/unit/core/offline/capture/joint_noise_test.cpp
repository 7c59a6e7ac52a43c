#include "offline/capture/joint_noise.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "synthetic_walker.h"

namespace stridewire {
namespace {

// Rotates a joint about its x axis, which bends toes.
Quat Bend(double angle_rad) {
  return {static_cast<float>(std::cos(0.5 * angle_rad)),
          static_cast<float>(std::sin(0.5 * angle_rad)), 0.0f, 0.0f};
}

class RemoveJointNoise : public testing::Test {
 protected:
  void SetUp() override {
    RecordProperty("seed", static_cast<int>(seed_));
    ASSERT_GE(toes_, 0);
  }

  Quat& At(int joint, int frame) {
    return capture_.clip.frame(frame).rotations[static_cast<std::size_t>(joint)];
  }
  // Bends the left toes as in a push-off of 0.25 s in the middle of the clip.
  [[nodiscard]] double PushOff(int frame) const {
    const double s = (frame - 0.5 * capture_.clip.frame_count()) / capture_.clip.fps / 0.25;
    return std::fabs(s) < 0.5 ? 0.25 * (1.0 + std::cos(2.0 * std::numbers::pi * s)) : 0.0;
  }
  std::vector<int> Remove() {
    return stridewire::RemoveJointNoise(capture_.skeleton, capture_.first_frame, capture_.clip);
  }
  // Returns the sum of the squared angles of a joint.
  double Squares(int joint) {
    double sum = 0.0;
    for (int f = 0; f < capture_.clip.frame_count(); ++f) {
      sum += std::pow(AngleBetween(At(joint, f), kIdentityQuat), 2);
    }
    return sum;
  }
  void SetNoise(int joint, double deviation_rad) {
    std::normal_distribution<double> noise(0.0, deviation_rad);
    for (int f = 0; f < capture_.clip.frame_count(); ++f) At(joint, f) = Bend(noise(random_));
  }

  std::uint32_t seed_ = std::random_device{}();
  std::mt19937 random_{seed_};
  Capture capture_ = SyntheticWalker{}.Walk({{Foot::kLeft, 0.5}, {Foot::kRight, 0.6}});
  int toes_ = capture_.skeleton.FindJoint("LeftToeBase");
  int ankle_ = capture_.skeleton.legs[0].ankle;
};

TEST_F(RemoveJointNoise, RemovesNoiseAndSingleFlipsFromToes) {
  SCOPED_TRACE(seed_);
  SetNoise(toes_, 0.05);
  for (int f = 7; f < capture_.clip.frame_count(); f += 20) At(toes_, f) = Bend(0.6);
  const double before = Squares(toes_);
  EXPECT_THAT(Remove(), testing::ElementsAre(toes_));
  EXPECT_LT(Squares(toes_), 0.04 * before);
  for (int f = 1; f < capture_.clip.frame_count(); ++f) {
    EXPECT_LT(AngleBetween(At(toes_, f - 1), At(toes_, f)), 0.04) << f;
  }
}

TEST_F(RemoveJointNoise, RemovesNoiseAtAHighFrameRate) {
  SCOPED_TRACE(seed_);
  capture_.clip.fps = 1000.0;
  SetNoise(toes_, 0.05);
  const double before = Squares(toes_);
  EXPECT_THAT(Remove(), testing::Contains(toes_));
  EXPECT_LT(Squares(toes_), 0.2 * before);
}

TEST_F(RemoveJointNoise, SmoothsOnlyJointsThatVibrate) {
  SCOPED_TRACE(seed_);
  SetNoise(ankle_, 0.01);
  SetNoise(toes_, 0.005);
  const double small = Squares(ankle_) + Squares(toes_);
  EXPECT_THAT(Remove(), testing::IsEmpty());
  EXPECT_EQ(Squares(ankle_) + Squares(toes_), small);

  SetNoise(ankle_, 0.1);
  const double large = Squares(ankle_);
  EXPECT_THAT(Remove(), testing::ElementsAre(ankle_));
  EXPECT_LT(Squares(ankle_), 0.5 * large);
}

TEST_F(RemoveJointNoise, KeepsAPushOff) {
  SCOPED_TRACE(seed_);
  SetNoise(toes_, 0.03);
  for (int f = 0; f < capture_.clip.frame_count(); ++f) {
    At(toes_, f) = At(toes_, f) * Bend(PushOff(f));
  }
  EXPECT_THAT(Remove(), testing::ElementsAre(toes_));
  for (int f = 0; f < capture_.clip.frame_count(); ++f) {
    EXPECT_NEAR(AngleBetween(At(toes_, f), kIdentityQuat), PushOff(f), 0.1) << f;
  }
}

TEST_F(RemoveJointNoise, KeepsOtherJointsAndFramesBeforeTheFirst) {
  capture_.first_frame = 1;
  At(toes_, 0) = Bend(1.0);  // Like the artificial T-pose of a recording.
  const Clip before = capture_.clip;
  static_cast<void>(Remove());
  for (int f = 0; f < capture_.clip.frame_count(); ++f) {
    for (int joint = 0; joint < capture_.skeleton.joint_count(); ++joint) {
      if (f > 0 && IsLimbEnd(capture_.skeleton, joint)) continue;
      EXPECT_EQ(At(joint, f), before.frame(f).rotations[static_cast<std::size_t>(joint)])
          << capture_.skeleton.joints[static_cast<std::size_t>(joint)].name << " " << f;
    }
  }
}

}  // namespace
}  // namespace stridewire
