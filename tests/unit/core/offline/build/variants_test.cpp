#include "offline/build/variants.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <set>
#include <vector>

#include "offline/build/library_writer.h"
#include "runtime/library/keytimes.h"
#include "runtime/skeleton/foot_vector.h"
#include "runtime/weights/correction.h"
#include "runtime/weights/measure.h"
#include "runtime/weights/variant_choice.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/synthesis.h"
#include "test_library.h"

namespace stridewire {
namespace {

GridExample Step(double start_m, double end_m) {
  GridExample step;
  step.parameters = {start_m, end_m};
  return step;
}

SelectedExample Used(ExampleFate fate) {
  SelectedExample used;
  used.fate = fate;
  return used;
}

constexpr double kUnits[] = {1.0, 1.0};

TEST(ChooseVariants, ReturnsTheStepsNearestToTheMedians) {
  std::vector<GridExample> found;
  std::vector<SelectedExample> used;
  for (const double length_m : {0.3, 0.7, 0.5, 0.9, 0.55, 0.45, 0.1}) {
    found.push_back(Step(-length_m, length_m));
    used.push_back(Used(ExampleFate::kAveraged));
  }
  const auto variants = ChooseVariants(found, used, kUnits, false);
  ASSERT_EQ(variants.size(), kStoredVariants);
  EXPECT_EQ(variants[0], 2u);
  EXPECT_EQ((std::set<std::size_t>{variants[1], variants[2]}), (std::set<std::size_t>{4, 5}));
}

TEST(ChooseVariants, ReturnsOnlyStepsThatDifferFromTheExamples) {
  const std::vector<GridExample> found{Step(-0.4, 0.4), Step(-0.5, 0.5), Step(-0.6, 0.6),
                                       Step(-0.7, 0.7)};
  const std::vector<SelectedExample> used{Used(ExampleFate::kKept), Used(ExampleFate::kOutlier),
                                          Used(ExampleFate::kRedundant),
                                          Used(ExampleFate::kAveraged)};
  EXPECT_EQ(ChooseVariants(found, used, kUnits, false).size(), 2u);
  EXPECT_EQ(ChooseVariants(found, used, kUnits, true).size(), 3u);
  constexpr double kThree[] = {1.0, 1.0, 1.0};
  EXPECT_TRUE(ChooseVariants(found, used, kThree, true).empty());
}

// A library of a walker with individual variation: every step occurs three times, with the root at
// a different height and with other keytimes.
class Variants : public testing::Test {
 protected:
  void SetUp() override {
    raw_ = MakeTestRawLibrary();
    for (RawGroup& group : raw_.groups) {
      const std::vector<RawExample> steps = group.examples;
      for (const double height_m : {-0.02, 0.02}) {
        for (RawExample step : steps) {
          for (int f = 0; f < step.clip.frame_count(); ++f) {
            step.clip.frame(f).root_position_m.y += static_cast<float>(height_m);
          }
          for (std::size_t k = 1; k + 1 < step.keytimes_s.size(); ++k) {
            step.keytimes_s[k] *= 1.0 + 4.0 * height_m;
          }
          group.examples.push_back(std::move(step));
        }
      }
    }
    auto built = LibraryBuilder::Selecting().Build(raw_);
    ASSERT_TRUE(built.has_value()) << built.error().text;
    library_ = *built;
  }
  [[nodiscard]] const MotionGroup& group() const { return library_->group(0); }

