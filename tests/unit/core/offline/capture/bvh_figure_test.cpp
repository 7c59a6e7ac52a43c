// How the reader interprets figures from different programs: their root, legs, axes and positions.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "capture_files.h"
#include "stridewire/offline/bvh_reader.h"

namespace stridewire {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

// A figure in centimetres with y up. Text() returns it as a BVH file with the motions that
// Animate() has set.
class Figure {
 public:
  struct Local {
    DVec3 position = DVec3(0.0);  // Written for joints that move.
    DVec3 degrees = DVec3(0.0);   // About z, x and y, in this order.
  };

  int Add(const std::string& name, int parent, DVec3 offset, bool moves = false) {
    joints_.push_back({name, parent, offset, moves});
    return static_cast<int>(joints_.size()) - 1;
  }

  // Sets the local transform of a joint; without it, the joint stays at its offset.
  void Animate(int joint, std::function<Local(int frame)> motion) {
    joints_[static_cast<std::size_t>(joint)].motion = std::move(motion);
  }

  [[nodiscard]] std::string Text() const {
    std::string text = "HIERARCHY\n";
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      if (joints_[j].parent < 0) text += JointText(static_cast<int>(j));
    }
    text += "MOTION\nFrames: " + std::to_string(frames) + "\nFrame Time: 0.0333333\n";
    for (int f = 0; f < frames; ++f) {
      for (const int j : order_) text += Row(j, f);
      text += '\n';
    }
    order_.clear();
    return text;
  }

  int frames = 60;

 private:
  struct Node {
    std::string name;
    int parent = -1;
    DVec3 offset;
    bool moves = false;
    std::function<Local(int)> motion;
  };

  static std::string Numbers(const DVec3& v) {
    return std::to_string(v.x) + ' ' + std::to_string(v.y) + ' ' + std::to_string(v.z) + ' ';
  }

  std::string JointText(int j) const {
    const Node& node = joints_[static_cast<std::size_t>(j)];
    order_.push_back(j);
    std::string text = (node.parent < 0 ? "ROOT " : "JOINT ") + node.name + "\n{\nOFFSET " +
                       Numbers(node.offset) + "\nCHANNELS ";
    text += node.moves ? "6 Xposition Yposition Zposition " : "3 ";
    text += "Zrotation Xrotation Yrotation\n";
    for (std::size_t child = 0; child < joints_.size(); ++child) {
      if (joints_[child].parent == j) text += JointText(static_cast<int>(child));
    }
    return text + "}\n";
  }

  std::string Row(int j, int frame) const {
    const Node& node = joints_[static_cast<std::size_t>(j)];
    Local local;
    local.position = node.offset;
    if (node.motion) local = node.motion(frame);
    return (node.moves ? Numbers(local.position) : "") + Numbers(local.degrees);
  }

  std::vector<Node> joints_;
  mutable std::vector<int> order_;  // Joints in the order of the file.
};

// Adds a walking body below `hips`.
struct Body {
  int thigh[2], shin[2], foot[2], spine;
};
Body AddBody(Figure& figure, int hips) {
  Body body{};
  for (int side = 0; side < 2; ++side) {
    const std::string name = side == 0 ? "Left" : "Right";
    const double x = side == 0 ? 9.0 : -9.0;
    body.thigh[side] = figure.Add(name + "UpLeg", hips, DVec3(x, -4, 0));
    body.shin[side] = figure.Add(name + "Leg", body.thigh[side], DVec3(0, -42, 0));
    body.foot[side] = figure.Add(name + "Foot", body.shin[side], DVec3(0, -41, 0));
    figure.Add(name + "ToeBase", body.foot[side], DVec3(0, -5, 13));
    const double phase = side * std::numbers::pi;
    figure.Animate(body.thigh[side], [=](int f) {
      return Figure::Local{DVec3(0.0), DVec3(0, -25.0 * std::sin(0.2 * f + phase), 0)};
    });
    figure.Animate(body.shin[side], [=](int f) {
      return Figure::Local{DVec3(0.0), DVec3(0, 25.0 + 20.0 * std::cos(0.2 * f + phase), 0)};
    });
  }
  body.spine = figure.Add("Spine", hips, DVec3(0, 15, 0));
  const int chest = figure.Add("Chest", body.spine, DVec3(0, 25, 0));
  figure.Add("Head", chest, DVec3(0, 25, 2));
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "Left" : "Right";
    const int arm = figure.Add(name + "Arm", chest, DVec3(side * 18, 15, 0));
    figure.Add(name + "Hand", figure.Add(name + "ForeArm", arm, DVec3(side * 28, 0, 0)),
               DVec3(side * 25, 0, 0));
  }
  return body;
}

