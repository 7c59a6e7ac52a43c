#include "offline/capture/leg_finder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "offline/capture/leg_names.h"

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
      {"mixamorig_LeftUpLeg", Side::kLeft, LegPart::kHip},
      {"mixamorig_LeftLeg", Side::kLeft, LegPart::kKnee},
      {"mixamorigRightFoot", Side::kRight, LegPart::kAnkle},
      {"CC_Base_L_Thigh", Side::kLeft, LegPart::kHip},
      {"CC_Base_R_Calf", Side::kRight, LegPart::kKnee},
      {"CC_Base_L_Foot", Side::kLeft, LegPart::kAnkle},
      {"CC_Base_L_ToeBase", Side::kLeft, LegPart::kBall},
      {"CC_Base_L_CalfTwist01", Side::kLeft, LegPart::kNone},
      {"CC_Base_L_KneeShareBone", Side::kLeft, LegPart::kNone},
      {"Character1_LeftFoot", Side::kLeft, LegPart::kAnkle},
      {"Robot_LeftFoot", Side::kLeft, LegPart::kAnkle},
      {"Robot_LeftLeg", Side::kLeft, LegPart::kKnee},
      {"R_Rig_L_Foot", Side::kLeft, LegPart::kAnkle},
      {"J_Bip_L_UpperLeg", Side::kLeft, LegPart::kHip},
      {"J_Bip_L_LowerLeg", Side::kLeft, LegPart::kKnee},
      {"J_Bip_R_Foot", Side::kRight, LegPart::kAnkle},
      {"J_Bip_L_ToeBase", Side::kLeft, LegPart::kBall},
      {"J_Sec_L_SkirtFront1_01", Side::kLeft, LegPart::kNone},
      {"ValveBiped.Bip01_L_Calf", Side::kLeft, LegPart::kKnee},
      {"Bip001 R Foot", Side::kRight, LegPart::kAnkle},
      {"Bip001 L Toe0Nub", Side::kLeft, LegPart::kNone},
      {"AnkleLeft", Side::kLeft, LegPart::kAnkle},
      {"KneeRight", Side::kRight, LegPart::kKnee},
      {"HIP_LEFT", Side::kLeft, LegPart::kHip},
      {"FOOT_RIGHT", Side::kRight, LegPart::kAnkle},
      {"footright", Side::kRight, LegPart::kAnkle},
      {"LeftThigh", Side::kLeft, LegPart::kHip},
      {"LeftShin", Side::kLeft, LegPart::kKnee},
      {"LeftToeTip", Side::kLeft, LegPart::kNone},
      {"upperleg01.L", Side::kLeft, LegPart::kHip},
      {"lowerleg02.R", Side::kRight, LegPart::kKnee},
      {"toe1-1.L", Side::kLeft, LegPart::kBall},
      {"Left leg", Side::kLeft, LegPart::kKnee},
      {"Left ankle", Side::kLeft, LegPart::kAnkle},
      {"thigh.L", Side::kLeft, LegPart::kHip},
      {"calf_twist_01_l", Side::kLeft, LegPart::kNone},
      {"LeftLegTwist", Side::kLeft, LegPart::kNone},
      {"LeftUpLegRoll", Side::kLeft, LegPart::kNone},
      {"LeafLeftUpLegRoll1", Side::kLeft, LegPart::kNone},
      {"ik_foot_l", Side::kLeft, LegPart::kNone},
      {"LeftFoot_jnt", Side::kLeft, LegPart::kAnkle},
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
  const Expected<FoundLegs> found = FindLegs(RestShape(joints));
  ASSERT_TRUE(found.has_value());
  const FoundLegs& legs = *found;
  EXPECT_FALSE(legs.by_shape);
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
  const Expected<FoundLegs> found = FindLegs(RestShape(joints));
  ASSERT_TRUE(found.has_value());
  const FoundLegs& legs = *found;
  EXPECT_TRUE(legs.by_shape);
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
  EXPECT_FALSE(FindLegs(RestShape(joints)).has_value());
}

// A figure whose joints are added one by one, with poses in which chosen joints are bent.
class FigureSketch {
 public:
  int Add(const std::string& name, int parent, Vec3 offset) {
    joints_.push_back({name, parent, offset});
    return static_cast<int>(joints_.size()) - 1;
  }

