// Long walks with the built-in library and with one built from the captures of subject 16. The
// tests measure smoothness between steps, straightness and height.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "captured_library.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/offline/synthesis.h"

namespace stridewire {
namespace {

constexpr double kFps = 60.0;
constexpr double kDegrees = 180.0 / M_PI;

using Library = std::shared_ptr<const MotionLibrary>;

Library Builtin() {
  auto library = OpenLibrary("builtin");
  EXPECT_TRUE(library.has_value());
  return *library;
}

std::vector<MovementRequest> RandomSteps(int count, double low_m, double high_m, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<MovementRequest> requests;
  for (int i = 0; i < count; ++i) {
    const double share = static_cast<double>(random()) / 4294967296.0;
    requests.push_back({static_cast<std::uint64_t>(i + 1),
                        StepRequest{.length_m = low_m + share * (high_m - low_m)}});
  }
  return requests;
}

struct Smoothness {
  double largest_inside_rad = 0.0;  // Rotation of a joint between frames, away from transitions.
  double largest_at_join_rad = 0.0;
  double largest_pelvis_jump_m = 0.0;  // Change of position between frames in excess of the speed.
};

Smoothness Measure(const Synthesis& walk) {
  Smoothness result;
  const Clip& clip = walk.clip;
  std::vector<bool> is_join(static_cast<std::size_t>(clip.frame_count()), false);
  for (const MovementRecord& record : walk.movements) {
    // The start is between two frames; take the pair around it.
    const auto frame = static_cast<std::size_t>(std::ceil(record.start_s * kFps - 1e-9));
    if (frame < is_join.size()) is_join[frame] = true;
  }
  for (int f = 1; f < clip.frame_count(); ++f) {
    const double angle = LargestJointAngle(clip.frame(f - 1), clip.frame(f));
    double& largest = is_join[static_cast<std::size_t>(f)] ? result.largest_at_join_rad
                                                           : result.largest_inside_rad;
    largest = std::max(largest, angle);
    if (f < 2) continue;
    const auto at = [&](int i) { return clip.root_positions_m[static_cast<std::size_t>(i)]; };
    result.largest_pelvis_jump_m = std::max(
        result.largest_pelvis_jump_m, double{glm::length(at(f) - 2.0f * at(f - 1) + at(f - 2))});
  }
  return result;
}

double MeanHeight(const Clip& clip, int from, int to) {
  double sum = 0.0;
  for (int f = from; f < to; ++f) sum += clip.root_positions_m[static_cast<std::size_t>(f)].y;
  return sum / (to - from);
}

void ExpectASmoothWalk(const Library& library, double low_m, double high_m, unsigned seed) {
  const auto walk = Synthesize(
      {.library = library, .requests = RandomSteps(200, low_m, high_m, seed), .fps = kFps});
  ASSERT_TRUE(walk.has_value()) << Describe(walk.error());
  const Smoothness smooth = Measure(*walk);
  std::printf(
      "seed %u: joint rotation between frames %.2f deg inside, %.2f deg at joins; pelvis "
      "%.4f m beyond its speed\n",
      seed, smooth.largest_inside_rad * kDegrees, smooth.largest_at_join_rad * kDegrees,
      smooth.largest_pelvis_jump_m);
  EXPECT_LE(smooth.largest_at_join_rad, 2.0 * smooth.largest_inside_rad) << "seed " << seed;
  EXPECT_LE(smooth.largest_pelvis_jump_m, 0.02) << "seed " << seed;
  // The height in the last quarter must be that in the first quarter.
  const int frames = walk->clip.frame_count();
  EXPECT_NEAR(MeanHeight(walk->clip, 60, frames / 4),
              MeanHeight(walk->clip, 3 * frames / 4, frames - 60), 0.01);
  EXPECT_EQ(walk->movements.back().base.position_m.y, 0.0);
}

void ExpectAStraightWalk(const Library& library, double length_m, double max_aside_m) {
  const auto walk = Synthesize(
      {.library = library, .requests = RandomSteps(100, length_m, length_m, 1), .fps = kFps});
  ASSERT_TRUE(walk.has_value()) << Describe(walk.error());
  ASSERT_GE(walk->movements.size(), 101u);
  const BaseFrame& base = walk->movements[99].base;
  std::printf("100 steps of %.2f m: %.3f m aside, %.3f deg turned, %.1f m on\n", length_m,
              base.position_m.x, base.heading_rad * kDegrees, base.position_m.z);
  EXPECT_LE(std::fabs(base.position_m.x), max_aside_m);
  EXPECT_LE(std::fabs(base.heading_rad) * kDegrees, 1.0);
  EXPECT_GT(base.position_m.z, 90 * length_m);
}

TEST(BuiltinWalk, IsSmooth) { ExpectASmoothWalk(Builtin(), 0.35, 0.75, 200); }

TEST(BuiltinWalk, IsStraightWithEqualSteps) {
  for (const double length_m : {0.35, 0.55, 0.75}) ExpectAStraightWalk(Builtin(), length_m, 0.2);
}

class CapturedWalk : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    const std::vector<std::string> subjects = {"16"};
    STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
    LibraryBuilder builder =
        GetParam() ? LibraryBuilder::KeepingAll() : LibraryBuilder::Selecting();
    library_ = builder.Build(AssembleTakes(TakesOf(subjects), {})).value();
  }
  Library library_;
};

TEST_P(CapturedWalk, IsSmooth) { ExpectASmoothWalk(library_, 0.45, 0.77, 216); }

TEST_P(CapturedWalk, IsStraightWithEqualSteps) {
  // Without mirror images, steps of one foot lead a little further to the side than those of the
  // other.
  for (const double length_m : {0.55, 0.65, 0.75}) ExpectAStraightWalk(library_, length_m, 0.7);
}

INSTANTIATE_TEST_SUITE_P(AllAndAveraged, CapturedWalk, testing::Bool(),
                         [](const auto& param) { return param.param ? "All" : "Averaged"; });

}  // namespace
}  // namespace stridewire
