// Equal steps vary in time and pose as those of people do, while feet land in the same places.

#include "runtime/movement/stride_variation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "captured_library.h"
#include "instruction_sets.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/locomotion_profile.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
constexpr double kTickS = 1.0 / 60.0;

std::string BytesOf(ConstPoseSpan pose) {
  std::string bytes(reinterpret_cast<const char*>(&pose.root_position_m), sizeof(Vec3));
  bytes.append(reinterpret_cast<const char*>(pose.rotations.data()), pose.rotations.size_bytes());
  return bytes;
}

TEST(StrideVariation, RatesStayWithinTheirBoundAndVaryLikeStridesOfPeople) {
  constexpr int kSteps = 2000;
  double sum = 0.0;
  double squares = 0.0;
  double longest = 0.0;
  for (std::uint64_t step = 1; step <= kSteps; ++step) {
    const double stride = 0.5 / StrideVariation(7, step).RateFactor() +
                          0.5 / StrideVariation(7, step + 1).RateFactor();
    longest = std::max(longest, std::fabs(StrideVariation(7, step).RateFactor() - 1.0));
    sum += stride;
    squares += stride * stride;
  }
  const double mean = sum / kSteps;
  const double deviation = std::sqrt(squares / kSteps - mean * mean) / mean;
  std::printf("stride times vary by %.2f %%\n", 100.0 * deviation);
  EXPECT_LE(longest, StrideVariation::kMaxRateChange);
  EXPECT_GT(longest, 0.8 * StrideVariation::kMaxRateChange);
  EXPECT_NEAR(mean, 1.0, 0.002);
  EXPECT_NEAR(deviation, 0.013, 0.001);
}

TEST(StrideVariation, DependsOnSeedAndNumber) {
  EXPECT_EQ(StrideVariation(1, 2).RateFactor(), StrideVariation(1, 2).RateFactor());
  EXPECT_NE(StrideVariation(1, 2).RateFactor(), StrideVariation(1, 3).RateFactor());
  EXPECT_NE(StrideVariation(1, 2).RateFactor(), StrideVariation(2, 2).RateFactor());
  // Neighbouring avatars do not draw the same numbers one movement later.
  EXPECT_NE(StrideVariation(1, 2).RateFactor(), StrideVariation(2, 1).RateFactor());
  EXPECT_NE(StrideVariation(1, 2).WeightDirection(0), StrideVariation(1, 2).WeightDirection(1));
}

// A walk of equal steps.
struct Walk {
  std::vector<double> durations_s;          // Of the steady steps.
  std::vector<DVec3> footprints_m;          // Of all steps.
  std::vector<std::vector<DVec3>> poses_m;  // [step]: joints relative to the root in mid-step.
};

struct Manner {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
};
void PrintTo(const Manner& manner, std::ostream* out) { *out << manner.name; }

class StrideVariationOf : public testing::TestWithParam<Manner> {
 protected:
  static constexpr int kSteps = 200;
  static constexpr int kFirstSteady = 4;

  void SetUp() override {
    STRIDEWIRE_SKIP_WITHOUT_TAKES(GetParam().subjects);
    library_ = LibraryOf(GetParam().subjects);
    length_m_ = std::min(0.55, library_->locomotion_profile().longest_m);
  }

