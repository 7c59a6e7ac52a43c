#include "stridewire/base/math.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace stridewire {
namespace {

Quat Turn(double angle_rad) {
  const double half = 0.5 * angle_rad;
  const DVec3 axis = std::sin(half) * glm::normalize(DVec3(1.0, -2.0, 0.5));
  return Quat(DQuat(std::cos(half), axis.x, axis.y, axis.z));
}

TEST(AngleBetween, IsTheAngleOfTheRotation) {
  const Quat from = Turn(-1.3);
  for (double angle = 0.0; angle <= std::numbers::pi; angle += 0.0037) {
    const Quat to = Turn(angle - 1.3);
    // Quaternions in single precision are accurate to about 1e-7.
    ASSERT_NEAR(AngleBetween(from, to), angle, 5e-7) << angle;
    ASSERT_NEAR(AngleBetween(to, from), angle, 5e-7) << angle;
    // The negated quaternion is the same rotation.
    ASSERT_NEAR(AngleBetween(from, -to), angle, 5e-7) << angle;
  }
  EXPECT_EQ(AngleBetween(from, from), 0.0);
}

}  // namespace
}  // namespace stridewire
