#include "offline/builtin/builtin_library.h"

#include <gtest/gtest.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <string>
#include <vector>

namespace stridewire {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

const RawLibrary& Library() {
  static const RawLibrary library = GenerateBuiltinLibrary();
  return library;
}

/// World positions and rotations of all joints in one frame, in double precision.
struct Figure {
  std::vector<DVec3> positions;
  std::vector<DQuat> rotations;

  explicit Figure(ConstPoseSpan pose) {
    const Skeleton& skeleton = Library().skeleton;
    for (int j = 0; j < skeleton.joint_count(); ++j) {
      const Joint& joint = skeleton.joints[static_cast<std::size_t>(j)];
      const DQuat local(pose.rotations[static_cast<std::size_t>(j)]);
      if (joint.parent < 0) {
        positions.emplace_back(pose.root_position_m);
        rotations.push_back(local);
      } else {
        const auto p = static_cast<std::size_t>(joint.parent);
        positions.push_back(positions[p] + rotations[p] * DVec3(joint.offset_m));
        rotations.push_back(glm::normalize(rotations[p] * local));
      }
    }
  }

  [[nodiscard]] DVec3 Point(int joint, const Vec3& offset) const {
    const auto j = static_cast<std::size_t>(joint);
    return positions[j] + rotations[j] * DVec3(offset);
  }
  [[nodiscard]] DVec3 At(int joint) const { return positions[static_cast<std::size_t>(joint)]; }
  [[nodiscard]] DVec3 Heel(Foot foot) const {
    return Point(Library().skeleton.leg(foot).ankle, kBuiltinHeelOffsetM);
  }
  [[nodiscard]] DVec3 Ball(Foot foot) const {
    const Leg& leg = Library().skeleton.leg(foot);
    return Point(leg.ball, leg.ball_offset_m);
  }
  [[nodiscard]] DVec3 ToeTip(Foot foot) const {
    const Leg& leg = Library().skeleton.leg(foot);
    return Point(leg.ball, leg.toe_tip_offset_m);
  }