  [[nodiscard]] Walk PlayWalk(const AvatarOptions& options) const {
    AvatarSimulation avatar(library_, {}, options);
    for (int step = 0; step < kSteps; ++step) {
      EXPECT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = length_m_}}));
    }
    const Skeleton& skeleton = library_->skeleton();
    std::vector<Vec3> joints_m(skeleton.joints.size());
    std::vector<Quat> rotations(skeleton.joints.size());
    Walk walk;
    double begun_s = 0.0;
    bool is_sampled = true;
    for (int tick = 0; tick < 100 * kSteps; ++tick) {
      avatar.Advance(kTickS);
      for (const AvatarEvent& event : avatar.events()) {
        if (event.request_id != 1) continue;
        if (event.type == AvatarEventType::kStarted) begun_s = event.time_s, is_sampled = false;
        if (event.type == AvatarEventType::kFinished)
          walk.durations_s.push_back(event.time_s - begun_s);
        if (event.type == AvatarEventType::kFootStrike)
          walk.footprints_m.emplace_back(event.position_m);
      }
      const Movement* movement = avatar.movement();
      if (!is_sampled && movement != nullptr &&
          avatar.movement_time_s() >= 0.5 * movement->duration_s()) {
        is_sampled = true;
        AvatarBody body = avatar.body();
        body.Evaluate(0.5 * movement->duration_s());
        ForwardKinematics(skeleton, body.pose, joints_m, rotations);
        auto& pose = walk.poses_m.emplace_back();
        for (const Vec3& joint : joints_m) {
          pose.push_back(RotateYaw(-avatar.base().heading_rad, DVec3(joint - joints_m[0])));
        }
      }
      if (avatar.idle()) break;
    }
    EXPECT_EQ(walk.footprints_m.size(), static_cast<std::size_t>(kSteps));
    return walk;
  }

  // Returns the standard deviation of stride times relative to their mean.
  static double VariationOf(const std::vector<double>& durations_s) {
    double sum = 0.0;
    double squares = 0.0;
    double count = 0.0;
    for (std::size_t i = kFirstSteady; i + 2 < durations_s.size(); ++i) {
      const double stride_s = durations_s[i] + durations_s[i + 1];
      sum += stride_s;
      squares += stride_s * stride_s;
      count += 1.0;
    }
    const double mean = sum / count;
    return std::sqrt(std::max(0.0, squares / count - mean * mean)) / mean;
  }

  // Returns the mean distance of joints between steps of the same foot.
  static double PoseVariationOf(const Walk& walk) {
    double sum_m = 0.0;
    double count = 0.0;
    for (std::size_t i = kFirstSteady; i + 3 < walk.poses_m.size(); ++i) {
      for (std::size_t j = 0; j < walk.poses_m[i].size(); ++j) {
        sum_m += glm::length(walk.poses_m[i + 2][j] - walk.poses_m[i][j]);
        count += 1.0;
      }
    }
    return sum_m / count;
  }

  Library library_;
  double length_m_ = 0.0;
};

TEST_P(StrideVariationOf, StaysWithinWhatPeopleShow) {
  const Walk varied = PlayWalk({.stride_variation = true});
  const Walk exact = PlayWalk({.stride_variation = false});
  const double time = VariationOf(varied.durations_s);
  const double pose_m = PoseVariationOf(varied);
  std::printf("%s: stride times vary by %.2f %%, poses by %.2f cm\n", GetParam().name, 100.0 * time,
              100.0 * pose_m);
  EXPECT_GT(time, 0.008);
  EXPECT_LT(time, 0.02);
  EXPECT_LT(VariationOf(exact.durations_s), 1e-3);
  EXPECT_GE(pose_m, 0.001);
  EXPECT_LT(pose_m, 0.03);
  EXPECT_LT(PoseVariationOf(exact), 0.0005);
}

TEST_P(StrideVariationOf, KeepsFootprints) {
  const Walk varied = PlayWalk({.stride_variation = true, .seed = 3});
  const Walk exact = PlayWalk({.stride_variation = false, .seed = 3});
  ASSERT_EQ(varied.footprints_m.size(), exact.footprints_m.size());
  double ahead_m = 0.0;
  double sideways_m = 0.0;
  for (std::size_t i = 0; i < varied.footprints_m.size(); ++i) {
    const DVec3 away = varied.footprints_m[i] - exact.footprints_m[i];
    ahead_m = std::max(ahead_m, std::fabs(away.z));
    sideways_m = std::max(sideways_m, std::fabs(away.x));
  }
  std::printf("%s: footprints within %.3g mm ahead, %.3g mm sideways\n", GetParam().name,
              1e3 * ahead_m, 1e3 * sideways_m);
  EXPECT_LT(ahead_m, 1e-3);
  // The sideways places of straight steps follow the blend. The step width
  // of people varies by about 25 mm (Owings and Grabiner 2004).
  EXPECT_LT(sideways_m, 0.03);
}

TEST_P(StrideVariationOf, KeepsThePlaceOfTurnsOnTheSpot) {
  const auto base_after_turns = [&](bool stride_variation) {
    AvatarSimulation avatar(library_, {}, {.stride_variation = stride_variation, .seed = 3});
    for (int step = 0; step < 12; ++step) {
      EXPECT_TRUE(avatar.Enqueue({1, StepRequest{.turn_rad = 0.6, .allow_nearest = true}}));
    }
    while (!avatar.idle() && avatar.time_s() < 60.0) avatar.Advance(kTickS);
    EXPECT_TRUE(avatar.idle());
    return avatar.base();
  };
  const BaseFrame varied = base_after_turns(true);
  const BaseFrame exact = base_after_turns(false);
  const DVec3 away = varied.position_m - exact.position_m;
  const double apart_m = std::hypot(away.x, away.z);
  std::printf("%s: %.3g mm apart after 12 turns\n", GetParam().name, 1e3 * apart_m);
  EXPECT_LT(apart_m, 0.005);
}

