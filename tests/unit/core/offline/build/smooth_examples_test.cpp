#include "offline/build/smooth_examples.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>
#include <vector>

#include "offline/build/grid_example.h"
#include "offline/build/library_writer.h"
#include "offline/builtin/builtin_library.h"
#include "runtime/library/convex_hull.h"
#include "runtime/weights/measure.h"
#include "stridewire/offline/library_builder.h"

namespace stridewire {
namespace {

constexpr int kStraight = 0;  // 15 examples with 2 parameters.
constexpr int kGeneral = 9;   // 30 examples with 5 parameters.

// Generated steps with individual variation: the root of each step is raised or lowered by a
// constant.
class SmoothExamples : public testing::Test {
 protected:
  void SetUp() override {
    RecordProperty("seed", static_cast<int>(seed_));
    const RawLibrary raw = GenerateBuiltinLibrary();
    auto built = LibraryBuilder().Build(raw);
    ASSERT_TRUE(built.has_value());
    library_ = *built;
  }

  [[nodiscard]] const GridLayout& layout() const { return library_->layout(); }
  [[nodiscard]] const Skeleton& skeleton() const { return library_->skeleton(); }
  [[nodiscard]] const MotionGroup& clean() const { return library_->group(kStraight); }

  MotionGroup WithVariation(double deviation_m) {
    std::normal_distribution<double> height(0.0, deviation_m);
    MotionGroup group = clean();
    grid_.assign(group.grid.begin(), group.grid.end());
    manner_m_.clear();
    const auto n = static_cast<std::size_t>(group.example_count);
    const auto row = static_cast<std::size_t>(layout().row_floats);
    for (std::size_t e = 0; e < n; ++e) {
      manner_m_.push_back(height(random_));
      for (std::size_t p = 0; p < static_cast<std::size_t>(group.grid_point_count); ++p) {
        float* floats = &grid_[(p * n + e) * row];
        GridLayout::Root root = layout().RootOf(floats);
        root.position_m.y += manner_m_.back();
        layout().SetRoot(floats, root);
      }
    }
    group.grid = grid_;
    return group;
  }

  static std::vector<int> All(const MotionGroup& group) {
    std::vector<int> all(static_cast<std::size_t>(group.example_count));
    std::iota(all.begin(), all.end(), 0);
    return all;
  }

  std::vector<GridExample> Stored(const MotionGroup& group) const {
    const auto n = static_cast<std::size_t>(group.example_count);
    const auto row = static_cast<std::size_t>(layout().row_floats);
    const auto keys = static_cast<std::size_t>(group.interval_count()) + 1;
    std::vector<GridExample> examples(n);
    for (std::size_t e = 0; e < n; ++e) {
      const auto site = group.site(static_cast<int>(e));
      examples[e].parameters.assign(site.begin(), site.end());
      const auto times = group.keytimes_s.subspan(e * keys, keys);
      examples[e].keytimes_s.assign(times.begin(), times.end());
      for (std::size_t p = 0; p < static_cast<std::size_t>(group.grid_point_count); ++p) {
        const auto values = group.grid.subspan((p * n + e) * row, row);
        examples[e].rows.insert(examples[e].rows.end(), values.begin(), values.end());
      }
    }
    return examples;
  }

