#include "offline/capture/root_noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "stridewire/runtime/pose.h"
#include "synthetic_walker.h"

namespace stridewire {
namespace {

class RemoveRootNoise : public testing::Test {
 protected:
  struct World {
    std::vector<Vec3> positions;
    std::vector<Quat> rotations;
  };
  [[nodiscard]] World At(const Clip& clip, int frame) const {
    World world{std::vector<Vec3>(capture_.skeleton.joints.size()),
                std::vector<Quat>(capture_.skeleton.joints.size())};
    ForwardKinematics(capture_.skeleton, clip.frame(frame), world.positions, world.rotations);
    return world;
  }
  // Returns the mean acceleration of the root in m/s^2.
  [[nodiscard]] static double Acceleration(const Clip& clip) {
    double sum = 0.0;
    for (int f = 1; f + 1 < clip.frame_count(); ++f) {
      const Vec3 bend = clip.frame(f + 1).root_position_m - 2.0f * clip.frame(f).root_position_m +
                        clip.frame(f - 1).root_position_m;
      sum += static_cast<double>(glm::length(bend)) * clip.fps * clip.fps;
    }
    return sum / (clip.frame_count() - 2);
  }
  // Adds a random displacement and rotation to the root in each frame. The legs move with the root.
  void Shake(double deviation_m, double deviation_rad) {
    std::normal_distribution<float> metres(0.0f, static_cast<float>(deviation_m));
    std::normal_distribution<float> radians(0.0f, static_cast<float>(deviation_rad));
    for (int f = 0; f < capture_.clip.frame_count(); ++f) {
      PoseSpan pose = capture_.clip.frame(f);
      pose.root_position_m += Vec3(metres(random_), metres(random_), metres(random_));
      pose.rotations[0] =
          pose.rotations[0] * Normalise(Quat(1.0f, 0.5f * radians(random_), 0.5f * radians(random_),
                                             0.5f * radians(random_)));
    }
  }

  std::uint32_t seed_ = std::random_device{}();
  std::mt19937 random_{seed_};
  Capture capture_ = SyntheticWalker{}.Walk({{Foot::kLeft, 0.5}, {Foot::kRight, 0.6}});
};

TEST_F(RemoveRootNoise, LeavesAWalkUnchanged) {
  const Clip before = capture_.clip;
  EXPECT_FALSE(stridewire::RemoveRootNoise(capture_.skeleton, 0, capture_.clip));
  EXPECT_EQ(capture_.clip.root_positions_m, before.root_positions_m);
  EXPECT_EQ(capture_.clip.rotations, before.rotations);
}

TEST_F(RemoveRootNoise, SmoothsAShakingRootAndKeepsTheFeet) {
  std::printf("seed %u\n", seed_);
  const Clip clean = capture_.clip;
  Shake(0.004, 0.03);
  const Clip before = capture_.clip;
  ASSERT_TRUE(stridewire::RemoveRootNoise(capture_.skeleton, 0, capture_.clip));
  EXPECT_LT(Acceleration(capture_.clip) - Acceleration(clean),
            0.3 * (Acceleration(before) - Acceleration(clean)));
  double error_before_m = 0.0;
  double error_m = 0.0;
  for (int f = 0; f < before.frame_count(); ++f) {
    const World expected = At(clean, f);
    const World was = At(before, f);
    const World is = At(capture_.clip, f);
    for (const Leg& leg : capture_.skeleton.legs) {
      const auto ankle = static_cast<std::size_t>(leg.ankle);
      error_before_m += glm::length(was.positions[ankle] - expected.positions[ankle]);
      error_m += glm::length(is.positions[ankle] - expected.positions[ankle]);
      EXPECT_LT(AngleBetween(is.rotations[ankle], was.rotations[ankle]), 1e-3) << f;
    }
  }
  EXPECT_LT(error_m, 0.75 * error_before_m);
}

TEST_F(RemoveRootNoise, LeavesFramesBeforeTheFirstUnchanged) {
  Shake(0.004, 0.03);
  const Clip before = capture_.clip;
  ASSERT_TRUE(stridewire::RemoveRootNoise(capture_.skeleton, 10, capture_.clip));
  for (int f = 0; f < 10; ++f) {
    EXPECT_EQ(capture_.clip.frame(f).root_position_m, before.frame(f).root_position_m);
  }
}

}  // namespace
}  // namespace stridewire
