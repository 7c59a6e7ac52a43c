// Identities of the paper that must hold for every group of every library: the generated one, one
// of subject 01 (Debian's package assimp-testmodels) and one of subject 16 (external captures).

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "captured_library.h"
#include "offline/builtin/builtin_library.h"
#include "runtime/library/cardinal_basis.h"
#include "runtime/library/keytimes.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"

namespace stridewire {
namespace {

constexpr double kDegrees = 57.29577951308232;

struct Source {
  const char* name;
  std::vector<std::string> captures;  // Empty: the generated library.
  bool all;                           // Keeps every movement without averaging.
};

// Without this, GoogleTest prints the bytes of the struct as part of the test name.
void PrintTo(const Source& source, std::ostream* out) { *out << source.name; }

struct Library {
  RawLibrary raw;
  std::shared_ptr<const MotionLibrary> built;
};

Library Make(const Source& source) {
  Library library;
  if (source.captures.empty()) {
    library.raw = GenerateBuiltinLibrary();
  } else {
    LibraryAssembler assembler;
    for (const std::filesystem::path& path : TakesOf(source.captures)) {
      const auto capture = ReadBvh(path);
      if (!capture) {
        ADD_FAILURE() << Describe(capture.error());
        return library;
      }
      assembler.Add(*capture);
    }
    auto raw = assembler.Assemble();
    if (!raw) {
      ADD_FAILURE() << Describe(raw.error());
      return library;
    }
    library.raw = std::move(*raw);
  }
  LibraryBuilder builder = source.all ? LibraryBuilder() : LibraryBuilder::Selecting();
  builder.bends_toes = false;  // Stored examples are compared with captures.
  auto built = builder.Build(library.raw);
  if (!built) {
    ADD_FAILURE() << Describe(built.error());
    return library;
  }
  library.built = *built;
  return library;
}

class LibraryIdentity : public testing::TestWithParam<Source> {
 protected:
  void SetUp() override {
    const Source& source = GetParam();
    STRIDEWIRE_SKIP_WITHOUT_TAKES(source.captures);
    // Each library is built once per program.
    static std::map<std::string, Library> made;
    auto found = made.find(source.name);
    if (found == made.end()) found = made.emplace(source.name, Make(source)).first;
    library_ = &found->second;
    ASSERT_NE(library_->built, nullptr);
    scratch_.resize(static_cast<std::size_t>(library_->built->max_row_count()));
  }

  [[nodiscard]] const MotionLibrary& library() const { return *library_->built; }
  [[nodiscard]] int group_count() const { return static_cast<int>(library().groups().size()); }

  std::vector<double> WeightsAt(const MotionGroup& group, std::span<const double> parameters) {
    std::vector<double> centres;
    std::vector<double> scales;
    for (const Parameter& parameter : group.parameters) {
      centres.push_back(parameter.centre);
      scales.push_back(parameter.scale);
    }
    std::vector<double> weights(static_cast<std::size_t>(group.example_count));
    EvaluateWeights({centres, scales, group.sites, group.dilations, group.linear, group.radial},
                    parameters, weights);
    return weights;
  }

  // A convex combination of the examples, moved away from the first example's side by `growth`.
  std::vector<double> RandomPoint(const MotionGroup& group, double growth) {
    const std::size_t d = group.parameters.size();
    const auto n = static_cast<std::size_t>(group.example_count);
    std::vector<double> point(d, 0.0);
    std::vector<double> mean(d, 0.0);
    double sum = 0.0;
    for (std::size_t e = 0; e < n; ++e) {
      const double share = std::pow(std::exponential_distribution<double>()(random_), 2.0);
      sum += share;
      for (std::size_t l = 0; l < d; ++l) {
        point[l] += share * group.sites[e * d + l];
        mean[l] += group.sites[e * d + l] / static_cast<double>(n);
      }
    }
    for (std::size_t l = 0; l < d; ++l) {
      point[l] = mean[l] + (1.0 + growth) * (point[l] / sum - mean[l]);
    }
    return point;
  }

  Pose RandomPose(const Vec3& about_m) {
    std::normal_distribution<float> normal;
    Pose pose(library().skeleton().joint_count());
    pose.root_position_m = about_m + 0.3f * Vec3(normal(random_), normal(random_), normal(random_));
    for (Quat& q : pose.rotations) {
      q = Normalise(Quat(normal(random_), normal(random_), normal(random_), normal(random_)));
    }
    return pose;
  }