  // Angles in the sagittal plane in degrees. Hip is the flexion relative to the pelvis, Knee the
  // flexion, and Ankle the dorsiflexion.
  [[nodiscard]] double FootPitch(Foot foot) const {
    const DQuat& q = rotations[static_cast<std::size_t>(Library().skeleton.leg(foot).ankle)];
    const DVec3 ahead = q * DVec3(0.0, 0.0, 1.0);
    return kDegrees * std::atan2(ahead.y, std::hypot(ahead.x, ahead.z));
  }
  [[nodiscard]] double Thigh(Foot foot) const {
    const Leg& leg = Library().skeleton.leg(foot);
    const DVec3 thigh = At(leg.knee) - At(leg.hip);
    return kDegrees * std::atan2(thigh.z, -thigh.y);
  }
  [[nodiscard]] double Shank(Foot foot) const {
    const Leg& leg = Library().skeleton.leg(foot);
    const DVec3 shank = At(leg.ankle) - At(leg.knee);
    return kDegrees * std::atan2(shank.z, -shank.y);
  }
  [[nodiscard]] double Hip(Foot foot) const {
    const DVec3 up = rotations[0] * DVec3(0.0, 1.0, 0.0);
    return Thigh(foot) + kDegrees * std::atan2(up.z, up.y);
  }
  [[nodiscard]] double Knee(Foot foot) const { return Thigh(foot) - Shank(foot); }
  [[nodiscard]] double Ankle(Foot foot) const { return FootPitch(foot) - Shank(foot); }
};

Figure FrameOf(const RawExample& example, int frame) { return Figure(example.clip.frame(frame)); }

int FrameAt(const RawExample& example, double time_s) {
  return static_cast<int>(std::lround(time_s * example.clip.fps));
}

const RawExample& Step(double start_m, double end_m, std::size_t group = 0) {
  for (const RawExample& example : Library().groups[group].examples) {
    if (example.parameters[0] == -start_m && example.parameters[1] == end_m) return example;
  }
  ADD_FAILURE() << "no step " << start_m << " to " << end_m;
  return Library().groups[group].examples.front();
}

constexpr std::array kFeet = {Foot::kLeft, Foot::kRight};

// Returns the largest distance of a point from its first position, over frames from..to.
template <typename PointOf>
double Drift(const RawExample& example, int from, int to, PointOf point_of) {
  const DVec3 first = point_of(FrameOf(example, from));
  double drift = 0.0;
  for (int f = from; f <= to; ++f) {
    drift = std::max(drift, glm::length(point_of(FrameOf(example, f)) - first));
  }
  return drift;
}

TEST(BuiltinLibrary, HasTheDocumentedExamples) {
  const RawLibrary& library = Library();
  ASSERT_TRUE(library.skeleton.Validate());
  ASSERT_GE(library.groups.size(), 3u);  // general_steps_test.cpp tests the others.
  EXPECT_EQ(library.groups[0].kind, MovementKind::kStepLeft);
  EXPECT_EQ(library.groups[1].kind, MovementKind::kStepRight);
  EXPECT_EQ(library.groups[2].kind, MovementKind::kJump);
  EXPECT_EQ(library.groups[0].examples.size(), 15u);
  EXPECT_EQ(library.groups[1].examples.size(), 15u);
  EXPECT_EQ(library.groups[2].examples.size(), 4u);
  for (const RawGroup& group : std::span(library.groups).first(3)) {
    for (const RawExample& example : group.examples) {
      SCOPED_TRACE(example.source);
      EXPECT_TRUE(example.clip.Validate());
      EXPECT_EQ(example.clip.joint_count, library.skeleton.joint_count());
      EXPECT_EQ(example.clip.fps, 120.0);
      EXPECT_EQ(example.keytimes_s.front(), 0.0);
      for (std::size_t i = 1; i < example.keytimes_s.size(); ++i) {
        EXPECT_GE(example.keytimes_s[i] - example.keytimes_s[i - 1], 0.05);
      }
      EXPECT_EQ(example.keytimes_s.size(), IsStep(group.kind) ? 4u : 6u);
      EXPECT_EQ(example.parameters.size(), group.parameters.size());
      EXPECT_GE(example.clip.duration_s(), example.keytimes_s.back() - 1e-9);
      EXPECT_EQ(example.clip.root_positions_m[0].x, 0.0f);
      EXPECT_EQ(example.clip.root_positions_m[0].z, 0.0f);
    }
  }
}

TEST(BuiltinLibrary, ParametersEqualThePositionsOfTheBalls) {
  for (const std::size_t g : {0u, 1u}) {
    const Foot moving = MovingFoot(Library().groups[g].kind);
    for (const RawExample& example : Library().groups[g].examples) {
      SCOPED_TRACE(example.source);
      const Figure start = FrameOf(example, 0);
      const Figure end = FrameOf(example, FrameAt(example, example.keytimes_s.back()));
      const auto apart = [&](const Figure& figure) {
        return figure.Ball(moving).z - figure.Ball(OtherFoot(moving)).z;
      };
      EXPECT_NEAR(apart(start), example.parameters[0], 0.0005);
      EXPECT_NEAR(apart(end), example.parameters[1], 0.0005);
    }
  }
  for (const RawExample& jump : Library().groups[2].examples) {
    const Figure start = FrameOf(jump, 0), end = FrameOf(jump, jump.clip.frame_count() - 1);
    for (const Foot foot : kFeet) {
      EXPECT_NEAR(end.Ball(foot).z - start.Ball(foot).z, jump.parameters[0], 0.0005);
    }
  }
}

TEST(BuiltinLibrary, ContactPointsDoNotSlide) {
  for (const std::size_t g : {0u, 1u}) {
    const Foot moving = MovingFoot(Library().groups[g].kind), fixed = OtherFoot(moving);
    for (const RawExample& example : Library().groups[g].examples) {
      SCOPED_TRACE(example.source);
      const int toe_off = FrameAt(example, example.keytimes_s[1]);
      const int strike = FrameAt(example, example.keytimes_s[2]);
      const int end = FrameAt(example, example.keytimes_s[3]);
      const auto heel = [](Foot foot) { return [foot](const Figure& f) { return f.Heel(foot); }; };
      const auto ball = [](Foot foot) { return [foot](const Figure& f) { return f.Ball(foot); }; };
      const auto tip = [](Foot foot) { return [foot](const Figure& f) { return f.ToeTip(foot); }; };
      EXPECT_LE(Drift(example, 0, toe_off, heel(fixed)), 1e-4);  // Heel rocker.
      EXPECT_LE(Drift(example, toe_off, end, ball(fixed)),
                1e-4);                                           // Flat foot, then forefoot rocker.
      EXPECT_LE(Drift(example, 0, toe_off, tip(moving)), 1e-4);  // Toe rocker.
      EXPECT_LE(Drift(example, strike, end, heel(moving)), 1e-4);  // Heel rocker.
      EXPECT_NEAR(FrameOf(example, strike).Heel(moving).y, 0.0, 1e-4);
      EXPECT_NEAR(FrameOf(example, toe_off).Heel(fixed).y, 0.0, 1e-4);
    }
  }
  for (const RawExample& jump : Library().groups[2].examples) {
    SCOPED_TRACE(jump.source);
    const int toe_off = FrameAt(jump, jump.keytimes_s[2]),
              landing = FrameAt(jump, jump.keytimes_s[3]);
    for (const Foot foot : kFeet) {
      EXPECT_LE(Drift(jump, 0, toe_off, [&](const Figure& f) { return f.Ball(foot); }), 1e-4);
      EXPECT_LE(Drift(jump, landing, jump.clip.frame_count() - 1,
                      [&](const Figure& f) { return f.Heel(foot); }),
                1e-4);
    }
  }
}

TEST(BuiltinLibrary, JointsStayInTheHumanRange) {
  for (const RawGroup& group : std::span(Library().groups).first(3)) {
    for (const RawExample& example : group.examples) {
      SCOPED_TRACE(example.source);
      double least_knee = 180.0, most_knee = 0.0, least_ankle = 180.0, most_ankle = -180.0;
      for (int f = 0; f < example.clip.frame_count(); ++f) {
        const Figure figure = FrameOf(example, f);
        for (const Foot foot : kFeet) {
          least_knee = std::min(least_knee, figure.Knee(foot));
          most_knee = std::max(most_knee, figure.Knee(foot));
          least_ankle = std::min(least_ankle, figure.Ankle(foot));
          most_ankle = std::max(most_ankle, figure.Ankle(foot));
        }
      }
      EXPECT_GE(least_knee, 3.0);
      EXPECT_LE(most_knee, IsStep(group.kind) ? 75.0 : 120.0);
      EXPECT_GE(least_ankle, -35.0);
      EXPECT_LE(most_ankle, 38.0);
    }
  }
}

TEST(BuiltinLibrary, FeetClearTheGround) {
  for (const RawGroup& group : std::span(Library().groups).first(3)) {
    for (const RawExample& example : group.examples) {
      SCOPED_TRACE(example.source);
      for (int f = 0; f < example.clip.frame_count(); ++f) {
        const Figure figure = FrameOf(example, f);
        for (const Foot foot : kFeet) {
          const double lowest =
              std::min({figure.Heel(foot).y, figure.Ball(foot).y, figure.ToeTip(foot).y});
          ASSERT_GE(lowest, -0.001) << "frame " << f;
        }
      }
      if (!IsStep(group.kind)) continue;
      const Foot moving = MovingFoot(group.kind);
      const double toe_off_s = example.keytimes_s[1];
      const double swing_s = example.keytimes_s[2] - toe_off_s;
      for (int f = 0; f < example.clip.frame_count(); ++f) {
        const double u = (f / example.clip.fps - toe_off_s) / swing_s;
        const Figure figure = FrameOf(example, f);
        if (u >= 0.30 && u <= 0.85) {
          EXPECT_GE(figure.Heel(moving).y, 0.012) << u;
          EXPECT_GE(figure.Ball(moving).y, 0.012) << u;
        }
        if (u >= 0.50 && u <= 0.85) {
          EXPECT_GE(figure.ToeTip(moving).y, 0.012) << u;
        }
      }
    }
  }
}

// Returns the velocity of the root at the first or the last frame, computed from three frames.
DVec3 RootVelocity(const RawExample& example, bool at_end) {
  const auto& p = example.clip.root_positions_m;
  const std::size_t n = p.size() - 1;
  const double fps = example.clip.fps;
  if (at_end) return (1.5 * DVec3(p[n]) - 2.0 * DVec3(p[n - 1]) + 0.5 * DVec3(p[n - 2])) * fps;
  return (-1.5 * DVec3(p[0]) + 2.0 * DVec3(p[1]) - 0.5 * DVec3(p[2])) * fps;
}

double LargestAngle(ConstPoseSpan a, ConstPoseSpan b) {
  double largest = 0.0;
  for (std::size_t j = 0; j < a.rotations.size(); ++j) {
    largest = std::max(largest, AngleBetween(a.rotations[j], b.rotations[j]));
  }
  return largest;
}

// Returns the angular velocity of a joint at the first or the last keytime in degrees per second,
// from three frames.
DVec3 JointVelocity(const RawExample& example, std::size_t joint, bool at_end) {
  const auto turn = [&](int from) {
    const DQuat a(example.clip.frame(from).rotations[joint]);
    const DQuat b(example.clip.frame(from + 1).rotations[joint]);
    const DQuat d = glm::conjugate(a) * b;
    return DVec3(d.x, d.y, d.z) * (d.w < 0.0 ? -2.0 : 2.0) * example.clip.fps * kDegrees;
  };
  const int last = FrameAt(example, example.keytimes_s.back());
  return at_end ? 1.5 * turn(last - 1) - 0.5 * turn(last - 2) : 1.5 * turn(0) - 0.5 * turn(1);
}

TEST(BuiltinLibrary, StepsJoinContinuously) {
  for (const RawExample& left : Library().groups[0].examples) {
    for (const RawExample& right : Library().groups[1].examples) {
      if (left.parameters[1] != -right.parameters[0]) continue;
      SCOPED_TRACE(left.source + ", then " + right.source);
      const int last = FrameAt(left, left.keytimes_s.back());
      EXPECT_LE(kDegrees * LargestAngle(left.clip.frame(last), right.clip.frame(0)), 0.1);
      EXPECT_NEAR(left.clip.root_positions_m[static_cast<std::size_t>(last)].y,
                  right.clip.root_positions_m[0].y, 1e-4);
      EXPECT_LE(glm::length(RootVelocity(left, true) - RootVelocity(right, false)), 0.02);
      for (std::size_t j = 0; j < static_cast<std::size_t>(left.clip.joint_count); ++j) {
        const DVec3 before = JointVelocity(left, j, true), after = JointVelocity(right, j, false);
        // The velocities are estimated over 25 ms, in which a knee accelerates.
        EXPECT_LE(glm::length(before - after), 25.0) << Library().skeleton.joints[j].name;
      }
    }
  }
}

TEST(BuiltinLibrary, StartsAndEndsStanding) {
  const Pose& stand = Library().stand_pose;
  EXPECT_EQ(stand.root_position_m.x, 0.0f);
  EXPECT_EQ(stand.root_position_m.z, 0.0f);
  const auto expect_standing = [&](const RawExample& example, int frame) {
    SCOPED_TRACE(example.source);
    EXPECT_LE(kDegrees * LargestAngle(stand, example.clip.frame(frame)), 0.1);
    EXPECT_NEAR(stand.root_position_m.y,
                example.clip.root_positions_m[static_cast<std::size_t>(frame)].y, 1e-4);
  };
  for (const double length_m : {0.35, 0.55, 0.75}) {
    expect_standing(Step(0.0, length_m), 0);
    const RawExample& stop = Step(length_m, 0.0, 1);
    expect_standing(stop, FrameAt(stop, stop.keytimes_s.back()));
  }
  for (const RawExample& jump : Library().groups[2].examples) {
    expect_standing(jump, 0);
    expect_standing(jump, jump.clip.frame_count() - 1);
  }
}

TEST(BuiltinLibrary, RightStepsMirrorLeftSteps) {
  const RawLibrary& library = Library();
  for (std::size_t e = 0; e < 15; ++e) {
    const RawExample& left = library.groups[0].examples[e];
    const RawExample& right = library.groups[1].examples[e];
    SCOPED_TRACE(left.source);
    EXPECT_EQ(left.parameters, right.parameters);
    EXPECT_EQ(left.keytimes_s, right.keytimes_s);
    EXPECT_FALSE(left.mirrored);
    EXPECT_TRUE(right.mirrored);
    for (int f = 0; f < left.clip.frame_count(); f += 7) {
      const Figure a = FrameOf(left, f), b = FrameOf(right, f);
      for (int j = 0; j < library.skeleton.joint_count(); ++j) {
        std::string name = library.skeleton.joints[static_cast<std::size_t>(j)].name;
        if (name.starts_with("Left")) {
          name.replace(0, 4, "Right");
        } else if (name.starts_with("Right")) {
          name.replace(0, 5, "Left");
        }
        const DVec3 p = a.At(j), q = b.At(library.skeleton.FindJoint(name));
        ASSERT_LE(glm::length(DVec3(-p.x, p.y, p.z) - q), 1e-5) << name << " in frame " << f;
      }
    }
  }
}

// Normal sagittal angles of walking in degrees, by percent of the cycle since heel-strike: hip
// flexion, knee flexion, ankle dorsiflexion. Rounded values, accurate within 5 degrees, from
// Winter, Biomechanics and Motor Control of Human Movement, and Perry and Burnfield, Gait Analysis.
constexpr double kNormalAngles[][4] = {
    {0, 22, 4, 0},     {12, 18, 18, -4}, {30, 3, 10, 6},  {40, -6, 6, 9},  {50, -11, 11, 7},
    {62, -6, 38, -18}, {72, 9, 63, -8},  {80, 19, 53, 0}, {90, 23, 20, 1}, {97, 22, 2, 0}};

// Returns the angles of a leg over one cycle of steady walking: as the fixed foot, then as the
// moving foot.
std::array<double, 3> AnglesAt(const RawExample& step, double cycle_percent) {
  const double step_s = step.keytimes_s[3], support_s = step.keytimes_s[3] - step.keytimes_s[2];
  double t = cycle_percent / 100.0 * 2.0 * step_s - support_s;
  if (t < 0.0) t += 2.0 * step_s;
  const Foot foot = t < step_s ? Foot::kRight : Foot::kLeft;
  if (t >= step_s) t -= step_s;
  const double at = t * step.clip.fps;
  const int f = std::min(static_cast<int>(at), step.clip.frame_count() - 2);
  const Figure a = FrameOf(step, f), b = FrameOf(step, f + 1);
  const double s = at - f;
  return {(1.0 - s) * a.Hip(foot) + s * b.Hip(foot), (1.0 - s) * a.Knee(foot) + s * b.Knee(foot),
          (1.0 - s) * a.Ankle(foot) + s * b.Ankle(foot)};
}

TEST(BuiltinLibrary, WalksWithNormalAngles) {
  const RawExample& step = Step(0.75, 0.75);
  double squares[3] = {0.0, 0.0, 0.0};
  for (const auto& row : kNormalAngles) {
    const auto angles = AnglesAt(step, row[0]);
    for (std::size_t i = 0; i < 3; ++i) squares[i] += std::pow(angles[i] - row[i + 1], 2.0);
  }
  const auto rms = [&](int i) { return std::sqrt(squares[i] / std::size(kNormalAngles)); };
  EXPECT_LE(rms(0), 8.0) << "hip";
  // The knee yields by 27 degrees under load, as in captures of fast walks.
  EXPECT_LE(rms(1), 11.5) << "knee";
  EXPECT_LE(rms(2), 8.0) << "ankle";

  // The knee flexes twice: under load and in swing.
  std::vector<double> maxima;
  double before = AnglesAt(step, 98.0)[1], now = AnglesAt(step, 99.0)[1];
  for (int percent = 0; percent < 100; ++percent) {
    const double next = AnglesAt(step, percent)[1];
    if (now > before && now >= next && now > 15.0) maxima.push_back(percent - 1);
    before = now;
    now = next;
  }
  ASSERT_EQ(maxima.size(), 2u);
  EXPECT_NEAR(maxima[0], 14.0, 6.0);
  EXPECT_NEAR(maxima[1], 75.0, 6.0);  // In captures, this maximum is at 75 %.
}

// Segment masses and centres of Winter's table, independent of the code of the generator.
DVec3 BodyCentre(const Figure& figure) {
  const Skeleton& skeleton = Library().skeleton;
  const auto at = [&](const std::string& name) { return figure.At(skeleton.FindJoint(name)); };
  const auto along = [](const DVec3& a, const DVec3& b, double s) { return a + s * (b - a); };
  DVec3 sum = 0.497 * along(at("Hips"), at("Neck"), 0.5);
  sum += 0.081 * figure.Point(skeleton.FindJoint("Head"), Vec3(0.0f, 0.06f, 0.01f));
  for (const std::string side : {"Left", "Right"}) {
    const float out = side == "Left" ? 1.0f : -1.0f;
    sum += 0.100 * along(at(side + "UpLeg"), at(side + "Leg"), 0.433);
    sum += 0.0465 * along(at(side + "Leg"), at(side + "Foot"), 0.433);
    sum += 0.0145 * along(at(side + "Foot"), at(side + "ToeBase"), 0.5);
    sum += 0.028 * along(at(side + "Arm"), at(side + "ForeArm"), 0.436);
    sum += 0.016 * along(at(side + "ForeArm"), at(side + "Hand"), 0.430);
    sum += 0.006 * figure.Point(skeleton.FindJoint(side + "Hand"), Vec3(out * 0.0945f, 0.0f, 0.0f));
  }
  return sum;
}

TEST(BuiltinLibrary, CentreOfMassFollowsAParabolaInFlight) {
  for (const RawExample& jump : Library().groups[2].examples) {
    SCOPED_TRACE(jump.source);
    const int toe_off = FrameAt(jump, jump.keytimes_s[2]),
              landing = FrameAt(jump, jump.keytimes_s[3]);
    const double flight_s = (landing - toe_off) / jump.clip.fps;
    const DVec3 from = BodyCentre(FrameOf(jump, toe_off)), to = BodyCentre(FrameOf(jump, landing));
    const DVec3 speed = (to - from) / flight_s + DVec3(0.0, 0.5 * 9.81 * flight_s, 0.0);
    for (int f = toe_off; f <= landing; ++f) {
      const double t = (f - toe_off) / jump.clip.fps;
      const DVec3 expected = from + speed * t - DVec3(0.0, 0.5 * 9.81 * t * t, 0.0);
      EXPECT_LE(glm::length(BodyCentre(FrameOf(jump, f)) - expected), 1e-4) << "frame " << f;
    }
    const double rise = speed.y * speed.y / (2.0 * 9.81);
    EXPECT_NEAR(rise, 0.06 + 0.10 * jump.parameters[0], 0.01);
  }
}

std::uint64_t HashOf(const RawLibrary& library) {
  std::uint64_t hash = 0;
  const auto mix = [&](const void* data, std::size_t bytes) {
    hash = XXH3_64bits_withSeed(data, bytes, hash);
  };
  for (const RawGroup& group : library.groups) {
    for (const RawExample& example : group.examples) {
      mix(example.clip.rotations.data(), example.clip.rotations.size() * sizeof(Quat));
      mix(example.clip.root_positions_m.data(),
          example.clip.root_positions_m.size() * sizeof(Vec3));
      mix(example.keytimes_s.data(), example.keytimes_s.size() * sizeof(double));
    }
  }
  mix(library.stand_pose.rotations.data(), library.stand_pose.rotations.size() * sizeof(Quat));
  return hash;
}

TEST(BuiltinLibrary, IsDeterministic) {
  EXPECT_EQ(HashOf(GenerateBuiltinLibrary()), HashOf(GenerateBuiltinLibrary()));
}

}  // namespace
}  // namespace stridewire
