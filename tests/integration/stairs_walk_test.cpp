// Walks to a place at the top of a flight of stairs and back down, with random rises and treads.
// The test measures how high feet swing, how far and how fast knees and ankles bend, and how
// abruptly the pelvis rises and falls, and compares each with a limit derived from people.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>

#include "captured_library.h"
#include "leg_geometry.h"
#include "pelvis_acceleration.h"
#include "random.h"
#include "stridewire/offline/synthesis.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {
namespace {

constexpr double kFps = 60.0;

// Limits derived from captures of people on blocks and stairs.
constexpr double kMaxSwingM = 0.2;  // Above the higher one of the two footprints.
constexpr double kMaxKneeDeg = 120.0;
constexpr double kMaxKneeDegPerS = 800.0;
constexpr double kMaxAnkleDeg = 50.0;
constexpr double kMaxAcceleration = 17.0;       // Of the pelvis, vertical, in m/s^2.
constexpr double kMaxUsualAcceleration = 10.0;  // The same in 99 % of all frames.
// People take one tread at a time if two are higher than this.
constexpr double kMaxClimbM = 0.18;

struct Flight {
  double rise_m;
  double tread_m;
  int treads;
};

std::shared_ptr<const Terrain> Build(const Flight& flight) {
  constexpr double kLandingM = 3.0;
  TerrainData data;
  for (int i = 0; i < flight.treads; ++i) {
    const double begin_m = 0.6 + i * flight.tread_m;
    const bool is_last = i + 1 == flight.treads;
    data.boxes.push_back({{-2.0, begin_m},
                          {2.0, begin_m + (is_last ? kLandingM : flight.tread_m)},
                          (i + 1) * flight.rise_m});
  }
  return Terrain::Make(std::move(data)).value();
}

Synthesis WalkUpAndDown(const std::shared_ptr<const MotionLibrary>& library, const Flight& flight) {
  const double top_m = 0.6 + (flight.treads - 1) * flight.tread_m + 1.2;
  const std::vector<MovementRequest> requests{
      {1, WalkRequest{.position_m = {0.0, flight.treads * flight.rise_m, top_m}}},
      {2, StandRequest{.seconds = 0.5}},
      {3, WalkRequest{.position_m = {0.0, 0.0, -0.5}, .heading_rad = M_PI}}};
  return Synthesize({.library = library,
                     .requests = requests,
                     .fps = kFps,
                     .options = {.terrain = Build(flight)}})
      .value();
}

// Largest values during a walk up and down.
struct StairsMotion {
  double swing_m = 0.0;
  double knee_deg = 0.0;
  double knee_deg_per_s = 0.0;
  double ankle_deg = 0.0;
  double acceleration = 0.0;
  double usual_acceleration = 0.0;
  double climb_m = 0.0;  // Largest height between footprints of successive steps.
};

void MeasurePelvis(const Clip& clip, StairsMotion& motion) {
  std::vector<double> accelerations = VerticalPelvisAccelerations(clip, kFps);
  std::ranges::sort(accelerations);
  motion.acceleration = accelerations.back();
  motion.usual_acceleration = accelerations[accelerations.size() * 99 / 100];
}

void MeasureLegs(const MotionLibrary& library, const Synthesis& synthesis, StairsMotion& motion) {
  LegGeometry legs(library.skeleton(), library.stand_pose());
  const Clip& clip = synthesis.clip;
  const auto frames = static_cast<std::size_t>(clip.frame_count());
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const double rest_m = legs.RestingHeights(foot)[1];
    std::vector<double> balls_m;
    std::vector<double> knees_deg;
    for (std::size_t f = 0; f < frames; ++f) {
      legs.Set(clip.frame(static_cast<int>(f)));
      balls_m.push_back(legs.Sole(foot)[1].y - rest_m);
      knees_deg.push_back(legs.KneeDegrees(foot));
      motion.ankle_deg = std::max(motion.ankle_deg, legs.AnkleDegrees(foot));
    }
    motion.knee_deg = std::max(motion.knee_deg, std::ranges::max(knees_deg));
    for (std::size_t f = 1; f + 1 < frames; ++f) {
      const double speed = std::fabs(knees_deg[f + 1] - knees_deg[f - 1]) * 0.5 * kFps;
      motion.knee_deg_per_s = std::max(motion.knee_deg_per_s, speed);
    }
    // The swings of a foot are between its plants.
    std::map<double, PlantRecord> plants;
    for (const MovementRecord& movement : synthesis.movements) {
      for (const PlantRecord& plant : movement.plants) {
        if (plant.foot == foot) plants.emplace(plant.from_s, plant);
      }
    }
    for (auto next = plants.begin(); next != plants.end(); ++next) {
      if (next == plants.begin()) continue;
      const PlantRecord& from = std::prev(next)->second;
      const double ends_m = std::max(from.anchor_m.y, next->second.anchor_m.y);
      const auto last = std::min(static_cast<std::size_t>(next->second.from_s * kFps), frames - 1);
      for (auto f = static_cast<std::size_t>(from.to_s * kFps); f <= last; ++f) {
        motion.swing_m = std::max(motion.swing_m, balls_m[f] - ends_m);
      }
    }
  }
}

