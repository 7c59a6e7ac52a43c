// Standing avatars settle into the stand pose and idle: they breathe, sway and shift their weight
// without moving their feet.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "captured_library.h"
#include "counted_memory.h"
#include "instruction_sets.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/locomotion_profile.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
constexpr double kTickS = 1.0 / 60.0;
constexpr double kRadPerDegree = 0.017453292519943295;

std::string BytesOf(ConstPoseSpan pose) {
  std::string bytes(reinterpret_cast<const char*>(&pose.root_position_m), sizeof(Vec3));
  bytes.append(reinterpret_cast<const char*>(pose.rotations.data()), pose.rotations.size_bytes());
  return bytes;
}

Pose Copy(ConstPoseSpan pose) {
  Pose copy(static_cast<int>(pose.rotations.size()));
  copy.root_position_m = pose.root_position_m;
  std::ranges::copy(pose.rotations, copy.rotations.begin());
  return copy;
}

void AdvanceFor(AvatarSimulation& avatar, double seconds) {
  for (int tick = 0; tick * kTickS < seconds; ++tick) avatar.Advance(kTickS);
}

void AdvanceUntilIdle(AvatarSimulation& avatar) {
  for (int tick = 0; tick < 6000; ++tick) {
    avatar.Advance(kTickS);
    if (avatar.idle()) return;
  }
  FAIL() << "the avatar does not come to rest";
}

// Returns the mean distance between the joints of two poses, each relative to its root.
double MeanDistance(const Skeleton& skeleton, ConstPoseSpan a, double heading_a, ConstPoseSpan b) {
  std::vector<Vec3> of_a(skeleton.joints.size());
  std::vector<Vec3> of_b(skeleton.joints.size());
  std::vector<Quat> rotations(skeleton.joints.size());
  ForwardKinematics(skeleton, a, of_a, rotations);
  ForwardKinematics(skeleton, b, of_b, rotations);
  double sum_m = 0.0;
  for (std::size_t j = 0; j < of_a.size(); ++j) {
    const DVec3 at = RotateYaw(-heading_a, DVec3(of_a[j] - of_a[0]));
    sum_m += glm::length(at - DVec3(of_b[j] - of_b[0]));
  }
  return sum_m / static_cast<double>(of_a.size());
}

struct Manner {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
};
void PrintTo(const Manner& manner, std::ostream* out) { *out << manner.name; }

class IdleMotion : public testing::TestWithParam<Manner> {
 protected:
  void SetUp() override {
    STRIDEWIRE_SKIP_WITHOUT_TAKES(GetParam().subjects);
    library_ = LibraryOf(GetParam().subjects);
  }
  [[nodiscard]] AvatarSimulation Make(const AvatarOptions& options = {}) const {
    return {library_, {DVec3(200.0, 0.0, -300.0), 2.0}, options};
  }
  void Walk(AvatarSimulation& avatar, int steps = 3) const {
    const double length_m = std::min(0.55, library_->locomotion_profile().longest_m);
    for (int step = 0; step < steps; ++step) {
      ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = length_m}}));
    }
  }
  Library library_;
};

