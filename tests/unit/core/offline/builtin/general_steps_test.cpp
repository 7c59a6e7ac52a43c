// General steps of the generated library: backward, turning, sideways, up and down.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "leg_geometry.h"
#include "offline/builtin/builtin_library.h"
#include "runtime/skeleton/foot_vector.h"

namespace stridewire {
namespace {

using enum ParameterName;

constexpr std::size_t kFirstGeneralGroup = 3;  // After the straight steps and the jump.

const RawLibrary& Library() {
  static const RawLibrary library = GenerateBuiltinLibrary();
  return library;
}

std::vector<const RawGroup*> GeneralGroups() {
  std::vector<const RawGroup*> groups;
  for (std::size_t g = kFirstGeneralGroup; g < Library().groups.size(); ++g) {
    groups.push_back(&Library().groups[g]);
  }
  return groups;
}

int IndexOf(const RawGroup& group, ParameterName name) {
  const auto found = std::find(group.parameters.begin(), group.parameters.end(), name);
  return found == group.parameters.end() ? -1 : static_cast<int>(found - group.parameters.begin());
}

bool IsBackward(const RawGroup& group) {
  return group.parameters.size() == 2 && group.examples.back().parameters.front() > 0.0;
}

LegGeometry Legs() { return {Library().skeleton, Library().stand_pose}; }

int FrameAt(const RawExample& example, std::size_t keytime) {
  return static_cast<int>(std::lround(example.keytimes_s[keytime] * example.clip.fps));
}

TEST(GeneralSteps, FollowTheStraightSteps) {
  ASSERT_EQ(Library().groups.size(), 13u);
  const std::vector<std::vector<ParameterName>> expected = {
      {kStartZ, kEndZ},
      {kStartX, kStartZ, kEndZ, kTurn},
      {kStartX, kStartZ, kEndX, kEndZ},
      {kStartY, kStartZ, kEndY, kEndZ, kTurn},
      {kStartY, kStartZ, kEndY, kEndZ, kTurn}};
  const auto groups = GeneralGroups();
  for (std::size_t g = 0; g < groups.size(); ++g) {
    EXPECT_EQ(groups[g]->kind, g % 2 == 0 ? MovementKind::kStepLeft : MovementKind::kStepRight);
    EXPECT_EQ(groups[g]->parameters, expected[g / 2]);
    EXPECT_EQ(groups[g]->examples.size(), groups[g - g % 2]->examples.size());
    std::set<std::string> sources;
    for (const RawExample& example : groups[g]->examples) {
      SCOPED_TRACE(example.source);
      EXPECT_TRUE(example.clip.Validate());
      EXPECT_TRUE(sources.insert(example.source).second) << "duplicate source";
      EXPECT_EQ(example.keytimes_s.size(), 4u);
      EXPECT_EQ(example.mirrored, g % 2 == 1);
      for (std::size_t i = 1; i < example.keytimes_s.size(); ++i) {
        EXPECT_GE(example.keytimes_s[i] - example.keytimes_s[i - 1], 0.05);
      }
    }
  }
}

TEST(GeneralSteps, ParametersEqualThePositionsOfTheBalls) {
  for (const RawGroup* group : GeneralGroups()) {
    const Foot moving = MovingFoot(group->kind);
    for (const RawExample& example : group->examples) {
      SCOPED_TRACE(example.source);
      const int last = example.clip.frame_count() - 1;
      const DVec3 start = FootVector(Library().skeleton, example.clip.frame(0), moving, 0.0);
      const DVec3 end = FootVector(Library().skeleton, example.clip.frame(last), moving,
                                   example.heading_change_rad);
      for (std::size_t l = 0; l < group->parameters.size(); ++l) {
        const double value = [&] {
          switch (group->parameters[l]) {
            case kStartX: return start.x;
            case kStartY: return start.y;
            case kStartZ: return start.z;
            case kEndX: return end.x;
            case kEndY: return end.y;
            case kEndZ: return end.z;
            default: return example.heading_change_rad;
          }
        }();
        EXPECT_NEAR(value, example.parameters[l], 0.0005) << ParameterText(group->parameters[l]);
      }
    }
  }
}

TEST(GeneralSteps, ContactPointsDoNotSlide) {
  enum Point { kHeel, kBall, kTip };
  LegGeometry legs = Legs();
  for (const RawGroup* group : GeneralGroups()) {
    const Foot moving = MovingFoot(group->kind), fixed = OtherFoot(moving);
    const bool backward = IsBackward(*group);
    for (const RawExample& example : group->examples) {
      SCOPED_TRACE(example.source);
      const auto drift = [&](Foot foot, Point point, std::size_t from, std::size_t to) {
        legs.Set(example.clip.frame(FrameAt(example, from)));
        const DVec3 first = legs.Sole(foot)[point];
        double most = 0.0;
        for (int f = FrameAt(example, from); f <= FrameAt(example, to); ++f) {
          legs.Set(example.clip.frame(f));
          most = std::max(most, glm::length(legs.Sole(foot)[point] - first));
        }
        return most;
      };
      // Steps backwards roll in reverse order: over the ball, then over the heel.
      EXPECT_LE(drift(fixed, backward ? kBall : kHeel, 0, 1), 1e-4);
      EXPECT_LE(drift(fixed, backward ? kHeel : kBall, 2, 3), 1e-4);
      EXPECT_LE(drift(moving, backward ? kHeel : kTip, 0, 1), 1e-4);
      const bool toes_first =
          IndexOf(*group, kEndY) >= 0 &&
          example.parameters[static_cast<std::size_t>(IndexOf(*group, kEndY))] < -0.1;
      EXPECT_LE(drift(moving, backward ? kTip : toes_first ? kBall : kHeel, 2, 3), 1e-4);
    }
  }
}

TEST(GeneralSteps, KneesBendForwardAndLegsStayApart) {
  LegGeometry legs = Legs();
  double widest_knee = 0.0, nearest = 1.0;
  for (const RawGroup* group : GeneralGroups()) {
    for (const RawExample& example : group->examples) {
      SCOPED_TRACE(example.source);
      double least_knee = 180.0, most_knee = 0.0, nearest_here = 1.0;
      for (int f = 0; f < example.clip.frame_count(); ++f) {
        legs.Set(example.clip.frame(f));
        for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
          least_knee = std::min(least_knee, legs.KneeDegrees(foot));
          most_knee = std::max(most_knee, legs.KneeDegrees(foot));
        }
        nearest_here = std::min(nearest_here, legs.LegDistance());
      }
      EXPECT_GE(least_knee, 3.5);
      EXPECT_LE(most_knee, 141.0);  // Two risers of 25 cm over a tread of 28 cm.
      EXPECT_GE(nearest_here, 0.07);
      widest_knee = std::max(widest_knee, most_knee);
      nearest = std::min(nearest, nearest_here);
    }
  }
  std::printf("knees bend by up to %.0f degrees, legs come as near as %.3f m\n", widest_knee,
              nearest);
}

TEST(GeneralSteps, ClearTheGroundInSwing) {
  LegGeometry legs = Legs();
  for (const RawGroup* group : GeneralGroups()) {
    if (IndexOf(*group, kEndY) >= 0) continue;  // Tested by ClearStairs.
    const Foot moving = MovingFoot(group->kind);
    for (const RawExample& example : group->examples) {
      SCOPED_TRACE(example.source);
      const double toe_off = FrameAt(example, 1), swing = FrameAt(example, 2) - toe_off;
      for (int f = 0; f < example.clip.frame_count(); ++f) {
        legs.Set(example.clip.frame(f));
        for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
          for (const DVec3& point : legs.Sole(foot)) ASSERT_GE(point.y, -0.001) << "frame " << f;
        }
        double u = (f - toe_off) / swing;
        if (IsBackward(*group)) u = 1.0 - u;
        if (u < 0.50 || u > 0.85) continue;
        for (const DVec3& point : legs.Sole(moving)) EXPECT_GE(point.y, 0.012) << u;
      }
    }
  }
}

