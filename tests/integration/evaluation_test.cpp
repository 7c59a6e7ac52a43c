// Compares the fast evaluation with the reference evaluation, on every instruction set of this
// machine.

#include <gtest/gtest.h>
#include <xxhash.h>

#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "base/trig.h"
#include "captured_library.h"
#include "instruction_sets.h"
#include "random.h"
#include "random_requests.h"
#include "reference_evaluation.h"
#include "rough_ground.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/plan/foot_sampler.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/evaluation_batcher.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/pose/pose_kernels.h"
#include "runtime/skeleton/leg_rig.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/protocol/limits.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;

struct Source {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
};
void PrintTo(const Source& source, std::ostream* out) { *out << source.name; }

void AppendBytes(const AvatarSimulation& avatar, std::string& bytes) {
  const ConstPoseSpan pose = avatar.pose();
  bytes.append(reinterpret_cast<const char*>(&pose.root_position_m), sizeof(Vec3));
  bytes.append(reinterpret_cast<const char*>(pose.rotations.data()), pose.rotations.size_bytes());
}

TEST(Evaluation, SimdSinesMatchScalarSines) {
  Random random(20261122);
  for (const std::int64_t set : InstructionSets()) {
    const OnlyInstructionSet only(set);
    for (int round = 0; round < 2000; ++round) {
      std::array<double, 21> angles{};
      for (double& angle : angles) {
        const double range = round % 3 == 0 ? 1e5 : round % 3 == 1 ? 10.0 : 1e-3;
        angle = random.Draw(-range, range);
      }
      angles[0] = 0.0;
      const auto count = static_cast<std::size_t>(1 + round % 21);
      std::array<double, 21> sines{};
      std::array<double, 21> cosines{};
      kernels::SinCos(angles.data(), count, sines.data(), cosines.data());
      for (std::size_t i = 0; i < count; ++i) {
        ASSERT_EQ(sines[i], Sin(angles[i])) << angles[i] << " on " << hwy::TargetName(set);
        ASSERT_EQ(cosines[i], Cos(angles[i])) << angles[i] << " on " << hwy::TargetName(set);
      }
    }
  }
}

Quat DrawRotation(Random& random, double largest_rad) {
  DVec3 axis;
  do {
    axis = {random.Draw(-1.0, 1.0), random.Draw(-1.0, 1.0), random.Draw(-1.0, 1.0)};
  } while (glm::length(axis) < 0.1);
  const double half = 0.5 * random.Draw(0.0, largest_rad);
  const DVec3 xyz = glm::normalize(axis) * std::sin(half);
  return Quat(DQuat(std::cos(half), xyz.x, xyz.y, xyz.z));
}

double AngleBetween(const DQuat& a, const DQuat& b) {
  const DQuat turn = glm::conjugate(a) * b;
  return 2.0 * std::atan2(glm::length(DVec3(turn.x, turn.y, turn.z)), std::fabs(turn.w));
}

