#include "offline/complete/complete_library.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "captured_library.h"
#include "offline/build/grid_cells.h"
#include "offline/builtin/builtin_library.h"
#include "offline/complete/stride_model.h"
#include "offline/inspect/self_check.h"
#include "reframing.h"
#include "runtime/library/keytimes.h"
#include "runtime/plan/request_plan.h"
#include "runtime/skeleton/foot_vector.h"
#include "stridewire/offline/library_builder.h"
#include "synthetic_walker.h"

namespace stridewire {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

// A walk that neither stops nor turns.
RawLibrary WalkWithoutStop() {
  LibraryAssembler assembler;
  assembler.Add(SyntheticWalker{}.Walk({{Foot::kLeft, 0.5},
                                        {Foot::kRight, 0.6},
                                        {Foot::kLeft, 0.55},
                                        {Foot::kRight, 0.6},
                                        {Foot::kLeft, 0.5},
                                        {Foot::kRight, 0.55}}));
  return assembler.Assemble().value();
}

// A rate at which the frames of generated steps are dense.
constexpr double kDenseFps = 120.0;

RawLibrary Completed(RawLibrary library, double grid_fps = LibraryBuilder().grid_fps) {
  const Completion completion = CompleteLibrary(library, grid_fps);
  EXPECT_EQ(completion.failure, "");
  EXPECT_GT(completion.example_count, 0);
  return library;
}

std::vector<const RawGroup*> CompletedGroups(const RawLibrary& library) {
  std::vector<const RawGroup*> groups;
  for (const RawGroup& group : library.groups) {
    if (group.is_completed) groups.push_back(&group);
  }
  return groups;
}

// Expects the checks of movement, but not those of the soles, which depend on the captures' ground.
void ExpectToWalk(const std::shared_ptr<const MotionLibrary>& library) {
  for (const CheckResult& check : CheckLibrary(library).checks) {
    if (check.name == "soles") continue;
    EXPECT_EQ(check.verdict, CheckVerdict::kPassed) << check.name << ": " << check.text;
  }
}

bool IsAlphanumeric(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

TEST(CompleteLibrary, SaysWhatTheCapturesLack) {
  RawLibrary library = WalkWithoutStop();
  const Completion completion = CompleteLibrary(library);
  EXPECT_THAT(completion.lacking, Contains("side steps"));
  EXPECT_THAT(completion.lacking, Contains("steps backward"));
  EXPECT_THAT(completion.lacking, Contains("turns on the spot"));
  const std::vector<std::string> sentences = DescribeCompletion(completion);
  ASSERT_GE(sentences.size(), 2u);
  EXPECT_THAT(sentences.front(), HasSubstr("The captures lack "));
  EXPECT_THAT(sentences.back(), HasSubstr("--no-complete"));
}

TEST(CompleteLibrary, AddsNothingToACompleteLibrary) {
  RawLibrary library = GenerateBuiltinLibrary();
  const std::size_t groups = library.groups.size();
  const Completion completion = CompleteLibrary(library);
  EXPECT_THAT(completion.lacking, testing::IsEmpty());
  EXPECT_EQ(completion.example_count, 0);
  EXPECT_EQ(library.groups.size(), groups);
}

TEST(CompleteLibrary, KeepsCapturedGroupsAndTheirStand) {
  const RawLibrary before = WalkWithoutStop();
  const RawLibrary after = Completed(before);
  ASSERT_GT(after.groups.size(), before.groups.size());
  for (std::size_t g = 0; g < before.groups.size(); ++g) {
    ASSERT_EQ(after.groups[g].examples.size(), before.groups[g].examples.size());
    EXPECT_FALSE(after.groups[g].is_completed);
    for (std::size_t e = 0; e < before.groups[g].examples.size(); ++e) {
      EXPECT_EQ(after.groups[g].examples[e].clip.rotations,
                before.groups[g].examples[e].clip.rotations);
      EXPECT_EQ(after.groups[g].examples[e].source, before.groups[g].examples[e].source);
    }
  }
  EXPECT_EQ(after.stand_pose.rotations, before.stand_pose.rotations);
  for (const RawGroup* group : CompletedGroups(after)) {
    for (const RawExample& example : group->examples) {
      EXPECT_TRUE(example.source.starts_with(kCompletedSource)) << example.source;
    }
  }
}

TEST(CompleteLibrary, StepsAreWellFormed) {
  const RawLibrary library = Completed(WalkWithoutStop());
  for (const RawGroup* group : CompletedGroups(library)) {
    const Foot moving = MovingFoot(group->kind);
    for (const RawExample& example : group->examples) {
      SCOPED_TRACE(example.source);
      EXPECT_TRUE(example.clip.Validate().has_value());
      EXPECT_TRUE(ValidateKeytimes(example.keytimes_s).has_value());
      ASSERT_EQ(std::ssize(example.frame_times_s), example.clip.frame_count());
      EXPECT_EQ(example.frame_times_s.front(), 0.0);
      EXPECT_EQ(example.frame_times_s.back(), example.keytimes_s.back());
      const DVec3 end =
          FootVector(library.skeleton, example.clip.frame(example.clip.frame_count() - 1), moving,
                     example.heading_change_rad);
      const auto l = static_cast<std::size_t>(
          std::ranges::find(group->parameters, ParameterName::kEndZ) - group->parameters.begin());
      EXPECT_NEAR(example.parameters[l], end.z, 1e-6);
      // The ball of the fixed foot stays in place.
      const DVec3 first(BallPosition(library.skeleton, example.clip.frame(0), OtherFoot(moving)));
      for (int f = 1; f < example.clip.frame_count(); ++f) {
        const DVec3 ball(BallPosition(library.skeleton, example.clip.frame(f), OtherFoot(moving)));
        ASSERT_LT(std::hypot(ball.x - first.x, ball.z - first.z), 2e-3) << "frame " << f;
      }
    }
  }
}

// From frame to frame, no joint rotates faster than 12 rad/s, as in motions of people.
TEST(CompleteLibrary, StepsAreSmooth) {
  const RawLibrary library = Completed(WalkWithoutStop(), kDenseFps);
  for (const RawGroup* group : CompletedGroups(library)) {
    for (const RawExample& example : group->examples) {
      const std::vector<double>& times_s = example.frame_times_s;
      for (int f = 1; f < example.clip.frame_count(); ++f) {
        const auto i = static_cast<std::size_t>(f);
        ASSERT_LT(LargestJointAngle(example.clip.frame(f - 1), example.clip.frame(f)),
                  12.0 * (times_s[i] - times_s[i - 1]))
            << example.source << ", frame " << f;
      }
    }
  }
}

// LibraryBuilder stores the frames of generated steps without interpolation.
TEST(CompleteLibrary, FramesAreGridPoints) {
  const RawLibrary raw = Completed(WalkWithoutStop());
  const auto library = LibraryBuilder::Selecting().Build(raw).value();
  const GridLayout& layout = library->layout();
  for (std::size_t g = 0; g < raw.groups.size(); ++g) {
    if (!raw.groups[g].is_completed) continue;
    const MotionGroup& group = library->groups()[g];
    for (int e = 0; e < group.example_count; ++e) {
      const Clip& clip = raw.groups[g].examples[static_cast<std::size_t>(e)].clip;
      ASSERT_EQ(group.grid_point_count, clip.frame_count());
      for (int p = 0; p < group.grid_point_count; ++p) {
        const auto row = static_cast<std::size_t>(p * group.row_count() + e);
        const auto floats = static_cast<std::size_t>(layout.row_floats);
        const Vec3 stored(layout.RootOf(&group.grid[row * floats]).position_m);
        ASSERT_EQ(stored, clip.frame(p).root_position_m);
      }
    }
  }
}

// Smoothing the mean stride keeps the pelvis moving evenly, although the points of the stride are
// not evenly spaced in time.
TEST(MeasureStride, KeepsTheSpeedOfThePelvisEven) {
  STRIDEWIRE_SKIP_WITHOUT_TAKES({"16"});
  const RawLibrary library = AssembleTakes(TakesOf({"16"}), {.mirror = true});
  for (const Foot moving : {Foot::kLeft, Foot::kRight}) {
    const auto stride = complete::MeasureStride(library, moving);
    ASSERT_TRUE(stride.has_value());
    const auto speed = [&](std::size_t point) {
      const double length_m = stride->points[point + 1].root_m.z - stride->points[point].root_m.z;
      return length_m / (complete::TimeAtPoint(stride->keytimes_s, point + 1) -
                         complete::TimeAtPoint(stride->keytimes_s, point));
    };
    for (std::size_t point = 0; point + 2 < stride->points.size(); ++point) {
      EXPECT_NEAR(speed(point), speed(point + 1), 0.1) << "point " << point;
    }
  }
}

// Strides of an even walk whose double support takes 0.03 s. At the end of a stride, the root is
// 5 cm further ahead than at the start of the next one. The difference must not be distributed over
// the double support alone.
TEST(JoinStrides, DistributesDifferencesOverTimeRatherThanOverPoints) {
  constexpr double kSpeedMPerS = 1.2;
  constexpr double kDifferenceM = 0.05;
  std::array<complete::StrideModel, 2> strides;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    complete::StrideModel& stride = strides[static_cast<std::size_t>(foot)];
    stride.keytimes_s = {0.0, 0.03, 0.47, 0.5};
    for (std::size_t p = 0; p < complete::kPointCount; ++p) {
      complete::PostureSample& point = stride.points.emplace_back();
      const double time_s = complete::TimeAtPoint(stride.keytimes_s, p);
      point.root_m = DVec3(0.0, 0.9, (kSpeedMPerS + kDifferenceM / 0.5) * time_s);
      point.rotations.assign(1, DQuat(1.0, 0.0, 0.0, 0.0));
      point.ankles.fill(DQuat(1.0, 0.0, 0.0, 0.0));
      point.balls_m[static_cast<std::size_t>(foot)].z = kSpeedMPerS * (2.0 * time_s - 0.5);
    }
  }
  complete::JoinStrides(strides);
  for (const complete::StrideModel& stride : strides) {
    for (std::size_t p = 1; p < complete::kPointCount; ++p) {
      const double way_m = stride.points[p].root_m.z - stride.points[p - 1].root_m.z;
      const double passed_s = complete::TimeAtPoint(stride.keytimes_s, p) -
                              complete::TimeAtPoint(stride.keytimes_s, p - 1);
      EXPECT_NEAR(way_m / passed_s, kSpeedMPerS, 0.35) << "point " << p;
    }
  }
}

TEST(CompleteLibrary, StopsEndInTheStandPose) {
  const RawLibrary library = Completed(WalkWithoutStop());
  int stops = 0;
  for (const RawGroup* group : CompletedGroups(library)) {
    if (group->parameters.size() != 2) continue;
    const DVec3 stand =
        FootVector(library.skeleton, library.stand_pose, MovingFoot(group->kind), 0.0);
    for (const RawExample& example : group->examples) {
      if (std::fabs(example.parameters[1] - stand.z) > 0.01) continue;
      ++stops;
      const ConstPoseSpan end = example.clip.frame(example.clip.frame_count() - 1);
      EXPECT_LT(LargestJointAngle(end, library.stand_pose), 0.02) << example.source;
      EXPECT_NEAR(end.root_position_m.y, library.stand_pose.root_position_m.y, 2e-3)
          << example.source;
    }
  }
  EXPECT_GE(stops, 8);
}

// A stride of one foot ends in the pose in which a stride of the other foot starts.
TEST(CompleteLibrary, StridesContinueEachOther) {
  const RawLibrary library = Completed(WalkWithoutStop(), kDenseFps);
  // Returns the longest step of a foot, among straight steps.
  const auto longest = [&](Foot foot) {
    const RawExample* best = nullptr;
    for (const RawGroup* group : CompletedGroups(library)) {
      if (group->kind != StepKind(foot) || group->parameters.size() != 2) continue;
      for (const RawExample& example : group->examples) {
        const double length_m = example.parameters[1] - example.parameters[0];
        if (best == nullptr || length_m > best->parameters[1] - best->parameters[0]) {
          best = &example;
        }
      }
    }
    return best;
  };
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const RawExample* before = longest(foot);
    const RawExample* after = longest(OtherFoot(foot));
    ASSERT_TRUE(before != nullptr && after != nullptr);
    const ConstPoseSpan end = before->clip.frame(before->clip.frame_count() - 1);
    const ConstPoseSpan start = after->clip.frame(0);
    EXPECT_LT(LargestJointAngle(end, start), 0.06);
    EXPECT_NEAR(end.root_position_m.y, start.root_position_m.y, 0.01);
    const Vec3 end_step =
        end.root_position_m - before->clip.frame(before->clip.frame_count() - 2).root_position_m;
    const double end_step_s = before->frame_times_s.back() - before->frame_times_s.rbegin()[1];
    const Vec3 start_step = after->clip.frame(1).root_position_m - start.root_position_m;
    EXPECT_NEAR(end_step.z / end_step_s, start_step.z / after->frame_times_s[1], 0.2);
  }
}