  Movement Start(int g, std::span<const double> parameters, const BaseFrame& base = {}) {
    Movement movement;
    movement.difference = Pose(library().skeleton().joint_count());
    StartMovement(library().group(g), g, parameters, base, scratch_, movement);
    return movement;
  }

  // Returns the stored example: weight 1 for it, with its own keytimes.
  Movement Stored(int g, int example) {
    const MotionGroup& group = library().group(g);
    Movement movement = Start(g, group.site(example));
    std::ranges::fill(movement.weights, 0.0f);
    movement.weights[static_cast<std::size_t>(example)] = 1.0f;
    const auto keys = static_cast<std::size_t>(group.interval_count() + 1);
    const auto own = group.keytimes_s.subspan(static_cast<std::size_t>(example) * keys, keys);
    movement.warp = TimeWarp(own, group.cells);
    return movement;
  }

  Pose Blend(const Movement& movement, double time_s, GridCache& cache) {
    Pose pose(library().skeleton().joint_count());
    EvaluateBlend(library().group(movement.group), library().layout(), movement, time_s, cache,
                  pose);
    return pose;
  }

  Pose Shown(const Movement& movement, double time_s, GridCache& cache) {
    Pose pose(library().skeleton().joint_count());
    EvaluateMovement(library().group(movement.group), library().layout(), movement, time_s, cache,
                     pose);
    return pose;
  }

