// Walks over stepping stones, stairs, a ramp and hills. The tests measure how deep soles go into
// the ground, how much they clear it, and whether they stand on it.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "captured_library.h"
#include "leg_geometry.h"
#include "pelvis_acceleration.h"
#include "random.h"
#include "stridewire/offline/synthesis.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
using Ground = std::shared_ptr<const Terrain>;
constexpr double kFps = 60.0;

// Largest depth below the ground, smallest clearance above it, and largest drift.
constexpr double kDeepestM = 0.002;
// People climbing blocks of 40 cm bend their knees by up to 125 degrees.
constexpr double kLargestKneeDeg = 130.0;
constexpr double kMostDriftM = 0.001;
constexpr double kLeastClearanceM = 0.01;
// A foot is over an edge if the ground below its heel or toes is this much below the ground at its
// ball, on slopes of up to 20 degrees. Toes that tilt to the ground after a heel strike may be over
// the edge by a few millimetres.
constexpr double kEdgeM = 0.1;
constexpr double kOverhangM = 0.005;
// Of the pelvis, vertical, in m/s^2. People who climb stay below 9.6 in 99 % of all frames.
constexpr double kMaxAcceleration = 9.0;

struct Walker {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
  // Distances and heights within what its steps reach.
  double nearest_stone_m = 0.35;
  double furthest_stone_m = 0.6;
  double rise_m = 0.25;
};
void PrintTo(const Walker& walker, std::ostream* out) { *out << walker.name; }

struct Course {
  Ground ground;
  std::vector<MovementRequest> requests;
};

void AddStep(Course& course, Foot foot, const DVec3& at, double heading_rad = 0.0) {
  course.requests.push_back(
      {course.requests.size() + 1, StepRequest{.foot = foot, .at = {{at, heading_rad}}}});
}

// The ladder of slabs in the paper: one slab per step, at random distances and heights.
Course Stones(Random& random, int steps, const Walker& walker) {
  Course course;
  TerrainData data;
  double z = 0.0;
  double height = 0.0;
  Foot foot = Foot::kLeft;
  data.boxes.push_back({{-0.5, -0.5}, {0.5, 0.25}, 0.0});
  for (int i = 0; i < steps; ++i) {
    z += i == 0 ? 0.55 : random.Draw(walker.nearest_stone_m, walker.furthest_stone_m);
    height = std::clamp(height + random.Draw(-walker.rise_m, walker.rise_m), 0.0, 2.0);
    const double x = foot == Foot::kLeft ? 0.1 : -0.1;
    data.boxes.push_back({{x - 0.12, z - 0.22}, {x + 0.12, z + 0.16}, height});
    AddStep(course, foot, {x, height, z});
    foot = OtherFoot(foot);
  }
  course.ground = Terrain::Make(std::move(data)).value();
  return course;
}

Course Stairs(double rise_m, double tread_m, int up) {
  Course course;
  TerrainData data;
  Foot foot = Foot::kLeft;
  const auto add = [&](double z, double height) {
    AddStep(course, foot, {foot == Foot::kLeft ? 0.1 : -0.1, height, z});
    foot = OtherFoot(foot);
  };
  double z = 0.5;
  for (int i = 1; i <= up; ++i) {
    data.boxes.push_back(
        {{-1.0, z - 0.2}, {1.0, z - 0.2 + tread_m * (2 * (up - i) + 2) + 0.6}, i * rise_m});
    add(z, i * rise_m);
    z += tread_m;
  }
  add(z, up * rise_m);
  // Going down, each tread ends where the next one begins.
  const double top_end = data.boxes.back().max_m.z;
  z = top_end - 0.08;
  add(z, up * rise_m);
  for (int i = up - 1; i >= 0; --i) {
    z += tread_m;
    add(z, i * rise_m);
  }
  course.ground = Terrain::Make(std::move(data)).value();
  return course;
}

// A straight walk over a height field.
Course Over(HeightField field, int steps, double length_m) {
  Course course;
  course.ground = Terrain::Make({.height_field = std::move(field), .boxes = {}}).value();
  for (int i = 0; i < steps; ++i) {
    course.requests.push_back(
        {static_cast<std::uint64_t>(i + 1), StepRequest{.length_m = length_m}});
  }
  return course;
}

Course Ramp(double degrees) {
  HeightField field{{-5.0, -5.0}, 0.25, 41, 121, {}};
  for (int row = 0; row < field.rows; ++row) {
    const double z = -5.0 + 0.25 * row;
    const double up = std::clamp(z - 1.0, 0.0, 6.0) - std::clamp(z - 9.0, 0.0, 6.0);
    const auto height = static_cast<float>(up * std::tan(degrees * M_PI / 180.0));
    field.heights_m.insert(field.heights_m.end(), static_cast<std::size_t>(field.columns), height);
  }
  return Over(std::move(field), 30, 0.5);
}

