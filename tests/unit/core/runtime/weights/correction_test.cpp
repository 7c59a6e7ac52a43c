#include "runtime/weights/correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "counted_memory.h"
#include "distorted_library.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/terrain/foot_support.h"
#include "runtime/weights/end_poses.h"
#include "runtime/weights/measure.h"
#include "stridewire/runtime/terrain.h"
#include "test_library.h"

namespace stridewire {
namespace {

// Scratch objects for corrections and measurements.
struct Scratch {
  explicit Scratch(const MotionLibrary& library)
      : correction(library),
        weights(static_cast<std::size_t>(library.max_row_count())),
        cache(library.layout()),
        pose(library.skeleton().joint_count()) {
    movement.weights.reserve(static_cast<std::size_t>(library.max_row_count()));
  }
  Correction Correct(const MotionLibrary& library, const ParameterValues& wanted,
                     const CorrectionLimits& limits) {
    const Correction result =
        CorrectWeights(library.group(0), wanted, limits, correction, movement);
    movement.group = 0;
    std::ranges::copy(correction.weights(library.group(0)), weights.begin());
    return result;
  }
  // Measures a movement with these parameters independently of the correction.
  ParameterValues Measure(const MotionLibrary& library, const ParameterValues& parameters,
                          int group = 0) {
    StartMovement(library.group(group), group,
                  std::span(parameters.values).first(static_cast<std::size_t>(parameters.count)),
                  {}, weights, movement);
    return MeasureAsIs(library);
  }
  // Measures the current movement independently of the correction.
  ParameterValues MeasureAsIs(const MotionLibrary& library) {
    cache.Clear();
    return MeasureMovement(library, movement, cache, pose);
  }
  // Largest difference in metres between two ways to measure, due to rounding. Poses are floats.
  // With few examples, weights may reach a thousand, and then single terms place the root a hundred
  // metres away from their sum.
  double RoundingM(const MotionGroup& group, const GridLayout& layout) {
    double far_m = 0.0;
    for (const int point : {0, group.grid_point_count - 1}) {
      EvaluateGridPoint(group, layout, movement, point, cache, pose);
      far_m = std::max(far_m, static_cast<double>(glm::length(pose.root_position_m)));
    }
    return std::max(1e-6, 4.0 * std::numeric_limits<float>::epsilon() * far_m);
  }
  double WeightSum() const {
    double sum = 0.0;
    for (const float weight : movement.weights) sum += std::fabs(static_cast<double>(weight));
    return sum;
  }

