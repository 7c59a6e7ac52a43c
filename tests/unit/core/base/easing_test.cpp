#include "base/easing.h"

#include <gtest/gtest.h>

namespace stridewire {
namespace {

TEST(Easing, IsConstantOutsideTheUnitInterval) {
  for (const auto step : {SmoothStep, SmootherStep}) {
    EXPECT_EQ(step(-0.5), 0.0);
    EXPECT_EQ(step(0.0), 0.0);
    EXPECT_EQ(step(0.5), 0.5);
    EXPECT_EQ(step(1.0), 1.0);
    EXPECT_EQ(step(1.5), 1.0);
  }
  for (const double x : {-0.5, 0.0, 1.0, 1.5}) EXPECT_EQ(Bump(x), 0.0);
  EXPECT_EQ(Bump(0.5), 1.0);
}

TEST(Easing, SlopeIsZeroAtBothEnds) {
  constexpr double kStep = 1e-4;
  for (const auto ease : {SmoothStep, SmootherStep, Bump}) {
    EXPECT_NEAR((ease(kStep) - ease(0.0)) / kStep, 0.0, 2e-3);
    EXPECT_NEAR((ease(1.0) - ease(1.0 - kStep)) / kStep, 0.0, 2e-3);
  }
  EXPECT_NEAR(SmootherStep(kStep) / (kStep * kStep), 0.0, 2e-3) << "curvature";
}

}  // namespace
}  // namespace stridewire
