#include "offline/build/error_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "offline/builtin/builtin_library.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/weights/measure.h"
#include "stridewire/offline/open_library.h"

namespace stridewire {
namespace {

class ErrorMapOfBuiltin : public testing::Test {
 protected:
  void SetUp() override {
    auto opened = OpenLibrary("builtin");
    ASSERT_TRUE(opened.has_value());
    library_ = *std::move(opened);
  }

  // Computes e(p) directly, by synthesizing and measuring the movement.
  [[nodiscard]] double Direct(int g, const std::vector<double>& p) const {
    const MotionGroup& group = library_->group(g);
    std::vector<double> scratch(static_cast<std::size_t>(library_->max_row_count()));
    Movement movement;
    StartMovement(group, g, p, {}, scratch, movement);
    GridCache cache(library_->layout());
    Pose pose(library_->skeleton().joint_count());
    ParameterValues wanted;
    wanted.count = group.parameter_count();
    std::copy(p.begin(), p.end(), wanted.values.begin());
    return LargestDifference(group, wanted, MeasureMovement(*library_, movement, cache, pose));
  }

  std::shared_ptr<const MotionLibrary> library_;
};

TEST_F(ErrorMapOfBuiltin, EqualsDirectEvaluation) {
  for (int g = 0; g < static_cast<int>(library_->groups().size()); ++g) {
    SCOPED_TRACE(g);
    const int d = library_->group(g).parameter_count();
    const ErrorMapOptions options = {
        .axis_x = 0, .axis_y = d > 1 ? d - 1 : -1, .columns = 7, .rows = 5};
    const auto map = MeasureErrorMap(*library_, g, options);
    ASSERT_TRUE(map.has_value());
    ASSERT_EQ(map->error_m.size(), map->x.size() * map->y.size());
    int inside = 0;
    double largest = 0.0;
    for (std::size_t r = 0; r < map->y.size(); ++r) {
      for (std::size_t c = 0; c < map->x.size(); ++c) {
        const double error_m = map->error_m[r * map->x.size() + c];
        if (std::isnan(error_m)) continue;
        std::vector<double> p = map->others;
        p[0] = map->x[c];
        if (options.axis_y >= 0) p[static_cast<std::size_t>(options.axis_y)] = map->y[r];
        EXPECT_DOUBLE_EQ(error_m, Direct(g, p));
        EXPECT_GE(map->weight_sum[r * map->x.size() + c], 1.0 - 1e-6);
        largest = std::max(largest, error_m);
        ++inside;
      }
    }
    EXPECT_GT(inside, 3);
    EXPECT_EQ(map->max_error_m, largest);
  }
}

TEST_F(ErrorMapOfBuiltin, RejectsInvalidAxesAndSizes) {
  const int d = library_->group(0).parameter_count();
  const auto fails = [&](int group, const ErrorMapOptions& options) {
    const auto map = MeasureErrorMap(*library_, group, options);
    return !map.has_value() && map.error().code == ErrorCode::kOutOfRange;
  };
  EXPECT_TRUE(fails(-1, {}));
  EXPECT_TRUE(fails(static_cast<int>(library_->groups().size()), {}));
  EXPECT_TRUE(fails(0, {.axis_x = d}));
  EXPECT_TRUE(fails(0, {.axis_x = -1}));
  EXPECT_TRUE(fails(0, {.axis_x = 0, .axis_y = 0}));
  EXPECT_TRUE(fails(0, {.axis_x = 0, .axis_y = -2}));
  EXPECT_TRUE(fails(0, {.columns = 1}));
  EXPECT_TRUE(fails(0, {.rows = ErrorMapOptions::kMaxPoints + 1}));
}

}  // namespace
}  // namespace stridewire