// The height of the hips changes with the square of the distance between the feet. If it changed in
// proportion, the knees would be bent in short steps.
TEST(CompleteLibrary, ShortStepsKeepTheHeightOfTheHips) {
  const RawLibrary library = Completed(WalkWithoutStop());
  const RawGroup& straight = *CompletedGroups(library).front();
  ASSERT_EQ(straight.parameters[0], ParameterName::kStartZ);
  const auto fall_m = [&](const RawExample& example) {
    return library.stand_pose.root_position_m.y - example.clip.frame(0).root_position_m.y;
  };
  const auto start_m = [](const RawExample& example) { return -example.parameters[0]; };
  const RawExample& longest = *std::ranges::max_element(straight.examples, {}, start_m);
  ASSERT_GT(std::fabs(fall_m(longest)), 0.01f);
  int short_steps = 0;
  for (const RawExample& example : straight.examples) {
    const double part = start_m(example) / start_m(longest);
    if (part < 0.4 || part > 0.55) continue;
    EXPECT_LT(fall_m(example) / fall_m(longest), 0.4f) << example.source;
    ++short_steps;
  }
  EXPECT_GT(short_steps, 0);
}

// People take fewer steps per minute if the steps are shorter.
TEST(CompleteLibrary, ShortStridesTakeLonger) {
  const RawLibrary library = Completed(WalkWithoutStop());
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    // Strides as long at the end as at the start, from length to duration.
    std::map<double, double> duration_s;
    for (const RawGroup* group : CompletedGroups(library)) {
      if (group->kind != StepKind(foot) || group->parameters.size() != 2) continue;
      for (const RawExample& example : group->examples) {
        const double start_m = -example.parameters[0];
        const double end_m = example.parameters[1];
        if (end_m < 0.2 || std::fabs(end_m - start_m) > 0.05) continue;
        duration_s[end_m] = example.keytimes_s.back();
      }
    }
    ASSERT_EQ(duration_s.size(), 2u);
    const auto [half_m, half_s] = *duration_s.begin();
    const auto [full_m, full_s] = *duration_s.rbegin();
    EXPECT_NEAR(half_m, 0.5 * full_m, 0.05);
    EXPECT_GT(half_s, 1.05 * full_s);
    EXPECT_LT(half_s, 1.3 * full_s);
  }
}