// FootSampler must return the feet of poses that are evaluated one by one.
TEST(Evaluation, FootSamplerMatchesSinglePoses) {
  constexpr unsigned kSeed = 20261126;
  const Library library = OpenLibrary("builtin").value();
  const LegRig& rig = library->leg_rig();
  Random random(kSeed);
  Pose pose(library->skeleton().joint_count());
  Pose scratch = pose;
  FootPlanScratch plan_scratch(*library);
  int sampled = 0;
  for (int walk = 0; walk < 40; ++walk) {
    AvatarSimulation avatar(library,
                            {DVec3(random.Draw(-900.0, 900.0), 0.0, random.Draw(-900.0, 900.0)),
                             random.Draw(-4.0, 4.0)});
    for (int step = 0; step < 6; ++step) {
      const bool jumps = random.Draw(0.0, 1.0) < 0.2;
      MovementRequest request;
      if (jumps) {
        request.movement = JumpRequest{.length_m = random.Draw(0.3, 1.5)};
      } else {
        request.movement =
            StepRequest{.length_m = random.Draw(0.0, 0.7), .turn_rad = random.Draw(-0.5, 0.5)};
      }
      ASSERT_TRUE(avatar.Enqueue(request));
    }
    for (int look = 0; look < 12; ++look) {
      const auto ticks = static_cast<int>(random.Draw(1.0, 12.0));
      for (int tick = 0; tick < ticks; ++tick) avatar.Advance(1.0 / 60.0);
      if (avatar.movement() == nullptr) continue;
      Movement movement = *avatar.movement();
      // If all weights are 0, rotations have no mean.
      if (look % 6 == 5) movement.weights.assign(movement.weights.size(), 0.0f);
      std::vector<double> times_s(static_cast<std::size_t>(random.Draw(1.0, 16.99)));
      for (double& time_s : times_s) {
        time_s = random.Draw(0.0, random.Draw(0.0, 1.0) < 0.5 ? 0.3 : movement.duration_s() + 0.01);
      }
      const auto eased =
          static_cast<std::size_t>(random.Draw(0.0, static_cast<double>(times_s.size()) + 0.99));
      for (const std::int64_t set : InstructionSets()) {
        const OnlyInstructionSet only(set);
        SCOPED_TRACE(::testing::Message() << "seed " << kSeed << ", walk " << walk << ", look "
                                          << look << ", " << hwy::TargetName(set));
        plan_scratch.cache().Clear();
        FootSampler sampler(plan_scratch, scratch);
        sampler.SetDifference(movement);
        sampler.Sample(movement, times_s, eased);
        GridCache own(library->layout());
        for (std::size_t i = 0; i < times_s.size(); ++i) {
          (i < eased ? EvaluateMovement : EvaluateBlend)(
              library->group(movement.group), library->layout(), movement, times_s[i], own, pose);
          for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
            LegPose leg;
            EvaluateLeg(library->skeleton(), rig, pose, foot, leg);
            const BlendedFoot expected = FootOf(rig, foot, DVec3(pose.root_position_m), leg);
            ASSERT_EQ(sampler.Ball(i, foot), expected.ball_m) << i;
            const BlendedFoot found = sampler.FootAt(i, foot);
            ASSERT_EQ(found.ball_m, expected.ball_m) << i;
            ASSERT_EQ(found.heading_rad, expected.heading_rad) << i;
            ASSERT_EQ(found.flatness, expected.flatness) << i;
          }
        }
      }
      ++sampled;
    }
  }
  EXPECT_GT(sampled, 300);
}

// Tests difference poses whose rotations are up to half a turn.
TEST(Evaluation, FadesDifferencesOfAnySize) {
  constexpr unsigned kSeed = 20261125;
  constexpr std::size_t kJoints = 37;
  Random random(kSeed);
  double worst_rad = 0.0;
  for (int round = 0; round < 2000; ++round) {
    std::vector<Quat> row(kJoints);
    std::vector<Quat> differences(kJoints);
    for (Quat& q : row) q = DrawRotation(random, 3.1) * static_cast<float>(random.Draw(0.2, 1.5));
    for (Quat& q : differences) {
      q = DrawRotation(random, round % 4 == 0 ? 3.14159 : 1.0);
      if (random.Draw(0.0, 1.0) < 0.5) q = -q;
    }
    const double fraction = round % 7 == 0 ? 1.0 : random.Draw(0.0, 1.0);
    std::vector<Quat> eased(kJoints);
    ASSERT_TRUE(kernels::BlendRotations({.row = &row[0].x,
                                         .joint_count = kJoints,
                                         .difference = &differences[0].x,
                                         .fraction = static_cast<float>(fraction),
                                         .velocity = nullptr,
                                         .seconds = 0.0f},
                                        &eased[0].x));
    for (std::size_t j = 0; j < kJoints; ++j) {
      DQuat difference = glm::normalize(DQuat(differences[j]));
      if (difference.w < 0.0) difference = -difference;
      const DVec3 xyz(difference.x, difference.y, difference.z);
      const double half = std::atan2(glm::length(xyz), difference.w);
      const DVec3 part =
          glm::length(xyz) > 0.0 ? glm::normalize(xyz) * std::sin(fraction * half) : DVec3(0.0);
      const DQuat expected =
          glm::normalize(DQuat(row[j])) * DQuat(std::cos(fraction * half), part.x, part.y, part.z);
      ASSERT_NEAR(Dot(eased[j], eased[j]), 1.0f, 1e-6f) << "seed " << kSeed;
      worst_rad = std::max(worst_rad, AngleBetween(expected, DQuat(eased[j])));
    }
  }
  std::printf("%.2g rad off at most\n", worst_rad);
  EXPECT_LT(worst_rad, 1e-6) << "seed " << kSeed;
}

