#include "runtime/pose/plant_feet.h"

#include <gtest/gtest.h>

#include <cmath>

#include "runtime/plan/foot_locks.h"

namespace stridewire {
namespace {

// Returns the turn of a foot that stands on a footprint with heading 0.
double TurnOfStandingFoot(double heading_rad, double flatness) {
  Movement movement;
  StandOn(FootLocks{}, movement);
  return CorrectFoot(movement, Foot::kLeft, 0.1, {.heading_rad = heading_rad, .flatness = flatness})
      .turn_rad;
}

TEST(CorrectFoot, LocksTheHeadingOfAFlatFoot) {
  EXPECT_NEAR(TurnOfStandingFoot(0.4, 1.0), -0.4, 1e-12);
  EXPECT_NEAR(TurnOfStandingFoot(-0.9, 1.0), 0.9, 1e-12);
  EXPECT_EQ(TurnOfStandingFoot(0.4, 0.4), 0.0);
}

// Where the ankle passes over the ball, the direction from ankle to ball turns by half a circle.
TEST(CorrectFoot, KeepsAFootWhoseAnkleHasPassedItsBall) {
  EXPECT_EQ(TurnOfStandingFoot(3.1, 0.9), 0.0);
  EXPECT_EQ(TurnOfStandingFoot(-2.2, 0.9), 0.0);
  double before_rad = TurnOfStandingFoot(-3.14, 0.9);
  for (double heading_rad = -3.13; heading_rad < 3.14; heading_rad += 0.01) {
    const double turn_rad = TurnOfStandingFoot(heading_rad, 0.9);
    EXPECT_NEAR(turn_rad, before_rad, 0.03) << heading_rad;
    before_rad = turn_rad;
  }
}

}  // namespace
}  // namespace stridewire