  std::uint32_t seed_ = std::random_device{}();
  std::mt19937 random_{seed_};
  std::shared_ptr<const MotionLibrary> library_;
  std::vector<float> grid_;
  std::vector<double> manner_m_;
};

TEST_F(SmoothExamples, WeightsSumToOneAndReproduceParameters) {
  SCOPED_TRACE(seed_);
  const MotionGroup& group = clean();
  std::vector<int> used = All(group);
  used.erase(used.begin() + 4);
  const auto smooth = FitSmooth(group, used, {0.3, 2.0});
  ASSERT_NE(smooth, nullptr);
  std::uniform_real_distribution<double> anywhere(-0.2, 1.0);
  std::vector<double> scratch(static_cast<std::size_t>(group.example_count));
  for (int i = 0; i < 100; ++i) {
    const double p[] = {anywhere(random_), anywhere(random_)};
    Movement movement;
    SetWeights(smooth->group, -1, p, scratch, movement);
    double sum = 0.0;
    double mean[2] = {0.0, 0.0};
    for (std::size_t e = 0; e < scratch.size(); ++e) {
      sum += scratch[e];
      for (std::size_t l = 0; l < 2; ++l)
        mean[l] += scratch[e] * group.site(static_cast<int>(e))[l];
    }
    EXPECT_EQ(scratch[4], 0.0);
    EXPECT_NEAR(sum, 1.0, 1e-9);
    EXPECT_NEAR(mean[0], p[0], 1e-9);
    EXPECT_NEAR(mean[1], p[1], 1e-9);
  }
}

// ChooseSmoothness derives leave-one-out errors from one inverse. They must equal the errors found
// by actually leaving out each example.
TEST_F(SmoothExamples, MinimizeTheLeaveOneOutError) {
  SCOPED_TRACE(seed_);
  for (const double deviation_m : {0.0, 0.005, 0.05}) {
    const MotionGroup group = WithVariation(deviation_m);
    const std::vector<int> all = All(group);
    const std::vector<double> products = MovementProducts(group, layout(), skeleton());
    const auto chosen = ChooseSmoothness(group, all, products);
    ASSERT_TRUE(chosen.has_value());
    const auto n = all.size();
    const auto left_out_m = [&](const Smoothness& smoothness) {
      double sum_m = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        std::vector<int> others = all;
        others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
        std::vector<double> sites, applied(2), metric;
        for (const int e : others) {
          sites.insert(sites.end(), group.site(e).begin(), group.site(e).end());
        }
        for (const Parameter& parameter : group.parameters) metric.push_back(1.0 / parameter.scale);
        ProjectOntoHull(sites, metric, 0.1, group.site(static_cast<int>(i)), applied);
        Movement movement;
        std::vector<double> w(n);
        SetWeights(FitSmooth(group, others, smoothness)->group, -1, applied, w, movement);
        w[i] -= 1.0;
        double squared = 0.0;
        for (std::size_t a = 0; a < n; ++a) {
          for (std::size_t b = 0; b < n; ++b) squared += w[a] * w[b] * products[a * n + b];
        }
        sum_m += std::sqrt(std::max(0.0, squared));
      }
      return sum_m;
    };
    const double least_m = left_out_m(*chosen);
    for (const double ridge : {0.03, 0.1, 0.3, 1.0, 3.0, 10.0}) {
      for (const double radius : {2.0, 3.0}) {
        EXPECT_LE(least_m, left_out_m({ridge, radius}) + 1e-6) << deviation_m << " " << ridge;
      }
    }
    if (deviation_m == 0.0) {
      EXPECT_EQ(chosen->ridge, 0.03);
    }
  }
}

TEST_F(SmoothExamples, LoseIndividualVariationAndKeepParameters) {
  SCOPED_TRACE(seed_);
  const std::vector<GridExample> were = Stored(clean());
  // The ratio of single draws scatters so much that one in forty exceeds the limit.
  constexpr int kDraws = 8;
  double before = 0.0;
  double after = 0.0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const MotionGroup group = WithVariation(0.05);
    std::vector<GridExample> examples = Stored(group);
    ASSERT_TRUE(stridewire::SmoothExamples(group, layout(), skeleton(), examples).has_value());
    for (std::size_t e = 0; e < examples.size(); ++e) {
      for (std::size_t l = 0; l < 2; ++l) {
        EXPECT_NEAR(examples[e].parameters[l], were[e].parameters[l], 1.1e-4);
      }
      const auto height = [&](const GridExample& example) {
        return layout().RootOf(example.rows.data()).position_m.y;
      };
      before += manner_m_[e] * manner_m_[e];
      after += std::pow(height(examples[e]) - height(were[e]), 2);
      EXPECT_TRUE(ValidateKeytimes(examples[e].keytimes_s).has_value());
    }
  }
  EXPECT_LT(after, 0.8 * before);
}

TEST_F(SmoothExamples, AreUnchangedIfThereAreTooFew) {
  const MotionGroup group = WithVariation(0.05);
  const std::vector<double> products = MovementProducts(group, layout(), skeleton());
  std::vector<int> few = All(group);
  few.resize(12);  // Four per coefficient of a linear function of two parameters.
  EXPECT_TRUE(ChooseSmoothness(group, few, products).has_value());
  few.pop_back();
  EXPECT_FALSE(ChooseSmoothness(group, few, products).has_value());
}

