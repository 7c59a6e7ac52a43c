// Avatars that start and stop accelerate their pelvis no more than people do.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "captured_library.h"
#include "offline/complete/complete_library.h"
#include "stridewire/offline/synthesis.h"

namespace stridewire {
namespace {

constexpr double kFps = 60.0;
// The horizontal acceleration of the pelvis is averaged over this number of frames. In captures of
// starts and stops it is at most 4.6 m/s^2.
constexpr std::size_t kAveragedFrames = 5;
constexpr double kMaxAcceleration = 6.0;

struct Manner {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
};
void PrintTo(const Manner& manner, std::ostream* out) { *out << manner.name; }

class StartStop : public testing::TestWithParam<Manner> {};

double LargestAcceleration(const Clip& clip) {
  const auto& root_m = clip.root_positions_m;
  const auto velocity = [&](std::size_t f) {
    return (root_m[f + kAveragedFrames] - root_m[f]) * static_cast<float>(kFps / kAveragedFrames);
  };
  double largest = 0.0;
  for (std::size_t f = 0; f + 1 + kAveragedFrames < root_m.size(); ++f) {
    const Vec3 change = (velocity(f + 1) - velocity(f)) * static_cast<float>(kFps);
    largest = std::max(largest, static_cast<double>(std::hypot(change.x, change.z)));
  }
  return largest;
}

// Returns a library with generated starts and stops if the captures lack them.
std::shared_ptr<const MotionLibrary> CompletedLibrary(const std::vector<std::string>& subjects) {
  if (subjects.empty()) return OpenLibrary("builtin").value();
  RawLibrary raw = AssembleTakes(TakesOf(subjects), {.mirror = true});
  EXPECT_EQ(CompleteLibrary(raw).failure, "");
  return LibraryBuilder::Selecting().Build(raw).value();
}

TEST_P(StartStop, AcceleratesGently) {
  STRIDEWIRE_SKIP_WITHOUT_TAKES(GetParam().subjects);
  const auto library = CompletedLibrary(GetParam().subjects);
  const auto check = [&](const AvatarOptions& options, double length_m) {
    std::vector<MovementRequest> requests;
    for (int walk = 0; walk < 2; ++walk) {
      requests.push_back({1, StandRequest{.seconds = 1.0}});
      for (int step = 0; step < 6; ++step) {
        requests.push_back({2, StepRequest{.length_m = length_m, .allow_nearest = true}});
      }
    }
    requests.push_back({3, StandRequest{.seconds = 1.0}});
    const auto walk =
        Synthesize({.library = library, .requests = requests, .fps = kFps, .options = options});
    ASSERT_TRUE(walk.has_value()) << Describe(walk.error());
    const double largest = LargestAcceleration(walk->clip);
    std::printf("%s, steps of %.2f m, %s %d: pelvis acceleration at most %.1f m/s^2\n",
                GetParam().name, length_m, options.stride_variation ? "seed" : "not varied",
                static_cast<int>(options.seed), largest);
    EXPECT_LT(largest, kMaxAcceleration) << "steps of " << length_m << " m, seed " << options.seed;
  };
  for (const double length_m : {0.4, 0.6, 0.75}) {
    check({}, length_m);
    for (const std::uint64_t seed : {0u, 1u}) {
      check({.stride_variation = true, .seed = seed}, length_m);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Libraries, StartStop,
                         testing::Values(Manner{"Builtin", {}}, Manner{"Subject16", {"16"}},
                                         Manner{"Subject05", {"05"}}, Manner{"Subject09", {"09"}},
                                         Manner{"Subject29", {"29"}},
                                         Manner{"Subjects03And14", {"03", "14"}}),
                         [](const auto& of) { return std::string(of.param.name); });

}  // namespace
}  // namespace stridewire