  /// Adds a pose in which joint `name` turns by an angle about the x axis, with all joints below.
  void AddPose(const std::vector<std::pair<std::string, double>>& bends) {
    FigureShape shape = RestShape(joints_);
    std::vector<DQuat> world(joints_.size(), DQuat(1.0, 0.0, 0.0, 0.0));
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      if (joints_[j].parent >= 0) {
        const auto parent = static_cast<std::size_t>(joints_[j].parent);
        shape.rest[j] = shape.rest[parent] + world[parent] * DVec3(joints_[j].offset_m);
        world[j] = world[parent];
      }
      for (const auto& [name, angle] : bends) {
        if (name != joints_[j].name) continue;
        world[j] = world[j] * DQuat(std::cos(0.5 * angle), std::sin(0.5 * angle), 0.0, 0.0);
      }
    }
    poses_.push_back(shape.rest);
  }

  [[nodiscard]] FigureShape Shape() const {
    FigureShape shape = RestShape(joints_);
    shape.poses = poses_;
    return shape;
  }
  [[nodiscard]] std::string Name(int j) const {
    return j < 0 ? "none" : joints_[static_cast<std::size_t>(j)].name;
  }
  [[nodiscard]] std::string LegNames(const FoundLeg& leg) const {
    return Name(leg.hip) + ' ' + Name(leg.knee) + ' ' + Name(leg.ankle) + ' ' + Name(leg.ball);
  }

 private:
  std::vector<Joint> joints_;
  std::vector<std::vector<DVec3>> poses_;
};

struct LegSegment {
  std::string name;
  float length;
};

// Adds two straight legs with feet. "*" in a name stands for the side, "Left" or "Right".
void AddLegs(FigureSketch& figure, const std::vector<LegSegment>& segments) {
  for (const std::string side : {"Left", "Right"}) {
    int parent = 0;
    float above = 0.0f;
    for (const LegSegment& segment : segments) {
      std::string name = segment.name;
      if (const std::size_t at = name.find('*'); at != std::string::npos) name.replace(at, 1, side);
      const Vec3 offset =
          parent == 0 ? Vec3(side == "Left" ? 0.1f : -0.1f, -0.05f, 0) : Vec3(0, -above, 0);
      parent = figure.Add(name, parent, offset);
      above = segment.length;
    }
    figure.Add("Toe" + side, parent, Vec3(0, -0.06f, 0.14f));
  }
}

void AddUpperBody(FigureSketch& figure) {
  int spine = figure.Add("S0", 0, Vec3(0, 0.2f, 0));
  spine = figure.Add("S1", spine, Vec3(0, 0.25f, 0));
  for (const float x : {1.0f, -1.0f}) {  // Arms hang down.
    const std::string side = x > 0.0f ? "A" : "B";
    int arm = figure.Add(side + "0", spine, Vec3(x * 0.1f, 0, 0));
    arm = figure.Add(side + "1", arm, Vec3(x * 0.1f, 0, 0));
    arm = figure.Add(side + "2", arm, Vec3(0, -0.3f, 0));
    figure.Add(side + "3", arm, Vec3(0, -0.25f, 0));
  }
}

TEST(LegFinder, SkipsTwistJointsWithoutNames) {
  for (const bool bends : {false, true}) {
    FigureSketch figure;
    figure.Add("0", -1, Vec3(0.0f));
    AddLegs(figure, {{"*a", 0.21f}, {"*b", 0.21f}, {"*c", 0.2f}, {"*d", 0.2f}, {"*e", 0.0f}});
    AddUpperBody(figure);
    for (int f = 0; bends && f < 20; ++f) {
      const double knee = 0.05 * f;
      figure.AddPose({{"Lefta", -0.5 * knee}, {"Leftc", knee}, {"Righta", 0.3}, {"Rightc", 0.6}});
    }
    const Expected<FoundLegs> legs = FindLegs(figure.Shape());
    ASSERT_TRUE(legs.has_value()) << Describe(legs.error());
    EXPECT_TRUE(legs->by_shape);
    EXPECT_TRUE(legs->sides_known) << "the names contain the sides";
    EXPECT_EQ(figure.LegNames(legs->legs[0]), "Lefta Leftc Lefte ToeLeft");
    EXPECT_EQ(figure.LegNames(legs->legs[1]), "Righta Rightc Righte ToeRight");
  }
}