// Sixteen rows side by side, all with an inertial difference pose.
struct Sixteen {
  static constexpr std::size_t kJoints = 5;
  static constexpr std::size_t kRowFloats = GridLayout(kJoints).row_floats;
  using Lanes = std::array<float, kernels::kBlock>;
  using DoubleLanes = std::array<double, kernels::kBlock>;

  explicit Sixteen(Random& random) {
    for (std::size_t i = 0; i < kernels::kBlock; ++i) {
      for (std::size_t j = 0; j < kJoints; ++j) {
        GridLayout::SetRotation(rows[i].data(), j, DrawRotation(random, 3.0));
        const Quat difference = DrawRotation(random, 3.1);
        for (std::size_t c = 0; c < 4; ++c) differences[4 * j + c][i] = (&difference.x)[c];
        for (std::size_t c = 0; c < 3; ++c) {
          velocities[3 * j + c][i] = static_cast<float>(random.Draw(-30.0, 30.0));
        }
      }
      fraction[i] = static_cast<float>(random.Draw(0.0, 1.0));
      slope_s[i] = static_cast<float>(random.Draw(0.0, 0.2));
    }
    kernels::PrepareDifferences(differences[0].data(), kJoints, kernels::kBlock, ease[0].data());
    kernels::FindLargestVelocities(velocities[0].data(), kJoints, kernels::kBlock, fastest.data());
  }

  [[nodiscard]] bool Finish() {
    std::array<const float*, kernels::kBlock> of_lanes;
    for (std::size_t i = 0; i < kernels::kBlock; ++i) of_lanes[i] = rows[i].data();
    return kernels::FinishPoses({.rows = of_lanes.data(),
                                 .joint_count = kJoints,
                                 .lanes = kernels::kBlock,
                                 .base_m = zeros[0].data(),
                                 .heading_rad = zeros[0].data(),
                                 .sine = zeros[0].data(),
                                 .cosine = ones.data(),
                                 .extra_turn_rad = zeros[0].data(),
                                 .remaining_turn = zeros[0].data(),
                                 .ease = ease[0].data(),
                                 .velocity = velocities[0].data(),
                                 .fastest = fastest.data(),
                                 .root_ease_m = no_root[0].data(),
                                 .root_ease_m_s = no_root[0].data(),
                                 .fraction = fraction.data(),
                                 .slope_s = slope_s.data(),
                                 .is_eased = all.data(),
                                 .is_inertial = all.data()},
                                roots_m[0].data(), rotations[0].data());
  }

  static constexpr Lanes All() {
    Lanes lanes;
    lanes.fill(1.0f);
    return lanes;
  }
  alignas(64) std::array<std::array<float, kRowFloats>, kernels::kBlock> rows{};
  alignas(64) std::array<Lanes, 4 * kJoints> differences{};
  alignas(64) std::array<Lanes, 3 * kJoints> velocities{};
  alignas(64) std::array<Lanes, kernels::kDifferenceFloats * kJoints> ease{};
  alignas(64) Lanes fastest{}, fraction{}, slope_s{};
  alignas(64) Lanes all = All();
  alignas(64) std::array<Lanes, 3> no_root{};
  alignas(64) std::array<DoubleLanes, 3> zeros{};
  alignas(64) DoubleLanes ones{1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};
  alignas(64) std::array<Lanes, 3> roots_m{};
  alignas(64) std::array<Lanes, 4 * kJoints> rotations{};
};