// A tread begins 14 cm behind the ball of a foot that lands on it from below, and ends 2 cm ahead
// of the ball of a foot that leaves it downwards.
double StairsAt(double z, const DVec3& rear_ball, const DVec3& front_ball) {
  const double edge = rear_ball.y < front_ball.y ? front_ball.z - 0.14 : rear_ball.z + 0.02;
  return z < edge ? rear_ball.y : front_ball.y;
}

TEST(GeneralSteps, ClearStairs) {
  LegGeometry legs = Legs();
  for (const RawGroup* group : GeneralGroups()) {
    const int end_y = IndexOf(*group, kEndY);
    if (end_y < 0) continue;
    const Foot moving = MovingFoot(group->kind), fixed = OtherFoot(moving);
    for (const RawExample& example : group->examples) {
      if (example.heading_change_rad != 0.0)
        continue;  // The stairs of a turn are not parallel to z.
      SCOPED_TRACE(example.source);
      const auto ball = [&](int frame, Foot foot) {
        legs.Set(example.clip.frame(frame));
        return legs.Sole(foot)[1];
      };
      const DVec3 start = ball(0, moving), middle = ball(0, fixed);
      const DVec3 end = ball(example.clip.frame_count() - 1, moving);
      for (int f = 0; f < example.clip.frame_count(); ++f) {
        legs.Set(example.clip.frame(f));
        for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
          for (const DVec3& point : legs.Sole(foot)) {
            const double ground = point.z < middle.z ? StairsAt(point.z, start, middle)
                                                     : StairsAt(point.z, middle, end);
            ASSERT_GE(point.y, ground - 0.02) << "frame " << f << ", z " << point.z;
          }
        }
      }
    }
  }
}