TEST_F(SmoothExamples, HaveWiderRadiiAndBoundedWeightsInManyDimensions) {
  SCOPED_TRACE(seed_);
  for (const int g : {kStraight, kGeneral}) {
    const MotionGroup& group = library_->group(g);
    std::vector<double> scales;
    for (const Parameter& parameter : group.parameters) scales.push_back(parameter.scale);
    const auto wide = FitSmoothBasis(group.sites, scales);
    ASSERT_TRUE(wide.has_value());
    const double factor = wide->radius_factor;
    EXPECT_NEAR(wide->basis.dilations[0] / group.dilations[0], factor, 1e-12);
    if (g == kStraight) {
      EXPECT_EQ(factor, 1.0);
    } else {
      EXPECT_GT(factor, 1.05);
      EXPECT_LE(factor, 1.5);
    }
    EXPECT_LT(wide->basis.condition, 1000.0);
  }
}

TEST_F(SmoothExamples, RadiusFactorIsStoredInTheFile) {
  std::vector<MotionGroup> groups(library_->groups().begin(), library_->groups().end());
  const auto written = [&](double factor) {
    groups[0].radius_factor = factor;
    return WriteLibrary({skeleton(), library_->stand_pose(), groups, library_->layers()});
  };
  const auto wide = written(1.5);
  ASSERT_TRUE(wide.has_value());
  EXPECT_EQ((*wide)->group(0).radius_factor, 1.5);
  EXPECT_EQ((*wide)->group(1).radius_factor, 1.0);
  for (const double bad : {0.0, -1.0, 1e6, std::nan("")}) {
    const auto refused = written(bad);
    ASSERT_FALSE(refused.has_value()) << bad;
    EXPECT_NE(Describe(refused.error()).find("radius factor"), std::string::npos);
  }
}

// One joint that turns about one axis, from 0 to `end_rad` over the grid.
GridExample Turning(const GridLayout& layout, int points, double parameter, double end_rad) {
  GridExample example;
  example.parameters = {parameter};
  example.rows.resize(static_cast<std::size_t>(points) *
                      static_cast<std::size_t>(layout.row_floats));
  for (int p = 0; p < points; ++p) {
    const double half = 0.5 * end_rad * p / (points - 1);
    float* row = example.rows.data() + p * layout.row_floats;
    row[0] = static_cast<float>(std::sin(half));
    row[3] = static_cast<float>(std::cos(half));
  }
  return example;
}

TEST(AlignHemispheres, KeepsTracksContinuous) {
  const GridLayout layout(1);
  constexpr int kPoints = 9;
  // The middle example is the reference. The last one passes an angle of 180 degrees from it.
  std::vector<GridExample> examples = {Turning(layout, kPoints, 0.0, -0.4),
                                       Turning(layout, kPoints, 1.0, 0.2),
                                       Turning(layout, kPoints, 2.0, 4.5)};
  const auto quat = [&](const GridExample& example, int p) {
    return GridLayout::RotationOf(example.rows.data() + p * layout.row_floats, 0);
  };
  // Random signs, as in captures.
  for (std::size_t e = 0; e < examples.size(); ++e) {
    for (int p = 0; p < kPoints; ++p) {
      if ((static_cast<std::size_t>(p) * 7 + e * 3) % 5 < 2) continue;
      float* row = examples[e].rows.data() + p * layout.row_floats;
      GridLayout::SetRotation(row, 0, -GridLayout::RotationOf(row, 0));
    }
  }
  AlignHemispheres(examples, layout, 1);
  for (const GridExample& example : examples) {
    float along = 0.0f;
    for (int p = 0; p < kPoints; ++p) {
      along += Dot(quat(example, p), quat(examples[1], p));
      if (p > 0) {
        EXPECT_GT(Dot(quat(example, p), quat(example, p - 1)), 0.9f) << p;
      }
    }
    EXPECT_GT(along, 0.0f);
  }
}

}  // namespace
}  // namespace stridewire