// Difference poses make rotations longer before they are normalized. A rotation that is too short
// to have a mean must still be detected.
TEST(Evaluation, DetectsShortRotationsInEveryLaneAndJoint) {
  constexpr unsigned kSeed = 20261126;
  Random random(kSeed);
  for (const std::int64_t set : InstructionSets()) {
    const OnlyInstructionSet only(set);
    for (int round = 0; round < 2000; ++round) {
      Sixteen poses(random);
      ASSERT_TRUE(poses.Finish()) << hwy::TargetName(set) << ", seed " << kSeed;
      const auto lane = static_cast<std::size_t>(random.Draw(0.0, 15.999));
      const auto joint = static_cast<std::size_t>(random.Draw(0.0, 4.999));
      float* row = poses.rows[lane].data();
      const Quat q = GridLayout::RotationOf(row, joint);
      GridLayout::SetRotation(row, joint, q * static_cast<float>(random.Draw(0.01, 0.0999)));
      ASSERT_FALSE(poses.Finish())
          << hwy::TargetName(set) << ", lane " << lane << ", joint " << joint << ", seed " << kSeed;
    }
  }
}

// All machines produce this hash (decision 0002). If a formula for poses changes intentionally, the
// hash changes, and the protocol needs a new version. Otherwise clients that evaluate movements
// with the old formulas would display other poses than the server (decision 0021). If only the
// decisions of avatars change, for example the speed of a step, the protocol needs no new version,
// because replicas receive these decisions.
TEST(Evaluation, MatchesTheProtocolVersion) {
  DrawnCrowd crowd(LibraryOf({}), 24, 10, {.idle_motion = false});
  std::string bytes;
  for (int tick = 0; tick < 300; ++tick) {
    crowd.Advance();
    for (const AvatarSimulation& avatar : crowd.avatars()) AppendBytes(avatar, bytes);
  }
  EXPECT_EQ(XXH3_64bits(bytes.data(), bytes.size()), 0xac340be787f055f5u);
  EXPECT_EQ(protocol::kProtocolVersion, 1u);
}

// The bytes of varied steps must be the same, too. Replicas receive the results of the variation,
// so a new hash needs no new version of the protocol.
TEST(Evaluation, StrideVariationHasTheSameBytesOnEveryMachine) {
  std::string bytes;
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    AvatarSimulation avatar(LibraryOf({}), {},
                            {.idle_motion = false, .stride_variation = true, .seed = seed});
    for (int step = 0; step < 12; ++step) {
      ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = 0.6}}));
    }
    for (int tick = 0; tick < 400; ++tick) {
      avatar.Advance(1.0 / 60.0);
      AppendBytes(avatar, bytes);
    }
  }
  EXPECT_EQ(XXH3_64bits(bytes.data(), bytes.size()), 0xd4d70f55830aa7a1u);
}

// The same for poses of standing avatars, whose motion is generated when a library is opened.
TEST(Evaluation, IdleMotionMatchesTheProtocolVersion) {
  std::string bytes;
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    AvatarSimulation avatar(LibraryOf({}), {}, {.seed = seed});
    for (int tick = 0; tick < 600; ++tick) {
      avatar.Advance(1.0 / 60.0);
      AppendBytes(avatar, bytes);
    }
  }
  EXPECT_EQ(XXH3_64bits(bytes.data(), bytes.size()), 0x5bae607f71be9026u);
  EXPECT_EQ(protocol::kProtocolVersion, 1u);
}

class LibraryEvaluation : public testing::TestWithParam<Source> {
 protected:
  void SetUp() override {
    STRIDEWIRE_SKIP_WITHOUT_TAKES(GetParam().subjects);
    library_ = LibraryOf(GetParam().subjects);
  }
  Library library_;
};

