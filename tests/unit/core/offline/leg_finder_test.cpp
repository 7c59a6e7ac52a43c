#include "offline/capture/leg_finder.h"

#include <gtest/gtest.h>

namespace stridewire {
namespace {

TEST(LegFinder, RecognizesNamesOfManyPrograms) {
  struct Case {
    const char* name;
    Side side;
    LegPart part;
  };
  const Case cases[] = {
      {"LeftUpLeg", Side::kLeft, LegPart::kHip},
      {"LeftLeg", Side::kLeft, LegPart::kKnee},
      {"LeftFoot", Side::kLeft, LegPart::kAnkle},
      {"LeftToeBase", Side::kLeft, LegPart::kBall},
      {"mixamorig:RightUpLeg", Side::kRight, LegPart::kHip},
      {"mixamorig:RightToe_End", Side::kRight, LegPart::kNone},
      {"LeftHip", Side::kLeft, LegPart::kHip},
      {"LeftKnee", Side::kLeft, LegPart::kKnee},
      {"LeftAnkle", Side::kLeft, LegPart::kAnkle},
      {"RightToe", Side::kRight, LegPart::kBall},
      {"lfemur", Side::kLeft, LegPart::kHip},
      {"rtibia", Side::kRight, LegPart::kKnee},
      {"lfoot", Side::kLeft, LegPart::kAnkle},
      {"rtoes", Side::kRight, LegPart::kBall},
      {"lThigh", Side::kLeft, LegPart::kHip},
      {"rShin", Side::kRight, LegPart::kKnee},
      {"Bip01 L Thigh", Side::kLeft, LegPart::kHip},
      {"Bip01 R Calf", Side::kRight, LegPart::kKnee},
      {"Bip01 L Toe0", Side::kLeft, LegPart::kBall},
      {"thigh_l", Side::kLeft, LegPart::kHip},
      {"calf_r", Side::kRight, LegPart::kKnee},
      {"ball_l", Side::kLeft, LegPart::kBall},
      {"DEF-shin.R.001", Side::kRight, LegPart::kKnee},
      {"foot.L", Side::kLeft, LegPart::kAnkle},
      {"leftfoot", Side::kLeft, LegPart::kAnkle},
      {"right_upper_leg", Side::kRight, LegPart::kHip},
      {"LeftLowerLeg", Side::kLeft, LegPart::kKnee},
      {"LHipJoint", Side::kLeft, LegPart::kHip},
      {"lhipjoint", Side::kLeft, LegPart::kNone},
      {"Hips", Side::kNone, LegPart::kNone},
      {"thigh_twist_01_l", Side::kLeft, LegPart::kNone},
      {"LeftFootIK", Side::kLeft, LegPart::kNone},
      {"LeftForeArm", Side::kLeft, LegPart::kNone},
      {"RightHand", Side::kRight, LegPart::kNone},
      {"LeftShoulder", Side::kLeft, LegPart::kNone},
      {"leg", Side::kNone, LegPart::kNone},
      {"", Side::kNone, LegPart::kNone},
  };
  for (const Case& c : cases) {
    EXPECT_EQ(static_cast<int>(ReadLegName(c.name).part), static_cast<int>(c.part)) << c.name;
    if (c.part != LegPart::kNone) {
      EXPECT_EQ(static_cast<int>(ReadLegName(c.name).side), static_cast<int>(c.side)) << c.name;
    }
  }
}

// A hip joint of length zero above the thigh, and a twist joint inside the thigh.
TEST(LegFinder, IgnoresHelperJointsOfTheThigh) {
  std::vector<Joint> joints = {{"Hips", -1, Vec3(0.0f)}};
  for (const std::string side : {"Left", "Right"}) {
    const float x = side == "Left" ? 0.1f : -0.1f;
    const int at = static_cast<int>(joints.size());
    joints.push_back({side.substr(0, 1) + "HipJoint", 0, Vec3(0.0f)});
    joints.push_back({side + "UpLeg", at, Vec3(x, -0.1f, 0)});
    joints.push_back({side + "UpLegRoll", at + 1, Vec3(0, -0.2f, 0)});
    joints.push_back({side + "Leg", at + 2, Vec3(0, -0.2f, 0)});
    joints.push_back({side + "Foot", at + 3, Vec3(0, -0.4f, 0)});
    joints.push_back({side + "ToeBase", at + 4, Vec3(0, -0.05f, 0.1f)});
    joints.push_back({side + "FootIK", 0, Vec3(x, -0.9f, 0)});
  }
  FoundLegs legs;
  ASSERT_TRUE(FindLegsByName(joints, legs));
  for (int side = 0; side < 2; ++side) {
    const int at = side == 0 ? 1 : 8;
    EXPECT_EQ(legs.legs[side].hip, at + 1);
    EXPECT_EQ(legs.legs[side].knee, at + 3);
    EXPECT_EQ(legs.legs[side].ankle, at + 4);
    EXPECT_EQ(legs.legs[side].ball, at + 5);
  }
}

// Without names, arms are also a pair of equal chains, but farther from the root than legs.
TEST(LegFinder, DistinguishesLegsFromArmsByShape) {
  std::vector<Joint> joints = {{"0", -1, Vec3(0.0f)}};
  const auto add = [&](int parent, Vec3 offset) {
    joints.push_back({std::to_string(joints.size()), parent, offset});
    return static_cast<int>(joints.size()) - 1;
  };
  int chest = add(0, Vec3(0, 0.4f, 0));
  for (const float x : {1.0f, -1.0f})
    add(add(add(add(chest, Vec3(x * 0.2f, 0.1f, 0)), Vec3(x * 0.6f, 0, 0)), Vec3(x * 0.6f, 0, 0)),
        Vec3(x * 0.2f, 0, 0));
  const int first_leg = static_cast<int>(joints.size());
  for (const float x : {1.0f, -1.0f})
    add(add(add(add(0, Vec3(x * 0.1f, 0, 0)), Vec3(0, -0.42f, 0)), Vec3(0, -0.41f, 0)),
        Vec3(0, -0.05f, 0.13f));
  FoundLegs legs;
  ASSERT_TRUE(FindLegsByShape(joints, legs));
  EXPECT_FALSE(legs.sides_known);
  EXPECT_EQ(legs.legs[0].hip, first_leg);
  EXPECT_EQ(legs.legs[0].ball, first_leg + 3);
  EXPECT_EQ(legs.legs[1].hip, first_leg + 4);

  // A single leg is not a pair.
  joints.resize(static_cast<std::size_t>(first_leg) + 4);
  joints.erase(joints.begin() + 6, joints.begin() + 10);  // Removes an arm as well.
  for (Joint& joint : joints) {
    if (joint.parent >= 6) joint.parent -= 4;
  }
  EXPECT_FALSE(FindLegsByShape(joints, legs));
  EXPECT_FALSE(FindLegsByName(joints, legs));
}

}  // namespace
}  // namespace stridewire