// The same steps result from captures whose joints have other frames.
TEST(CompleteLibrary, DoesNotDependOnTheAxesOfJoints) {
  const RawLibrary raw = WalkWithoutStop();
  const JointFrames frames = RandomFrames(raw.skeleton, 5);
  const RawLibrary completed = Completed(raw);
  const RawLibrary reframed = Completed(Reframed(raw, frames));
  ASSERT_EQ(completed.groups.size(), reframed.groups.size());
  std::vector<Vec3> positions[2];
  std::vector<Quat> rotations(raw.skeleton.joints.size());
  for (auto& p : positions) p.resize(raw.skeleton.joints.size());
  for (std::size_t g = 0; g < completed.groups.size(); ++g) {
    ASSERT_EQ(completed.groups[g].examples.size(), reframed.groups[g].examples.size());
    for (std::size_t e = 0; e < completed.groups[g].examples.size(); ++e) {
      const Clip& one = completed.groups[g].examples[e].clip;
      const Clip& other = reframed.groups[g].examples[e].clip;
      ASSERT_EQ(one.frame_count(), other.frame_count());
      for (int f = 0; f < one.frame_count(); f += 3) {
        ForwardKinematics(completed.skeleton, one.frame(f), positions[0], rotations);
        ForwardKinematics(reframed.skeleton, other.frame(f), positions[1], rotations);
        for (std::size_t j = 0; j < positions[0].size(); ++j) {
          ASSERT_LT(glm::length(positions[0][j] - positions[1][j]), 1e-4f)
              << completed.groups[g].examples[e].source << ", frame " << f << ", joint " << j;
        }
      }
    }
  }
}