Figure::Local HipsMotion(int f) {
  return {DVec3(2.0 * std::sin(0.2 * f), 84.0 + 2.0 * std::cos(0.4 * f), 4.0 * f),
          DVec3(2.0 * std::cos(0.2 * f), 5.0, 8.0 * std::sin(0.2 * f))};
}

Figure PlainFigure() {
  Figure figure;
  const int hips = figure.Add("Hips", -1, DVec3(0, 90, 0), true);
  figure.Animate(hips, HipsMotion);
  AddBody(figure, hips);
  return figure;
}

Capture Read(const std::string& text, const BvhReadOptions& options = {}) {
  Expected<Capture> capture = ParseBvh(text, "figure.bvh", options);
  EXPECT_TRUE(capture.has_value()) << (capture ? "" : Describe(capture.error()));
  return capture ? std::move(*capture) : Capture{};
}

std::string ErrorOf(const std::string& text) {
  const Expected<Capture> capture = ParseBvh(text, "figure.bvh");
  return capture ? "none" : Describe(capture.error());
}

std::vector<std::string> Names(const Capture& capture) {
  std::vector<std::string> names;
  for (const Joint& joint : capture.skeleton.joints) names.push_back(joint.name);
  return names;
}

Vec3 PositionOf(const Capture& capture, int frame, const std::string& name) {
  const ConstPoseSpan pose = capture.clip.frame(frame);
  Vec3 position(0.0f);
  for (int j = capture.skeleton.FindJoint(name); j >= 0;
       j = capture.skeleton.joints[static_cast<std::size_t>(j)].parent) {
    position = pose.rotations[static_cast<std::size_t>(j)] * position;
    position += j == 0 ? pose.root_position_m
                       : capture.skeleton.joints[static_cast<std::size_t>(j)].offset_m;
  }
  return position;
}

// Returns the largest distance between joints of the same name.
double WorstPosition(const Capture& a, const Capture& b) {
  if (a.clip.frame_count() != b.clip.frame_count()) return 1e9;
  double worst = 0.0;
  for (int f = 0; f < a.clip.frame_count(); ++f) {
    for (const std::string& name : Names(a)) {
      if (b.skeleton.FindJoint(name) < 0) return 1e9;
      const Vec3 d = PositionOf(a, f, name) - PositionOf(b, f, name);
      worst = std::max(worst, static_cast<double>(glm::length(d)));
    }
  }
  return worst;
}

TEST(BvhFigure, MergesJointsAboveTheLegsIntoTheRoot) {
  const Capture plain = Read(PlainFigure().Text());
  for (const bool reference_moves : {false, true}) {
    Figure figure;
    const int reference = figure.Add("Reference", -1, DVec3(0.0), true);
    const int hips = figure.Add("Hips", reference, DVec3(0, 90, 0), true);
    figure.Animate(reference, [=](int f) {
      Figure::Local local;
      if (reference_moves) local.position = DVec3(0, 0, 4.0 * f);
      return local;
    });
    figure.Animate(hips, [=](int f) {
      Figure::Local local = HipsMotion(f);
      if (reference_moves) local.position.z = 0.0;
      return local;
    });
    AddBody(figure, hips);
    const Capture capture = Read(figure.Text());
    EXPECT_EQ(Names(capture), Names(plain));
    EXPECT_LT(WorstPosition(plain, capture), 1e-5);
    EXPECT_THAT(capture.notes, Contains(HasSubstr("the root of the figure is Hips")));
  }
}

