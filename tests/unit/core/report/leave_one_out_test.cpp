#include "offline/build/leave_one_out.h"

#include <gtest/gtest.h>

#include "captured_library.h"
#include "stridewire/offline/open_library.h"

namespace stridewire {
namespace {

TEST(LeaveOneOut, CardinalWeightsAreNearestForGeneratedSteps) {
  const auto library = OpenLibrary("builtin");
  ASSERT_TRUE(library.has_value());
  const LeaveOneOut left_out = MeasureLeaveOneOut(**library, 0);
  EXPECT_EQ(left_out.movements, (*library)->group(0).example_count);
  const auto& [cardinal, nearest, inverse] = left_out.means;
  EXPECT_LT(cardinal.pose_m, nearest.pose_m);
  EXPECT_LT(cardinal.parameter_m, nearest.parameter_m);
  EXPECT_GT(cardinal.pose_m, 0.0);
  EXPECT_GT(inverse.pose_m, 0.0);
  for (const LeftOutMean& mean : left_out.means) EXPECT_GT(mean.planted_m, 0.0);
  EXPECT_EQ(left_out.wins[0], 0.0);
  EXPECT_GT(left_out.wins[1], 0.5);
}

// The footprints of a captured step determine a part of its pose. If planting uses them well, steps
// are nearer to their captures than without planting.
TEST(LeaveOneOut, PlantingBringsCapturedStepsNearer) {
  const std::vector<std::string> subjects = {kDebianTakes};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  const RawLibrary raw = AssembleTakes(TakesOf(subjects), {});
  const auto library = LibraryBuilder().Build(raw);
  ASSERT_TRUE(library.has_value());
  int groups = 0;
  for (int g = 0; g < static_cast<int>((*library)->groups().size()); ++g) {
    if (!IsStep((*library)->group(g).kind)) continue;
    const LeaveOneOut left_out = MeasureLeaveOneOut(**library, g);
    if (left_out.movements == 0) continue;
    ++groups;
    EXPECT_GT(left_out.means[0].planted_m, 0.0);
    EXPECT_LT(left_out.means[0].planted_m, 0.9 * left_out.means[0].pose_m) << "group " << g;
  }
  EXPECT_EQ(groups, 4);
}

TEST(LeaveOneOut, DoesNotUseTheLeftOutExample) {
  const auto library = OpenLibrary("builtin");
  ASSERT_TRUE(library.has_value());
  // The nearest example is never the example that is left out. With a cluster diameter of 4 m, all
  // other examples are averaged into one.
  const LeaveOneOut apart = MeasureLeaveOneOut(**library, 0, 0.0);
  const LeaveOneOut averaged = MeasureLeaveOneOut(**library, 0, 4.0);
  EXPECT_GT(apart.means[1].pose_m, 0.01);
  EXPECT_EQ(apart.means[1].pose_m, averaged.means[1].pose_m);
  EXPECT_GT(averaged.means[0].pose_m, apart.means[0].pose_m);
}

}  // namespace
}  // namespace stridewire