TEST(CompleteLibrary, ComposesAStandIfNoneIsCaptured) {
  RawLibrary library = WalkWithoutStop();
  // The first stride starts with one foot ahead.
  const ConstPoseSpan stride = library.groups.front().examples[1].clip.frame(0);
  ASSERT_GT(std::fabs(FootVector(library.skeleton, stride, Foot::kLeft, 0.0).z), 0.3);
  library.stand_pose.root_position_m = stride.root_position_m;
  library.stand_pose.rotations.assign(stride.rotations.begin(), stride.rotations.end());
  const Completion completion = CompleteLibrary(library);
  EXPECT_TRUE(completion.has_composed_stand);
  const DVec3 feet = FootVector(library.skeleton, library.stand_pose, Foot::kLeft, 0.0);
  EXPECT_NEAR(feet.z, 0.0, 0.02);
  EXPECT_NEAR(feet.y, 0.0, 0.02);
  EXPECT_GT(feet.x, 0.1);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    EXPECT_NEAR(BallPosition(library.skeleton, library.stand_pose, foot).y, kWalkerBallHeightM,
                0.02);
  }
}

TEST(CompleteLibrary, ComposesAStandIfTheFeetAreTilted) {
  RawLibrary flat = WalkWithoutStop();
  ASSERT_LT(flat.stand_tilt_m, 0.005);
  RawLibrary tilted = flat;
  EXPECT_FALSE(CompleteLibrary(flat).has_composed_stand);
  tilted.stand_tilt_m = 0.03;
  const Completion completion = CompleteLibrary(tilted);
  EXPECT_TRUE(completion.has_composed_stand);
  EXPECT_THAT(completion.stand_reason, HasSubstr("heels or toes"));
  EXPECT_EQ(tilted.stand_tilt_m, 0.0);
}