// Blender exports a figure with z up below an armature that turns it to y up.
TEST(BvhFigure, AppliesAFixedRotationAboveTheRootToTheRestPose) {
  Figure figure;
  const int armature = figure.Add("Armature", -1, DVec3(0.0), true);
  figure.Animate(armature, [](int) { return Figure::Local{DVec3(0.0), DVec3(0, -90, 0)}; });
  const int hips = figure.Add("Hips", armature, DVec3(0, 0, 90), true);
  figure.Animate(hips, [](int f) {  // Moves along -y of the armature, which is z of the file.
    return Figure::Local{DVec3(0, -4.0 * f, 84), DVec3(0.0)};
  });
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "Left" : "Right";
    const int thigh = figure.Add(name + "UpLeg", hips, DVec3(side * 9, 0, -4));
    const int shin = figure.Add(name + "Leg", thigh, DVec3(0, 0, -42));
    const int foot = figure.Add(name + "Foot", shin, DVec3(0, 0, -41));
    figure.Add(name + "ToeBase", foot, DVec3(0, -13, -5));
  }
  figure.Add("Head", figure.Add("Spine", hips, DVec3(0, 0, 40)), DVec3(0, 0, 20));
  const Capture capture = Read(figure.Text());
  EXPECT_EQ(capture.up, BvhAxis::kPlusY);
  EXPECT_EQ(Names(capture).front(), "Hips");
  for (const int f : {0, 30}) {
    EXPECT_NEAR(glm::length(capture.clip.frame(f).root_position_m - Vec3(0, 0.84, 0.04 * f)), 0.0,
                1e-5);
    EXPECT_LT(AngleBetween(capture.clip.frame(f).rotations[0], kIdentityQuat), 1e-5);
    EXPECT_GT(PositionOf(capture, f, "LeftFoot").x, 0.08f);
    EXPECT_LT(PositionOf(capture, f, "LeftFoot").y, 0.05f);
  }
}

TEST(BvhFigure, LeavesOutPropsAboveTheLegs) {
  Figure figure;
  const int reference = figure.Add("Reference", -1, DVec3(0.0), true);
  const int hips = figure.Add("Hips", reference, DVec3(0, 90, 0), true);
  figure.Animate(hips, HipsMotion);
  AddBody(figure, hips);
  const int camera = figure.Add("Camera", reference, DVec3(0, 150, 300), true);
  figure.Add("CameraTarget", camera, DVec3(0, 0, -100));
  const int ik = figure.Add("ik_hand_root", reference, DVec3(0.0));
  figure.Add("ik_hand_l", ik, DVec3(50, 100, 0), true);
  const Capture plain = Read(PlainFigure().Text());
  const Capture capture = Read(figure.Text());
  EXPECT_EQ(Names(capture), Names(plain));
  EXPECT_LT(WorstPosition(plain, capture), 1e-5);
  EXPECT_THAT(capture.notes, Contains(HasSubstr("Camera above the legs is left out")));
  EXPECT_THAT(capture.notes, Contains(HasSubstr("ik_hand_root above the legs is left out")));
}

// The spine hangs on a joint above the pelvis, which then is the root.
TEST(BvhFigure, KeepsABodyThatHangsAboveTheLegs) {
  Figure figure;
  const int hips = figure.Add("Hips", -1, DVec3(0, 90, 0), true);
  figure.Animate(hips, HipsMotion);
  const int pelvis = figure.Add("Pelvis", hips, DVec3(0, -2, 0));
  figure.Animate(pelvis, [](int f) {
    return Figure::Local{DVec3(0.0), DVec3(0, 0, 10.0 * std::sin(0.3 * f))};
  });
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "Left" : "Right";
    const int thigh = figure.Add(name + "UpLeg", pelvis, DVec3(side * 9, -4, 0));
    const int foot = figure.Add(name + "Foot", figure.Add(name + "Leg", thigh, DVec3(0, -42, 0)),
                                DVec3(0, -41, 0));
    figure.Add(name + "ToeBase", foot, DVec3(0, -5, 13));
  }
  figure.Add("Head", figure.Add("Spine", hips, DVec3(0, 40, 0)), DVec3(0, 20, 0));
  const Capture capture = Read(figure.Text());
  EXPECT_EQ(Names(capture).front(), "Hips");
  EXPECT_GE(capture.skeleton.FindJoint("Pelvis"), 0);
  EXPECT_THAT(capture.notes, Not(Contains(HasSubstr("the root of the figure"))));

  // If the pelvis travels in its parent, it is the root, and the spine is attached to it.
  Figure moving;
  const int top = moving.Add("Top", -1, DVec3(0.0));
  const int root = moving.Add("Pelvis", top, DVec3(0, 90, 0), true);
  moving.Animate(root, HipsMotion);
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "Left" : "Right";
    const int thigh = moving.Add(name + "UpLeg", root, DVec3(side * 9, -4, 0));
    moving.Add(name + "Foot", moving.Add(name + "Leg", thigh, DVec3(0, -42, 0)), DVec3(0, -41, 0));
  }
  int spine = moving.Add("Spine", top, DVec3(0, 95, 0), true);
  moving.Animate(spine, [](int f) {
    Figure::Local local = HipsMotion(f);
    local.position.y += 1.0;  // At the hips, and turned like them.
    return local;
  });
  moving.Add("Head", moving.Add("Chest", spine, DVec3(0, 40, 0)), DVec3(0, 20, 0));
  const Capture attached = Read(moving.Text());
  EXPECT_EQ(Names(attached).front(), "Pelvis");
  EXPECT_EQ(attached.skeleton.joints[static_cast<std::size_t>(attached.skeleton.FindJoint("Spine"))]
                .parent,
            0);
  EXPECT_THAT(attached.notes, Contains(HasSubstr("Spine above the legs is attached")));
  EXPECT_NEAR(PositionOf(attached, 30, "Spine").z, PositionOf(attached, 30, "Pelvis").z, 0.002);
}