  CorrectionScratch correction;
  std::vector<double> weights;
  GridCache cache;
  Pose pose;
  Movement movement;
};

std::uint32_t Seed() { return std::random_device{}(); }

class InDimensions : public testing::TestWithParam<int> {};

TEST_P(InDimensions, ReachesRequestsInsideTheHull) {
  const int d = GetParam();
  const std::uint32_t seed = Seed();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  double largest_m = 0.0;
  for (int l = 0; l < 4; ++l) {
    const auto library = MakeDistortedLibrary(d, d == 1 ? 5 : 6 * d + 4, 0.6, random());
    const MotionGroup& group = library->group(0);
    Scratch scratch(*library);
    for (int i = 0; i < 50; ++i) {
      const ParameterValues wanted = PointInHull(group, random);
      const double miss_m = LargestDifference(group, wanted, scratch.Measure(*library, wanted));
      largest_m = std::max(largest_m, miss_m);
      const Correction correction =
          scratch.Correct(*library, wanted, DefaultCorrectionLimits(group));
      EXPECT_NEAR(correction.initial_error_m, miss_m, 1e-6);
      EXPECT_LE(correction.iterations, d <= 2 ? 3 : 8);
      EXPECT_LT(correction.error_m, 1e-4) << "library " << l << " point " << i;
      // The reported parameters are those that are measured.
      EXPECT_NEAR(LargestDifference(group, wanted, scratch.MeasureAsIs(*library)),
                  correction.error_m, 1e-6);
      EXPECT_EQ(scratch.movement.parameters.values, wanted.values);
      EXPECT_LT(scratch.Correct(*library, wanted, {.max_iterations = 3}).error_m, 1e-3);
    }
  }
  // If no library had an error, the correction would not be tested. In one of 600 random libraries,
  // no error exceeds 0.09 mm, so it is improbable that this holds for all four.
  EXPECT_GT(largest_m, 1e-4);
}

TEST_P(InDimensions, NeverIncreasesTheErrorAndKeepsWeightsBounded) {
  const int d = GetParam();
  const std::uint32_t seed = Seed();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  // There are too few examples for the parameters, so many requests cannot be reached.
  const auto library = MakeDistortedLibrary(d, d + 1, 0.7, seed);
  const MotionGroup& group = library->group(0);
  std::mt19937 random(seed);
  Scratch scratch(*library);
  for (int i = 0; i < 200; ++i) {
    // Also try parameters outside the hull, far beyond the limit for requests.
    ParameterValues wanted = PointInHull(group, random);
    for (std::size_t l = 0; l < group.parameters.size(); ++l) {
      const Parameter& parameter = group.parameters[l];
      wanted.values[l] +=
          (static_cast<double>(random()) / 4294967296.0 - 0.5) * (parameter.max - parameter.min);
    }
    static_cast<void>(scratch.Measure(*library, wanted));
    const double weight_sum = scratch.WeightSum();
    const Correction correction =
        scratch.Correct(*library, wanted, {.max_iterations = static_cast<int>(random() % 12)});
    EXPECT_LE(correction.error_m, correction.initial_error_m);
    EXPECT_NEAR(LargestDifference(group, wanted, scratch.MeasureAsIs(*library)), correction.error_m,
                scratch.RoundingM(group, library->layout()));
    EXPECT_LE(scratch.WeightSum(), std::max(kMaxCorrectedWeightSum, weight_sum) * (1.0 + 1e-7));
  }
}

// Compares J with finite differences, at blended weights inside and outside the hull.
TEST_P(InDimensions, DerivativesMatchFiniteDifferences) {
  const int d = GetParam();
  const std::uint32_t seed = Seed();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const auto library = MakeDistortedLibrary(d, 3 * d + 3, 0.6, seed);
  const MotionGroup& group = library->group(0);
  const auto n = static_cast<std::size_t>(group.example_count);
  std::mt19937 random(seed);
  Scratch scratch(*library);
  std::vector<double> weights(n);
  std::vector<double> slopes(n * static_cast<std::size_t>(d));
  constexpr double kStep = 1e-2;
  for (int i = 0; i < 5; ++i) {
    static_cast<void>(scratch.Measure(*library, PointInHull(group, random)));
    std::copy_n(scratch.weights.begin(), n, weights.begin());
    ApplyWeights(group, weights, scratch.movement);
    EndPoses ends(library->skeleton(), library->layout());
    ends.SetGroup(group);
    ends.Blend(scratch.movement);
    ends.MeasureSlopes(slopes);
    for (std::size_t e = 1; e < n; ++e) {
      // Move weight from the first example to this one, which keeps the sum.
      const auto measured = [&](double by) {
        std::vector<double> w = weights;
        w[e] += by;
        w[0] -= by;
        ApplyWeights(group, w, scratch.movement);
        return scratch.MeasureAsIs(*library);
      };
      const ParameterValues more = measured(kStep);
      const ParameterValues less = measured(-kStep);
      for (std::size_t l = 0; l < static_cast<std::size_t>(d); ++l) {
        EXPECT_NEAR(slopes[l * n + e] - slopes[l * n],
                    (more.values[l] - less.values[l]) / (2.0 * kStep), 2e-3)
            << l << " " << e;
      }
    }
  }
}

// Similar requests must result in similar weights, everywhere.
TEST_P(InDimensions, IsContinuousInTheRequest) {
  const int d = GetParam();
  const std::uint32_t seed = Seed();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const auto library = MakeDistortedLibrary(d, d == 1 ? 5 : 6 * d + 4, 0.6, seed);
  const MotionGroup& group = library->group(0);
  std::mt19937 random(seed);
  Scratch scratch(*library);
  const auto weights = [&](const ParameterValues& wanted) {
    scratch.Correct(*library, wanted, DefaultCorrectionLimits(group));
    return scratch.movement.weights;
  };
  constexpr int kSteps = 100;
  for (int i = 0; i < 10; ++i) {
    const ParameterValues from = PointInHull(group, random);
    const ParameterValues to = PointInHull(group, random);
    std::vector<float> before;
    std::vector<float> uncorrected_before;
    for (int s = 0; s <= kSteps; ++s) {
      ParameterValues wanted = from;
      for (std::size_t l = 0; l < static_cast<std::size_t>(d); ++l) {
        wanted.values[l] += (to.values[l] - from.values[l]) * s / kSteps;
      }
      static_cast<void>(scratch.Measure(*library, wanted));
      const std::vector<float> uncorrected = scratch.movement.weights;
      const std::vector<float> now = weights(wanted);
      double moved = 0.0;
      double uncorrected_moved = 0.0;
      for (std::size_t e = 0; s > 0 && e < now.size(); ++e) {
        moved += std::fabs(static_cast<double>(now[e] - before[e]));
        uncorrected_moved += std::fabs(static_cast<double>(uncorrected[e] - uncorrected_before[e]));
      }
      EXPECT_LT(moved, 3.0 * uncorrected_moved + 0.03) << i << " " << s;
      before = now;
      uncorrected_before = uncorrected;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Correction, InDimensions, testing::Range(1, 8));

TEST(Correction, LimitsTheWeightsOfSparseClimbs) {
  const std::uint32_t seed = Seed();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 random(seed);
  // A few random libraries need no limit, so several are drawn.
  double largest_uncorrected = 0.0;
  for (int l = 0; l < 5; ++l) {
    const auto library = MakeDistortedLibrary(7, 20, 0.6, random());
    const MotionGroup& group = library->group(0);
    Scratch scratch(*library);
    for (int i = 0; i < 50; ++i) {
      const ParameterValues wanted = PointInHull(group, random);
      static_cast<void>(scratch.Measure(*library, wanted));
      largest_uncorrected = std::max(largest_uncorrected, scratch.WeightSum());
      scratch.Correct(*library, wanted, DefaultCorrectionLimits(group));
      EXPECT_LE(scratch.WeightSum(), kSparseWeightSum * (1.0 + 1e-6));
      double sum = 0.0;
      for (const float weight : scratch.movement.weights) sum += static_cast<double>(weight);
      EXPECT_NEAR(sum, 1.0, 1e-5);
    }
  }
  EXPECT_GT(largest_uncorrected, kSparseWeightSum);

  const auto dense = MakeDistortedLibrary(7, 32, 0.6, seed);
  EXPECT_EQ(DefaultCorrectionLimits(dense->group(0)).weight_sum, kMaxCorrectedWeightSum);
  const auto level = MakeDistortedLibrary(5, 12, 0.6, seed);
  EXPECT_EQ(DefaultCorrectionLimits(level->group(0)).weight_sum, kMaxCorrectedWeightSum);
}

TEST(Correction, ChangesNothingWithoutIterations) {
  const auto library = MakeDistortedLibrary(3, 20, 0.6, 5);
  std::mt19937 random(1);
  Scratch scratch(*library);
  const ParameterValues wanted = PointInHull(library->group(0), random);
  const ParameterValues uncorrected = scratch.Measure(*library, wanted);
  const std::vector<float> weights = scratch.movement.weights;
  const Correction correction = scratch.Correct(*library, wanted, {.max_iterations = 0});
  EXPECT_EQ(scratch.movement.weights, weights);
  EXPECT_NEAR(correction.error_m, LargestDifference(library->group(0), wanted, uncorrected), 1e-6);
  EXPECT_EQ(correction.error_m, correction.initial_error_m);
  EXPECT_EQ(correction.iterations, 0);
}

TEST(Correction, KeepsTheWeightsOfAnExample) {
  const auto library = MakeDistortedLibrary(4, 30, 0.6, 6);
  Scratch scratch(*library);
  const MotionGroup& group = library->group(0);
  for (int e = 0; e < group.example_count; ++e) {
    ParameterValues wanted{.count = 4};
    std::copy_n(group.site(e).begin(), 4, wanted.values.begin());
    const Correction correction = scratch.Correct(*library, wanted, DefaultCorrectionLimits(group));
    EXPECT_EQ(correction.iterations, 0) << e;
    EXPECT_NEAR(static_cast<double>(scratch.movement.weights[static_cast<std::size_t>(e)]), 1.0,
                1e-6);
  }
}

TEST(Correction, NeverAllocates) {
  const auto library = MakeDistortedLibrary(7, 46, 0.6, 7);
  std::mt19937 random(1);
  Scratch scratch(*library);
  const ParameterValues wanted = PointInHull(library->group(0), random);
  const std::size_t before = counted_memory::LiveBytes();
  counted_memory::ResetPeak();
  const Correction correction = scratch.Correct(*library, wanted, {.max_iterations = 20});
  EXPECT_EQ(counted_memory::PeakBytes(), before);
  EXPECT_GT(correction.iterations, 1);
}

TEST(Terrain, QueriesDoNotAllocate) {
  TerrainData data;
  data.height_field = HeightField{{-1, -1}, 0.5, 3, 3, {0, 1, 0, 1, 0, 1, 0, 1, 0}};
  for (int b = 0; b < 100; ++b) data.boxes.push_back({{0.1 * b, 0}, {0.1 * b + 0.2, 1}, 0.01 * b});
  const auto terrain = Terrain::Make(std::move(data));
  ASSERT_TRUE(terrain);
  const std::size_t before = counted_memory::LiveBytes();
  counted_memory::ResetPeak();
  double sum = 0.0;
  for (double x = -2.0; x < 11.0; x += 0.1) {
    sum += (*terrain)->HeightAt(x, 0.5) + (*terrain)->NormalAt(x, 0.5).y +
           (*terrain)->HighestWithin(x, 0.5, 0.6) +
           SupportOf(**terrain, x, 0.5, x, {0.2, 0.1, 0.05}).gap_m;
  }
  EXPECT_EQ(counted_memory::PeakBytes(), before);
  EXPECT_GT(sum, 0.0);
}

// The weights of a movement must not depend on its base frame. A client that evaluates the movement
// elsewhere must get the same weights.
TEST(Correction, DoesNotDependOnTheBaseFrame) {
  const auto library = MakeTestLibrary();
  const auto weights = [&](const BaseFrame& start) {
    AvatarSimulation avatar(library, start);
    EXPECT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = 0.47}}));
    avatar.Advance(1.0 / 60.0);
    EXPECT_NE(avatar.movement(), nullptr);
    return avatar.movement()->weights;
  };
  EXPECT_EQ(weights({}), weights({{1.0, 2.0, 3.0}, 0.0}));
}

