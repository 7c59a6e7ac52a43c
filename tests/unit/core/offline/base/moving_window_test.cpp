#include "offline/base/moving_window.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stridewire {
namespace {

using testing::ElementsAre;

TEST(MovingWindow, MaximumSpreadsToBothSides) {
  EXPECT_THAT(MovingMaximum({0, 0, 3, 0, 1, 0}, 1), ElementsAre(0, 3, 3, 3, 1, 1));
  EXPECT_THAT(MovingMaximum({2, 1}, 5), ElementsAre(2, 2));
  EXPECT_THAT(MovingMaximum({}, 2), ElementsAre());
}

TEST(MovingWindow, MeanContinuesTheFirstAndLastValue) {
  EXPECT_THAT(MovingMean({0, 0, 4, 0}, {1, 2, 1}), ElementsAre(0, 1, 2, 1));
  EXPECT_THAT(MovingMean({8, 0, 0}, {1, 2, 1}), ElementsAre(6, 2, 0));
  EXPECT_THAT(MovingMean({5, 5}, {1, 1, 1}), ElementsAre(5, 5));
}

}  // namespace
}  // namespace stridewire
