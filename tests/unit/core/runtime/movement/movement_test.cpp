#include "runtime/movement/movement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <random>

#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/foot_vector.h"
#include "test_library.h"

namespace stridewire {
namespace {

class MovementTest : public testing::Test {
 protected:
  Movement Start(int group_index, std::span<const double> parameters, const BaseFrame& base = {}) {
    Movement movement;
    movement.difference = Pose(7);
    StartMovement(library_->group(group_index), group_index, parameters, base, scratch_, movement);
    cache_.Clear();
    return movement;
  }
  Pose Blend(const Movement& movement, double time_s) {
    Pose pose(7);
    EvaluateBlend(library_->group(movement.group), library_->layout(), movement, time_s, cache_,
                  pose);
    return pose;
  }
  Pose Shown(const Movement& movement, double time_s) {
    Pose pose(7);
    EvaluateMovement(library_->group(movement.group), library_->layout(), movement, time_s, cache_,
                     pose);
    return pose;
  }

  const std::shared_ptr<const MotionLibrary> library_ = MakeTestLibrary();
  GridCache cache_{library_->layout()};
  std::vector<double> scratch_ = std::vector<double>(15);
};

TEST_F(MovementTest, ReachesTheRequestedLengths) {
  for (const auto& p : {std::array{-0.3, 0.5}, std::array{-0.1, 0.35}, std::array{-0.55, 0.15}}) {
    const Movement movement = Start(0, p);
    EXPECT_NEAR(std::accumulate(movement.weights.begin(), movement.weights.end(), 0.0), 1.0, 1e-6);
    const DVec3 start = FootVector(library_->skeleton(), Blend(movement, 0.0), Foot::kLeft, 0.0);
    const DVec3 end =
        FootVector(library_->skeleton(), Blend(movement, movement.duration_s()), Foot::kLeft, 0.0);
    EXPECT_NEAR(start.z, p[0], 0.01);
    EXPECT_NEAR(end.z, p[1], 0.01);
  }
}

TEST_F(MovementTest, BaseFrameTransformsTheWholeMovement) {
  const std::array p = {-0.3, 0.5};
  const Movement at_origin = Start(0, p);
  const Pose plain = Blend(at_origin, 0.3);
  const Movement moved = Start(0, p, {{10.0, 1.0, -5.0}, M_PI / 2});
  const Pose turned = Blend(moved, 0.3);
  EXPECT_NEAR(turned.root_position_m.x, 10.0 + plain.root_position_m.z, 1e-5);
  EXPECT_NEAR(turned.root_position_m.y, 1.0 + plain.root_position_m.y, 1e-5);
  double heading = 0.0;
  ASSERT_TRUE(HeadingOf(turned.rotations[0], heading));
  EXPECT_NEAR(heading, M_PI / 2, 1e-6);
  EXPECT_LT(AngleBetween(turned.rotations[1], plain.rotations[1]), 1e-6);
}

TEST_F(MovementTest, StartsInThePreviousPoseAndEndsInItsOwn) {
  std::mt19937 random(77);
  std::normal_distribution<float> normal;
  const std::array p = {-0.2, 0.4};
  Movement movement = Start(1, p, {{3.0, 0.0, 2.0}, 0.5});
  Pose previous(7);
  previous.root_position_m = {2.9f, 0.8f, 2.1f};
  for (Quat& q : previous.rotations) {
    q = Normalise(Quat(normal(random), normal(random), normal(random), normal(random)));
  }
  Subtract(previous, Blend(movement, 0.0), movement.difference);
  const Pose first = Shown(movement, 0.0);
  EXPECT_LT(glm::length(first.root_position_m - previous.root_position_m), 1e-5f);
  EXPECT_LT(LargestJointAngle(first, previous), 1e-3);
  for (const double t : {movement.ease_out_s, movement.duration_s()}) {
    EXPECT_LT(glm::length(Shown(movement, t).root_position_m - Blend(movement, t).root_position_m),
              1e-5f);
    EXPECT_LT(LargestJointAngle(Shown(movement, t), Blend(movement, t)), 1e-5);
  }
}

TEST_F(MovementTest, HasContinuousVelocityBetweenItsEnds) {
  const Movement movement = Start(0, std::array{-0.35, 0.45});
  const double h = 1.0 / 960.0;
  Vec3 last_velocity(0.0f);
  float largest = 0.0f;
  for (double t = h; t < movement.duration_s() - h; t += h) {
    const Vec3 velocity =
        (Blend(movement, t).root_position_m - Blend(movement, t - h).root_position_m) /
        static_cast<float>(h);
    if (t > 2 * h) largest = std::max(largest, glm::length(velocity - last_velocity));
    last_velocity = velocity;
  }
  EXPECT_LT(largest, 0.05f) << "linear interpolation of a 30 Hz grid steps by 0.2 m/s here";
}

TEST_F(MovementTest, CacheDoesNotChangeBytes) {
  const Movement movement = Start(0, std::array{-0.35, 0.45});
  for (const double t : {0.5, 0.1, 0.3, 0.31, 0.0, 0.45}) {
    GridCache fresh(library_->layout());
    Pose expected(7);
    EvaluateBlend(library_->group(0), library_->layout(), movement, t, fresh, expected);
    const Pose cached = Blend(movement, t);
    EXPECT_EQ(cached.root_position_m, expected.root_position_m);
    for (std::size_t j = 0; j < 7; ++j) EXPECT_EQ(cached.rotations[j], expected.rotations[j]);
  }
}

TEST_F(MovementTest, ReturnsUnitRotationsForExtrapolatedWeights) {
  const Movement movement = Start(0, std::array{-2.0, 3.0});
  for (double t = 0.0; t <= movement.duration_s(); t += 0.01) {
    for (const Quat& q : Blend(movement, t).rotations) ASSERT_NEAR(glm::length(q), 1.0f, 1e-5f);
  }
}

TEST_F(MovementTest, UsesTheLargestExampleIfRotationsCancel) {
  Movement cancels = Start(0, std::array{-0.35, 0.45});
  std::ranges::fill(cancels.weights, 0.0f);
  Movement alone = cancels;
  cancels.weights[2] = 0.51f;
  cancels.weights[3] = -0.5f;
  alone.weights[2] = 1.0f;
  const double time_s = 0.4 * cancels.duration_s();
  const Pose pose = Blend(cancels, time_s);
  cache_.Clear();
  const Pose largest = Blend(alone, time_s);
  for (std::size_t j = 1; j < pose.rotations.size(); ++j) {
    EXPECT_LT(AngleBetween(pose.rotations[j], largest.rotations[j]), 1e-5) << j;
  }
}

TEST_F(MovementTest, BaseAfterIsBelowTheRootAndTurned) {
  Movement movement = Start(0, std::array{-0.4, 0.4}, {{1.0, 0.5, 2.0}, 0.3});
  movement.heading_change_rad = 0.25;
  const Pose end = Blend(movement, movement.duration_s());
  const BaseFrame after = BaseAfter(movement, end);
  EXPECT_FLOAT_EQ(static_cast<float>(after.position_m.x), end.root_position_m.x);
  EXPECT_EQ(after.position_m.y, 0.5);
  EXPECT_DOUBLE_EQ(after.heading_rad, 0.55);
}

TEST_F(MovementTest, SwingingFootTiltsLessThanTheGround) {
  constexpr float kDegree = 0.0174533f;
  const Vec3 slope(0.0f, std::cos(20.0f * kDegree), -std::sin(20.0f * kDegree));
  Movement movement = Start(0, std::array{-0.4, 0.4});
  FootTrajectory& trajectory = movement.feet.foot(Foot::kLeft);
  trajectory.normals.fill(slope);
  trajectory.release_s = 0.2 * movement.duration_s();
  trajectory.land_s = 0.8 * movement.duration_s();
  const auto tilt_deg = [&](double part) {
    const Vec3 normal =
        CorrectFoot(movement, Foot::kLeft, part * movement.duration_s(), BlendedFoot{}).normal;
    return std::acos(normal.y) / kDegree;
  };
  for (const double standing : {0.0, 0.2, 0.8, 1.0}) EXPECT_NEAR(tilt_deg(standing), 20.0, 0.1);
  EXPECT_LT(tilt_deg(0.5), 10.0);
}

}  // namespace
}  // namespace stridewire
