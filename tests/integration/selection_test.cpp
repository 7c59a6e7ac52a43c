// Measures how many captured steps the selection keeps, and compares errors: each step is left out
// and synthesized from the selected steps, from all steps, and from the same number of random
// steps.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <random>
#include <vector>

#include "captured_library.h"
#include "offline/base/statistics.h"
#include "offline/build/example_clusters.h"
#include "offline/build/grid_cells.h"
#include "offline/build/left_out_error.h"
#include "offline/build/select_examples.h"
#include "runtime/weights/measure.h"

namespace stridewire {
namespace {

using Clusters = std::vector<std::vector<int>>;

// A group in the state in which LibraryBuilder selects its examples.
struct Steps {
  Steps(const RawLibrary& library, const RawGroup& raw)
      : skeleton(library.skeleton), group(raw), layout(skeleton.joint_count()) {
    const Quat& stand_root = library.stand_pose.rotations[0];
    const std::vector<int> cells = ChooseCells(group, 30.0, layout, stand_root);
    for (const RawExample& example : group.examples) {
      examples.push_back(ResampleOnGrid(example, cells, layout, stand_root));
    }
    AlignHemispheres(examples, layout, skeleton.joint_count());
    for (const GridExample& example : examples) {
      truths.push_back(JointPositions(example, layout, skeleton));
    }
    for (const ParameterName name : group.parameters) {
      units.push_back(name == ParameterName::kTurn ? kMetresPerRadian : 1.0);
    }
  }

  [[nodiscard]] Selected Select(const SelectionOptions& options, double diameter_m) const {
    return SelectExamplesJob{examples, units, diameter_m, options, layout, skeleton, group}.Run();
  }

  // Returns the mean error with which the stored examples reproduce each example, which is left out
  // if it is stored itself.
  [[nodiscard]] double LeftOutM(const Clusters& stored) const {
    std::vector<GridExample> averages;
    for (const auto& cluster : stored) {
      averages.push_back(AverageExamples(examples, cluster, layout, skeleton, group));
    }
    LeftOutProbe probe(layout, skeleton, units);
    double sum = 0.0;
    for (std::size_t s = 0; s < examples.size(); ++s) {
      std::vector<const GridExample*> set;
      GridExample without;
      for (std::size_t c = 0; c < stored.size(); ++c) {
        if (!std::ranges::binary_search(stored[c], static_cast<int>(s))) {
          set.push_back(&averages[c]);
          continue;
        }
        std::vector<int> others = stored[c];
        std::erase(others, static_cast<int>(s));
        if (others.empty()) continue;
        without = AverageExamples(examples, others, layout, skeleton, group);
        set.push_back(&without);
      }
      const auto blend = MakeBlendSet(std::move(set));
      if (!blend) return HUGE_VAL;
      sum += probe.Measure(*blend, examples[s], truths[s]).pose_m;
    }
    return sum / static_cast<double>(examples.size());
  }

  [[nodiscard]] Clusters All() const {
    Clusters all;
    for (int i = 0; i < static_cast<int>(examples.size()); ++i) all.push_back({i});
    return all;
  }

  // Returns the median over several seeds.
  [[nodiscard]] double RandomLeftOutM(std::size_t count, unsigned seeds) const {
    std::vector<double> errors;
    for (unsigned seed = 1; seed <= seeds; ++seed) {
      std::mt19937 random(seed);
      Clusters clusters = All();
      for (std::size_t i = clusters.size() - 1; i > 0; --i) {
        std::swap(clusters[i], clusters[random() % (i + 1)]);
      }
      clusters.resize(count);
      errors.push_back(LeftOutM(clusters));
    }
    return Median(errors);
  }

