// Long random walks with the built-in library and with captured ones. The motion is written to BVH
// and read back, and the feet are compared with the requested footprints.

#include <gtest/gtest.h>

#include <cstdio>
#include <sstream>

#include "captured_library.h"
#include "offline/inspect/leg_survey.h"
#include "plant_measure.h"
#include "random.h"
#include "runtime/skeleton/leg_rig.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/bvh_writer.h"
#include "stridewire/offline/library_builder.h"
#include "test_library.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
constexpr double kFps = 60.0;
constexpr double kDegrees = 180.0 / M_PI;

// Parameters of random steps, within what each library spans.
struct Walker {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
  double least_length_m;
  double most_length_m;
  double least_side_m;
  double most_side_m;
  double most_turn_rad;
};

void PrintTo(const Walker& walker, std::ostream* out) { *out << walker.name; }

// Writes the motion to BVH and reads it back.
Clip ThroughBvh(const Skeleton& skeleton, const Clip& clip) {
  std::ostringstream text;
  EXPECT_TRUE(WriteBvh(skeleton, clip, text).has_value());
  const auto capture = ParseBvh(text.str(), "walk.bvh", {.unit_m = 1.0});
  EXPECT_TRUE(capture.has_value()) << (capture ? "" : capture.error().text);
  return capture->clip;
}

class FootPlant : public testing::TestWithParam<Walker> {};
INSTANTIATE_TEST_SUITE_P(
    Libraries, FootPlant,
    testing::Values(Walker{"Builtin", {}, 0.3, 0.75, 0.13, 0.26, 0.5},
                    Walker{"Subject16", {"16"}, 0.45, 0.75, 0.05, 0.2, 0.4},
                    Walker{"Subject01", {"01"}, 0.3, 0.58, 0.05, 0.25, 0.5},
                    Walker{"DebianTakes", {kDebianTakes}, 0.5, 0.58, 0.1, 0.2, 0.2}),
    [](const auto& walker) { return walker.param.name; });

// Footprints as a level designer might place them. Each has a random distance, side and turn from
// the previous one, and all are known in world space before the first step.
struct Trail {
  std::vector<MovementRequest> requests;
  std::vector<Footprint> prints;
  std::vector<Foot> feet;
};

Trail RandomTrail(const Walker& walker, const Library& library, int steps, unsigned seed) {
  Random random(seed);
  DVec3 stands[2];
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    stands[static_cast<int>(foot)] =
        DVec3(BallPosition(library->skeleton(), library->stand_pose(), foot));
    stands[static_cast<int>(foot)].y = 0.0;
  }
  Trail trail;
  double heading_rad = 0.0;
  Foot foot = Foot::kLeft;
  for (int i = 0; i < steps; ++i) {
    // Turn to the side of the moving foot: left turns happen with left steps.
    const double sign = foot == Foot::kLeft ? 1.0 : -1.0;
    double turn_rad = sign * random.Draw(-0.3, 1.0) * walker.most_turn_rad;
    // Stay near the origin, where floats are precise: turn back when far away.
    const DVec3 stands_at = stands[static_cast<int>(foot)];
    if (glm::length(stands_at) > 30.0) {
      const double home_rad = std::atan2(-stands_at.x, -stands_at.z);
      const bool turns_home = sign * WrapAngle(home_rad - heading_rad) > 0.0;
      turn_rad = sign * (turns_home ? 0.8 : -0.2) * walker.most_turn_rad;
    }
    heading_rad += turn_rad;
    const DVec3 vector(sign * random.Draw(walker.least_side_m, walker.most_side_m), 0.0,
                       random.Draw(walker.least_length_m, walker.most_length_m));
    const DVec3 lands = stands[static_cast<int>(OtherFoot(foot))] + RotateYaw(heading_rad, vector);
    stands[static_cast<int>(foot)] = lands;
    trail.requests.push_back({static_cast<std::uint64_t>(i + 1),
                              StepRequest{.foot = foot, .at = {{lands, heading_rad}}}});
    trail.prints.push_back({lands, heading_rad});
    trail.feet.push_back(foot);
    foot = OtherFoot(foot);
  }
  return trail;
}

