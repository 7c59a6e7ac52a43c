// Checks the generator of the corpus test itself.

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "corpus/bvh_notation.h"
#include "corpus/bvh_positions.h"
#include "corpus/corpus_case.h"
#include "corpus/gait.h"
#include "corpus/postures.h"
#include "corpus/rig.h"

namespace stridewire::test {
namespace {

FigureMotion SixSteps(const Figure& figure) {
  return RenderGait(figure, PlanWalk(figure, {.turn_rad = 0.2, .heading_rad = 0.5}), 30.0);
}

// Largest distance between the same parts of two rigs in any frame.
double LargestDifference(const Rig& a, const Rig& b) {
  double largest = 0.0;
  for (int f = 0; f < a.frame_count(); ++f) {
    const std::vector<DVec3> in_a = a.Positions(f);
    const std::vector<DVec3> in_b = b.Positions(f);
    for (std::size_t p = 0; p < a.parts.size(); ++p) {
      if (a.parts[p] < 0 || b.parts[p] < 0) continue;
      const DVec3 difference =
          in_a[static_cast<std::size_t>(a.parts[p])] - in_b[static_cast<std::size_t>(b.parts[p])];
      largest = std::max(largest, glm::length(difference));
    }
  }
  return largest;
}

TEST(CorpusGenerator, StandingFeetDoNotMove) {
  const Figure figure(1.05);
  const Gait gait =
      PlanWalk(figure, {.length_m = 0.65, .heel_rad = 0.3, .rises_m = {0.0, 0.0, 0.08}});
  const Rig rig = MakeRig(figure, RenderGait(figure, gait, 60.0));
  for (int foot = 0; foot < 2; ++foot) {
    const Part toes = foot == 0 ? Part::kLeftToes : Part::kRightToes;
    const auto joint = static_cast<std::size_t>(rig.parts[static_cast<std::size_t>(toes)]);
    for (const Footprint& print : gait.prints[static_cast<std::size_t>(foot)]) {
      for (int f = 0; f < rig.frame_count(); ++f) {
        const double t = f / rig.fps;
        if (t < print.land_s + kHeelS || t > print.lift_s) continue;
        EXPECT_LT(glm::length(rig.Positions(f)[joint] - print.ball_m), 1e-6) << t;
      }
    }
  }
}

TEST(CorpusGenerator, FeetMoveWithoutJumps) {
  const Figure figure;
  const double fps = 240.0;
  const Gait gait = PlanWalk(figure, {.heel_rad = 0.3, .slope_z = 0.01, .rises_m = {0.0, -0.1}});
  const Rig rig = MakeRig(figure, RenderGait(figure, gait, fps));
  std::vector<DVec3> before = rig.Positions(0);
  for (int f = 1; f < rig.frame_count(); ++f) {
    const std::vector<DVec3> now = rig.Positions(f);
    for (std::size_t j = 0; j < now.size(); ++j) {
      EXPECT_LT(glm::length(now[j] - before[j]) * fps, 8.0) << rig.joints[j].name << ' ' << f;
    }
    before = now;
  }
}

TEST(CorpusGenerator, RunnersFallFreelyBetweenSteps) {
  const Figure figure;
  const Gait gait = PlanRun(figure, {});
  const double fps = 120.0;
  const FigureMotion motion = RenderGait(figure, gait, fps);
  const auto stands = [&](double t) {
    return std::ranges::any_of(gait.prints, [&](const std::vector<Footprint>& prints) {
      return std::ranges::any_of(prints, [&](const Footprint& print) {
        return t > print.land_s - 0.02 && t < print.lift_s + 0.02;
      });
    });
  };
  int flying = 0;
  for (std::size_t i = 1; i + 1 < motion.poses.size(); ++i) {
    if (stands(gait.begin_s + static_cast<double>(i) / fps)) continue;
    ++flying;
    const double acceleration = (motion.poses[i + 1].pelvis_m.y - 2.0 * motion.poses[i].pelvis_m.y +
                                 motion.poses[i - 1].pelvis_m.y) *
                                fps * fps;
    EXPECT_NEAR(acceleration, -9.81, 0.01);
  }
  EXPECT_GT(flying, 20);
}

TEST(CorpusGenerator, RigsMoveLikeTheFigure) {
  const Figure figure;
  const Rig plain = MakeRig(figure, SixSteps(figure));
  for (const Roots roots : {Roots::kStatic, Roots::kRotated, Roots::kTrajectory, Roots::kSplit}) {
    for (const TwistPlace twist : {TwistPlace::kInside, TwistPlace::kBeside}) {
      for (const Frames frames : {Frames::kLegsDown, Frames::kLegsAside, Frames::kAlongBones,
                                  Frames::kQuarters, Frames::kRandom}) {
        Random random(7);
        Rig rig = plain;
        AddTwistJoints(twist, rig);
        AddFingers(rig);
        AddPropInHand(rig);
        AddRoots(roots, rig);
        ReFrame(frames, random, rig);
        RemoveToes(true, rig);
        EXPECT_LT(LargestDifference(plain, rig), 1e-9);
      }
    }
  }
}

TEST(CorpusGenerator, TextHoldsTheMotionInEveryNotation) {
  const Figure figure;
  Rig rig = MakeRig(figure, SixSteps(figure));
  Random random(3);
  ReFrame(Frames::kRandom, random, rig);
  std::array<int, 3> order{0, 1, 2};
  do {
    for (const bool rotations_first : {false, true}) {
      BvhNotation notation;
      notation.rotation_order = order;
      notation.position_order = {order[1], order[2], order[0]};
      notation.rotations_first = rotations_first;
      notation.positions_everywhere = order[0] == 1;
      const BvhPositions positions(WriteRig(rig, notation));
      ASSERT_EQ(positions.frame_count(), rig.frame_count());
      ASSERT_EQ(positions.joint_count(), static_cast<int>(rig.joints.size()));
      EXPECT_NEAR(positions.frame_time_s(), 1.0 / rig.fps, 1e-6);
      for (int f = 0; f < rig.frame_count(); f += 10) {
        const std::vector<DVec3> expected = rig.Positions(f);
        const std::vector<DVec3> written = positions.At(f);
        for (std::size_t j = 0; j < rig.joints.size(); ++j) {
          const int in_file = positions.Find(rig.joints[j].name);
          ASSERT_GE(in_file, 0);
          EXPECT_LT(glm::length(written[static_cast<std::size_t>(in_file)] - expected[j]), 1e-5);
        }
      }
    }
  } while (std::ranges::next_permutation(order).found);
}

TEST(CorpusGenerator, SameSeedGivesTheSameBytes) {
  for (const Movement movement : {Movement::kWalk, Movement::kRun, Movement::kCrawl}) {
    EXPECT_EQ(DrawCase(movement, 5).bvh, DrawCase(movement, 5).bvh);
    EXPECT_NE(DrawCase(movement, 5).bvh, DrawCase(movement, 6).bvh);
  }
}

}  // namespace
}  // namespace stridewire::test
