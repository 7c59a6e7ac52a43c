#include "offline/build/refine.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "distorted_library.h"
#include "offline/builtin/builtin_library.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/weights/correction.h"
#include "runtime/weights/measure.h"
#include "stridewire/offline/library_builder.h"
#include "test_library.h"

namespace stridewire {
namespace {

std::uint32_t Seed() { return std::random_device{}(); }

std::vector<std::byte> BytesOf(const MotionLibrary& library) {
  return {library.bytes().begin(), library.bytes().end()};
}

// Computes e(p) and the sum of |w(p)| with the code that avatars use.
struct Measured {
  double error_m = 0.0;
  double weight_sum = 0.0;
  double sum = 0.0;
};
Measured MeasureAt(const MotionLibrary& library, int group_index, const ParameterValues& p) {
  const MotionGroup& group = library.group(group_index);
  std::vector<double> scratch(static_cast<std::size_t>(library.max_row_count()));
  Movement movement;
  GridCache cache(library.layout());
  Pose pose(library.skeleton().joint_count());
  StartMovement(group, group_index, std::span(p.values).first(static_cast<std::size_t>(p.count)),
                {}, scratch, movement);
  Measured measured;
  for (const float weight : movement.weights) {
    measured.sum += static_cast<double>(weight);
    measured.weight_sum += std::fabs(static_cast<double>(weight));
  }
  measured.error_m = LargestDifference(group, p, MeasureMovement(library, movement, cache, pose));
  return measured;
}

double LargestError(const MotionLibrary& library, std::uint32_t seed, int points = 500) {
  std::mt19937 random(seed);
  double largest_m = 0.0;
  for (int i = 0; i < points; ++i) {
    const ParameterValues p = PointInHull(library.group(0), random);
    largest_m = std::max(largest_m, MeasureAt(library, 0, p).error_m);
  }
  return largest_m;
}

class RefineInDimensions : public testing::TestWithParam<int> {};

TEST_P(RefineInDimensions, ReducesTheLargestErrorWithinItsBounds) {
  const int d = GetParam();
  const std::uint32_t seed = Seed();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const auto library = MakeDistortedLibrary(d, d == 1 ? 5 : 5 * d + 2, 0.6, seed);
  const auto refined =
      Refine(library, {.max_error_m = 1e-4, .max_pseudoexamples = 6, .samples = 800, .seed = seed});
  ASSERT_TRUE(refined.has_value()) << Describe(refined.error());
  const GroupRefinement& report = refined->groups.at(0);
  const MotionGroup& group = refined->library->group(0);
  const int pseudoexamples = group.site_count - group.example_count;
  EXPECT_LE(pseudoexamples, 6);
  EXPECT_EQ(report.max_error_curve_m.size(), static_cast<std::size_t>(pseudoexamples) + 1);
  EXPECT_LE(report.max_error_curve_m.back(), report.max_error_curve_m.front());
  EXPECT_LE(report.after.weight_sum_max,
            1.1 * std::max(kMaxRefinedWeightSum, report.before.weight_sum_max));
  EXPECT_LE(report.after.condition, std::max(kMaxRefinedCondition, report.before.condition));
  EXPECT_LT(report.pseudoexample_error_m, 1e-5);
  EXPECT_LE(report.after.max_error_m, report.before.max_error_m);
  if (pseudoexamples > 0) {
    EXPECT_LT(report.max_error_curve_m.back(), report.max_error_curve_m.front());
  }
  // Checks other points than those of the refinement, whose samples may miss a part of a narrow
  // peak.
  EXPECT_LE(LargestError(*refined->library, seed + 1), 1.5 * report.after.max_error_m + 1e-5);
  EXPECT_LE(LargestError(*library, seed + 1), 1.5 * report.before.max_error_m + 1e-5);
}

TEST_P(RefineInDimensions, WeightsSumToOneAndReproduceAllSites) {
  const int d = GetParam();
  const std::uint32_t seed = Seed();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const auto library = MakeDistortedLibrary(d, d == 1 ? 5 : 4 * d + 2, 0.7, seed);
  for (const RefineRule rule : {RefineRule::kAmended, RefineRule::kBare}) {
    const auto refined = Refine(
        library,
        {.rule = rule, .max_error_m = 0.0, .max_pseudoexamples = 4, .samples = 300, .seed = seed});
    ASSERT_TRUE(refined.has_value()) << Describe(refined.error());
    const MotionGroup& group = refined->library->group(0);
    if (rule == RefineRule::kBare) {
      EXPECT_GT(group.site_count, group.example_count);
    }
    for (int s = 0; s < group.site_count; ++s) {
      ParameterValues p{.count = d};
      std::copy(group.site(s).begin(), group.site(s).end(), p.values.begin());
      const Measured measured = MeasureAt(*refined->library, 0, p);
      EXPECT_LT(measured.error_m, 1e-5) << "site " << s;
      // Sites keep a minimum distance.
      for (int t = std::max(s + 1, group.example_count); t < group.site_count; ++t) {
        double squared = 0.0;
        for (std::size_t l = 0; l < group.parameters.size(); ++l) {
          squared += std::pow((group.site(s)[l] - group.site(t)[l]) / group.parameters[l].scale, 2);
        }
        EXPECT_GE(std::sqrt(squared), kMinPseudoexampleDistance - 1e-9) << s << " and " << t;
      }
    }
    std::mt19937 random(seed);
    for (int i = 0; i < 50; ++i) {
      const Measured measured = MeasureAt(*refined->library, 0, PointInHull(group, random));
      EXPECT_NEAR(measured.sum, 1.0, 1e-5 * measured.weight_sum);
    }
  }
}

// The run-time correction must work as well after refinement as before it.
TEST_P(RefineInDimensions, KeepsTheAccuracyOfRunTimeCorrection) {
  const int d = GetParam();
  const std::uint32_t seed = Seed();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  const auto library = MakeDistortedLibrary(d, d == 1 ? 5 : 6 * d + 4, 0.6, seed);
  const auto refined =
      Refine(library, {.max_error_m = 1e-4, .max_pseudoexamples = 4, .samples = 400, .seed = seed});
  ASSERT_TRUE(refined.has_value()) << Describe(refined.error());
  const MotionGroup& group = refined->library->group(0);
  std::mt19937 random(seed);
  CorrectionScratch scratch(*refined->library);
  Movement movement;
  for (int i = 0; i < 100; ++i) {
    const Correction correction =
        CorrectWeights(group, PointInHull(group, random), {.max_iterations = 8}, scratch, movement);
    EXPECT_LT(correction.error_m, 1e-4) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Refine, RefineInDimensions, testing::Range(1, 8));

TEST(Refine, IsIndependentOfTheNumberOfThreads) {
  const auto library = MakeDistortedLibrary(2, 13, 0.7, 11);
  std::vector<std::byte> first;
  for (const int threads : {1, 2, 5, 2}) {
    const auto refined = Refine(library, {.max_error_m = 1e-3, .samples = 200, .threads = threads});
    ASSERT_TRUE(refined.has_value());
    EXPECT_GT(refined->library->group(0).site_count, 13);
    if (first.empty()) first = BytesOf(*refined->library);
    EXPECT_TRUE(BytesOf(*refined->library) == first) << threads << " threads";
  }
}

TEST(Refine, ReplacesExistingPseudoexamples) {
  const auto library = MakeDistortedLibrary(2, 12, 0.7, 12);
  const RefineOptions options{.max_error_m = 1e-3, .samples = 500};
  const auto once = Refine(library, options);
  ASSERT_TRUE(once.has_value());
  ASSERT_GT(once->library->group(0).site_count, 12);
  const auto twice = Refine(once->library, options);
  ASSERT_TRUE(twice.has_value());
  EXPECT_TRUE(BytesOf(*once->library) == BytesOf(*twice->library));
  const auto none = Refine(once->library, {.max_pseudoexamples = 0, .samples = 10});
  ASSERT_TRUE(none.has_value());
  EXPECT_TRUE(BytesOf(*none->library) == BytesOf(*library));
}

TEST(Refine, KeepsAccurateLibraries) {
  const auto library = LibraryBuilder{}.Build(GenerateBuiltinLibrary());
  ASSERT_TRUE(library.has_value());
  const auto refined = Refine(*library, {.max_error_m = 0.1, .samples = 100});
  ASSERT_TRUE(refined.has_value());
  EXPECT_TRUE(BytesOf(*refined->library) == BytesOf(**library));
  for (const GroupRefinement& group : refined->groups) {
    EXPECT_EQ(group.end, RefineEnd::kErrorReached);
  }
}

TEST(Refine, HandlesASingleExample) {
  const auto library = MakeDistortedLibrary(2, 1, 0.6, 13);
  const auto refined = Refine(library, {.max_error_m = 0.0, .samples = 10});
  ASSERT_TRUE(refined.has_value()) << Describe(refined.error());
  EXPECT_EQ(refined->library->group(0).site_count, 1);
}

TEST(Refine, StopsIfProgressReturnsFalse) {
  const auto library = MakeDistortedLibrary(2, 12, 0.7, 12);
  int told = 0;
  double last = -1.0;
  RefineOptions options{.max_error_m = 0.0, .samples = 200};
  options.progress = [&](double done) {
    EXPECT_GE(done, last);
    EXPECT_LE(done, 1.0);
    last = done;
    return ++told < 3;
  };
  const auto refined = Refine(library, options);
  ASSERT_FALSE(refined.has_value());
  EXPECT_EQ(std::string(refined.error().text), "stopped");
  EXPECT_EQ(told, 3);
}

TEST(Refine, RejectsInvalidOptions) {
  const auto library = MakeTestLibrary();
  for (const RefineOptions& options :
       {RefineOptions{.max_error_m = -1.0}, RefineOptions{.max_error_m = NAN},
        RefineOptions{.max_pseudoexamples = -1}, RefineOptions{.max_pseudoexamples = 1025},
        RefineOptions{.samples = 0}}) {
    EXPECT_EQ(Refine(library, options).error().code, ErrorCode::kOutOfRange);
  }
}

// The reason why the amended rule is the default: with the bare rule the error sometimes grows.
TEST(Refine, BareRuleIsNotMonotone) {
  int grown = 0;
  for (std::uint32_t seed = 1; seed <= 5; ++seed) {
    const auto library = MakeDistortedLibrary(2, 12, 0.7, seed);
    const auto bare = Refine(
        library,
        {.rule = RefineRule::kBare, .max_error_m = 0.0, .max_pseudoexamples = 8, .samples = 500});
    ASSERT_TRUE(bare.has_value());
    const std::vector<double>& curve = bare->groups[0].max_error_curve_m;
    for (std::size_t i = 1; i < curve.size(); ++i) grown += curve[i] > curve[i - 1] ? 1 : 0;
  }
  EXPECT_GT(grown, 0);
}

}  // namespace
}  // namespace stridewire