TEST(LegFinder, TakesTheJointThatBendsOfSeveralWithTheNameOfAKnee) {
  FigureSketch figure;
  figure.Add("Hips", -1, Vec3(0.0f));
  AddLegs(
      figure,
      {{"*UpLeg", 0.21f}, {"*UpLeg1", 0.21f}, {"*Leg", 0.2f}, {"*Leg1", 0.2f}, {"*Foot", 0.0f}});
  EXPECT_EQ(figure.LegNames(FindLegs(figure.Shape())->legs[0]),
            "LeftUpLeg LeftLeg LeftFoot ToeLeft");
  for (int f = 0; f < 20; ++f) figure.AddPose({{"LeftLeg", 0.05 * f}, {"RightLeg", 0.04 * f}});
  const Expected<FoundLegs> legs = FindLegs(figure.Shape());
  ASSERT_TRUE(legs.has_value());
  EXPECT_EQ(figure.LegNames(legs->legs[0]), "LeftUpLeg LeftLeg LeftFoot ToeLeft");
  EXPECT_EQ(figure.LegNames(legs->legs[1]), "RightUpLeg RightLeg RightFoot ToeRight");
}

// Some rigs call the thigh "leg" and the shin "knee".
TEST(LegFinder, AcceptsALegAboveAKnee) {
  FigureSketch figure;
  figure.Add("Hips", -1, Vec3(0.0f));
  AddLegs(figure, {{"* leg", 0.42f}, {"* knee", 0.4f}, {"* ankle", 0.0f}});
  for (int f = 0; f < 20; ++f) {
    figure.AddPose({{"Left leg", 0.08 * f}, {"Left knee", 0.03 * f}, {"Right knee", 0.3}});
  }
  const Expected<FoundLegs> legs = FindLegs(figure.Shape());
  ASSERT_TRUE(legs.has_value());
  EXPECT_EQ(figure.LegNames(legs->legs[0]), "Left leg Left knee Left ankle ToeLeft");
}

TEST(LegFinder, RefusesAFigureWithOneLeg) {
  for (const bool named_arms : {false, true}) {
    FigureSketch figure;
    figure.Add("Hips", -1, Vec3(0.0f));
    int leg = figure.Add("RightUpLeg", 0, Vec3(-0.1f, 0, 0));
    leg = figure.Add("RightLeg", leg, Vec3(0, -0.42f, 0));
    figure.Add("RightFoot", leg, Vec3(0, -0.42f, 0));
    if (named_arms) {
      for (const std::string side : {"Left", "Right"}) {
        int arm = figure.Add(side + "Arm", 0, Vec3(side == "Left" ? 0.2f : -0.2f, 0.5f, 0));
        arm = figure.Add(side + "ForeArm", arm, Vec3(0, -0.6f, 0));
        figure.Add(side + "Hand", arm, Vec3(0, -0.9f, 0));
      }
    } else {
      AddUpperBody(figure);
    }
    const Expected<FoundLegs> legs = FindLegs(figure.Shape());
    ASSERT_FALSE(legs.has_value());
    EXPECT_EQ(legs.error().code, ErrorCode::kUnsupported);
    EXPECT_THAT(legs.error().text, testing::HasSubstr("has a right leg, but no left leg"));
  }
}

TEST(LegFinder, DoesNotTakeHangingArmsForLegs) {
  FigureSketch figure;
  figure.Add("0", -1, Vec3(0.0f));
  AddUpperBody(figure);
  figure.Add("1", figure.Add("2", figure.Add("3", 0, Vec3(0, -0.1f, 0)), Vec3(0, -0.4f, 0)),
             Vec3(0, -0.4f, 0));
  figure.AddPose({{"A2", 0.3}});
  EXPECT_FALSE(FindLegs(figure.Shape()).has_value());
}