INSTANTIATE_TEST_SUITE_P(Libraries, StrideVariationOf,
                         testing::Values(Manner{"Builtin", {}}, Manner{"Subject01", {kDebianTakes}},
                                         Manner{"Subject16", {"16"}}),
                         [](const auto& tested) { return tested.param.name; });

class BuiltinStrideVariation : public testing::Test {
 protected:
  // Returns the bytes of the poses of a walk.
  [[nodiscard]] std::string BytesOfWalk(const AvatarOptions& options,
                                        const StepRequest& step = {.length_m = 0.6}) const {
    AvatarSimulation avatar(library_, {}, options);
    for (int i = 0; i < 8; ++i) EXPECT_TRUE(avatar.Enqueue({1, step}));
    std::string bytes;
    for (int tick = 0; tick < 300; ++tick) {
      avatar.Advance(kTickS);
      bytes += BytesOf(avatar.pose());
    }
    return bytes;
  }
  Library library_ = LibraryOf({});
};

TEST_F(BuiltinStrideVariation, DiffersBySeedAndByNothingElse) {
  const AvatarOptions three{.idle_motion = false, .stride_variation = true, .seed = 3};
  const AvatarOptions four{.idle_motion = false, .stride_variation = true, .seed = 4};
  EXPECT_EQ(BytesOfWalk(three), BytesOfWalk(three));
  EXPECT_NE(BytesOfWalk(three), BytesOfWalk(four));
  AvatarOptions exact_three = three;
  AvatarOptions exact_four = four;
  exact_three.stride_variation = exact_four.stride_variation = false;
  EXPECT_EQ(BytesOfWalk(exact_three), BytesOfWalk(exact_four));
}

TEST_F(BuiltinStrideVariation, HasTheSameBytesOnEveryInstructionSet) {
  std::string first;
  for (const std::int64_t set : InstructionSets()) {
    const OnlyInstructionSet only(set);
    const std::string bytes = BytesOfWalk({.stride_variation = true, .seed = 5});
    if (first.empty()) first = bytes;
    EXPECT_TRUE(bytes == first) << hwy::TargetName(set);
  }
}

// Avatars that begin to walk together do not remain in step.
TEST_F(BuiltinStrideVariation, NeighboursFallOutOfStep) {
  const auto strike_of = [&](std::uint64_t seed) {
    AvatarSimulation avatar(library_, {}, {.stride_variation = true, .seed = seed});
    for (int i = 0; i < 60; ++i) EXPECT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = 0.6}}));
    int strikes = 0;
    while (strikes < 50 && avatar.time_s() < 100.0) {
      avatar.Advance(kTickS);
      for (const AvatarEvent& event : avatar.events()) {
        strikes += event.type == AvatarEventType::kFootStrike;
      }
    }
    return avatar.time_s();
  };
  std::vector<double> strikes_s;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) strikes_s.push_back(strike_of(seed));
  const auto [first, last] = std::ranges::minmax(strikes_s);
  EXPECT_GT(last - first, 0.1);
}

// Stride variation changes neither the duration nor the pose of steps with exact placement.
TEST_F(BuiltinStrideVariation, SparesExactSteps) {
  const auto bytes_of = [&](bool stride_variation) {
    AvatarSimulation avatar(library_, {},
                            {.idle_motion = false, .stride_variation = stride_variation});
    for (int i = 0; i < 6; ++i) {
      const Foot foot = i % 2 == 0 ? Foot::kLeft : Foot::kRight;
      const DVec3 at(foot == Foot::kLeft ? 0.09 : -0.09, 0.0, 0.4 * (i + 1));
      EXPECT_TRUE(avatar.Enqueue(
          {1, StepRequest{.foot = foot, .at = FootprintRequest{at, 0.0}, .exact_only = true}}));
    }
    std::string bytes;
    int strikes = 0;
    while (strikes < 6 && avatar.time_s() < 10.0) {
      avatar.Advance(kTickS);
      bytes += BytesOf(avatar.pose());
      for (const AvatarEvent& event : avatar.events()) {
        EXPECT_NE(event.type, AvatarEventType::kRejected) << DescribeRejection(event);
        strikes += event.type == AvatarEventType::kFootStrike;
      }
    }
    EXPECT_EQ(strikes, 6);
    return bytes;
  };
  EXPECT_EQ(bytes_of(true), bytes_of(false));
}

}  // namespace
}  // namespace stridewire