TEST_P(FootPlant, RandomStepsLandOnTheirFootprintsAndStayThere) {
  const Walker& walker = GetParam();
  STRIDEWIRE_SKIP_WITHOUT_TAKES(walker.subjects);
  const Library library = LibraryOf(walker.subjects);
  const unsigned seed = 20261121;
  const Trail trail = RandomTrail(walker, library, 1000, seed);
  const auto synthesis = Synthesize({.library = library, .requests = trail.requests, .fps = kFps});
  ASSERT_TRUE(synthesis.has_value());
  const auto unplanted = Synthesize({.library = library,
                                     .requests = trail.requests,
                                     .fps = kFps,
                                     .options = {.foot_planting = false}});
  ASSERT_TRUE(unplanted.has_value());
  const Skeleton& skeleton = library->skeleton();
  const Clip clip = ThroughBvh(skeleton, synthesis->clip);
  const PlantFigures figures = MeasurePlanting(skeleton, clip, synthesis->movements);
  const PlantFigures before = MeasurePlanting(skeleton, unplanted->clip, unplanted->movements);

  const VelocityStep examples = LargestStepOfExamples(*LibraryOfAll(walker.subjects), kFps);

  // At each landing, compare the ball and the heading of the foot with its footprint.
  const FootCurves curves = CurvesOf(skeleton, clip);
  int missed = 0;
  int steps = 0;
  double worst_m = 0.0;
  double worst_deg = 0.0;
  double halves_m[2] = {};  // Mean error of the first and the last hundred steps.
  for (const MovementRecord& record : synthesis->movements) {
    if (record.request_id == 0) continue;
    const auto i = static_cast<std::size_t>(record.request_id - 1);
    const auto f = static_cast<int>(trail.feet[i]);
    ASSERT_FALSE(record.plants.empty());
    const auto frame = static_cast<std::size_t>(
        std::min(std::ceil(record.plants.back().from_s * kFps - 1e-6), clip.frame_count() - 1.0));
    const DVec3 at = curves.balls[f][frame];
    const double miss_m =
        std::hypot(at.x - trail.prints[i].position_m.x, at.z - trail.prints[i].position_m.z);
    const double miss_deg =
        kDegrees *
        std::fabs(WrapAngle(curves.headings_rad[f][frame] - trail.prints[i].heading_rad));
    missed += miss_m > 1e-3 || miss_deg > 0.5;
    worst_m = std::max(worst_m, miss_m);
    worst_deg = std::max(worst_deg, miss_deg);
    if (i < 100) halves_m[0] += miss_m / 100.0;
    if (i >= 900) halves_m[1] += miss_m / 100.0;
    ++steps;
  }
  const double before_p99 = Percentile(before.knee_acceleration, 0.99);
  const double after_p99 = Percentile(figures.knee_acceleration, 0.99);
  std::printf(
      "%s: seed %u, %d contacts, drift %.4f mm, %.3f mm/s (unplanted %.1f mm); %d of %d landings "
      "missed, worst %.3f mm %.3f deg, first hundred %.4f mm, last %.4f mm; knees from %.1f deg "
      "(unplanted %.1f), acceleration p99 %.0f (%.0f, ratio %.2f), max %.0f (%.0f, ratio %.2f); "
      "velocities step by %.2f rad/s, %.2f m/s at joins (unplanted %.2f, %.2f), %.2f, %.2f inside "
      "(%.2f, %.2f), %.2f, %.2f in the examples\n",
      walker.name, seed, figures.contacts, 1e3 * figures.largest_drift_m,
      1e3 * figures.largest_speed_m_s, 1e3 * before.largest_drift_m, missed, steps, 1e3 * worst_m,
      worst_deg, 1e3 * halves_m[0], 1e3 * halves_m[1], figures.least_knee_deg,
      before.least_knee_deg, after_p99, before_p99, after_p99 / before_p99,
      figures.knee_acceleration.back(), before.knee_acceleration.back(),
      figures.knee_acceleration.back() / before.knee_acceleration.back(),
      figures.largest_join_step.joint_rad_s, figures.largest_join_step.root_m_s,
      before.largest_join_step.joint_rad_s, before.largest_join_step.root_m_s,
      figures.largest_inside_step.joint_rad_s, figures.largest_inside_step.root_m_s,
      before.largest_inside_step.joint_rad_s, before.largest_inside_step.root_m_s,
      examples.joint_rad_s, examples.root_m_s);
  EXPECT_EQ(steps, 1000);
  EXPECT_LE(figures.largest_drift_m, 1e-3);
  EXPECT_LE(figures.largest_speed_m_s, 0.5e-3);
  EXPECT_LE(missed, 1);
  EXPECT_GE(figures.least_knee_deg, 0.0);
  EXPECT_LE(after_p99, 1.5 * before_p99);
  EXPECT_LE(figures.largest_join_step.joint_rad_s, 1.5 * examples.joint_rad_s);
  EXPECT_LE(figures.largest_join_step.root_m_s, std::max(0.5, 1.5 * examples.root_m_s));
}