TEST(BvhFigure, RefusesPositionsOfTheBodyThatVary) {
  struct Case {
    const char* joint;
    double amplitude_cm;
    bool is_refused;
  };
  for (const Case& c :
       {Case{"LeftLeg", 1.5, false}, Case{"LeftLeg", 2.5, true}, Case{"Spine", 3.0, true},
        Case{"LeftForeArm", 3.0, true}, Case{"LeftHand", 10.0, false}}) {
    SCOPED_TRACE(c.joint);
    Figure figure;
    const int hips = figure.Add("Hips", -1, DVec3(0, 90, 0), true);
    figure.Animate(hips, HipsMotion);
    AddBody(figure, hips);
    std::string text = figure.Text();
    // Gives one joint position channels. Its numbers follow those of the joints before it.
    const std::string header = std::string("JOINT ") + c.joint + "\n{\nOFFSET ";
    const std::size_t at = text.find(header);
    ASSERT_NE(at, std::string::npos);
    const std::size_t channels = text.find("CHANNELS 3 ", at);
    text.replace(channels, 11, "CHANNELS 6 Xposition Yposition Zposition ");
    int before = 6;
    for (std::size_t j = text.find("JOINT"); j < at; j = text.find("JOINT", j + 1)) before += 3;
    double offset[3];
    ASSERT_EQ(std::sscanf(text.c_str() + at + header.size(), "%lf %lf %lf", offset, offset + 1,
                          offset + 2),
              3);
    std::size_t row = text.find('\n', text.find("Frame Time")) + 1;
    for (int f = 0; row < text.size(); ++f) {
      for (int number = 0; number < before; ++number) row = text.find(' ', row) + 1;
      const std::string numbers =
          std::to_string(offset[0]) + ' ' +
          std::to_string(offset[1] + (f % 2 == 0 ? 1.0 : -1.0) * c.amplitude_cm) + ' ' +
          std::to_string(offset[2]) + ' ';
      text.insert(row, numbers);
      row = text.find('\n', row) + 1;
    }
    const std::string error = ErrorOf(text);
    if (c.is_refused) {
      EXPECT_THAT(error, HasSubstr(std::string("the joint ") + c.joint + " moves by up to 0.0"));
      EXPECT_THAT(error, HasSubstr("export the motion without stretch"));
    } else {
      EXPECT_EQ(error, "none");
      EXPECT_THAT(Read(text).notes, Contains(HasSubstr("largest deviation")));
    }
  }
}

TEST(BvhFigure, ChoosesTheRootThatHasLegs) {
  const Capture plain = Read(PlainFigure().Text());
  for (const bool prop_first : {false, true}) {
    Figure figure;
    const auto add_prop = [&] {
      const int prop = figure.Add("Sword", -1, DVec3(0.0), true);
      figure.Add("Blade", prop, DVec3(0, 80, 0));
    };
    if (prop_first) add_prop();
    const int hips = figure.Add("Hips", -1, DVec3(0, 90, 0), true);
    figure.Animate(hips, HipsMotion);
    AddBody(figure, hips);
    if (!prop_first) add_prop();
    const Capture capture = Read(figure.Text());
    EXPECT_EQ(Names(capture), Names(plain));
    EXPECT_LT(WorstPosition(plain, capture), 1e-6);
    EXPECT_THAT(capture.notes, Contains(HasSubstr("the ROOT Sword is left out")));
  }
}

