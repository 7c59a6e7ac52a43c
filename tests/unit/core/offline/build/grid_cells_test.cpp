#include "offline/build/grid_cells.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace stridewire {
namespace {

// A step of a figure with a single joint. Its swing takes `swing_s`, in which the joint turns by
// `turn_rad` back and forth.
RawGroup OneStep(double swing_s, float turn_rad) {
  RawExample step;
  step.clip.fps = 120.0;
  step.clip.Resize(200, 1);
  step.keytimes_s = {0.0, 0.2, 0.2 + swing_s, 0.4 + swing_s};
  for (int f = 0; f < step.clip.frame_count(); ++f) {
    const float turn = turn_rad * std::sin(0.4f * static_cast<float>(f));
    step.clip.frame(f).rotations[0] = YawRotation(turn);
  }
  RawGroup group;
  group.examples.push_back(step);
  return group;
}

std::vector<int> CellsOf(double swing_s, float turn_rad) {
  return ChooseCells(OneStep(swing_s, turn_rad), 30.0, GridLayout(1), kIdentityQuat);
}

// At 30 cells per second the swing is exactly between 12 and 13 cells.
TEST(ChooseCells, AreTheSameForLengthsThatDifferByRoundingErrors) {
  const double swing_s = 12.5 / 30.0;
  EXPECT_EQ(CellsOf(swing_s, 0.0f), (std::vector<int>{6, 12, 6}));
  EXPECT_EQ(CellsOf(swing_s * (1.0 + 1e-9), 0.0f), CellsOf(swing_s * (1.0 - 1e-9), 0.0f));
}

TEST(ChooseCells, GrowWhereTheMotionIsLively) {
  const std::vector<int> still = CellsOf(0.5, 0.0f);
  const std::vector<int> lively = CellsOf(0.5, 0.5f);
  ASSERT_EQ(still.size(), lively.size());
  for (std::size_t i = 0; i < still.size(); ++i) EXPECT_GT(lively[i], still[i]);
}

}  // namespace
}  // namespace stridewire
