#include "offline/build/pose_error.h"

#include <gtest/gtest.h>

#include <cmath>

#include "offline/builtin/builtin_library.h"
#include "stridewire/offline/library_builder.h"

namespace stridewire {
namespace {

std::vector<std::string> JointsOf(BodyPart part, const Skeleton& skeleton) {
  const std::vector<BodyPart> parts = FindBodyParts(skeleton, Pose(skeleton.joint_count()));
  std::vector<std::string> names;
  for (std::size_t j = 0; j < parts.size(); ++j) {
    if (parts[j] == part) names.push_back(skeleton.joints[j].name);
  }
  return names;
}

// Like the CMU figures, with joints that carry only a leg, but without names that identify sides.
Skeleton SpreadFigure() {
  Skeleton figure;
  const auto add = [&](const char* name, int parent, Vec3 offset_m) {
    figure.joints.push_back({name, parent, offset_m});
    return figure.joint_count() - 1;
  };
  const int root = add("root", -1, Vec3(0.0f));
  for (const float side : {1.0f, -1.0f}) {
    const bool left = side > 0.0f;
    const int link = add(left ? "a0" : "b0", root, Vec3(0.0f));
    Leg& leg = figure.legs[left ? 0 : 1];
    leg.hip = add(left ? "a1" : "b1", link, Vec3(0.1f * side, 0.0f, 0.0f));
    leg.knee = add(left ? "a2" : "b2", leg.hip, Vec3(0.0f, -0.45f, 0.0f));
    leg.ankle = leg.ball = add(left ? "a3" : "b3", leg.knee, Vec3(0.0f, -0.45f, 0.0f));
  }
  const int back = add("back", root, Vec3(0.0f, 0.2f, 0.0f));
  const int chest = add("chest", back, Vec3(0.0f, 0.2f, 0.0f));
  const int neck = add("neck", chest, Vec3(0.0f, 0.2f, 0.0f));
  add("head", neck, Vec3(0.0f, 0.1f, 0.0f));
  for (const float side : {1.0f, -1.0f}) {
    const int upper = add(side > 0.0f ? "c1" : "d1", chest, Vec3(0.2f * side, 0.1f, 0.0f));
    add(side > 0.0f ? "c2" : "d2", upper, Vec3(0.3f * side, 0.0f, 0.0f));
  }
  return figure;
}

TEST(FindBodyParts, DistinguishesLegsArmsHeadAndTrunk) {
  using Names = std::vector<std::string>;
  const Skeleton figure = SpreadFigure();
  ASSERT_TRUE(figure.Validate().has_value());
  EXPECT_EQ(JointsOf(BodyPart::kLegs, figure), (Names{"a1", "a2", "a3", "b1", "b2", "b3"}));
  EXPECT_EQ(JointsOf(BodyPart::kArms, figure), (Names{"c1", "c2", "d1", "d2"}));
  EXPECT_EQ(JointsOf(BodyPart::kHead, figure), (Names{"neck", "head"}));
  EXPECT_EQ(JointsOf(BodyPart::kTrunk, figure), (Names{"root", "a0", "b0", "back", "chest"}));
}

TEST(FindBodyParts, HandlesTheGeneratedFigure) {
  const RawLibrary library = GenerateBuiltinLibrary();
  for (const BodyPart part :
       {BodyPart::kTrunk, BodyPart::kHead, BodyPart::kArms, BodyPart::kLegs}) {
    EXPECT_GE(JointsOf(part, library.skeleton).size(), 2u) << BodyPartName(part);
  }
  EXPECT_EQ(JointsOf(BodyPart::kLegs, library.skeleton).size(), 8u);
}

TEST(PoseComparison, RootShiftIsTheErrorOfEveryPart) {
  const Skeleton figure = SpreadFigure();
  PoseComparison comparison(figure, Pose(figure.joint_count()));
  const std::vector<Pose> truth(3, Pose(figure.joint_count()));
  std::vector<Pose> other = truth;
  for (Pose& pose : other) pose.root_position_m = Vec3(0.03f, 0.0f, -0.04f);
  const PoseError error = comparison.Measure(truth, other).value();
  EXPECT_NEAR(error.mean_m, 0.05, 1e-7);
  EXPECT_NEAR(error.max_m, 0.05, 1e-7);
  for (const double part_m : error.part_m) EXPECT_NEAR(part_m, 0.05, 1e-7);
}

TEST(PoseComparison, BentKneeIsAnErrorOfTheLegsOnly) {
  const Skeleton figure = SpreadFigure();
  PoseComparison comparison(figure, Pose(figure.joint_count()));
  const std::vector<Pose> truth(2, Pose(figure.joint_count()));
  std::vector<Pose> other = truth;
  const double angle_rad = 0.4;
  const auto half = static_cast<float>(angle_rad / 2.0);
  const auto knee = static_cast<std::size_t>(figure.legs[0].knee);
  other[1].rotations[knee] = Quat(std::cos(half), std::sin(half), 0.0f, 0.0f);
  const PoseError error = comparison.Measure(truth, other).value();
  const double ankle_m = 2.0 * 0.45 * std::sin(angle_rad / 2.0);  // In one of two poses.
  EXPECT_NEAR(error.max_m, ankle_m, 1e-6);
  EXPECT_NEAR(error.mean_m, ankle_m / 2.0 / figure.joint_count(), 1e-6);
  EXPECT_NEAR(error.part_m[static_cast<std::size_t>(BodyPart::kLegs)], ankle_m / 2.0 / 6.0, 1e-6);
  EXPECT_EQ(error.part_m[static_cast<std::size_t>(BodyPart::kArms)], 0.0);
  EXPECT_EQ(error.part_m[static_cast<std::size_t>(BodyPart::kHead)], 0.0);
}

TEST(PoseComparison, RejectsMovementsOfDifferentShape) {
  const Skeleton figure = SpreadFigure();
  PoseComparison comparison(figure, Pose(figure.joint_count()));
  const std::vector<Pose> two(2, Pose(figure.joint_count()));
  const std::vector<Pose> three(3, Pose(figure.joint_count()));
  const std::vector<Pose> short_poses(2, Pose(figure.joint_count() - 1));
  EXPECT_EQ(comparison.Measure(two, three).error().code, ErrorCode::kShapeMismatch);
  EXPECT_EQ(comparison.Measure(two, short_poses).error().code, ErrorCode::kShapeMismatch);
  EXPECT_EQ(comparison.Measure({}, {}).error().code, ErrorCode::kShapeMismatch);
}

TEST(PosesAtGridPoints, BlendOfOneExampleEqualsTheExample) {
  const RawLibrary raw = GenerateBuiltinLibrary();
  const auto library = LibraryBuilder().Build(raw).value();
  PoseComparison comparison(library->skeleton(), library->stand_pose());
  for (std::size_t g = 0; g < raw.groups.size(); ++g) {
    const MotionGroup& group = library->group(static_cast<int>(g));
    ASSERT_EQ(static_cast<std::size_t>(group.example_count), raw.groups[g].examples.size());
    const std::size_t e = raw.groups[g].examples.size() / 2;
    std::vector<double> weights(raw.groups[g].examples.size(), 0.0);
    weights[e] = 1.0;
    const RawExample& example = raw.groups[g].examples[e];
    const std::vector<Pose> sampled =
        PosesAtGridPoints(example.clip, example.keytimes_s, group.cells);
    const std::vector<Pose> blended = PosesAtGridPoints(group, library->layout(), weights);
    EXPECT_LE(comparison.Measure(sampled, blended).value().max_m, 1e-5) << "group " << g;
  }
}

}  // namespace
}  // namespace stridewire