TEST(CompleteLibrary, LibrariesOfOneWalkOrJumpCanWalk) {
  ExpectToWalk(LibraryBuilder::Selecting().Build(Completed(WalkWithoutStop())).value());
  LibraryAssembler jumps;
  jumps.Add(SyntheticWalker{}.Jump(0.8));
  ExpectToWalk(LibraryBuilder::Selecting().Build(Completed(jumps.Assemble().value())).value());
}

TEST(CompleteLibrary, BuilderStoresAllGeneratedSteps) {
  const RawLibrary raw = Completed(WalkWithoutStop());
  const auto library = LibraryBuilder::Selecting().Build(raw).value();
  ASSERT_EQ(library->groups().size(), raw.groups.size());
  for (std::size_t g = 0; g < raw.groups.size(); ++g) {
    EXPECT_EQ(library->groups()[g].is_completed, raw.groups[g].is_completed);
    if (!raw.groups[g].is_completed) continue;
    EXPECT_EQ(library->groups()[g].example_count, static_cast<int>(raw.groups[g].examples.size()));
  }
}

TEST(CompleteLibrary, CapturedStepsArePreferred) {
  const auto library = LibraryBuilder::Selecting().Build(Completed(WalkWithoutStop())).value();
  const MotionGroup& captured = library->groups().front();
  ASSERT_FALSE(captured.is_completed);
  const auto site = captured.site(0);
  const Foot moving = MovingFoot(captured.kind);
  FootState feet;
  const double outward = moving == Foot::kLeft ? 1.0 : -1.0;
  feet.left_from_right_m = DVec3(0.2, 0.0, outward * site[0]);
  const auto plan =
      PlanStep(*library, {.foot = moving, .length_m = site[1]}, feet, OtherFoot(moving), false);
  ASSERT_TRUE(plan.has_value());
  EXPECT_EQ(plan->group, 0);
  feet.left_from_right_m = DVec3(0.2, 0.0, 0.0);
  const auto back =
      PlanStep(*library, {.foot = moving, .length_m = -0.3}, feet, OtherFoot(moving), true);
  ASSERT_TRUE(back.has_value());
  EXPECT_TRUE(library->group(back->group).is_completed);
  EXPECT_FALSE(back->clamped);
}