  RawLibrary raw_;
  std::shared_ptr<const MotionLibrary> library_;
};

TEST_F(Variants, HaveTheKeytimesAndTheSidewaysEndOfTheBlend) {
  for (const MotionGroup& group : library_->groups()) {
    EXPECT_EQ(group.variant_count, IsStep(group.kind) ? 4 : 0);
    EXPECT_EQ(group.row_count(), group.example_count + group.variant_count);
    const auto rows = static_cast<std::size_t>(group.row_count());
    const auto keys = static_cast<std::size_t>(group.interval_count()) + 1;
    EXPECT_EQ(group.keytimes_s.size(), rows * keys);
    std::vector<double> scratch(rows);
    Movement movement;
    for (int v = 0; v < group.variant_count; ++v) {
      SetWeights(group, 0, group.variant(v), scratch, movement);
      std::vector<double> blended(keys);
      BlendKeytimes(group.keytimes_s, movement.weights, blended);
      const auto own = static_cast<std::size_t>(group.example_count + v) * keys;
      for (std::size_t k = 0; k < keys; ++k) {
        EXPECT_DOUBLE_EQ(group.keytimes_s[own + k], blended[k]);
      }
      GridCache cache(library_->layout());
      const int last = group.grid_point_count - 1;
      const auto floats = static_cast<std::size_t>(library_->layout().row_floats);
      const std::size_t row =
          static_cast<std::size_t>(last) * rows + static_cast<std::size_t>(group.example_count + v);
      EXPECT_NEAR(
          library_->layout().RootOf(&group.grid[row * floats]).position_m.x,
          library_->layout().RootOf(cache.Row(group, movement.weights, last).data()).position_m.x,
          1e-6);
    }
  }
}

// Returns how far the root of a row is ahead of the ball of a foot.
double RootAheadM(const MotionLibrary& library, std::span<const float> row, Foot foot) {
  const Pose pose = PoseOfRow(row, library.layout(), library.skeleton().joint_count());
  return double{pose.root_position_m.z} - double{BallPosition(library.skeleton(), pose, foot).z};
}

TEST_F(Variants, MoveTheBodyForwardLikeTheBlend) {
  const auto floats = static_cast<std::size_t>(library_->layout().row_floats);
  int strides = 0;
  for (const MotionGroup& group : library_->groups()) {
    if (group.variant_count == 0) continue;
    const Foot standing = OtherFoot(MovingFoot(group.kind));
    const auto rows = static_cast<std::size_t>(group.row_count());
    std::vector<double> scratch(rows);
    GridCache cache(library_->layout());
    Movement movement;
    for (int v = 0; v < group.variant_count; ++v) {
      SetWeights(group, 0, group.variant(v), scratch, movement);
      cache.Clear();
      const std::size_t own =
          static_cast<std::size_t>(group.example_count) + static_cast<std::size_t>(v);
      const auto own_m = [&](int p) {
        const std::size_t row = static_cast<std::size_t>(p) * rows + own;
        return RootAheadM(*library_, group.grid.subspan(row * floats, floats), standing);
      };
      const auto blended_m = [&](int p) {
        return RootAheadM(*library_, cache.Row(group, movement.weights, p), standing);
      };
      const int last = group.grid_point_count - 1;
      const double scale = (own_m(last) - own_m(0)) / (blended_m(last) - blended_m(0));
      for (int p = 0; p <= last; ++p) {
        EXPECT_NEAR(own_m(p) - own_m(0), scale * (blended_m(p) - blended_m(0)), 0.003);
      }
      ++strides;
    }
  }
  EXPECT_GT(strides, 0);
}

TEST_F(Variants, SurviveAFile) {
  const auto read = MotionLibrary::FromBytes(library_->bytes());
  ASSERT_TRUE(read.has_value());
  const MotionGroup& group = (*read)->group(0);
  ASSERT_EQ(group.variant_count, 4);
  EXPECT_EQ(group.variant(3)[0], this->group().variant(3)[0]);
  EXPECT_EQ((*read)->max_row_count(), library_->max_row_count());
}

TEST_F(Variants, OfAFileAreChecked) {
  const std::size_t d = group().parameters.size();
  // Writes a library whose first group has variants with these parameters, and tables of the size
  // that the group then needs.
  const auto fails = [&](const std::vector<double>& parameters, std::size_t omitted_keytimes,
                         const char* text) {
    std::vector<MotionGroup> groups(library_->groups().begin(), library_->groups().end());
    MotionGroup& first = groups[0];
    first.variant_parameters = parameters;
    first.variant_count = static_cast<int>(parameters.size() / d);
    const auto rows = static_cast<std::size_t>(first.row_count());
    const std::vector<float> grid(rows * static_cast<std::size_t>(first.grid_point_count) *
                                  static_cast<std::size_t>(library_->layout().row_floats));
    const std::size_t keys = static_cast<std::size_t>(first.interval_count()) + 1;
    std::vector<double> keytimes_s(first.keytimes_s.begin(), first.keytimes_s.end());
    keytimes_s.resize(rows * keys - omitted_keytimes);
    const std::vector<double> headings_rad(rows);
    first.grid = grid;
    first.keytimes_s = keytimes_s;
    first.heading_change_rad = headings_rad;
    const auto written = WriteLibrary({library_->skeleton(), library_->stand_pose(), groups, {}});
    ASSERT_FALSE(written.has_value());
    EXPECT_EQ(written.error().code, ErrorCode::kMalformed);
    EXPECT_STREQ(written.error().text, text);
  };
  fails(std::vector<double>(d * (MotionLibrary::kMaxVariants + 1)), 0,
        "a group's variant count is out of range");
  fails({0.0, 0.3, 0.0, HUGE_VAL}, 0, "a variant's parameter is out of range");
  fails({0.0, 0.3}, 1, "a group's time tables have the wrong size");
}

TEST_F(Variants, AreBlendedOnlyInVariedSteps) {
  CorrectionScratch scratch(*library_);
  Movement movement;
  const ParameterValues wanted{.values = {-0.3, 0.32}, .count = 2};
  const CorrectionLimits limits = DefaultCorrectionLimits(group());
  const auto n = static_cast<std::size_t>(group().example_count);
  const auto shares = [&] { return std::span(movement.weights).subspan(n); };

  CorrectWeights(group(), wanted, limits, scratch, movement);
  ASSERT_EQ(movement.weights.size(), n + 4);
  for (const float share : shares()) EXPECT_EQ(share, 0.0f);

  GridCache cache(library_->layout());
  Pose pose(library_->skeleton().joint_count());
  std::set<std::size_t> chosen;
  for (std::uint64_t step = 1; step <= 40; ++step) {
    const auto corrected =
        CorrectWeights(group(), wanted, limits, scratch, movement, StrideVariation(5, step));
    EXPECT_LT(corrected.error_m, 1e-4);
    double sum = 0.0;
    for (const float weight : movement.weights) sum += static_cast<double>(weight);
    EXPECT_NEAR(sum, 1.0, 1e-5);
    int used = 0;
    for (std::size_t v = 0; v < shares().size(); ++v) {
      if (shares()[v] == 0.0f) continue;
      ++used;
      chosen.insert(v);
      EXPECT_GT(shares()[v], 0.0f);
      EXPECT_LT(shares()[v], 1.0f);
    }
    EXPECT_EQ(used, 1);
    movement.group = 0;
    cache.Clear();
    const ParameterValues measured = MeasureMovement(*library_, movement, cache, pose);
    EXPECT_LT(LargestDifference(group(), wanted, measured), 2e-4);
  }
  EXPECT_GT(chosen.size(), 1u);
}

TEST_F(Variants, CountWithTheirOwnParametersInRecords) {
  std::vector<MovementRequest> requests;
  for (std::uint64_t id = 1; id <= 12; ++id) {
    requests.push_back({id, StepRequest{.length_m = 0.32}});
  }
  AvatarOptions options;
  options.stride_variation = true;
  const auto played = Synthesize({.library = library_, .requests = requests, .options = options});
  ASSERT_TRUE(played.has_value()) << played.error().text;
  int varied = 0;
  for (const MovementRecord& record : played->movements) {
    const MotionGroup& steps = library_->group(static_cast<std::size_t>(record.group));
    const auto n = static_cast<std::size_t>(steps.example_count);
    ASSERT_EQ(record.weights.size(), static_cast<std::size_t>(steps.row_count()));
    for (std::size_t l = 0; l < steps.parameters.size(); ++l) {
      double sum = 0.0;
      for (std::size_t e = 0; e < n; ++e) {
        sum += static_cast<double>(record.weights[e]) * steps.site(static_cast<int>(e))[l];
      }
      for (std::size_t v = n; v < record.weights.size(); ++v) {
        if (record.weights[v] != 0.0f) ++varied;
        sum += static_cast<double>(record.weights[v]) * steps.variant(static_cast<int>(v - n))[l];
      }
      EXPECT_NEAR(record.corrected.values[l], sum, 1e-9);
      EXPECT_NEAR(record.corrected.values[l], record.applied.values[l], 0.05);
    }
  }
  EXPECT_GT(varied, 0);
}

TEST_F(Variants, AreNotChosenForDistantSteps) {
  for (std::uint64_t step = 1; step <= 20; ++step) {
    const StrideVariation variation(5, step);
    const VariantShare near =
        ChooseVariant(group(), {.values = {-0.3, 0.3}, .count = 2}, variation);
    EXPECT_GE(near.variant, 0);
    EXPECT_GT(near.weight, 0.0);
    EXPECT_LE(near.weight, 1.0);
    EXPECT_EQ(ChooseVariant(group(), {.values = {-0.3, 1.4}, .count = 2}, variation).variant, -1);
  }
}

}  // namespace
}  // namespace stridewire