  static constexpr unsigned kSeed = 20261121;
  std::mt19937 random_{kSeed};
  const Library* library_ = nullptr;
  std::vector<double> scratch_;
};

TEST_P(LibraryIdentity, WeightsSumToOne) {
  std::printf("seed %u\n", kSeed);
  for (int g = 0; g < group_count(); ++g) {
    const MotionGroup& group = library().group(g);
    double largest = 0.0;
    for (int i = 0; i < 300; ++i) {
      const double growth = i < 100 ? 0.0 : i < 200 ? 0.1 : 1.0;
      double sum = 0.0;
      for (const double weight : WeightsAt(group, RandomPoint(group, growth))) sum += weight;
      largest = std::max(largest, std::fabs(sum - 1.0));
    }
    EXPECT_LE(largest, 1e-6) << "group " << g;
  }
}

TEST_P(LibraryIdentity, WeightsAreOneHotAtTheExamples) {
  for (int g = 0; g < group_count(); ++g) {
    const MotionGroup& group = library().group(g);
    for (int e = 0; e < group.example_count; ++e) {
      const std::vector<double> weights = WeightsAt(group, group.site(e));
      for (int k = 0; k < group.example_count; ++k) {
        ASSERT_NEAR(weights[static_cast<std::size_t>(k)], k == e ? 1.0 : 0.0, 1e-6)
            << "group " << g << " example " << e << " weight " << k;
      }
    }
  }
}

TEST_P(LibraryIdentity, MovementsStartInThePreviousPose) {
  std::printf("seed %u\n", kSeed);
  double start_m = 0.0;
  double start_rad = 0.0;
  double end_m = 0.0;
  double end_rad = 0.0;
  for (int g = 0; g < group_count(); ++g) {
    const MotionGroup& group = library().group(g);
    GridCache cache(library().layout());
    for (int i = 0; i < 40; ++i) {
      const BaseFrame base = {{2.0, 0.1, -1.0}, 0.7 * i};
      const std::vector<double> parameters =
          i < group.example_count && i < 10
              ? std::vector<double>(group.site(i).begin(), group.site(i).end())
              : RandomPoint(group, 0.1);
      Movement movement = Start(g, parameters, base);
      cache.Clear();
      const Pose own = Blend(movement, 0.0, cache);
      const Pose previous = RandomPose(own.root_position_m);
      Subtract(previous, own, movement.difference);
      const Pose first = Shown(movement, 0.0, cache);
      start_m =
          std::max(start_m, double{glm::length(first.root_position_m - previous.root_position_m)});
      start_rad = std::max(start_rad, LargestJointAngle(first, previous));
      for (const double t :
           {movement.ease_out_s, 0.5 * (movement.ease_out_s + movement.duration_s()),
            movement.duration_s()}) {
        const Pose shown = Shown(movement, t, cache);
        const Pose blend = Blend(movement, t, cache);
        end_m = std::max(end_m, double{glm::length(shown.root_position_m - blend.root_position_m)});
        end_rad = std::max(end_rad, LargestJointAngle(shown, blend));
      }
    }
  }
  std::printf("M'(0) from P: %.2g m, %.2g rad; M'(T) from M(T): %.2g m, %.2g rad\n", start_m,
              start_rad, end_m, end_rad);
  EXPECT_LE(start_m, 1e-5);
  EXPECT_LE(start_rad, 1e-5);
  EXPECT_LE(end_m, 1e-5);
  EXPECT_LE(end_rad, 1e-5);
}

TEST_P(LibraryIdentity, ReproducesEachExampleAtItsParameters) {
  double largest_rad = 0.0;
  double largest_m = 0.0;
  for (int g = 0; g < group_count(); ++g) {
    const MotionGroup& group = library().group(g);
    for (int e = 0; e < group.example_count; ++e) {
      const Movement movement = Start(g, group.site(e));
      const Movement stored = Stored(g, e);
      ASSERT_NEAR(movement.duration_s(), stored.duration_s(), 1e-5);
      GridCache cache(library().layout());
      GridCache stored_cache(library().layout());
      for (double t = 0.0; t < stored.duration_s(); t += 1.0 / 60.0) {
        const Pose got = Blend(movement, t, cache);
        const Pose expected = Blend(stored, t, stored_cache);
        largest_rad = std::max(largest_rad, LargestJointAngle(got, expected));
        largest_m = std::max(largest_m,
                             double{glm::length(got.root_position_m - expected.root_position_m)});
      }
    }
  }
  std::printf("movement from stored example: %.2g deg, %.2g m\n", largest_rad * kDegrees,
              largest_m);
  EXPECT_LE(largest_rad * kDegrees, 0.01);
  EXPECT_LE(largest_m, 1e-4);
}

TEST_P(LibraryIdentity, StoredExamplesEqualTheCapture) {
  double sum_rad = 0.0;
  double largest_rad = 0.0;
  double largest_mean_rad = 0.0;
  std::int64_t count = 0;
  int compared = 0;
  int averaged = 0;
  for (int g = 0; g < group_count(); ++g) {
    const MotionGroup& group = library().group(g);
    const RawGroup& raw = library_->raw.groups[static_cast<std::size_t>(g)];
    ASSERT_EQ(raw.kind, group.kind);
    GridCache cache(library().layout());
    Pose captured(library().skeleton().joint_count());
    for (int e = 0; e < group.example_count; ++e) {
      // By its parameters, which are unique in a group; an average of several has its own.
      const auto site = group.site(e);
      const auto found = std::ranges::find_if(raw.examples, [&](const RawExample& example) {
        return std::ranges::equal(example.parameters, site);
      });
      if (found == raw.examples.end()) {
        ++averaged;
        continue;
      }
      ++compared;
      EXPECT_EQ(found->source, group.sources[static_cast<std::size_t>(e)]);
      const Movement stored = Stored(g, e);
      cache.Clear();
      double example_rad = 0.0;
      std::int64_t example_count = 0;
      for (double t = 0.0; t <= found->keytimes_s.back(); t += 1.0 / 120.0) {
        const Pose got = Blend(stored, t, cache);
        SampleClip(found->clip, t, captured);
        for (std::size_t j = 0; j < got.rotations.size(); ++j) {
          const double angle = AngleBetween(got.rotations[j], captured.rotations[j]);
          example_rad += angle;
          largest_rad = std::max(largest_rad, angle);
          ++example_count;
        }
      }
      largest_mean_rad =
          std::max(largest_mean_rad, example_rad / static_cast<double>(example_count));
      sum_rad += example_rad;
      count += example_count;
    }
  }
  ASSERT_GT(compared, 0);
  const double mean_deg = sum_rad / static_cast<double>(count) * kDegrees;
  std::printf(
      "%s: stored examples from captured ones: mean %.4f deg, worst example %.4f deg, largest of a "
      "joint %.2f deg (%d examples, %d averages)\n",
      GetParam().name, mean_deg, largest_mean_rad * kDegrees, largest_rad * kDegrees, compared,
      averaged);
  EXPECT_LE(mean_deg, 0.5);
  EXPECT_LE(largest_mean_rad * kDegrees, 0.5);
}

INSTANTIATE_TEST_SUITE_P(Libraries, LibraryIdentity,
                         testing::Values(Source{"Builtin", {}, true},
                                         Source{"Subject01All", {kDebianTakes}, true},
                                         Source{"Subject01Averaged", {kDebianTakes}, false},
                                         Source{"Subject16All", {"16"}, true},
                                         Source{"Subject16Averaged", {"16"}, false}),
                         [](const auto& param) { return std::string(param.param.name); });

}  // namespace
}  // namespace stridewire