// The ground is level, so standing soles stay on it, whatever heights the captured feet had.
TEST_P(FootPlant, SolesStayOnLevelGround) {
  const Walker& walker = GetParam();
  STRIDEWIRE_SKIP_WITHOUT_TAKES(walker.subjects);
  const Library library = LibraryOf(walker.subjects);
  const unsigned seed = 20261125;
  const Trail trail = RandomTrail(walker, library, 300, seed);
  const auto synthesis = Synthesize({.library = library, .requests = trail.requests, .fps = kFps});
  ASSERT_TRUE(synthesis.has_value());
  LegDeviations legs;
  SurveyLegs(*library, *synthesis, true, legs);
  std::printf("%s: seed %u, soles at most %.1f mm above the ground, balls %.1f mm below it\n",
              walker.name, seed, 1e3 * legs.hover_m, 1e3 * legs.sink_m);
  EXPECT_LE(legs.hover_m, 0.012);
  EXPECT_LE(legs.sink_m, 0.01);
}

// The toes of a foot that leaves the ground do not push into it, even if the foot leaves the ground
// while the pose still blends from another one.
TEST_P(FootPlant, ToesLeaveLevelGround) {
  const Walker& walker = GetParam();
  STRIDEWIRE_SKIP_WITHOUT_TAKES(walker.subjects);
  const Library library = LibraryOf(walker.subjects);
  const unsigned seed = 20261126;
  Random random(seed);
  std::vector<MovementRequest> requests;
  for (std::uint64_t id = 1; id <= 300; ++id) {
    const double length_m = random.Draw(0.0, 1.0) < 0.5 ? 0.0 : walker.most_length_m;
    const double turn_rad = random.Draw(-1.0, 1.0) * walker.most_turn_rad;
    requests.push_back(
        {.id = id, .movement = StepRequest{.length_m = length_m, .turn_rad = turn_rad}});
  }
  const auto synthesis = Synthesize({.library = library, .requests = requests, .fps = kFps});
  ASSERT_TRUE(synthesis.has_value());
  double sink_m = 0.0;
  LegPose leg;
  for (int frame = 0; frame < synthesis->clip.frame_count(); ++frame) {
    const ConstPoseSpan pose = synthesis->clip.frame(frame);
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      EvaluateLeg(library->skeleton(), library->leg_rig(), pose, foot, leg);
      sink_m = std::max(sink_m, -static_cast<double>(pose.root_position_m.y + leg.toe_tip_m.y));
    }
  }
  std::printf("%s: seed %u, toe tips at most %.1f mm below the ground\n", walker.name, seed,
              1e3 * sink_m);
  EXPECT_LE(sink_m, 0.008);  // The plan allows 3 mm, and 5 mm by which toes give way.
}

// A footprint in reach is met even if the examples do not span the step. For one out of reach, the
// report gives the distance between the foot and the footprint.
TEST(FootprintError, ReportsHowFarAStepMissesItsFootprint) {
  const Library library = OpenLibrary("builtin").value();
  const auto step_to = [&](const Footprint& print) {
    const std::vector<MovementRequest> requests = {
        {1, StepRequest{.foot = Foot::kLeft,
                        .at = {{print.position_m, print.heading_rad}},
                        .allow_nearest = true}}};
    return Synthesize({.library = library, .requests = requests, .fps = kFps})
        .value()
        .movements.front();
  };
  // No example combines this turn with this length.
  const MovementRecord met = step_to({{0.3, 0.0, 0.55}, 0.5});
  EXPECT_FALSE(met.clamped);
  EXPECT_LE(met.landing_error_m, 1e-4);
  EXPECT_LE(met.landing_error_rad * kDegrees, 0.05);

  const MovementRecord missed = step_to({{0.1, 0.0, 2.5}, 0.0});
  EXPECT_TRUE(missed.clamped);
  const DVec3 landed = missed.plants.back().anchor_m;
  EXPECT_NEAR(missed.landing_error_m, std::hypot(0.1 - landed.x, 2.5 - landed.z), 1e-4);
  EXPECT_GT(missed.landing_error_m, 1.0);
}

// The ball of the right foot is so close to its ankle that the squared distance underflows to 0 in
// float. Divisions by it must not cause NaN in planted rotations.
TEST(ShortFoot, KeepsRotationsNormalized) {
  RawLibrary raw = MakeTestRawLibrary();
  raw.skeleton.legs[1].ball_offset_m.z = 3.1e-43f;
  LibraryBuilder builder;
  const Library library = builder.Build(raw).value();
  std::vector<MovementRequest> requests;
  for (int i = 0; i < 4; ++i) requests.push_back({1, StepRequest{.length_m = 0.5}});
  requests.push_back({2, JumpRequest{.length_m = 0.6}});
  const auto synthesis = Synthesize({.library = library, .requests = requests, .fps = kFps});
  ASSERT_TRUE(synthesis.has_value());
  EXPECT_EQ(synthesis->movements.back().kind, MovementKind::kJump);
  for (const Quat& rotation : synthesis->clip.rotations) {
    ASSERT_NEAR(glm::length(rotation), 1.0f, 1e-4f);
  }
}

}  // namespace
}  // namespace stridewire