// A figure that hangs by its arms with drawn-up legs stands in the rest pose.
TEST(LegFinder, DoesNotTakeArmsThatCarryTheBodyForLegs) {
  FigureSketch figure;
  figure.Add("0", -1, Vec3(0.0f));
  AddLegs(figure, {{"*a", 0.42f}, {"*b", 0.42f}, {"*c", 0.0f}});
  AddUpperBody(figure);
  for (int f = 0; f < 5; ++f) {
    figure.AddPose({{"A2", 3.1},
                    {"B2", 3.1},
                    {"Lefta", -1.6},
                    {"Righta", -1.6},
                    {"Leftb", 2.6},
                    {"Rightb", 2.6}});
  }
  const Expected<FoundLegs> legs = FindLegs(figure.Shape());
  ASSERT_TRUE(legs.has_value()) << Describe(legs.error());
  EXPECT_EQ(figure.LegNames(legs->legs[0]), "Lefta Leftb Leftc ToeLeft");
}

TEST(LegFinder, RefusesFiguresWithManyLegs) {
  for (const bool named : {false, true}) {
    FigureSketch crab;
    crab.Add("Body", -1, Vec3(0.0f));
    for (int pair = 0; pair < 4; ++pair) {
      for (const float x : {1.0f, -1.0f}) {
        const std::string name = (x > 0 ? "Left" : "Right") + std::to_string(pair);
        const auto label = [&](const char* part) {
          return named ? name + part : std::to_string(pair) + (x > 0 ? "x" : "y") + part[0];
        };
        int leg = crab.Add(label("UpLeg"), 0, Vec3(x * 0.1f, 0, 0.2f * static_cast<float>(pair)));
        leg = crab.Add(label("Leg"), leg, Vec3(x * 0.2f, -0.1f, 0));
        leg = crab.Add(label("Foot"), leg, Vec3(x * 0.1f, -0.3f, 0));
        crab.Add(label("Toe"), leg, Vec3(x * 0.05f, -0.1f, 0));
      }
    }
    const Expected<FoundLegs> legs = FindLegs(crab.Shape());
    ASSERT_FALSE(legs.has_value()) << named;
    EXPECT_THAT(legs.error().text, testing::HasSubstr("more than two legs"));
  }
}

// A dog whose joints have the names of a person: its hands stand on the ground.
TEST(LegFinder, RefusesAFigureOnHandsAndFeet) {
  for (const float hand_y : {-0.8f, -0.2f}) {
    FigureSketch figure;
    figure.Add("Hips", -1, Vec3(0.0f));
    AddLegs(figure, {{"*UpLeg", 0.4f}, {"*Leg", 0.4f}, {"*Foot", 0.0f}});
    const int spine = figure.Add("Spine", 0, Vec3(0, 0, 0.8f));
    for (const std::string side : {"Left", "Right"}) {
      const int arm = figure.Add(side + "Arm", spine, Vec3(side == "Left" ? 0.1f : -0.1f, 0, 0));
      figure.Add(side + "Hand", arm, Vec3(0, hand_y, 0));
    }
    const Expected<FoundLegs> legs = FindLegs(figure.Shape());
    EXPECT_EQ(legs.has_value(), hand_y > -0.5f);
    if (!legs) {
      EXPECT_THAT(legs.error().text, testing::HasSubstr("on hands and feet"));
    }
  }
}

// In rigs whose joints have their x axis along the bone, the rest pose is a bundle of parallel
// bones. In this pose, the hands are beside the feet, but that does not mean that the figure stands
// on them.
TEST(LegFinder, AcceptsRigsWhoseBonesAreParallel) {
  FigureSketch figure;
  figure.Add("Hips", -1, Vec3(0.0f));
  const int spine = figure.Add("Spine", 0, Vec3(0.4f, 0, 0));
  for (const std::string side : {"Left", "Right"}) {
    const float z = side == "Left" ? 0.1f : -0.1f;
    int leg = figure.Add(side + "UpLeg", 0, Vec3(0, 0, z));
    leg = figure.Add(side + "Leg", leg, Vec3(0.4f, 0, 0));
    figure.Add(side + "Foot", leg, Vec3(0.4f, 0, 0));
    int arm = figure.Add(side + "Arm", spine, Vec3(0, 0, 2.0f * z));
    arm = figure.Add(side + "ForeArm", arm, Vec3(0.3f, 0, 0));
    figure.Add(side + "Hand", arm, Vec3(0.3f, 0, 0));
  }
  const Expected<FoundLegs> legs = FindLegs(figure.Shape());
  ASSERT_TRUE(legs.has_value()) << Describe(legs.error());
  EXPECT_FALSE(legs->by_shape);
}

}  // namespace
}  // namespace stridewire
