// Stairs, a slalom, sideways and backward steps and turns on the spot, with the built-in library
// and with captures that span them. Knees must bend forward, legs must not cross, and no foot may
// go more than 3 cm into the ground.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "captured_library.h"
#include "leg_geometry.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/offline/synthesis.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
using Steps = std::vector<StepRequest>;

Library Builtin() { return OpenLibrary("builtin").value(); }

StepRequest Ahead(double length_m, double turn_rad = 0.0, double height_m = 0.0) {
  return {.length_m = length_m, .height_m = height_m, .turn_rad = turn_rad};
}

Steps Stairs(double rise_m, double tread_m) {
  Steps steps(4, Ahead(tread_m, 0.0, rise_m));
  steps.front().foot = Foot::kLeft;
  steps.push_back(Ahead(0.0));
  for (int i = 0; i < 4; ++i) steps.push_back(Ahead(tread_m, 0.0, -rise_m));
  steps.push_back(Ahead(0.4));
  steps.push_back(Ahead(0.0));
  return steps;
}

// Stairs on which both feet stand on each step before the next.
Steps StairsFootByFoot(double rise_m, double tread_m) {
  Steps steps;
  for (const double way : {1.0, -1.0}) {
    for (int i = 0; i < 3; ++i) {
      steps.push_back(Ahead(tread_m, 0.0, way * rise_m));
      steps.push_back(Ahead(0.1));
    }
  }
  steps.front().foot = Foot::kLeft;
  return steps;
}

Steps Slalom(double length_m, double turn_rad) {
  Steps steps = {Ahead(length_m), Ahead(length_m, turn_rad), Ahead(length_m, turn_rad)};
  for (int i = 0; i < 4; ++i) steps.push_back(Ahead(length_m, -turn_rad));
  for (int i = 0; i < 2; ++i) steps.push_back(Ahead(length_m, turn_rad));
  steps.push_back(Ahead(length_m));
  return steps;
}

Steps Shuffle(Foot lead, double side_m, double near_m) {
  Steps steps;
  for (int i = 0; i < 4; ++i) {
    steps.push_back({.foot = lead, .side_m = side_m});
    steps.push_back({.foot = OtherFoot(lead), .side_m = near_m});
  }
  return steps;
}

Steps Backward(double length_m) {
  Steps steps(5, Ahead(-length_m));
  steps.front().foot = Foot::kLeft;
  return steps;
}

Steps TurnOnTheSpot(double turn_rad) {
  Steps steps;
  for (int i = 0; i < 6; ++i) {
    steps.push_back({.foot = turn_rad > 0.0 ? Foot::kLeft : Foot::kRight, .turn_rad = turn_rad});
    steps.push_back({.foot = turn_rad > 0.0 ? Foot::kRight : Foot::kLeft});
  }
  return steps;
}

struct Foothold {
  double z_m;
  double height_m;
};

// Ground height of stairs along z. On the way up, a tread begins 14 cm behind the ball of the foot
// on it, but at least 10 cm ahead of the ball of the foot below, which is 1 cm ahead of its toes.
// On the way down, a tread ends 1 cm ahead of the ball of the foot on it.
double GroundAt(const std::vector<Foothold>& holds, double z_m) {
  double height = holds.front().height_m;
  for (std::size_t i = 1; i < holds.size(); ++i) {
    const Foothold &a = holds[i - 1], &b = holds[i];
    const double edge =
        a.height_m < b.height_m ? std::max(b.z_m - 0.14, a.z_m + 0.10) : a.z_m + 0.01;
    if (z_m > (a.height_m == b.height_m ? b.z_m : edge)) height = b.height_m;
  }
  return height;
}

struct Looks {
  double least_knee_deg = 180.0;
  double most_knee_deg = 0.0;
  double nearest_legs_m = 1.0;
  double deepest_m = 0.0;        // Depth of heel, ball or toes below the ground; NaN: unknown.
  double largest_drift_m = 0.0;  // Drift of a planted ball.
  int extrapolated = 0;
  int clamped = 0;
  std::set<int> groups;
  BaseFrame end;
};