TEST_P(IdleMotion, MovesTheBodyAndNotTheFeet) {
  AvatarSimulation avatar = Make();
  Walk(avatar);
  AdvanceUntilIdle(avatar);
  AdvanceFor(avatar, 0.6);  // Heels come down while the avatar settles.
  const Skeleton& skeleton = library_->skeleton();
  std::array<Vec3, 2> stand_m;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    stand_m[static_cast<std::size_t>(foot)] = BallPosition(skeleton, avatar.pose(), foot);
  }
  Pose before = Copy(avatar.pose());
  double farthest_m = 0.0;
  double fastest_rad = 0.0;
  double farthest_root_m = 0.0;
  int distinct = 0;
  constexpr int kTicks = 60 * 100;  // More than two loops.
  const Vec3 root_m = avatar.pose().root_position_m;
  for (int tick = 0; tick < kTicks; ++tick) {
    avatar.Advance(kTickS);
    ASSERT_TRUE(avatar.idle());
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const Vec3 away =
          BallPosition(skeleton, avatar.pose(), foot) - stand_m[static_cast<std::size_t>(foot)];
      farthest_m = std::max(farthest_m, static_cast<double>(glm::length(away)));
    }
    const double step_rad = LargestJointAngle(before, avatar.pose());
    fastest_rad = std::max(fastest_rad, step_rad);
    farthest_root_m = std::max(
        farthest_root_m, static_cast<double>(glm::length(avatar.pose().root_position_m - root_m)));
    distinct += BytesOf(before) != BytesOf(avatar.pose());
    before = Copy(avatar.pose());
  }
  std::printf("%s: balls within %.3g mm, root within %.3g mm, joints at most %.3g degrees a tick\n",
              GetParam().name, 1e3 * farthest_m, 1e3 * farthest_root_m,
              fastest_rad / kRadPerDegree);
  // Far from the origin a float resolves 0.03 mm.
  EXPECT_LT(farthest_m, 1.5e-4);
  EXPECT_GT(farthest_root_m, 0.005);
  EXPECT_LT(farthest_root_m, 0.06);
  EXPECT_LT(fastest_rad, 0.5 * kRadPerDegree);
  EXPECT_GT(distinct, kTicks * 9 / 10);
}

TEST_P(IdleMotion, SettlesIntoTheStandPose) {
  for (int steps = 1; steps <= 4; ++steps) {
    AvatarSimulation avatar = Make();
    Walk(avatar, steps);
    AdvanceUntilIdle(avatar);
    AdvanceFor(avatar, 0.4);
    EXPECT_LT(MeanDistance(library_->skeleton(), avatar.pose(), avatar.base().heading_rad,
                           library_->stand_pose()),
              0.05)
        << steps << " steps";
  }
}

// Neither the start nor the end of the motion is visible as a jump. Movements themselves may begin
// abruptly, so their largest step without idle motion is the limit.
TEST_P(IdleMotion, StartsAndEndsSmoothly) {
  const auto largest_step_degrees = [&](bool idle_motion) {
    double largest_rad = 0.0;
    for (int round = 0; round < 12; ++round) {
      AvatarSimulation avatar =
          Make({.idle_motion = idle_motion, .seed = static_cast<std::uint64_t>(round)});
      AdvanceFor(avatar, 0.25 * round);
      for (int walk = 0; walk < 3; ++walk) {
        Walk(avatar, 1 + round % 3);
        Pose before = Copy(avatar.pose());
        for (int tick = 0; tick < 60 || !avatar.idle(); ++tick) {
          avatar.Advance(kTickS);
          largest_rad = std::max(largest_rad, LargestJointAngle(before, avatar.pose()));
          before = Copy(avatar.pose());
        }
        AdvanceFor(avatar, 0.1 * round);
      }
    }
    return largest_rad / kRadPerDegree;
  };
  const double still_degrees = largest_step_degrees(false);
  const double idling_degrees = largest_step_degrees(true);
  std::printf("%s: joints turn by at most %.3g degrees per tick, without idle motion by %.3g\n",
              GetParam().name, idling_degrees, still_degrees);
  EXPECT_LT(idling_degrees, 1.1 * still_degrees + 0.5);
}

TEST_P(IdleMotion, StandsStillIfDisabled) {
  AvatarSimulation avatar = Make({.idle_motion = false});
  Walk(avatar);
  AdvanceUntilIdle(avatar);
  EXPECT_EQ(avatar.displayed_movement(), nullptr);
  const std::string bytes = BytesOf(avatar.pose());
  for (int tick = 0; tick < 600; ++tick) {
    avatar.Advance(kTickS);
    ASSERT_EQ(BytesOf(avatar.pose()), bytes);
  }
}