double LargestClimb(const Synthesis& synthesis) {
  double climb_m = 0.0;
  double before_m = 0.0;
  for (const MovementRecord& movement : synthesis.movements) {
    if (movement.kind != MovementKind::kStepLeft && movement.kind != MovementKind::kStepRight) {
      continue;
    }
    const double height_m = movement.plants.back().anchor_m.y;
    climb_m = std::max(climb_m, std::fabs(height_m - before_m));
    before_m = height_m;
  }
  return climb_m;
}

class StairsWalk : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Libraries, StairsWalk, testing::Values("", "16", "29"),
                         [](const auto& subject) {
                           const std::string name = subject.param;
                           return name.empty() ? "Builtin" : "Subject" + name;
                         });

TEST_P(StairsWalk, StaysWithinHumanLimits) {
  std::vector<std::string> subjects;
  if (*GetParam() != '\0') subjects.emplace_back(GetParam());
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  const auto library = LibraryOf(subjects);
  constexpr unsigned kSeed = 5;
  std::printf("seed %u\n", kSeed);
  Random random(kSeed);
  // Treads of 26 cm are as short as the feet of `builtin`, so that heels overhang them. Treads of
  // 60 cm need strides whose rear leg is still bent when the avatar reaches the top.
  std::vector<Flight> flights{{0.1, 0.3, 7}, {0.17, 0.3, 7}, {0.2, 0.26, 6}, {0.17, 0.6, 6}};
  for (int i = 0; i < 3; ++i) {
    flights.push_back({random.Draw(0.1, 0.17), random.Draw(0.29, 0.38), 6});
  }
  for (const Flight& flight : flights) {
    const Synthesis synthesis = WalkUpAndDown(library, flight);
    for (const WalkRecord& walk : synthesis.walks) EXPECT_TRUE(walk.arrived) << walk.reason;
    StairsMotion motion;
    MeasurePelvis(synthesis.clip, motion);
    MeasureLegs(*library, synthesis, motion);
    motion.climb_m = LargestClimb(synthesis);
    std::printf(
        "%4.1f x %4.1f cm: feet swing up to %4.1f cm above footprints, knees %5.1f deg, %4.0f "
        "deg/s, ankles %4.1f deg, pelvis %4.1f m/s^2, usually below %4.1f, steps climb up to %4.1f "
        "cm\n",
        1e2 * flight.rise_m, 1e2 * flight.tread_m, 1e2 * motion.swing_m, motion.knee_deg,
        motion.knee_deg_per_s, motion.ankle_deg, motion.acceleration, motion.usual_acceleration,
        1e2 * motion.climb_m);
    EXPECT_LE(motion.swing_m, kMaxSwingM);
    EXPECT_LE(motion.knee_deg, kMaxKneeDeg);
    EXPECT_LE(motion.knee_deg_per_s, kMaxKneeDegPerS);
    EXPECT_LE(motion.ankle_deg, kMaxAnkleDeg);
    EXPECT_LE(motion.acceleration, kMaxAcceleration);
    EXPECT_LE(motion.usual_acceleration, kMaxUsualAcceleration);
    EXPECT_LE(motion.climb_m, std::max(kMaxClimbM, flight.rise_m + 1e-6));
  }
}

}  // namespace
}  // namespace stridewire