Looks LookAt(const char* name, const Library& library, const Steps& steps) {
  std::vector<MovementRequest> requests;
  for (const StepRequest& step : steps) requests.push_back({requests.size() + 1, step});
  const auto synthesis = Synthesize({.library = library, .requests = requests});
  EXPECT_TRUE(synthesis.has_value());
  Looks looks;
  LegGeometry legs(library->skeleton(), library->stand_pose());
  legs.Set(synthesis->clip.frame(0));
  std::vector<Foothold> holds;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) holds.push_back({legs.Sole(foot)[1].z, 0.0});
  bool level = true;
  bool is_along_z = true;
  for (const MovementRecord& record : synthesis->movements) {
    if (record.request_id != 0) {
      looks.groups.insert(record.group);
      looks.extrapolated += record.extrapolated;
      looks.clamped += record.clamped;
      looks.end = record.base;
      is_along_z = is_along_z && std::fabs(record.base.heading_rad) < 0.1;
    }
    for (const PlantRecord& plant : record.plants) {
      looks.largest_drift_m = std::max(looks.largest_drift_m, plant.drift_m);
    }
    holds.push_back({record.plants.back().anchor_m.z, record.base.position_m.y});
    level = level && record.base.position_m.y == 0.0;
  }
  std::ranges::sort(holds, {}, &Foothold::z_m);
  for (int f = 0; f < synthesis->clip.frame_count(); ++f) {
    legs.Set(synthesis->clip.frame(f));
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      looks.least_knee_deg = std::min(looks.least_knee_deg, legs.KneeDegrees(foot));
      looks.most_knee_deg = std::max(looks.most_knee_deg, legs.KneeDegrees(foot));
      const auto sole = legs.Sole(foot);
      for (std::size_t p = 0; p < sole.size(); ++p) {
        const double ground = level ? 0.0 : GroundAt(holds, sole[p].z);
        const double above = sole[p].y - ground;
        looks.deepest_m = std::max(looks.deepest_m, -above);
      }
    }
    looks.nearest_legs_m = std::min(looks.nearest_legs_m, legs.LegDistance());
  }
  // The ground of a winding staircase does not follow from z.
  if (!level && !is_along_z) looks.deepest_m = std::numeric_limits<double>::quiet_NaN();
  std::printf(
      "%-28s knees %4.1f to %5.1f deg, legs %.3f m apart, %.3f m into the ground, balls drift %.3f "
      "m, "
      "%d extrapolated, %d clamped of %zu, groups",
      name, looks.least_knee_deg, looks.most_knee_deg, looks.nearest_legs_m, looks.deepest_m,
      looks.largest_drift_m, looks.extrapolated, looks.clamped, steps.size());
  for (const int group : looks.groups) std::printf(" %d", group);
  std::printf("\n");
  return looks;
}

void ExpectGoodLooks(const Looks& looks, double least_apart_m) {
  EXPECT_GE(looks.least_knee_deg, 0.0);
  EXPECT_LE(looks.most_knee_deg, 140.0);
  EXPECT_GE(looks.nearest_legs_m, least_apart_m);
  EXPECT_LE(looks.deepest_m, 0.03);
}

constexpr double kLegsApartM = 0.05;

TEST(GeneralStepsBuiltin, ClimbsStairs) {
  const Library library = Builtin();
  for (const double rise_m : {0.15, 0.20, 0.25}) {
    const Looks looks = LookAt("builtin stairs", library, Stairs(rise_m, 0.30));
    ExpectGoodLooks(looks, kLegsApartM);
    EXPECT_NEAR(looks.end.position_m.y, 0.0, 0.01);
    EXPECT_NEAR(looks.end.position_m.z, 8 * 0.30 + 0.4, 0.1);
  }
}

TEST(GeneralStepsBuiltin, ClimbsAWindingStaircase) {
  Steps steps(7, Ahead(0.3, 0.35, 0.15));
  steps.front().turn_rad = 0.0;
  const Looks looks = LookAt("builtin winding stairs", Builtin(), steps);
  EXPECT_GE(looks.least_knee_deg, 0.0);
  EXPECT_GE(looks.nearest_legs_m, kLegsApartM);
  EXPECT_NEAR(looks.end.heading_rad, 6 * 0.35, 0.05);
  EXPECT_NEAR(looks.end.position_m.y, 7 * 0.15, 0.02);
}

TEST(GeneralStepsBuiltin, WalksASlalom) {
  const Library library = Builtin();
  for (const double length_m : {0.4, 0.6, 0.7}) {
    const Looks looks = LookAt("builtin slalom", library, Slalom(length_m, 0.45));
    ExpectGoodLooks(looks, kLegsApartM);
    EXPECT_NEAR(looks.end.heading_rad, 0.0, 0.01);
  }
}