TEST_P(LibraryEvaluation, MatchesTheReference) {
  constexpr unsigned kSeed = 1;
  DrawnCrowd crowd(library_, 20, kSeed);
  Pose fast(library_->skeleton().joint_count());
  Pose reference(library_->skeleton().joint_count());
  Pose sampled(library_->skeleton().joint_count());
  GridCache cache(library_->layout());
  double largest_m = 0.0;
  double largest_rad = 0.0;
  double sampled_rad = 0.0;  // Sum over all poses.
  int poses = 0;
  for (int tick = 0; tick < 600; ++tick) {
    crowd.Advance();
    for (const AvatarSimulation& avatar : crowd.avatars()) {
      const Movement* movement = avatar.displayed_movement();
      if (movement == nullptr) continue;
      const MotionGroup& group = library_->group(movement->group);
      cache.Clear();
      EvaluateMovement(group, library_->layout(), *movement, avatar.movement_time_s(), cache, fast);
      EvaluateMovementByReference(group, library_->layout(), *movement, avatar.movement_time_s(),
                                  reference);
      EvaluateMovementBySampling(group, library_->layout(), *movement, avatar.movement_time_s(),
                                 sampled);
      const Vec3 apart = fast.root_position_m - reference.root_position_m;
      largest_m = std::max(largest_m, static_cast<double>(glm::length(apart)));
      largest_rad = std::max(largest_rad, LargestJointAngle(fast, reference));
      sampled_rad += LargestJointAngle(sampled, reference);
      ++poses;
    }
  }
  std::printf("%s: %d poses: %.2g m, %.2g rad from the reference; sampled %.2g rad on average\n",
              GetParam().name, poses, largest_m, largest_rad, sampled_rad / poses);
  EXPECT_GT(poses, 4000);
  EXPECT_LT(largest_m, 1e-5) << "seed " << kSeed;
  EXPECT_LT(largest_rad, 1e-5) << "seed " << kSeed;
  // Blending before or after interpolating gives nearly the same pose.
  EXPECT_LT(sampled_rad / poses, 0.03) << "seed " << kSeed;
}

TEST_P(LibraryEvaluation, PlantingMatchesTheReference) {
  constexpr unsigned kSeed = 2;
  DrawnCrowd crowd(library_, 20, kSeed);
  const Skeleton& skeleton = library_->skeleton();
  const LegRig& rig = library_->leg_rig();
  Pose fast(skeleton.joint_count());
  Pose reference(skeleton.joint_count());
  GridCache cache(library_->layout());
  double largest_m = 0.0;
  double largest_rad = 0.0;
  double farthest_foot_m = 0.0;
  int poses = 0;
  int on_rough_ground = 0;
  for (int tick = 0; tick < 900; ++tick) {
    crowd.Advance();
    for (const AvatarSimulation& avatar : crowd.avatars()) {
      const Movement* movement = avatar.displayed_movement();
      if (movement == nullptr) continue;
      if (!movement->feet.is_active) continue;
      const MotionGroup& group = library_->group(movement->group);
      cache.Clear();
      const double time_s = avatar.movement_time_s();
      EvaluateMovement(group, library_->layout(), *movement, time_s, cache, fast);
      reference = fast;
      PlantFeet(rig, *movement, time_s, fast);
      PlantFeetByReference(skeleton, rig, *movement, time_s, reference);
      const Vec3 apart = fast.root_position_m - reference.root_position_m;
      largest_m = std::max(largest_m, static_cast<double>(glm::length(apart)));
      largest_rad = std::max(largest_rad, LargestJointAngle(fast, reference));
      for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
        const Vec3 ball =
            BallPosition(skeleton, fast, foot) - BallPosition(skeleton, reference, foot);
        farthest_foot_m = std::max(farthest_foot_m, static_cast<double>(glm::length(ball)));
      }
      ++poses;
      on_rough_ground += movement->feet.keeps_above_ground;
    }
  }
  std::printf("%s: %d poses (%d on rough ground): root %.2g m, joints %.2g rad, feet %.2g m\n",
              GetParam().name, poses, on_rough_ground, largest_m, largest_rad, farthest_foot_m);
  EXPECT_GT(poses, 4000);
  EXPECT_GT(on_rough_ground, 1000);
  EXPECT_LT(largest_m, 2e-5) << "seed " << kSeed;
  EXPECT_LT(farthest_foot_m, 2e-5) << "seed " << kSeed;
  // The knee angle of a nearly straight leg amplifies errors of its length.
  EXPECT_LT(largest_rad, 2e-4) << "seed " << kSeed;
}