class CompleteCaptures : public testing::TestWithParam<const char*> {};

// Each take alone, without mirror images, is the hardest case.
TEST_P(CompleteCaptures, EveryTakePassesTheSelfCheck) {
  const std::vector<std::string> subjects = {GetParam()};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  for (const std::filesystem::path& take : TakesOf(subjects)) {
    SCOPED_TRACE(take.string());
    const auto library =
        LibraryBuilder::Selecting().Build(Completed(AssembleTakes({take}, {}))).value();
    for (const CheckResult& check : CheckLibrary(library).checks) {
      EXPECT_EQ(check.verdict, CheckVerdict::kPassed) << check.name << ": " << check.text;
    }
  }
}

// ChooseCells does not measure the stored error of generated steps.
TEST_P(CompleteCaptures, GeneratedStepsAreStoredAccurately) {
  const std::vector<std::string> subjects = {GetParam()};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  const RawLibrary library =
      Completed(AssembleTakes(TakesOf(subjects), {.mirror = true}), kDenseFps);
  const GridLayout layout(library.skeleton.joint_count());
  const Quat& stand_root = library.stand_pose.rotations[0];
  const double fps = LibraryBuilder{}.grid_fps;
  for (const RawGroup* group : CompletedGroups(library)) {
    RawGroup measured = *group;
    measured.is_completed = false;
    EXPECT_EQ(ChooseCells(*group, fps, layout, stand_root),
              ChooseCells(measured, fps, layout, stand_root))
        << group->examples.front().source;
  }
}

// Subject 08 takes long strides, 17 sneaks, and 135 kicks.
INSTANTIATE_TEST_SUITE_P(Subjects, CompleteCaptures,
                         testing::Values(kDebianTakes, "05", "06", "09", "29", "32", "gaits/08",
                                         "gaits/17", "gaits/135"),
                         [](const auto& param) {
                           std::string name = param.param;
                           std::erase_if(name, [](char c) { return !IsAlphanumeric(c); });
                           return name;
                         });

}  // namespace
}  // namespace stridewire