// The motion does not change where the avatar walks, and requests start as early as without it.
TEST_P(IdleMotion, DoesNotChangeMovements) {
  AvatarSimulation idling = Make();
  AvatarSimulation still = Make({.idle_motion = false});
  for (int walk = 0; walk < 3; ++walk) {
    for (AvatarSimulation* avatar : {&idling, &still}) {
      AdvanceFor(*avatar, 2.0);
      Walk(*avatar);
      AdvanceUntilIdle(*avatar);
    }
    EXPECT_NEAR(idling.time_s(), still.time_s(), 1e-9);
    const DVec3 apart = idling.base().position_m - still.base().position_m;
    EXPECT_LT(glm::length(apart), 0.02) << walk;
    for (std::size_t f = 0; f < 2; ++f) {
      const DVec3 between =
          idling.body().locks[f].print.position_m - still.body().locks[f].print.position_m;
      EXPECT_LT(glm::length(between), 1e-3) << walk;
    }
  }
}

TEST_P(IdleMotion, HasTheSameBytesOnEveryInstructionSet) {
  std::vector<std::string> first;
  for (const std::int64_t set : InstructionSets()) {
    const OnlyInstructionSet only(set);
    AvatarSimulation avatar = Make({.seed = 5});
    Walk(avatar);
    std::vector<std::string> ticks;
    for (int tick = 0; tick < 900; ++tick) {
      avatar.Advance(kTickS);
      ticks.push_back(BytesOf(avatar.pose()));
    }
    if (first.empty()) first = ticks;
    EXPECT_TRUE(ticks == first) << hwy::TargetName(set);
  }
}

INSTANTIATE_TEST_SUITE_P(Libraries, IdleMotion,
                         testing::Values(Manner{"Builtin", {}}, Manner{"Subject01", {kDebianTakes}},
                                         Manner{"Subject16", {"16"}}),
                         [](const auto& tested) { return tested.param.name; });

class BuiltinIdleMotion : public testing::Test {
 protected:
  Library library_ = LibraryOf({});
};

TEST_F(BuiltinIdleMotion, DiffersBySeedAndByNothingElse) {
  const auto bytes_of = [&](std::uint64_t seed, double tick_s) {
    AvatarSimulation avatar(library_, {}, {.seed = seed});
    for (int tick = 0; tick < 4.0 / tick_s; ++tick) avatar.Advance(tick_s);
    return BytesOf(avatar.pose());
  };
  EXPECT_EQ(bytes_of(3, kTickS), bytes_of(3, kTickS));
  EXPECT_EQ(bytes_of(3, 0.25), bytes_of(3, 0.5));
  EXPECT_NE(bytes_of(3, kTickS), bytes_of(4, kTickS));
}

// A requested stand is an ordinary stand.
TEST_F(BuiltinIdleMotion, ContinuesDuringRequestedStands) {
  AvatarSimulation avatar(library_, {}, {});
  AvatarSimulation undisturbed(library_, {}, {});
  for (int tick = 0; tick < 600; ++tick) {
    if (tick % 100 == 10) {
      ASSERT_TRUE(avatar.Enqueue({1, StandRequest{.seconds = 0.5}}));
    }
    avatar.Advance(kTickS);
    undisturbed.Advance(kTickS);
    ASSERT_EQ(BytesOf(avatar.pose()), BytesOf(undisturbed.pose())) << tick;
  }
}

// A rejected step leaves the loop where it was.
TEST_F(BuiltinIdleMotion, ContinuesAfterARejectedStep) {
  AvatarSimulation avatar(library_, {}, {});
  AvatarSimulation undisturbed(library_, {}, {});
  AdvanceFor(avatar, 5.0);
  AdvanceFor(undisturbed, 5.0);
  ASSERT_TRUE(avatar.Enqueue(
      {1, StepRequest{.at = FootprintRequest{DVec3(9.0, 0.0, 9.0), 0.0}, .exact_only = true}}));
  Pose before = Copy(avatar.pose());
  for (int tick = 0; tick < 300; ++tick) {
    avatar.Advance(kTickS);
    undisturbed.Advance(kTickS);
    EXPECT_LT(LargestJointAngle(before, avatar.pose()), 0.3 * kRadPerDegree) << tick;
    before = Copy(avatar.pose());
  }
  EXPECT_TRUE(avatar.idle());
  EXPECT_LT(LargestJointAngle(avatar.pose(), undisturbed.pose()), 0.1 * kRadPerDegree);
}