TEST(GeneralStepsBuiltin, StepsSideways) {
  const Library library = Builtin();
  for (const Foot lead : {Foot::kLeft, Foot::kRight}) {
    const Looks looks = LookAt("builtin shuffle", library, Shuffle(lead, 0.4, 0.13));
    ExpectGoodLooks(looks, kLegsApartM);
    EXPECT_NEAR(looks.end.position_m.x, (lead == Foot::kLeft ? 4 : -4) * 0.27, 0.03);
    EXPECT_NEAR(looks.end.position_m.z, 0.0, 0.02);
  }
}

TEST(GeneralStepsBuiltin, WalksBackward) {
  const Looks looks = LookAt("builtin backward", Builtin(), Backward(0.3));
  ExpectGoodLooks(looks, kLegsApartM);
  EXPECT_NEAR(looks.end.position_m.z, -5 * 0.3, 0.25);
  EXPECT_NEAR(looks.end.position_m.x, 0.0, 0.02);
}

TEST(GeneralStepsBuiltin, TurnsOnTheSpot) {
  const Library library = Builtin();
  for (const double turn_rad : {1.0, -1.0, 0.5}) {
    const Looks looks = LookAt("builtin turn on the spot", library, TurnOnTheSpot(turn_rad));
    ExpectGoodLooks(looks, 0.03);
    EXPECT_NEAR(looks.end.heading_rad, 6.0 * turn_rad, 0.05);
    EXPECT_LE(std::hypot(looks.end.position_m.x, looks.end.position_m.z), 0.4);
  }
}

struct Selection {
  const char* name;
  LibraryBuilder builder;
};
class GeneralStepsCaptured : public testing::TestWithParam<Selection> {};
INSTANTIATE_TEST_SUITE_P(Steps, GeneralStepsCaptured,
                         testing::Values(Selection{"All", LibraryBuilder::KeepingAll()},
                                         Selection{"Selected", LibraryBuilder::Selecting()}),
                         [](const auto& selection) { return selection.param.name; });

// Both subjects climb blocks of about 0.2 m, with 0.43 m from foot to foot. Stairs of 0.25 m are
// beyond their captures, so requests are clamped to the grown hull; the motion must still look
// right.
TEST_P(GeneralStepsCaptured, ClimbsTheBlocksOfSubjects03And14) {
  const std::vector<std::string> subjects = {"03", "14"};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  const Library library = BuildFromTakes(TakesOf(subjects), GetParam().builder);
  for (const double rise_m : {0.15, 0.20, 0.25}) {
    for (const double tread_m : {0.34, 0.38}) {
      ExpectGoodLooks(LookAt("03+14 stairs", library, Stairs(rise_m, tread_m)), kLegsApartM);
    }
  }
  for (const double rise_m : {0.15, 0.20, 0.25}) {
    ExpectGoodLooks(LookAt("03+14 foot by foot", library, StairsFootByFoot(rise_m, 0.38)),
                    kLegsApartM);
  }
}

TEST_P(GeneralStepsCaptured, WalksTheSlalomOfSubject16) {
  const std::vector<std::string> subjects = {"16"};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  const Library library = BuildFromTakes(TakesOf(subjects), GetParam().builder);
  // Subject 16 crosses its legs where it turns most.
  ExpectGoodLooks(LookAt("16 slalom", library, Slalom(0.6, 0.4)), 0.019);
}

TEST_P(GeneralStepsCaptured, StepsSidewaysAndBackwardLikeSubject09) {
  const std::vector<std::string> subjects = {"09"};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  const Library library = BuildFromTakes(TakesOf(subjects), GetParam().builder);
  for (const Foot lead : {Foot::kLeft, Foot::kRight}) {
    ExpectGoodLooks(LookAt("09 shuffle", library, Shuffle(lead, 0.30, 0.13)), kLegsApartM);
    ExpectGoodLooks(LookAt("09 shuffle", library, Shuffle(lead, 0.36, 0.18)), kLegsApartM);
  }
  ExpectGoodLooks(LookAt("09 backward", library, Backward(0.35)), kLegsApartM);
}

}  // namespace
}  // namespace stridewire