Course Hills(Random& random) {
  HeightField field{{-8.0, -4.0}, 0.5, 33, 97, {}};
  const double phase[4] = {random.Draw(0, 6), random.Draw(0, 6), random.Draw(0, 6),
                           random.Draw(0, 6)};
  for (int row = 0; row < field.rows; ++row) {
    for (int column = 0; column < field.columns; ++column) {
      const double x = -8.0 + 0.5 * column;
      const double z = -4.0 + 0.5 * row;
      const double y = 0.3 * std::sin(0.9 * z + phase[0]) + 0.2 * std::sin(0.7 * x + phase[1]) +
                       0.1 * std::sin(1.7 * z + 0.8 * x + phase[2]) +
                       0.02 * std::sin(6.0 * z + 5.0 * x + phase[3]);
      field.heights_m.push_back(static_cast<float>(y));
    }
  }
  return Over(std::move(field), 40, 0.5);
}

struct Looks {
  double deepest_m = 0.0;          // Depth of heel, ball or toes below the ground.
  double standing_m = 0.0;         // The same for standing feet.
  double least_clearance_m = 9.0;  // Clearance of the ball in the middle of a swing.
  double drift_m = 0.0;
  double off_ground_m = 0.0;  // Height of a standing foot's ball above where it should be.
  double least_knee_deg = 180.0;
  double largest_knee_deg = 0.0;
  int over_edges = 0;  // Standing feet whose heel or toes are over an edge.
  double travelled_m = 0.0;
};

bool IsOverEdge(LegGeometry& legs, const Clip& clip, std::size_t frame, Foot foot,
                const Terrain& ground) {
  legs.Set(clip.frame(static_cast<int>(frame)));
  const auto [heel, ball, toe] = legs.Sole(foot);
  const auto is_over = [&, &ball = ball](const auto& end) {
    const auto nearer = end + kOverhangM * glm::normalize(ball - end);
    return ground.HeightAt(nearer.x, nearer.z) < ground.HeightAt(ball.x, ball.z) - kEdgeM;
  };
  return is_over(heel) || is_over(toe);
}

Looks LookAt(const char* name, const Library& library, const Course& course) {
  const double ground = course.ground->HeightAt(0.0, 0.0);
  const auto synthesis = Synthesize({.library = library,
                                     .start = {{0.0, ground, 0.0}, 0.0},
                                     .requests = course.requests,
                                     .fps = kFps,
                                     .options = {.terrain = course.ground}});
  EXPECT_TRUE(synthesis.has_value());
  Looks looks;
  const Clip& clip = synthesis->clip;
  const Skeleton& skeleton = library->skeleton();
  LegGeometry legs(skeleton, library->stand_pose());
  // Which feet stand in each frame, and the elapsed fraction of the swing of the others.
  const auto frames = static_cast<std::size_t>(clip.frame_count());
  std::vector<char> stands[2] = {std::vector<char>(frames), std::vector<char>(frames)};
  for (const MovementRecord& record : synthesis->movements) {
    for (const PlantRecord& plant : record.plants) {
      looks.drift_m = std::max(looks.drift_m, plant.drift_m);
      const auto first = static_cast<std::size_t>(std::ceil(plant.from_s * kFps - 1e-6));
      const auto last = static_cast<std::size_t>(std::floor(plant.to_s * kFps + 1e-6));
      looks.over_edges += IsOverEdge(legs, clip, (first + std::min(last, frames - 1)) / 2,
                                     plant.foot, *course.ground);
      for (std::size_t f = first; f <= std::min(last, frames - 1); ++f) {
        stands[static_cast<int>(plant.foot)][f] = 1;
      }
    }
  }
  for (std::size_t f = 0; f < frames; ++f) {
    legs.Set(clip.frame(static_cast<int>(f)));
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      looks.least_knee_deg = std::min(looks.least_knee_deg, legs.KneeDegrees(foot));
      looks.largest_knee_deg = std::max(looks.largest_knee_deg, legs.KneeDegrees(foot));
      const auto sole = legs.Sole(foot);
      const auto& rest = legs.RestingHeights(foot);
      const auto& planted = stands[static_cast<int>(foot)];
      for (std::size_t p = 0; p < 3; ++p) {
        const double above = sole[p].y - rest[p] - course.ground->HeightAt(sole[p].x, sole[p].z);
        looks.deepest_m = std::max(looks.deepest_m, -above);
        if (planted[f]) looks.standing_m = std::max(looks.standing_m, -above);
        if (p == 1 && planted[f]) looks.off_ground_m = std::max(looks.off_ground_m, above);
        // Only measure at least a tenth of a second after release and before landing.
        bool swings = p == 1;
        for (int k = -6; k <= 6; ++k) {
          const auto g = static_cast<std::ptrdiff_t>(f) + k;
          if (g < 0 || g >= static_cast<std::ptrdiff_t>(frames) ||
              planted[static_cast<std::size_t>(g)])
            swings = false;
        }
        if (swings) looks.least_clearance_m = std::min(looks.least_clearance_m, above);
      }
    }
  }
  looks.travelled_m = clip.root_positions_m.back().z;
  std::printf(
      "%-26s %5.1f m: %.1f mm into the ground, standing %.1f mm, balls stand up to %.1f mm high, "
      "pass at least %.1f mm above it, drift %.3f mm, knees from %.1f to %.1f deg, "
      "%d over an edge\n",
      name, looks.travelled_m, 1e3 * looks.deepest_m, 1e3 * looks.standing_m,
      1e3 * looks.off_ground_m, 1e3 * looks.least_clearance_m, 1e3 * looks.drift_m,
      looks.least_knee_deg, looks.largest_knee_deg, looks.over_edges);
  return looks;
}

