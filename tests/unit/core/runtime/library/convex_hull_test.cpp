#include "runtime/library/convex_hull.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

namespace stridewire {
namespace {

TEST(ConvexHull, KeepsPointsInside) {
  const std::vector<double> square = {0, 0, 1, 0, 1, 1, 0, 1};
  std::array<double, 2> nearest{};
  EXPECT_EQ(ProjectOntoHull(square, std::array{1.0, 1.0}, 0.0, std::array{0.3, 0.8}, nearest), 0.0);
  EXPECT_EQ(nearest, (std::array{0.3, 0.8}));
}

TEST(ConvexHull, ProjectsOntoFacesAndCorners) {
  const std::vector<double> square = {0, 0, 1, 0, 1, 1, 0, 1};
  std::array<double, 2> nearest{};
  EXPECT_NEAR(ProjectOntoHull(square, std::array{1.0, 1.0}, 0.0, std::array{0.25, 3.0}, nearest),
              2.0, 1e-9);
  EXPECT_NEAR(nearest[0], 0.25, 1e-9);
  EXPECT_NEAR(nearest[1], 1.0, 1e-9);
  EXPECT_NEAR(ProjectOntoHull(square, std::array{1.0, 1.0}, 0.0, std::array{4.0, 5.0}, nearest),
              5.0, 1e-9);
  EXPECT_NEAR(nearest[0], 1.0, 1e-9);
  EXPECT_NEAR(nearest[1], 1.0, 1e-9);
}

TEST(ConvexHull, GrowsAboutTheMean) {
  const std::vector<double> segment = {0.0, 2.0};
  std::array<double, 1> nearest{};
  ProjectOntoHull(segment, std::array{1.0}, 0.1, std::array{5.0}, nearest);
  EXPECT_NEAR(nearest[0], 2.1, 1e-12);
}

TEST(ConvexHull, AcceptsSingleAndRepeatedPoints) {
  std::array<double, 3> nearest{};
  const std::vector<double> point = {1.0, 2.0, 3.0};
  EXPECT_NEAR(
      ProjectOntoHull(point, std::array{1.0, 1.0, 1.0}, 0.1, std::array{1.0, 2.0, 5.0}, nearest),
      2.0, 1e-12);
  const std::vector<double> same = {1, 2, 3, 1, 2, 3, 1, 2, 3};
  EXPECT_NEAR(
      ProjectOntoHull(same, std::array{1.0, 1.0, 1.0}, 0.1, std::array{1.0, 2.0, 5.0}, nearest),
      2.0, 1e-12);
}

// Checks the optimality condition in any dimension: for the nearest point x of a convex set, (v -
// x) . (target - x) <= 0 holds for every vertex v.
TEST(ConvexHull, SatisfiesTheOptimalityCondition) {
  const unsigned seed = 5150;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  for (int round = 0; round < 2000; ++round) {
    const std::size_t d = 1 + random() % 7;
    const std::size_t count = 1 + random() % 40;
    std::vector<double> points(count * d);
    for (double& value : points) value = normal(random);
    std::vector<double> metric(d);
    for (double& value : metric) value = 0.02 + std::fabs(normal(random));
    std::vector<double> target(d);
    for (double& value : target) value = 2.0 * normal(random);
    std::vector<double> nearest(d);
    const double distance = ProjectOntoHull(points, metric, 0.0, target, nearest);
    double measured = 0.0;
    for (std::size_t l = 0; l < d; ++l) {
      measured += std::pow((nearest[l] - target[l]) * metric[l], 2);
    }
    ASSERT_NEAR(std::sqrt(measured), distance, 1e-6) << "seed " << seed << " round " << round;
    for (std::size_t i = 0; i < count; ++i) {
      double along = 0.0;
      for (std::size_t l = 0; l < d; ++l) {
        along +=
            (points[i * d + l] - nearest[l]) * (target[l] - nearest[l]) * metric[l] * metric[l];
      }
      ASSERT_LT(along, 1e-5) << "seed " << seed << " round " << round << " d " << d << " n "
                             << count;
    }
  }
}

}  // namespace
}  // namespace stridewire