TEST_P(LibraryEvaluation, HasTheSameBytesOnEveryInstructionSet) {
  constexpr unsigned kSeed = 7;
  std::map<std::string, std::vector<std::string>> bytes;  // [instruction set][tick].
  for (const std::int64_t set : InstructionSets()) {
    const OnlyInstructionSet only(set);
    DrawnCrowd crowd(library_, 24, kSeed);
    std::vector<std::string>& ticks = bytes[hwy::TargetName(set)];
    for (int tick = 0; tick < 300; ++tick) {
      crowd.Advance();
      ticks.emplace_back();
      for (const AvatarSimulation& avatar : crowd.avatars()) AppendBytes(avatar, ticks.back());
    }
  }
  std::printf("instruction sets compared:");
  for (const auto& [set, ticks] : bytes) {
    std::printf(" %s", set.c_str());
    for (std::size_t tick = 0; tick < ticks.size(); ++tick) {
      ASSERT_TRUE(ticks[tick] == bytes.begin()->second[tick])
          << set << " differs from " << bytes.begin()->first << " from tick " << tick << ", seed "
          << kSeed;
    }
  }
  std::printf("\n");
}

TEST_P(LibraryEvaluation, DoesNotDependOnOtherLanes) {
  constexpr unsigned kSeed = 8;
  std::vector<std::string> alone;
  for (const std::size_t at_once : {1, 3, 16, 29}) {
    DrawnCrowd crowd(library_, 29, kSeed);
    for (std::size_t tick = 0; tick < 300; ++tick) {
      crowd.Advance(at_once);
      std::string bytes;
      for (const AvatarSimulation& avatar : crowd.avatars()) AppendBytes(avatar, bytes);
      if (at_once == 1) {
        alone.push_back(std::move(bytes));
      } else {
        ASSERT_TRUE(bytes == alone[tick])
            << at_once << " together differ from tick " << tick << ", seed " << kSeed;
      }
    }
  }
}

// Evaluates the displayed pose of a movement on its own.
Pose ShownAlone(const MotionLibrary& library, const Movement& movement, double time_s) {
  Pose pose(library.skeleton().joint_count());
  GridCache cache(library.layout());
  EvaluateMovement(library.group(movement.group), library.layout(), movement, time_s, cache, pose);
  PlantFeet(library.leg_rig(), movement, time_s, pose);
  return pose;
}

TEST_P(LibraryEvaluation, SinglePosesMatchBatches) {
  constexpr unsigned kSeed = 9;
  constexpr std::size_t kCrowd = 37;
  DrawnCrowd crowd(library_, kCrowd, kSeed);
  std::vector<Movement> movements(kCrowd);
  std::vector<Pose> shown(kCrowd, Pose(library_->skeleton().joint_count()));
  SoaPoseEvaluator evaluator(*library_, 1);
  int poses = 0;
  for (int tick = 0; tick < 200; ++tick) {
    crowd.Advance();
    std::vector<PoseJob> jobs;
    for (const AvatarSimulation& avatar : crowd.avatars()) {
      if (avatar.movement() == nullptr) continue;
      const std::size_t i = jobs.size();
      movements[i] = *avatar.movement();
      jobs.push_back({&movements[i], avatar.movement_time_s(), &shown[i]});
    }
    EvaluatePoses(evaluator, jobs);
    for (const PoseJob& job : jobs) {
      const Pose alone = ShownAlone(*library_, *job.movement, job.time_s);
      ASSERT_EQ(alone.root_position_m, job.pose->root_position_m) << "seed " << kSeed;
      ASSERT_EQ(alone.rotations, job.pose->rotations) << "seed " << kSeed;
      ++poses;
    }
  }
  EXPECT_GT(poses, 3000);
}