TEST(BvhFigure, KeepsTheUpAxisOfARestPoseThatStands) {
  // Lies on its back or front, or crawls with horizontal shins.
  for (const double tilt : {-90.0, 90.0}) {
    for (const bool crawls : {false, true}) {
      Figure figure;
      const int hips = figure.Add("Hips", -1, DVec3(0, 90, 0), true);
      figure.Animate(hips, [=](int f) {
        return Figure::Local{DVec3(0, crawls ? 45 : 12, crawls ? 2.0 * f : 0.0), DVec3(0, tilt, 0)};
      });
      const Body body = AddBody(figure, hips);
      for (const int side : {0, 1}) {
        figure.Animate(body.thigh[side], [=](int) {
          return Figure::Local{DVec3(0.0), DVec3(0, crawls ? -tilt : 0.0, 0)};
        });
        figure.Animate(body.shin[side], [=](int) {
          return Figure::Local{DVec3(0.0), DVec3(0, crawls ? 90.0 : 0.0, 0)};
        });
      }
      const Capture capture = Read(figure.Text());
      EXPECT_EQ(capture.up, BvhAxis::kPlusY);
      EXPECT_EQ(capture.up_source, UpSource::kRestPose);
      EXPECT_THAT(capture.notes, Contains(HasSubstr("up is taken as +y from the rest pose")));
      EXPECT_NEAR(capture.clip.frame(5).root_position_m.y, crawls ? 0.45 : 0.12, 1e-5);
    }
  }
}

// The rest pose has y up, but the world of the motion has z up: every frame turns the hips.
TEST(BvhFigure, FollowsAMotionThatStandsAlongAnotherAxis) {
  for (const double speed : {4.0, 0.0}) {
    Figure figure;
    const int hips = figure.Add("Hips", -1, DVec3(0, 0, 90), true);
    figure.Animate(hips,
                   [=](int f) { return Figure::Local{DVec3(0, -speed * f, 84), DVec3(0, 90, 0)}; });
    AddBody(figure, hips);
    const Capture capture = Read(figure.Text());
    EXPECT_EQ(capture.up, BvhAxis::kPlusZ);
    EXPECT_NEAR(capture.clip.frame(5).root_position_m.y, 0.84, 1e-5);
    EXPECT_THAT(capture.notes, Contains(HasSubstr("the up axis of the file is +z")));
  }
}

// The rotation of a joint above the hips does not belong to the rest pose if the hips undo it.
TEST(BvhFigure, IgnoresAFixedRotationThatTheHipsUndo) {
  for (const bool lies : {false, true}) {
    Figure figure;
    const int reference = figure.Add("Reference", -1, DVec3(0.0), true);
    figure.Animate(reference, [](int) { return Figure::Local{DVec3(0.0), DVec3(0, -90, 0)}; });
    const int hips = figure.Add("Hips", reference, DVec3(0, 0, 90), true);
    figure.Animate(hips, [=](int f) {  // y and z of the file are z and -y of the reference.
      return Figure::Local{DVec3(0, lies ? 0.0 : -4.0 * f, lies ? 5 : 84),
                           DVec3(0, lies ? 0 : 90, 0)};
    });
    const Body body = AddBody(figure, hips);
    if (lies) {  // Keeps the legs on the floor.
      for (const int side : {0, 1}) {
        figure.Animate(body.thigh[side], nullptr);
        figure.Animate(body.shin[side], nullptr);
      }
    }
    const Capture capture = Read(figure.Text());
    EXPECT_EQ(capture.up, BvhAxis::kPlusY) << lies;
    EXPECT_NEAR(capture.clip.frame(9).root_position_m.y, lies ? 0.05 : 0.84, 1e-5);
  }
}