TEST_F(BuiltinIdleMotion, NeedsPlantedFeet) {
  AvatarSimulation avatar(library_, {}, {.foot_planting = false});
  AdvanceFor(avatar, 1.0);
  EXPECT_EQ(avatar.displayed_movement(), nullptr);
}

// Idle ticks cost as little as those of a walk: no events, changes or memory.
TEST_F(BuiltinIdleMotion, IsFreeOfEventsAndAllocations) {
  AvatarSimulation avatar(library_, {}, {});
  AdvanceFor(avatar, 1.0);
  int changes = 0;
  const std::size_t before = counted_memory::LiveBytes();
  counted_memory::ResetPeak();
  for (int tick = 0; tick < 60 * 90; ++tick) {
    avatar.Advance(kTickS);
    ASSERT_TRUE(avatar.events().empty());
    changes += !avatar.is_event_free();
  }
  EXPECT_LE(counted_memory::PeakBytes(), before);
  EXPECT_LE(changes, 6);  // The loop begins again up to three times.
}

// A stand between two treads keeps each foot on its tread.
TEST_F(BuiltinIdleMotion, StandsOnStairs) {
  AvatarSimulation avatar(library_, {}, {});
  AdvanceFor(avatar, 1.0);
  ASSERT_TRUE(
      avatar.Enqueue({1, StepRequest{.foot = Foot::kLeft, .length_m = 0.0, .height_m = 0.17}}));
  AdvanceUntilIdle(avatar);
  AdvanceFor(avatar, 0.6);
  const auto balls = [&] {
    return std::array{BallPosition(library_->skeleton(), avatar.pose(), Foot::kLeft),
                      BallPosition(library_->skeleton(), avatar.pose(), Foot::kRight)};
  };
  const std::array<Vec3, 2> stand_m = balls();
  double farthest_m = 0.0;
  for (int tick = 0; tick < 600; ++tick) {
    avatar.Advance(kTickS);
    const std::array<Vec3, 2> now_m = balls();
    for (std::size_t f = 0; f < 2; ++f) {
      farthest_m = std::max(farthest_m, static_cast<double>(glm::length(now_m[f] - stand_m[f])));
    }
  }
  EXPECT_LT(farthest_m, 1e-4);
  for (std::size_t f = 0; f < 2; ++f) {
    EXPECT_NEAR(stand_m[f].y - library_->leg_rig().sides[f].ball_height_m,
                avatar.body().locks[f].print.position_m.y, 1e-3);
  }
}

// Between two points of its grid the motion keeps the feet as still as at the points.
TEST_F(BuiltinIdleMotion, GridIsFineEnough) {
  const MotionGroup& group = library_->group(library_->idle_group());
  const GridLayout& layout = library_->layout();
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  ASSERT_EQ(group.grid.size(), static_cast<std::size_t>(group.grid_point_count) * row_floats);
  Pose pose(library_->skeleton().joint_count());
  Pose next = pose;
  const auto get = [&](int point, Pose& to) {
    const float* row = &group.grid[static_cast<std::size_t>(point) * row_floats];
    to.root_position_m = Vec3(layout.RootOf(row).position_m);
    for (std::size_t j = 0; j < to.rotations.size(); ++j) {
      to.rotations[j] = GridLayout::RotationOf(row, j);
    }
  };
  get(0, pose);
  const Vec3 stand_m = BallPosition(library_->skeleton(), pose, Foot::kLeft);
  for (int point = 1; point < group.grid_point_count; ++point) {
    get(point, next);
    const Vec3 ball_m = BallPosition(library_->skeleton(), next, Foot::kLeft);
    EXPECT_LT(glm::length(ball_m - stand_m), 1e-5f) << point;
    // Rotations of successive rows are in one hemisphere, or blends would turn the long way round.
    for (std::size_t j = 0; j < pose.rotations.size(); ++j) {
      EXPECT_GT(Dot(pose.rotations[j], next.rotations[j]), 0.99f) << point;
    }
    std::swap(pose, next);
  }
}

}  // namespace
}  // namespace stridewire
