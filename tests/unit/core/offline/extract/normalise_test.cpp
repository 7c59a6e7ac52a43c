#include "offline/extract/normalise.h"

#include <gtest/gtest.h>

#include <random>

#include "stridewire/runtime/pose.h"
#include "synthetic_walker.h"

namespace stridewire {
namespace {

TEST(NormaliseClip, MovesTheStartRigidlyToTheOrigin) {
  const std::uint32_t seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-3.0, 3.0);
  SyntheticWalker walker;
  walker.heading_rad = any(random);
  walker.start_m = DVec3(any(random), 0.0, any(random));
  const Capture capture = walker.Walk({{Foot::kLeft, 0.5}, {Foot::kRight, 0.6}});
  const double heading = any(random);
  const double ground = 0.3 * any(random);
  const FrameRange frames{40, 160};
  const Clip clip = NormaliseClip(capture.clip, frames, heading, ground);
  ASSERT_EQ(clip.frame_count(), frames.size());
  EXPECT_TRUE(clip.Validate().has_value());
  const Vec3 first = capture.clip.root_positions_m[40];
  EXPECT_EQ(clip.root_positions_m[0].x, 0.0f);
  EXPECT_EQ(clip.root_positions_m[0].z, 0.0f);
  for (int f = 0; f < clip.frame_count(); ++f) {
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const DVec3 before(BallPosition(capture.skeleton, capture.clip.frame(40 + f), foot));
      const DVec3 after(BallPosition(capture.skeleton, clip.frame(f), foot));
      const DVec3 back = RotateYaw(heading, after) + DVec3(first.x, ground, first.z);
      EXPECT_LT(glm::length(back - before), 1e-5) << f;
    }
  }
}

TEST(NormaliseClip, TurnsTheFigureToItsHeading) {
  SyntheticWalker walker;
  walker.heading_rad = 1.9;
  const Capture capture = walker.Walk({{Foot::kLeft, 0.5}});
  const Clip clip = NormaliseClip(capture.clip, {0, 10}, 1.9, 0.0);
  double yaw = 1.0;
  ASSERT_TRUE(HeadingOf(clip.frame(0).rotations[0], yaw));
  EXPECT_NEAR(yaw, 0.0, 1e-6);
  // The feet are to the left (+x) and right of it.
  EXPECT_GT(BallPosition(capture.skeleton, clip.frame(0), Foot::kLeft).x, 0.05f);
  EXPECT_LT(BallPosition(capture.skeleton, clip.frame(0), Foot::kRight).x, -0.05f);
}

}  // namespace
}  // namespace stridewire