TEST(Correction, CanBeDisabledForAnAvatar) {
  const auto library = MakeTestLibrary();
  for (const bool corrected : {true, false}) {
    AvatarSimulation avatar(library, {}, {.run_time_correction = corrected});
    for (const double length_m : {0.33, 0.51, 0.13, 0.47}) {
      ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = length_m}}));
    }
    double largest_m = 0.0;
    bool is_moved = false;
    Scratch scratch(*library);
    int steps = 0;
    while (!avatar.idle()) {
      avatar.Advance(1.0 / 60.0);
      for (const AvatarEvent& event : avatar.events()) {
        if (event.type != AvatarEventType::kStarted) continue;
        const Movement& movement = *avatar.movement();
        scratch.cache.Clear();
        const ParameterValues measured =
            MeasureMovement(*library, movement, scratch.cache, scratch.pose);
        const MotionGroup& group = library->group(movement.group);
        largest_m = std::max(largest_m, LargestDifference(group, event.applied, measured));
        EXPECT_EQ(event.applied.values, movement.parameters.values);
        const std::vector<float> weights = movement.weights;
        static_cast<void>(scratch.Measure(*library, event.applied, movement.group));
        is_moved = is_moved || scratch.movement.weights != weights;
        ++steps;
      }
    }
    EXPECT_EQ(steps, 5);
    if (corrected) {
      EXPECT_LT(largest_m, 1e-4);
      EXPECT_TRUE(is_moved);
    } else {
      EXPECT_GT(largest_m, 1e-3);
      EXPECT_FALSE(is_moved);
    }
  }
}

}  // namespace
}  // namespace stridewire