  const Skeleton& skeleton;
  const RawGroup& group;
  GridLayout layout;
  std::vector<GridExample> examples;
  std::vector<std::vector<Vec3>> truths;
  std::vector<double> units;
};

SelectionOptions Defaults() { return LibraryBuilder::Selecting().selection; }
double Diameter() { return LibraryBuilder::Selecting().cluster_diameter; }

struct Figures {
  std::size_t found = 0, stored = 0;
  double all_m = 0.0, chosen_m = 0.0, random_m = 0.0;
};

Figures MeasureSelection(const char* folder, const RawLibrary& raw, const RawGroup& group) {
  const Steps steps(raw, group);
  const Selected selected = steps.Select(Defaults(), Diameter());
  const Figures figures{steps.examples.size(), selected.clusters.size(),
                        steps.LeftOutM(steps.All()), steps.LeftOutM(selected.clusters),
                        steps.RandomLeftOutM(selected.clusters.size(), 9)};
  std::printf(
      "%s %s, %zu parameters: %zu of %zu stored, %d outliers; left out: all %.4f m, chosen %.4f m, "
      "random %.4f m\n",
      folder, std::string(MovementKindName(group.kind)).c_str(), group.parameters.size(),
      figures.stored, figures.found, selected.report.Count(ExampleFate::kOutlier), figures.all_m,
      figures.chosen_m, figures.random_m);
  return figures;
}

TEST(Selection, FewStepsOfSubject16ReproduceTheOthersAsWellAsAll) {
  const std::vector<std::string> subjects = {"16"};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  const RawLibrary raw = AssembleTakes(TakesOf(subjects), {.mirror = true});
  int straight = 0;
  int general = 0;
  for (const RawGroup& group : raw.groups) {
    if (!IsStep(group.kind)) continue;
    const Figures figures = MeasureSelection("16", raw, group);
    const bool is_straight = group.parameters.size() == 2;
    ++(is_straight ? straight : general);
    EXPECT_LE(figures.stored, figures.found * 2 / (is_straight ? 6 : 3));
    EXPECT_LE(figures.chosen_m, figures.all_m * (is_straight ? 1.0 : 1.03));
    EXPECT_LE(figures.chosen_m, figures.random_m * (is_straight ? 0.8 : 0.97));
  }
  EXPECT_EQ(straight, 2);
  EXPECT_EQ(general, 2);
}

// Steps over blocks of different heights are all different.
TEST(Selection, KeepsStepsOfSubject03OverBlocks) {
  const std::vector<std::string> subjects = {"03"};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  const RawLibrary raw = AssembleTakes(TakesOf(subjects), {.mirror = true});
  for (const RawGroup& group : raw.groups) {
    if (group.parameters.size() < 7) continue;
    const Figures figures = MeasureSelection("03", raw, group);
    EXPECT_GE(figures.stored, figures.found * 9 / 10);
    EXPECT_LE(figures.chosen_m, figures.all_m * 1.01);
  }
}

TEST(Selection, ReproducesLeftOutExamplesWithinItsBound) {
  const std::vector<std::string> subjects = {"16"};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  const RawLibrary raw = AssembleTakes(TakesOf(subjects), {.mirror = true});
  const RawGroup& group = raw.groups.front();
  const Steps steps(raw, group);
  std::size_t before = steps.examples.size() + 1;
  for (const double bound_m : {0.015, 0.025, 0.05}) {
    const Selected selected = steps.Select({bound_m, 0.0}, 0.0);
    EXPECT_LT(selected.clusters.size(), before);  // A larger bound needs fewer examples.
    before = selected.clusters.size();
    std::vector<const GridExample*> set;
    for (const GridExample& example : selected.examples) set.push_back(&example);
    const auto blend = MakeBlendSet(set);
    ASSERT_TRUE(blend.has_value());
    LeftOutProbe probe(steps.layout, steps.skeleton, steps.units);
    int left_out = 0;
    for (std::size_t i = 0; i < steps.examples.size(); ++i) {
      const SelectedExample& example = selected.report.examples[i];
      if (example.example >= 0) continue;
      ++left_out;
      EXPECT_EQ(example.fate, ExampleFate::kRedundant);
      const LeftOutError error = probe.Measure(*blend, steps.examples[i], steps.truths[i]);
      EXPECT_LE(error.pose_m, bound_m) << example.source;
      EXPECT_LE(error.miss_m, bound_m) << example.source;
      EXPECT_NEAR(error.pose_m, example.error_m, 1e-12);
    }
    EXPECT_EQ(left_out + static_cast<int>(before), static_cast<int>(steps.examples.size()));
    // Every selected example is necessary.
    for (std::size_t c = 0; c < set.size(); ++c) {
      std::vector<const GridExample*> fewer = set;
      fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(c));
      const auto rest = MakeBlendSet(fewer);
      double worst_m = 0.0;
      for (std::size_t i = 0; rest && i < steps.examples.size(); ++i) {
        if (std::ranges::any_of(fewer, [&](const GridExample* example) {
              return example->source == steps.examples[i].source &&
                     example->parameters == steps.examples[i].parameters;
            })) {
          continue;
        }
        worst_m =
            std::max(worst_m, probe.Measure(*rest, steps.examples[i], steps.truths[i]).worst_m());
      }
      EXPECT_TRUE(!rest || worst_m > bound_m) << c;
    }
  }
}

// Changes the motion of a step whose parameters are inside the hull of the others.
TEST(Selection, DropsOutliersWithAReason) {
  const std::vector<std::string> subjects = {"16"};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  const RawLibrary raw = AssembleTakes(TakesOf(subjects), {.mirror = true});
  RawGroup group = raw.groups.front();
  const SelectionOptions options{0.0, 5.0};
  const Steps clean(raw, group);
  const auto victim = [&] {
    LeftOutProbe probe(clean.layout, clean.skeleton, clean.units);
    for (std::size_t i = 0; i < clean.examples.size(); ++i) {
      std::vector<const GridExample*> others;
      for (std::size_t k = 0; k < clean.examples.size(); ++k) {
        if (k != i) others.push_back(&clean.examples[k]);
      }
      const LeftOutError error =
          probe.Measure(MakeBlendSet(others).value(), clean.examples[i], clean.truths[i]);
      if (error.outside_m == 0.0 && error.pose_m < 0.03) return i;
    }
    return std::size_t{0};
  }();
  EXPECT_NE(clean.Select(options, 0.0).report.examples[victim].fate, ExampleFate::kOutlier);
  const RawExample captured = group.examples[victim];
  group.examples[victim].clip.fps /= 1.8;  // The same poses at a lower speed.
  for (double& keytime : group.examples[victim].keytimes_s) keytime *= 1.8;
  {
    const Selected selected = Steps(raw, group).Select(options, 0.0);
    const SelectedExample& dropped = selected.report.examples[victim];
    EXPECT_EQ(dropped.fate, ExampleFate::kOutlier);
    EXPECT_EQ(dropped.example, -1);
    EXPECT_NE(dropped.reason.find("longer"), std::string::npos) << dropped.reason;
  }
  group.examples[victim] = captured;
  for (Vec3& position : group.examples[victim].clip.root_positions_m) position.y -= 0.3f;
  {
    const Selected selected = Steps(raw, group).Select(options, 0.0);
    const SelectedExample& dropped = selected.report.examples[victim];
    EXPECT_EQ(dropped.fate, ExampleFate::kOutlier);
    EXPECT_NEAR(dropped.error_m, 0.3, 0.05);
    EXPECT_NE(dropped.reason.find("joints"), std::string::npos) << dropped.reason;
  }
}

}  // namespace
}  // namespace stridewire