void ExpectGoodLooks(const Looks& looks) {
  EXPECT_LE(looks.deepest_m, kDeepestM);
  EXPECT_GE(looks.least_clearance_m, kLeastClearanceM);
  EXPECT_LE(looks.drift_m, kMostDriftM);
  EXPECT_GE(looks.least_knee_deg, 0.0);
  EXPECT_LE(looks.largest_knee_deg, kLargestKneeDeg);
  EXPECT_EQ(looks.over_edges, 0);
}

class TerrainWalk : public testing::TestWithParam<Walker> {
 protected:
  void SetUp() override {
    const Walker& walker = GetParam();
    STRIDEWIRE_SKIP_WITHOUT_TAKES(walker.subjects);
    library_ = LibraryOf(walker.subjects);
  }
  Library library_;
};
class SteppingStones : public TerrainWalk {};
class WideStances : public TerrainWalk {};

const Walker kBuiltin{"Builtin", {}};
const Walker kSubject16{"Subject16", {"16"}};
const Walker kSubject01{"Subject01", {"01"}, 0.35, 0.5, 0.05};
const auto kName = [](const auto& walker) { return walker.param.name; };
INSTANTIATE_TEST_SUITE_P(Libraries, TerrainWalk, testing::Values(kBuiltin, kSubject16, kSubject01),
                         kName);
INSTANTIATE_TEST_SUITE_P(Libraries, SteppingStones,
                         testing::Values(kBuiltin, kSubject16, kSubject01), kName);

// The library of subject 16 rejects such wide steps sideways.
INSTANTIATE_TEST_SUITE_P(Libraries, WideStances, testing::Values(kBuiltin, kSubject01), kName);

TEST_P(SteppingStones, AreUsedOneByOne) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    Random random(seed);
    ExpectGoodLooks(LookAt("stones", library_, Stones(random, 30, GetParam())));
  }
}

TEST_P(TerrainWalk, WalksStairsUpAndDown) {
  for (const double rise_m : {0.15, 0.2, 0.25}) {
    ExpectGoodLooks(LookAt("stairs", library_, Stairs(rise_m, 0.34, 5)));
  }
}

TEST_P(TerrainWalk, WalksARampUpAndDown) {
  for (const double degrees : {5.0, 10.0, 20.0})
    ExpectGoodLooks(LookAt("ramp", library_, Ramp(degrees)));
}

TEST_P(TerrainWalk, WalksOverHills) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    Random random(seed);
    ExpectGoodLooks(LookAt("hills", library_, Hills(random)));
  }
}

// After a wide step sideways, level or onto a block, the leg of the other foot is fully extended
// and holds the root down until that foot is released. The root must then not spring up.
TEST_P(WideStances, AreClosedGently) {
  int played = 0;  // Courses whose footprints are within reach.
  for (const double rise_m : {0.0, 0.05, 0.1}) {
    for (const double side_m : {0.45, 0.5, 0.55, 0.6}) {
      Course course;
      TerrainData data;
      data.boxes.push_back({{0.1, -1.0}, {2.0, 1.0}, rise_m});
      course.ground = Terrain::Make(std::move(data)).value();
      AddStep(course, Foot::kLeft, {side_m - 0.1, rise_m, 0.05});
      AddStep(course, Foot::kRight, {side_m - 0.25, rise_m, 0.05});
      const auto synthesis = Synthesize({.library = library_,
                                         .start = {},
                                         .requests = course.requests,
                                         .fps = kFps,
                                         .options = {.terrain = course.ground}});
      ASSERT_TRUE(synthesis.has_value());
      if (synthesis->movements.size() < 2) continue;
      ++played;
      const double largest = std::ranges::max(VerticalPelvisAccelerations(synthesis->clip, kFps));
      std::printf("%.2f m sideways, %.2f m up: %.1f m/s^2\n", side_m, rise_m, largest);
      EXPECT_LT(largest, kMaxAcceleration) << side_m << " m sideways, " << rise_m << " m up";
    }
  }
  EXPECT_GE(played, 10);
}

}  // namespace
}  // namespace stridewire