// Bones of some rigs all point along one axis at rest, so that hands are level with the feet.
TEST(BvhFigure, ReadsARestPoseWhoseBonesPointAlongOneAxis) {
  Figure figure;
  const int hips = figure.Add("Hips", -1, DVec3(0, 90, 0), true);
  figure.Animate(hips, [](int f) { return Figure::Local{DVec3(0, 84, 4.0 * f), DVec3(0.0)}; });
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "Left" : "Right";
    const int thigh = figure.Add(name + "UpLeg", hips, DVec3(side * 9, -4, 0));
    figure.Animate(thigh, [](int) { return Figure::Local{DVec3(0.0), DVec3(-90, 0, 0)}; });
    const int foot = figure.Add(name + "Foot", figure.Add(name + "Leg", thigh, DVec3(42, 0, 0)),
                                DVec3(41, 0, 0));
    figure.Add(name + "ToeBase", foot, DVec3(5, 0, 13));
  }
  const int spine = figure.Add("Spine", hips, DVec3(20, 0, 0));
  figure.Animate(spine, [](int) { return Figure::Local{DVec3(0.0), DVec3(90, 0, 0)}; });
  const int chest = figure.Add("Chest", spine, DVec3(30, 0, 0));
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "Left" : "Right";
    const int arm = figure.Add(name + "Arm", chest, DVec3(0, 0, side * 18));
    figure.Animate(arm, [](int) { return Figure::Local{DVec3(0.0), DVec3(180, 0, 0)}; });
    figure.Add(name + "Hand", figure.Add(name + "ForeArm", arm, DVec3(28, 0, 0)), DVec3(12, 0, 0));
  }
  const Capture capture = Read(figure.Text());
  EXPECT_EQ(capture.up, BvhAxis::kPlusY);
  EXPECT_EQ(capture.up_source, UpSource::kMotion);
  EXPECT_NEAR(PositionOf(capture, 0, "LeftFoot").y, -0.03, 0.005);
}

TEST(BvhFigure, FindsLeftAndRightOfLegsThatStartAtTheSamePoint) {
  Figure figure;
  const int hips = figure.Add("Hips", -1, DVec3(0, 90, 0), true);
  figure.Animate(hips, HipsMotion);
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "Left" : "Right";
    const int thigh = figure.Add(name + "UpLeg", hips, DVec3(0, -4, 0));
    figure.Animate(thigh, [=](int) { return Figure::Local{DVec3(0.0), DVec3(side * 5, 0, 0)}; });
    figure.Add(name + "Foot", figure.Add(name + "Leg", thigh, DVec3(0, -42, 0)), DVec3(0, -41, 0));
  }
  const Capture capture = Read(figure.Text());
  EXPECT_GT(PositionOf(capture, 0, "LeftFoot").x, PositionOf(capture, 0, "RightFoot").x + 0.05f);
}

TEST(BvhFigure, ReadsTheExampleCases) {
  const std::filesystem::path folder = MocapDir().parent_path() / "cases";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no cases at " << folder;
  const auto read = [&](const char* name) { return ReadBvh(folder / name); };
  const Expected<Capture> base = read("m00_base.bvh");
  ASSERT_TRUE(base.has_value());
  struct Case {
    const char* name;
    const char* note;
  };
  for (const Case& c : {Case{"m01_root_static.bvh", "contains the motion of Reference"},
                        Case{"m15_decimal_comma.bvh", "decimal points"},
                        Case{"m16_frames_0.bvh", "Frames: declares 0 frames"},
                        Case{"m18_second_root.bvh", "is left out"}}) {
    const Expected<Capture> capture = read(c.name);
    ASSERT_TRUE(capture.has_value()) << Describe(capture.error());
    EXPECT_LT(WorstPosition(*base, *capture), 1e-6) << c.name;
    EXPECT_EQ(Names(*base), Names(*capture)) << c.name;
    EXPECT_THAT(capture->notes, Contains(HasSubstr(c.note))) << c.name;
  }
  const Expected<Capture> one_leg = read("m14_one_leg.bvh");
  ASSERT_FALSE(one_leg.has_value());
  EXPECT_THAT(one_leg.error().text, HasSubstr("no left leg"));
  const Expected<Capture> lying = read("m19_lying.bvh");
  ASSERT_TRUE(lying.has_value());
  EXPECT_EQ(lying->up, BvhAxis::kPlusY);
}

}  // namespace
}  // namespace stridewire