// Runs of poses on every instruction set: of movements at their start and in their middle, on level
// and uneven ground, with and without planting, redirected, and with a plant fade.
TEST_P(LibraryEvaluation, SampleRunsMatchSinglePoses) {
  constexpr unsigned kSeed = 10;
  constexpr std::size_t kCrowd = 41;
  Random random(kSeed);
  for (const std::int64_t set : InstructionSets()) {
    const OnlyInstructionSet only(set);
    DrawnCrowd crowd(library_, kCrowd, kSeed);
    std::vector<Movement> movements(kCrowd);
    SoaPoseEvaluator evaluator(*library_, 12);
    EvaluationBatcher queue;
    Pose pose(library_->skeleton().joint_count());
    int poses = 0;
    int settling = 0;
    std::array<int, 2> planted{};
    for (int tick = 0; tick < 240; ++tick) {
      crowd.Advance();
      if (tick % 3 != 0) continue;
      std::uint32_t tag = 0;
      std::size_t wanted = 0;
      for (const AvatarSimulation& avatar : crowd.avatars()) {
        if (avatar.movement() == nullptr) continue;
        movements[tag] = *avatar.movement();
        const int apart = 1 + static_cast<int>(random.Draw(0.0, 3.0));
        const int most = 1 + static_cast<int>(random.Draw(0.0, 12.0));
        const double step_s = random.Draw(0.005, 0.05);
        const int count =
            SampleRunCount(movements[tag], avatar.movement_time_s(), step_s, apart, most);
        ASSERT_LE(count, most);
        queue.Add({&movements[tag], avatar.movement_time_s(), step_s, apart}, count, tag);
        wanted += static_cast<std::size_t>(count);
        ++tag;
      }
      std::vector<double> time_s(tag);
      std::size_t seen = 0;
      queue.Evaluate(evaluator, [&](std::span<const EvaluationBatcher::Item> items, int at,
                                    const SoaPose& lanes) {
        for (std::size_t i = 0; i < items.size(); ++i) {
          const EvaluationBatcher::Item& item = items[i];
          if (at >= item.count) continue;
          const SampleRun& run = item.run;
          double& now_s = time_s[item.tag];
          if (at == 0) now_s = run.time_s;
          for (int t = 0; at > 0 && t < run.ticks_apart; ++t) now_s += run.step_s;
          ASSERT_TRUE(at == 0 || now_s <= run.movement->duration_s() + 1e-9);
          lanes.Get(i, pose);
          const Pose alone = ShownAlone(*library_, *run.movement, now_s);
          ASSERT_EQ(alone.root_position_m, pose.root_position_m)
              << hwy::TargetName(set) << ", tick " << tick << ", pose " << at << ", seed " << kSeed;
          ASSERT_TRUE(std::memcmp(alone.rotations.data(), pose.rotations.data(),
                                  pose.rotations.size() * sizeof(Quat)) == 0)
              << hwy::TargetName(set) << ", tick " << tick << ", pose " << at << ", seed " << kSeed;
          ++seen;
          const FootPlan& feet = run.movement->feet;
          ++planted[feet.is_active ? 1 : 0];
          settling += feet.is_active && now_s < run.movement->start_offset_s + feet.plant_fade_s;
        }
      });
      if (HasFatalFailure()) return;
      EXPECT_EQ(seen, wanted);
      EXPECT_TRUE(queue.empty());
      poses += static_cast<int>(seen);
    }
    std::printf("%s: %d poses, %d not planted, %d settling\n", hwy::TargetName(set), poses,
                planted[0], settling);
    EXPECT_GT(poses, 2000);
    EXPECT_GT(planted[0], 100);
    EXPECT_GT(settling, 5);
  }
}

INSTANTIATE_TEST_SUITE_P(Libraries, LibraryEvaluation,
                         testing::Values(Source{"Builtin", {}}, Source{"Subject01", {kDebianTakes}},
                                         Source{"Subject16", {"16"}}),
                         [](const auto& tested) { return tested.param.name; });

}  // namespace
}  // namespace stridewire
