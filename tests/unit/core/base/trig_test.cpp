#include "base/trig.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace stridewire {
namespace {

TEST(Trig, MatchesTheCLibrary) {
  for (double x = -50.0; x <= 50.0; x += 0.000717) {
    ASSERT_NEAR(Sin(x), std::sin(x), 1e-15) << x;
    ASSERT_NEAR(Cos(x), std::cos(x), 1e-15) << x;
  }
  for (double a = -3.14159; a <= 3.14159; a += 0.0000731) {
    ASSERT_NEAR(Atan2(std::sin(a), std::cos(a)), a, 1.5e-15) << a;
  }
  for (double x = -1.0; x <= 1.0; x += 0.0000371) ASSERT_NEAR(Acos(x), std::acos(x), 2e-15) << x;
}

TEST(Trig, IsExactAtSpecialValues) {
  EXPECT_EQ(Sin(0.0), 0.0);
  EXPECT_EQ(Cos(0.0), 1.0);
  EXPECT_EQ(Atan2(0.0, 0.0), 0.0);
  EXPECT_EQ(Acos(1.5), 0.0);
  EXPECT_EQ(Acos(-1.5), std::numbers::pi);
  EXPECT_NEAR(Atan2(0.0, -1.0), std::numbers::pi, 1e-15);
}

}  // namespace
}  // namespace stridewire