TEST(GeneralSteps, RightStepsMirrorLeftSteps) {
  const auto groups = GeneralGroups();
  for (std::size_t g = 0; g + 1 < groups.size(); g += 2) {
    for (std::size_t e = 0; e < groups[g]->examples.size(); ++e) {
      const RawExample& left = groups[g]->examples[e];
      const RawExample& right = groups[g + 1]->examples[e];
      SCOPED_TRACE(left.source);
      EXPECT_EQ(left.heading_change_rad, -right.heading_change_rad);
      for (std::size_t l = 0; l < left.parameters.size(); ++l) {
        const ParameterName name = groups[g]->parameters[l];
        const bool flips = name == kStartX || name == kEndX || name == kTurn;
        EXPECT_EQ(left.parameters[l], flips ? -right.parameters[l] : right.parameters[l]);
      }
      for (int f = 0; f < left.clip.frame_count(); f += 9) {
        const Vec3 a = BallPosition(Library().skeleton, left.clip.frame(f), Foot::kLeft);
        const Vec3 b = BallPosition(Library().skeleton, right.clip.frame(f), Foot::kRight);
        EXPECT_LE(glm::length(Vec3(-a.x, a.y, a.z) - b), 1e-5f);
      }
    }
  }
}

// If one step ends in the state in which another starts, its last pose equals the first pose of
// that step. After a turn this does not hold, since the rear foot keeps its direction.
TEST(GeneralSteps, JoinContinuously) {
  const auto groups = GeneralGroups();
  int joins = 0;
  for (std::size_t g = 0; g + 1 < groups.size(); g += 2) {
    const RawGroup& left = *groups[g];
    const RawGroup& right = *groups[g + 1];
    for (const RawExample& before : left.examples) {
      if (before.heading_change_rad != 0.0) continue;
      const int last = before.clip.frame_count() - 1;
      const DVec3 end = FootVector(Library().skeleton, before.clip.frame(last), Foot::kLeft, 0.0);
      for (const RawExample& after : right.examples) {
        const DVec3 start = FootVector(Library().skeleton, after.clip.frame(0), Foot::kRight, 0.0);
        if (glm::length(end + start) > 0.001) continue;
        SCOPED_TRACE(before.source + ", then " + after.source);
        ++joins;
        EXPECT_LE(LargestJointAngle(before.clip.frame(last), after.clip.frame(0)), 0.003);
        // Heights are relative to the fixed foot, which is the other foot in the next step.
        const double rise = IndexOf(left, kEndY) >= 0 ? end.y : 0.0;
        EXPECT_NEAR(before.clip.root_positions_m[static_cast<std::size_t>(last)].y - rise,
                    after.clip.root_positions_m[0].y, 0.001);
      }
    }
  }
  EXPECT_GE(joins, 100);
}

}  // namespace
}  // namespace stridewire
