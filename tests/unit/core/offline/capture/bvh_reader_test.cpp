#include "stridewire/offline/bvh_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>

#include "bvh_text.h"

namespace stridewire {
namespace {

using test::BvhText;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

std::vector<Vec3> Positions(const Capture& capture, int frame) {
  const ConstPoseSpan pose = capture.clip.frame(frame);
  const std::size_t count = capture.skeleton.joints.size();
  std::vector<Vec3> positions(count);
  std::vector<Quat> world(count);
  for (std::size_t j = 0; j < count; ++j) {
    const Joint& joint = capture.skeleton.joints[j];
    const auto parent = static_cast<std::size_t>(std::max(joint.parent, 0));
    positions[j] =
        j == 0 ? pose.root_position_m : positions[parent] + world[parent] * joint.offset_m;
    world[j] = j == 0 ? pose.rotations[0] : world[parent] * pose.rotations[j];
  }
  return positions;
}

Vec3 Point(const Capture& capture, int frame, int joint, Vec3 point) {
  const ConstPoseSpan pose = capture.clip.frame(frame);
  for (int j = joint; j >= 0; j = capture.skeleton.joints[static_cast<std::size_t>(j)].parent) {
    point = pose.rotations[static_cast<std::size_t>(j)] * point;
    point += j == 0 ? pose.root_position_m
                    : capture.skeleton.joints[static_cast<std::size_t>(j)].offset_m;
  }
  return point;
}

double Quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

const std::string& JointName(const Capture& capture, int joint) {
  return capture.skeleton.joints[static_cast<std::size_t>(joint)].name;
}

// Expects properties that every recording of an upright person has.
void ExpectUprightPerson(const Capture& capture) {
  ASSERT_TRUE(capture.skeleton.Validate().has_value());
  ASSERT_TRUE(capture.clip.Validate().has_value());
  const Leg& left = capture.skeleton.leg(Foot::kLeft);
  const Leg& right = capture.skeleton.leg(Foot::kRight);
  std::vector<double> hips, facing, ankles[2], balls[2], heads;
  int head = 0;
  for (int j = 0; j < capture.skeleton.joint_count(); ++j) {
    std::string name = JointName(capture, j);
    std::transform(name.begin(), name.end(), name.begin(),
                   [](char c) { return static_cast<char>(std::tolower(c)); });
    if (name == "head") head = j;
  }
  ASSERT_GT(head, 0);
  for (int f = capture.first_frame; f < capture.clip.frame_count(); ++f) {
    const std::vector<Vec3> p = Positions(capture, f);
    hips.push_back(p[0].y);
    double lowest = 1e9;
    heads.push_back(p[static_cast<std::size_t>(head)].y - p[0].y);
    Vec3 feet(0.0f);
    for (int side = 0; side < 2; ++side) {
      const Leg& leg = side == 0 ? left : right;
      const Vec3 ankle = p[static_cast<std::size_t>(leg.ankle)];
      const Vec3 ball = Point(capture, f, leg.ball, leg.ball_offset_m);
      const Vec3 tip = Point(capture, f, leg.ball, leg.toe_tip_offset_m);
      ankles[side].push_back(ankle.y);
      balls[side].push_back(ball.y);
      lowest = std::min(lowest, static_cast<double>(ball.y));
      feet += tip - ankle;
    }
    hips.back() -= lowest;
    const Vec3 front = capture.clip.frame(f).rotations[0] * Vec3(0, 0, 1);
    const Vec3 left_hand = capture.clip.frame(f).rotations[0] * Vec3(1, 0, 0);
    facing.push_back((front.x * feet.x + front.z * feet.z) /
                     (std::hypot(front.x, front.z) * std::hypot(feet.x, feet.z)));
    const Vec3 across =
        p[static_cast<std::size_t>(left.hip)] - p[static_cast<std::size_t>(right.hip)];
    ASSERT_GT(glm::dot(across, left_hand), 0.1f) << "frame " << f;
    ASSERT_LT(glm::length(across), 0.35f);
  }
  // Heights are above the lower ball, since some figures climb.
  EXPECT_GT(Quantile(hips, 0.5), 0.78);
  EXPECT_LT(Quantile(hips, 0.5), 1.06);
  EXPECT_GT(Quantile(heads, 0.5), 0.33);
  EXPECT_GT(Quantile(facing, 0.5), 0.9) << "feet and root must face in the same direction";
  for (int side = 0; side < 2; ++side) {
    // The floor is at y = 0, or a block stands on it. Ankles are above balls.
    EXPECT_GT(Quantile(balls[side], 0.05), -0.01);
    EXPECT_LT(Quantile(balls[side], 0.05), 0.25);
    EXPECT_GT(Quantile(ankles[side], 0.5) - Quantile(balls[side], 0.5), 0.01);
    EXPECT_LT(Quantile(ankles[side], 0.5) - Quantile(balls[side], 0.5), 0.1);
    const Leg& leg = side == 0 ? left : right;
    const auto length = [&](int j) {
      return glm::length(capture.skeleton.joints[static_cast<std::size_t>(j)].offset_m);
    };
    EXPECT_NEAR(length(leg.knee), 0.42, 0.08);
    EXPECT_NEAR(length(leg.ankle), 0.42, 0.08);
  }
}

struct FileFacts {
  const char* path;
  int joints, frames;
  double fps, unit_m;
  int first_frame;
  const char* left_leg;  // Hip, knee, ankle and ball.
};
constexpr double kCmuUnit = 0.0254 / 0.45;

TEST(ReadBvh, ReadsAllSharedCaptures) {
  const std::vector<std::filesystem::path> paths = test::SharedCaptures();
  if (paths.empty()) GTEST_SKIP() << "no captures at " << MocapDir();
  EXPECT_GE(paths.size(), 37u);
  for (const std::filesystem::path& path : paths) {
    SCOPED_TRACE(path.string());
    const Expected<Capture> capture = ReadBvh(path);
    ASSERT_TRUE(capture.has_value()) << Describe(capture.error());
    // Floors in the other folders are not level, so heights above y = 0 cannot be checked there.
    if (path.string().find("/cmu/") != std::string::npos) ExpectUprightPerson(*capture);
  }
}

TEST(ReadBvh, ReadsPackagedCaptures) {
  const std::vector<std::filesystem::path> paths = test::PackagedCaptures();
  if (paths.empty()) GTEST_SKIP() << "assimp-testmodels is not installed";
  for (const std::filesystem::path& path : paths) {
    SCOPED_TRACE(path.string());
    const Expected<Capture> capture = ReadBvh(path);
    ASSERT_TRUE(capture.has_value()) << Describe(capture.error());
    ExpectUprightPerson(*capture);
    EXPECT_EQ(capture->first_frame, 1);
    EXPECT_NEAR(capture->unit_m, kCmuUnit, 1e-9);
  }
}

TEST(ReadBvh, DetectsPropertiesOfDifferentFiles) {
  constexpr const char* kCmuLeg = "LeftUpLeg LeftLeg LeftFoot LeftToeBase";
  const FileFacts expected[] = {
      {"cmu/01/01_01.bvh", 31, 2752, 120, kCmuUnit, 1, kCmuLeg},
      {"cmu/01/01_03.bvh", 31, 4511, 120, kCmuUnit, 1, kCmuLeg},
      {"cmu/05/05_01.bvh", 31, 599, 120, kCmuUnit, 1, kCmuLeg},
      {"cmu/06/06_08.bvh", 31, 343, 120, kCmuUnit, 1, kCmuLeg},
      {"cmu/09/09_12.bvh", 31, 1918, 120, kCmuUnit, 0, kCmuLeg},
      {"cmu/16/16_15.bvh", 31, 471, 120, kCmuUnit, 0, kCmuLeg},
      {"cmu/16/16_23.bvh", 31, 299, 120, kCmuUnit, 0, kCmuLeg},
      {"cmu/16/16_34.bvh", 31, 347, 120, kCmuUnit, 0, kCmuLeg},
      {"other/daz/13_13.bvh", 43, 440, 120, 0.01, 5, "lThigh lShin lFoot lFoot"},
      {"other/max/131_01.bvh", 31, 994, 120, kCmuUnit, 0, "LeftHip LeftKnee LeftAnkle LeftToe"},
      {"other/max/scaled_131_01.bvh", 31, 995, 120, 1.0, 0, "LeftHip LeftKnee LeftAnkle LeftToe"},
      {"other/amc2bvh/16_02.bvh", 31, 466, 30, kCmuUnit, 0, "lfemur ltibia lfoot ltoes"},
      {"other/pymo/AV_8Walk_Meredith_HVHA_Rep1.bvh", 23, 1064, 120, 0.0254, 0, kCmuLeg},
      {"other/animated-drawings/zombie.bvh", 27, 779, 30, 0.0398, 0, kCmuLeg},
  };
  if (test::SharedCaptures().empty()) GTEST_SKIP() << "no captures at " << MocapDir();
  for (const FileFacts& e : expected) {
    SCOPED_TRACE(e.path);
    const Expected<Capture> capture = ReadBvh(MocapDir() / e.path);
    ASSERT_TRUE(capture.has_value()) << Describe(capture.error());
    EXPECT_EQ(capture->skeleton.joint_count(), e.joints);
    EXPECT_EQ(capture->clip.frame_count(), e.frames);
    EXPECT_EQ(capture->clip.fps, e.fps);
    EXPECT_NEAR(capture->unit_m, e.unit_m, 1e-4 * e.unit_m + (e.unit_m == 0.0398 ? 4e-4 : 0.0));
    EXPECT_EQ(capture->first_frame, e.first_frame);
    const Leg& left = capture->skeleton.leg(Foot::kLeft);
    EXPECT_EQ(JointName(*capture, left.hip) + ' ' + JointName(*capture, left.knee) + ' ' +
                  JointName(*capture, left.ankle) + ' ' + JointName(*capture, left.ball),
              e.left_leg);
  }
}

// The same take in two units must give the same positions.
TEST(ReadBvh, IsIndependentOfTheUnit) {
  const std::filesystem::path folder = MocapDir() / "other/max";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no captures at " << MocapDir();
  const Expected<Capture> a = ReadBvh(folder / "131_01.bvh");
  const Expected<Capture> b = ReadBvh(folder / "scaled_131_01.bvh");
  ASSERT_TRUE(a.has_value() && b.has_value());
  double worst = 0.0;
  for (int f = 0; f < a->clip.frame_count(); ++f) {
    const std::vector<Vec3> p = Positions(*a, f);
    const std::vector<Vec3> q = Positions(*b, f);
    for (const int joint :
         {0, a->skeleton.leg(Foot::kLeft).ball, a->skeleton.leg(Foot::kRight).ankle}) {
      worst = std::max(worst, static_cast<double>(glm::length(p[static_cast<std::size_t>(joint)] -
                                                              q[static_cast<std::size_t>(joint)])));
    }
  }
  EXPECT_LT(worst, 1e-4);
}

TEST(ReadBvh, NotesTooLongFrameTime) {
  const std::filesystem::path path = MocapDir() / "other/amc2bvh/16_02.bvh";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no captures at " << MocapDir();
  const Expected<Capture> slow = ReadBvh(path);
  ASSERT_TRUE(slow.has_value());
  EXPECT_THAT(slow->notes, Contains(HasSubstr("Frame Time 0.033333 s may be too long")));
  BvhReadOptions options;
  options.fps = 120.0;
  const Expected<Capture> right = ReadBvh(path, options);
  ASSERT_TRUE(right.has_value());
  EXPECT_EQ(right->clip.fps, 120.0);
  EXPECT_THAT(right->notes, Not(Contains(HasSubstr("too long"))));
  for (const std::filesystem::path& other : test::SharedCaptures()) {
    if (other == path) continue;
    const Expected<Capture> capture = ReadBvh(other);
    ASSERT_TRUE(capture.has_value());
    EXPECT_THAT(capture->notes, Not(Contains(HasSubstr("too long")))) << other;
  }
}

// An independent reader for comparison. It uses 3x3 matrices of doubles and shares no code with the
// product. Units and up axes come from the documentation of the captures.
struct ReferenceReading {
  std::vector<std::string> names;
  std::vector<std::vector<std::array<double, 3>>>
      positions;  // [frame][joint], in file axes and units.
};

ReferenceReading ReadReference(const std::filesystem::path& path) {
  struct Node {
    int parent;
    double offset[3];
    std::vector<std::string> channels;
  };
  std::istringstream in(test::FileText(path));
  ReferenceReading reading;
  std::vector<Node> nodes;
  std::vector<int> stack;
  std::string word;
  int opened = -1;
  bool site = false;
  while (in >> word && word != "MOTION") {
    if (word == "ROOT" || word == "JOINT") {
      in >> word;
      reading.names.push_back(word);
      nodes.push_back({stack.empty() ? -1 : stack.back(), {0, 0, 0}, {}});
      opened = static_cast<int>(nodes.size()) - 1;
    } else if (word == "End") {
      site = true;
    } else if (word == "{") {
      stack.push_back(site ? stack.back() : opened);
    } else if (word == "}") {
      stack.pop_back();
      site = false;
    } else if (word == "OFFSET") {
      double v[3];
      in >> v[0] >> v[1] >> v[2];
      if (!site) std::copy(v, v + 3, nodes[static_cast<std::size_t>(stack.back())].offset);
    } else if (word == "CHANNELS") {
      int n = 0;
      in >> n;
      for (int i = 0; i < n; ++i) {
        in >> word;
        nodes[static_cast<std::size_t>(stack.back())].channels.push_back(word);
      }
    }
  }
  int frames = 0;
  double frame_time = 0.0;
  in >> word >> frames >> word >> word >> frame_time;
  using Matrix = std::array<std::array<double, 3>, 3>;
  for (int f = 0; f < frames; ++f) {
    std::vector<Matrix> world(nodes.size());
    std::vector<std::array<double, 3>> positions(nodes.size());
    for (std::size_t j = 0; j < nodes.size(); ++j) {
      Matrix m{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
      double t[3] = {nodes[j].offset[0], nodes[j].offset[1], nodes[j].offset[2]};
      for (const std::string& channel : nodes[j].channels) {
        double value = 0.0;
        in >> value;
        const int axis = channel[0] - 'X';
        if (channel.substr(1) == "position") {
          t[axis] = value;
          continue;
        }
        const double a = value * std::numbers::pi / 180.0;
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        Matrix turned = m;
        for (int row = 0; row < 3; ++row) {
          auto& r = m[static_cast<std::size_t>(row)];
          auto& o = turned[static_cast<std::size_t>(row)];
          const auto iu = static_cast<std::size_t>(u), iv = static_cast<std::size_t>(v);
          o[iu] = r[iu] * std::cos(a) + r[iv] * std::sin(a);
          o[iv] = r[iv] * std::cos(a) - r[iu] * std::sin(a);
        }
        m = turned;
      }
      if (nodes[j].parent < 0) {
        world[j] = m;
        positions[j] = {t[0], t[1], t[2]};
        continue;
      }
      const auto parent = static_cast<std::size_t>(nodes[j].parent);
      for (std::size_t row = 0; row < 3; ++row) {
        positions[j][row] = positions[parent][row];
        for (std::size_t k = 0; k < 3; ++k) positions[j][row] += world[parent][row][k] * t[k];
        for (std::size_t column = 0; column < 3; ++column) {
          world[j][row][column] = 0.0;
          for (std::size_t k = 0; k < 3; ++k)
            world[j][row][column] += world[parent][row][k] * m[k][column];
        }
      }
    }
    reading.positions.push_back(std::move(positions));
  }
  return reading;
}

TEST(ReadBvh, AgreesWithAReferenceReader) {
  struct File {
    const char* path;
    bool z_up;
  };
  const File files[] = {
      {"cmu/16/16_27.bvh", false},     {"cmu/06/06_08.bvh", false},
      {"other/daz/13_13.bvh", false},  {"other/pymo/AV_8Walk_Meredith_HVHA_Rep1.bvh", false},
      {"other/max/131_01.bvh", false}, {"other/animated-drawings/zombie.bvh", true}};
  if (test::SharedCaptures().empty()) GTEST_SKIP() << "no captures at " << MocapDir();
  for (const File& file : files) {
    SCOPED_TRACE(file.path);
    const std::filesystem::path path = MocapDir() / file.path;
    const Expected<Capture> capture = ReadBvh(path);
    ASSERT_TRUE(capture.has_value());
    const ReferenceReading plain = ReadReference(path);
    ASSERT_EQ(plain.names.size(), static_cast<std::size_t>(capture->skeleton.joint_count()));
    ASSERT_EQ(plain.positions.size(), static_cast<std::size_t>(capture->clip.frame_count()));
    double worst = 0.0;
    for (int f = 0; f < capture->clip.frame_count(); ++f) {
      const std::vector<Vec3> p = Positions(*capture, f);
      for (std::size_t j = 0; j < p.size(); ++j) {
        ASSERT_EQ(plain.names[j], JointName(*capture, static_cast<int>(j)));
        const auto& q = plain.positions[static_cast<std::size_t>(f)][j];
        // The z-up figure faces -y at rest, so (x, y, z) becomes (x, z, -y).
        const DVec3 ours =
            capture->unit_m * (file.z_up ? DVec3(q[0], q[2], -q[1]) : DVec3(q[0], q[1], q[2]));
        worst = std::max(worst, glm::length(ours - DVec3(p[j])));
      }
    }
    EXPECT_LT(worst, 2e-5);
  }
}

Capture Read(const std::string& text, const BvhReadOptions& options = {}) {
  Expected<Capture> capture = ParseBvh(text, "figure.bvh", options);
  EXPECT_TRUE(capture.has_value()) << (capture ? "" : Describe(capture.error()));
  return capture ? std::move(*capture) : Capture{};
}

double WorstPosition(const Capture& a, const Capture& b) {
  if (a.clip.frame_count() != b.clip.frame_count() || a.clip.joint_count != b.clip.joint_count)
    return 1e9;
  double worst = 0.0;
  for (int f = 0; f < a.clip.frame_count(); ++f) {
    const std::vector<Vec3> p = Positions(a, f);
    const std::vector<Vec3> q = Positions(b, f);
    for (std::size_t j = 0; j < p.size(); ++j)
      worst = std::max(worst, static_cast<double>(glm::length(p[j] - q[j])));
  }
  return worst;
}

double WorstRotation(const Capture& a, const Capture& b) {
  if (a.clip.rotations.size() != b.clip.rotations.size()) return 1e9;
  double worst = 0.0;
  for (std::size_t i = 0; i < a.clip.rotations.size(); ++i) {
    worst = std::max(worst, AngleBetween(a.clip.rotations[i], b.clip.rotations[i]));
  }
  return worst;
}

TEST(ParseBvh, AcceptsAnyLineEndsSpacesAndCase) {
  const Capture plain = Read(BvhText().Text());
  ASSERT_EQ(plain.clip.frame_count(), 12);
  BvhText text;
  std::vector<std::string> variants;
  for (const char* end : {"\r\n", "\r", "\n\n", "\t\n", " \r\n  \n"}) {
    text.line_end = end;
    text.last_line_end = true;
    variants.push_back(text.Text());
    text.last_line_end = false;
    variants.push_back(text.Text());
  }
  std::string mixed = BvhText().Text();  // CRLF in the header and LF in the rows.
  for (std::size_t at = 0; (at = mixed.find('\n', at)) < mixed.find("Frame Time"); at += 2)
    mixed.insert(at, "\r");
  variants.push_back(mixed);
  std::string lower = BvhText().Text();
  for (const char* word : {"HIERARCHY", "ROOT", "JOINT", "OFFSET", "CHANNELS", "End Site", "MOTION",
                           "Frames", "Frame Time", "Xposition", "Yposition", "Zposition",
                           "Xrotation", "Yrotation", "Zrotation"}) {
    const std::string from = word;
    std::string to = from;
    std::transform(to.begin(), to.end(), to.begin(),
                   [](char c) { return static_cast<char>(std::tolower(c)); });
    for (std::size_t at = 0; (at = lower.find(from, at)) != std::string::npos; at += to.size())
      lower.replace(at, from.size(), to);
  }
  variants.push_back(lower);
  const auto replaced = [](std::string s, const std::string& from, const std::string& to) {
    s.replace(s.find(from), from.size(), to);
    return s;
  };
  variants.push_back(replaced(BvhText().Text(), "Frames: ", "Frames:\t"));
  variants.push_back(replaced(BvhText().Text(), "Frames: ", "Frames:"));
  variants.push_back(replaced(BvhText().Text(), "Frame Time: ", "Frame Time:\t"));
  variants.push_back(replaced(BvhText().Text(), "JOINT LeftLeg\n\t\t{", "JOINT LeftLeg {"));
  variants.push_back("\xEF\xBB\xBF" + BvhText().Text());
  for (const std::string& variant : variants) {
    const Capture capture = Read(variant);
    EXPECT_EQ(capture.clip.rotations, plain.clip.rotations) << variant.substr(0, 300);
    EXPECT_EQ(capture.clip.root_positions_m, plain.clip.root_positions_m);
    EXPECT_EQ(capture.skeleton.joints.size(), plain.skeleton.joints.size());
  }
}

// The figure must read the same in all 24 orientations of the file axes and in all common units.
TEST(ParseBvh, ConvertsAxesAndUnits) {
  const Capture plain = Read(BvhText().Text());
  EXPECT_THAT(plain.notes, Contains(HasSubstr("1 m")));
  int orientations = 0;
  for (const int x : {1, -1, 2, -2, 3, -3}) {
    for (const int y : {1, -1, 2, -2, 3, -3}) {
      if (std::abs(x) == std::abs(y)) continue;
      // z = x cross y
      const int third = 6 - std::abs(x) - std::abs(y);
      const bool cyclic = std::abs(y) % 3 == (std::abs(x) + 1) % 3;
      const int sign = (x < 0 ? -1 : 1) * (y < 0 ? -1 : 1) * (cyclic ? 1 : -1);
      BvhText text;
      text.axes = {x, y, sign * third};
      for (const double unit :
           {1.0, 100.0, 1000.0, 1.0 / 0.0254, 0.45 / 0.0254, 1.0 / 0.3048, 10.0}) {
        text.unit = unit;
        SCOPED_TRACE(testing::Message()
                     << "axes " << x << ' ' << y << ' ' << sign * third << " unit " << unit);
        const Capture capture = Read(text.Text());
        ASSERT_NEAR(capture.unit_m, 1.0 / unit, 1e-6 / unit);
        ASSERT_LT(WorstPosition(plain, capture), 1e-5);
        ASSERT_LT(WorstRotation(plain, capture), 1e-5);
      }
      ++orientations;
    }
  }
  EXPECT_EQ(orientations, 24);
}

TEST(ParseBvh, FindsLegsByShape) {
  const Capture plain = Read(BvhText().Text());
  BvhText text;
  text.names = false;
  for (const std::array<int, 3>& axes :
       {std::array{1, 2, 3}, std::array{1, 3, -2}, std::array{-1, 2, -3}, std::array{3, 2, -1}}) {
    text.axes = axes;
    const Capture capture = Read(text.Text());
    EXPECT_THAT(capture.notes, Contains(HasSubstr("by shape")));
    for (int side = 0; side < 2; ++side) {
      EXPECT_EQ(capture.skeleton.legs[side].hip, plain.skeleton.legs[side].hip);
      EXPECT_EQ(capture.skeleton.legs[side].knee, plain.skeleton.legs[side].knee);
      EXPECT_EQ(capture.skeleton.legs[side].ankle, plain.skeleton.legs[side].ankle);
      EXPECT_EQ(capture.skeleton.legs[side].ball, plain.skeleton.legs[side].ball);
    }
    EXPECT_LT(WorstPosition(plain, capture), 1e-5);
  }
}

TEST(ParseBvh, FixesTheBallToTheAnkleWithoutToeJoint) {
  BvhText text;
  text.toes = false;
  const Capture capture = Read(text.Text());
  // The End Site (0, -0.06, 0.21) is farther than 0.2 leg lengths, so it is the tip of the toes.
  for (const Leg& leg : capture.skeleton.legs) {
    EXPECT_EQ(leg.ball, leg.ankle);
    EXPECT_NEAR(glm::length(leg.toe_tip_offset_m - Vec3(0, -0.06f, 0.21f)), 0.0, 1e-6);
    EXPECT_NEAR(glm::length(leg.ball_offset_m - Vec3(0, -0.06f, 0.14f)), 0.0, 1e-6);
  }
  text.end_sites = false;
  const Capture bare = Read(text.Text());
  for (const Leg& leg : bare.skeleton.legs) {
    EXPECT_EQ(leg.ball, leg.ankle);
    EXPECT_NEAR(leg.toe_tip_offset_m.z, 0.24 * 0.83, 0.01);
    EXPECT_LT(leg.ball_offset_m.z, leg.toe_tip_offset_m.z);
  }
  EXPECT_THAT(bare.notes, Contains(HasSubstr("neither a toe joint nor an End Site")));
}

TEST(ParseBvh, HandlesRigsWhoseRestPoseDoesNotStand) {
  BvhText text;
  text.folded = true;
  for (const std::array<int, 3>& axes : {std::array{1, 2, 3}, std::array{1, 3, -2}}) {
    text.axes = axes;
    const Capture capture = Read(text.Text());
    EXPECT_THAT(capture.notes, Contains(HasSubstr("rest pose does not stand")));
    const Leg& left = capture.skeleton.leg(Foot::kLeft);
    const Leg& right = capture.skeleton.leg(Foot::kRight);
    for (int f = 0; f < capture.clip.frame_count(); ++f) {
      const std::vector<Vec3> p = Positions(capture, f);
      const Vec3 foot =
          p[static_cast<std::size_t>(left.ball)] - p[static_cast<std::size_t>(left.ankle)];
      const Vec3 hips =
          p[static_cast<std::size_t>(left.hip)] - p[static_cast<std::size_t>(right.hip)];
      ASSERT_LT(p[static_cast<std::size_t>(left.ankle)].y, p[0].y - 0.6f);
      ASSERT_GT(foot.z, 0.01f);
      ASSERT_GT(hips.x, 0.15f);
      ASSERT_LT(AngleBetween(capture.clip.frame(f).rotations[0], kIdentityQuat), 0.5);
    }
  }
}

TEST(ParseBvh, UsesTheMeanOfPositionChannelsAsOffset) {
  BvhText text;
  text.positions_everywhere = true;
  const Capture capture = Read(text.Text());
  const Capture plain = Read(BvhText().Text());
  // Each y oscillates by 1 cm around its offset.
  for (std::size_t j = 1; j < capture.skeleton.joints.size(); ++j) {
    EXPECT_NEAR(
        glm::length(capture.skeleton.joints[j].offset_m - plain.skeleton.joints[j].offset_m), 0.0,
        1e-6);
  }
  EXPECT_THAT(capture.notes, Contains(HasSubstr("largest deviation 0.0100 m")));
}

TEST(ParseBvh, KeepsTheOffsetIfAllPositionsAreZero) {
  const std::string text =
      "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation "
      "Xrotation Yrotation\n"
      "JOINT LeftUpLeg\n{\nOFFSET 0.1 0 0\nCHANNELS 3 Xposition Yposition Zposition\nJOINT "
      "LeftLeg\n{\nOFFSET 0 -0.4 0\n"
      "JOINT LeftFoot\n{\nOFFSET 0 -0.4 0\nEnd Site\n{\nOFFSET 0 0 0.2\n}\n}\n}\n}\n"
      "JOINT RightUpLeg\n{\nOFFSET -0.1 0 0\nJOINT RightLeg\n{\nOFFSET 0 -0.4 0\n"
      "JOINT RightFoot\n{\nOFFSET 0 -0.4 0\nEnd Site\n{\nOFFSET 0 0 0.2\n}\n}\n}\n}\n}\n"
      "MOTION\nFrames: 1\nFrame Time: 0.01\n0 0.9 0 0 0 0 0 0 0\n";
  const Capture capture = Read(text);
  ASSERT_EQ(capture.skeleton.joint_count(), 7);
  EXPECT_EQ(capture.skeleton.joints[1].offset_m, Vec3(0.1f, 0.0f, 0.0f));
  EXPECT_EQ(capture.clip.root_positions_m[0], Vec3(0.0f, 0.9f, 0.0f));
}

TEST(ParseBvh, RootPositionsReplaceItsOffset) {
  std::string text = BvhText().Text();
  const std::string from = "OFFSET 0.0000000 0.0000000 0.0000000";
  text.replace(text.find(from), from.size(), "OFFSET 11 35 -54");
  EXPECT_EQ(Read(text).clip.root_positions_m, Read(BvhText().Text()).clip.root_positions_m);
}

TEST(ParseBvh, SkipsAnArtificialFirstPose) {
  std::string text = BvhText().Text();
  EXPECT_EQ(Read(text).first_frame, 0);
  // Inserts a T-pose as first frame, with all joints rotated by 40 degrees.
  const std::size_t rows = text.find('\n', text.find("Frame Time")) + 1;
  std::string row = "0 0.95 0 0 0 0";
  for (std::size_t j = 1; j < BvhText().Parts().size(); ++j) row += " 40 0 0";
  text.insert(rows, row + "\n");
  text.replace(text.find("Frames: 12"), 10, "Frames: 13");
  const Capture capture = Read(text);
  EXPECT_EQ(capture.clip.frame_count(), 13);
  EXPECT_EQ(capture.first_frame, 1);
  EXPECT_THAT(capture.notes, Contains(HasSubstr("artificial pose")));
}

TEST(ParseBvh, RoundsTheFrameRateIfItsDigitsAllow) {
  const std::pair<const char*, double> cases[] = {{".0083333", 120.0},
                                                  {"0.008333", 120.0},
                                                  {"0.00833333", 120.0},
                                                  {"8.33333e-03", 120.0},
                                                  {"0.033333", 30.0},
                                                  {"0.0333", 30.0},
                                                  {"0.033", 1 / 0.033},
                                                  {"0.01", 100.0},
                                                  {"0.0333667", 1 / 0.0333667},
                                                  {"0.041708", 1 / 0.041708},
                                                  {"0.0166667", 60.0},
                                                  {"1", 1.0},
                                                  {"0.004", 250.0}};
  for (const auto& [written, fps] : cases) {
    BvhText text;
    text.frame_time = written;
    EXPECT_EQ(Read(text.Text()).clip.fps, fps) << written;
  }
}

TEST(ParseBvh, AcceptsFewerOrMoreRowsThanDeclared) {
  BvhText text;
  text.frames_text = "99999999999";
  const Capture fewer = Read(text.Text());
  EXPECT_EQ(fewer.clip.frame_count(), 12);
  EXPECT_THAT(fewer.notes,
              Contains(HasSubstr("declares 99999999999 frames, but the file contains 12")));
  text.frames_text = "5";
  const Capture more = Read(text.Text());
  EXPECT_EQ(more.clip.frame_count(), 5);
  EXPECT_THAT(more.notes, Contains(HasSubstr("ignored the frames")));
}

TEST(ParseBvh, NamesMayRepeatOrContainSpacesAndInvalidUtf8) {
  std::string text = BvhText().Text();
  const auto rename = [&](const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
  };
  rename("JOINT Head", "JOINT Spine");
  rename("JOINT LeftLeg", "JOINT Bip01 L Calf");
  rename("JOINT RightArm",
         "JOINT Br\xFC"
         "cke");
  const Capture capture = Read(text);
  EXPECT_GE(capture.skeleton.FindJoint("Spine_2"), 0);
  EXPECT_GE(capture.skeleton.FindJoint("Br_cke"), 0);
  EXPECT_EQ(capture.skeleton.leg(Foot::kLeft).knee, capture.skeleton.FindJoint("Bip01 L Calf"));
  EXPECT_THAT(capture.notes, Contains(HasSubstr("Spine_2")));
}

TEST(ParseBvh, OptionsOverrideDetection) {
  const std::string text = BvhText().Text();
  BvhReadOptions options;
  options.unit_m = 0.5;
  options.fps = 240.0;
  const Capture half = Read(text, options);
  EXPECT_EQ(half.unit_m, 0.5);
  EXPECT_EQ(half.clip.fps, 240.0);
  EXPECT_NEAR(half.clip.root_positions_m[0].y, 0.5 * 0.97, 0.01);

  options = {};
  options.up = BvhAxis::kPlusZ;
  // The z axis of the file becomes the y axis.
  EXPECT_NEAR(Read(text, options).clip.root_positions_m[11].y, 0.04 * 11, 1e-5);

  options = {};
  options.left_ankle = "LeftFoot";
  options.right_ankle = "RightFoot";
  options.left_ball = "LeftToeBase";
  EXPECT_EQ(Read(text, options).skeleton.leg(Foot::kLeft).ball,
            Read(text).skeleton.leg(Foot::kLeft).ball);
  // Swapped sides are accepted: the figure then faces backwards.
  std::swap(options.left_ankle, options.right_ankle);
  options.left_ball.clear();
  const Capture swapped = Read(text, options);
  EXPECT_THAT(swapped.notes, Contains(HasSubstr("backwards")));
}

TEST(ParseBvh, ErrorsNameTheOption) {
  const std::string text = BvhText().Text();
  struct Case {
    BvhReadOptions options;
    ErrorCode code;
    const char* where;
  };
  std::vector<Case> cases;
  const auto add = [&](auto set, ErrorCode code, const char* where) {
    BvhReadOptions options;
    set(options);
    cases.push_back({options, code, where});
  };
  for (const double bad : {0.0, -1.0, 1001.0, std::nan("")}) {
    add([&](auto& o) { o.unit_m = bad; }, ErrorCode::kInvalidArgument, "unit_m");
  }
  for (const double bad : {0.0, -30.0, 10001.0, std::nan("")}) {
    add([&](auto& o) { o.fps = bad; }, ErrorCode::kInvalidArgument, "fps");
  }
  add(
      [](auto& o) {
        o.left_ankle = "NoSuchJoint";
        o.right_ankle = "RightFoot";
      },
      ErrorCode::kNotFound, "left_ankle");
  add([](auto& o) { o.left_ankle = "LeftFoot"; }, ErrorCode::kNotFound, "right_ankle");
  add(
      [](auto& o) {
        o.left_ankle = "LeftUpLeg";
        o.right_ankle = "RightFoot";
      },
      ErrorCode::kInvalidArgument, "left_ankle");
  add(
      [](auto& o) {
        o.left_ankle = "LeftFoot";
        o.right_ankle = "LeftFoot";
      },
      ErrorCode::kInvalidArgument, "right_ankle");
  add([](auto& o) { o.right_ball = "NoSuchJoint"; }, ErrorCode::kNotFound, "right_ball");
  add([](auto& o) { o.right_ball = "LeftToeBase"; }, ErrorCode::kInvalidArgument, "right_ball");
  for (const Case& c : cases) {
    const Expected<Capture> capture = ParseBvh(text, "figure.bvh", c.options);
    ASSERT_FALSE(capture.has_value()) << c.where;
    EXPECT_EQ(capture.error().code, c.code) << c.where;
    EXPECT_EQ(capture.error().where, c.where);
  }
}

TEST(ReadBvh, ReportsUnreadableFiles) {
  const Expected<Capture> none = ReadBvh("/nowhere/at/all.bvh");
  ASSERT_FALSE(none.has_value());
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(none.error().where, "/nowhere/at/all.bvh");
  for (const char* path : {"/", "/dev/zero"}) {
    const Expected<Capture> folder = ReadBvh(path);
    ASSERT_FALSE(folder.has_value());
    EXPECT_EQ(folder.error().code, ErrorCode::kIo);
    EXPECT_EQ(folder.error().where, path);
  }
  // Files over the limit are rejected by their size. This one is sparse and uses no disk space.
  const std::filesystem::path huge =
      std::filesystem::path(testing::TempDir()) / "stridewire_huge.bvh";
  {
    std::ofstream(huge) << "HIERARCHY\n";
  }
  std::filesystem::resize_file(huge, kMaxBvhBytes + 1);
  const Expected<Capture> large = ReadBvh(huge);
  std::filesystem::remove(huge);
  ASSERT_FALSE(large.has_value());
  EXPECT_EQ(large.error().code, ErrorCode::kLimitExceeded);
}

// A small valid file, line by line, for tests that change one line.
std::vector<std::string> SmallFile() {
  return {"HIERARCHY",                                                               // 1
          "ROOT Hips",                                                               // 2
          "{",                                                                       // 3
          "OFFSET 0 0 0",                                                            // 4
          "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation",  // 5
          "JOINT LeftUpLeg",
          "{",
          "OFFSET 0.1 0 0",
          "CHANNELS 1 Xrotation",  // 9
          "JOINT LeftLeg",
          "{",
          "OFFSET 0 -0.4 0",  // 12
          "JOINT LeftFoot",
          "{",
          "OFFSET 0 -0.4 0",  // 15
          "End Site",
          "{",
          "OFFSET 0 0 0.2",
          "}",  // 19
          "}",
          "}",
          "}",  // 22
          "JOINT RightUpLeg",
          "{",
          "OFFSET -0.1 0 0",  // 25
          "JOINT RightLeg",
          "{",
          "OFFSET 0 -0.4 0",  // 28
          "JOINT RightFoot",
          "{",
          "OFFSET 0 -0.4 0",  // 31
          "End Site",
          "{",
          "OFFSET 0 0 0.2",
          "}",  // 35
          "}",
          "}",
          "}",
          "}",  // 39
          "MOTION",
          "Frames: 3",
          "Frame Time: 0.05",  // 42
          "0 0.8 0 1 2 3 4",
          "0 0.8 0 1 2 3 4",
          "0 0.8 0 1 2 3 4"};  // 45
}

std::string Joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

TEST(ParseBvh, ErrorsNameFileLineAndReason) {
  ASSERT_TRUE(ParseBvh(Joined(SmallFile()), "bad.bvh").has_value());
  struct Case {
    int line;          // The line that is changed, from 1.
    const char* text;  // Its new text.
    int reported;      // The line in `where`; 0: only the file.
    ErrorCode code;
    const char* sentence;
  };
  const Case cases[] = {
      {1, "HIERARCHIE", 1, ErrorCode::kMalformed, "expected HIERARCHY"},
      {1, "", 2, ErrorCode::kMalformed, "expected HIERARCHY"},
      {2, "JOINT Hips", 2, ErrorCode::kMalformed, "expected ROOT"},
      {2, "ROOT", 2, ErrorCode::kMalformed, "expected a joint name"},
      {2, "ROOT Hi\x01ps", 2, ErrorCode::kMalformed, "control character"},
      {3, "(", 3, ErrorCode::kMalformed, "expected { after a joint name"},
      {4, "OFFSET 0 0", 5, ErrorCode::kMalformed, "expected three numbers after OFFSET"},
      {4, "OFFSET 0 zero 0", 4, ErrorCode::kMalformed, "expected three numbers after OFFSET"},
      {4, "OFFSET 0 nan 0", 4, ErrorCode::kOutOfRange, "expected a finite number"},
      {4, "OFFSET 0 1e999 0", 4, ErrorCode::kOutOfRange, "expected a finite number"},
      {4, "OFFSET 0 0 0 0", 4, ErrorCode::kMalformed, "expected OFFSET, CHANNELS"},
      {4, "OFFSET 0 0 0 OFFSET 0 0 0", 4, ErrorCode::kMalformed, "two OFFSETs"},
      {8, "", 22, ErrorCode::kMalformed, "no OFFSET"},
      {5, "CHANNELS", 6, ErrorCode::kMalformed, "number of channels"},
      {5, "CHANNELS many", 5, ErrorCode::kMalformed, "number of channels"},
      {5, "CHANNELS 10 Xposition", 5, ErrorCode::kOutOfRange, "0 to 9 channels"},
      {5, "CHANNELS 1.5 Xposition", 5, ErrorCode::kOutOfRange, "0 to 9 channels"},
      {5, "CHANNELS -1", 5, ErrorCode::kOutOfRange, "0 to 9 channels"},
      {5, "CHANNELS 2 Xposition Wposition", 5, ErrorCode::kMalformed, "channel name"},
      {5, "CHANNELS 2 Xposition Yscaling", 5, ErrorCode::kMalformed, "channel name"},
      {5, "CHANNELS 2 Xposition Xposition", 5, ErrorCode::kMalformed, "duplicate channel"},
      {5, "CHANNELS 0 CHANNELS 0", 5, ErrorCode::kMalformed, "two CHANNELS"},
      {6, "LIMB LeftUpLeg", 6, ErrorCode::kMalformed, "expected OFFSET, CHANNELS"},
      {8, "OFFSET 0.1 500 0", 8, ErrorCode::kOutOfRange, "OFFSET of the joint is too large"},
      {18, "JOINT Toe", 18, ErrorCode::kMalformed, "expected OFFSET in an End Site"},
      {17, "", 18, ErrorCode::kMalformed, "expected { after End Site"},
      {18, "OFFSET 0 0", 19, ErrorCode::kMalformed, "expected three numbers after OFFSET"},
      {18, "OFFSET 0 0 900", 18, ErrorCode::kOutOfRange, "OFFSET of the End Site is too large"},
      {19, "JOINT Toe", 19, ErrorCode::kMalformed, "expected } after an End Site"},
      {39, "", 40, ErrorCode::kMalformed, "expected OFFSET, CHANNELS, JOINT, End Site or }"},
      {40, "ROOT Second", 41, ErrorCode::kMalformed, "expected { after a joint name"},
      {40, "", 41, ErrorCode::kMalformed, "expected MOTION"},
      {41, "Frame: 3", 41, ErrorCode::kMalformed, "expected Frames:"},
      {41, "Frames: three", 41, ErrorCode::kMalformed, "expected an integer"},
      {41, "Frames: 2.5e-3", 41, ErrorCode::kMalformed, "expected an integer"},
      {41, "Frames: nan", 41, ErrorCode::kMalformed, "expected an integer"},
      {41, "Frames: -3", 41, ErrorCode::kMalformed, "expected an integer"},
      {41, "Frames: 2.5", 41, ErrorCode::kMalformed, "expected an integer"},
      {41, "Frames: -99999999999999999999999", 41, ErrorCode::kMalformed, "expected an integer"},
      {41, "Frames:", 42, ErrorCode::kMalformed, "expected an integer"},
      {42, "Time: 0.05", 42, ErrorCode::kMalformed, "expected Frame Time:"},
      {42, "Frame Time: soon", 42, ErrorCode::kMalformed, "expected a number of seconds"},
      {42, "Frame Time: 0", 42, ErrorCode::kOutOfRange, "0.0001 to 10 seconds"},
      {42, "Frame Time: -0.05", 42, ErrorCode::kOutOfRange, "0.0001 to 10 seconds"},
      {42, "Frame Time: 0.05 s", 42, ErrorCode::kMalformed, "unexpected text after the number"},
      {44, "0 0.8 0 1 2 3", 44, ErrorCode::kMalformed, "fewer numbers than channels"},
      {44, "0 0.8 0 1 2 3 4 5", 44, ErrorCode::kMalformed, "more numbers than channels"},
      {44, "0 0.8 0 1 2 3 four", 44, ErrorCode::kMalformed, "expected a number"},
      {44, "0 0,8 0 1 2 3 4", 44, ErrorCode::kMalformed, "mixes commas and points"},
      {44, "0 0,8,1 0 1 2 3 4", 44, ErrorCode::kMalformed, "expected a number"},
      {44, "0 nan 0 1 2 3 4", 44, ErrorCode::kOutOfRange, "expected a finite number"},
      {44, "0 0.8 0 1 2 3 -inf", 44, ErrorCode::kOutOfRange, "expected a finite number"},
      {44, "0 0.8 0 1 2 3 1e8", 44, ErrorCode::kOutOfRange, "expected a finite number"},
      {44, "0 0.8 0 1 2 3\n4 5", 44, ErrorCode::kMalformed, "fewer numbers than channels"},
      {13, "JOINT Paw", 0, ErrorCode::kUnsupported, "no pair of legs was found"},
  };
  for (const Case& c : cases) {
    std::vector<std::string> lines = SmallFile();
    lines[static_cast<std::size_t>(c.line - 1)] = c.text;
    if (c.code == ErrorCode::kUnsupported && c.reported == 0) {
      for (std::string& line : lines) {
        if (line ==
            "OFFSET 0 -0.4 0") {  // Makes one leg short, so that neither names nor shape match.
          line = "OFFSET 0 -0.2 0";
          break;
        }
      }
    }
    const Expected<Capture> capture = ParseBvh(Joined(lines), "bad.bvh");
    ASSERT_FALSE(capture.has_value()) << "line " << c.line << ": " << c.text;
    SCOPED_TRACE(testing::Message() << "line " << c.line << ": " << c.text << "\n"
                                    << Describe(capture.error()));
    EXPECT_EQ(capture.error().where,
              c.reported == 0 ? "bad.bvh" : "bad.bvh:" + std::to_string(c.reported));
    EXPECT_THAT(capture.error().text, HasSubstr(c.sentence));
    EXPECT_EQ(capture.error().code, c.code);
  }
  // If the file is cut off before its first frame, the error is in its last line.
  const std::vector<std::string> lines = SmallFile();
  for (std::size_t kept = 0; kept < 42; ++kept) {
    const std::string text =
        Joined({lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(kept)});
    const Expected<Capture> capture = ParseBvh(text, "bad.bvh");
    ASSERT_FALSE(capture.has_value()) << kept;
    EXPECT_EQ(capture.error().code, ErrorCode::kMalformed) << kept;
    EXPECT_EQ(capture.error().where, "bad.bvh:" + std::to_string(kept + 1))
        << Describe(capture.error());
  }
}

TEST(ParseBvh, EnforcesItsLimits) {
  const auto chain = [](int joints, bool nested) {
    std::string text = "HIERARCHY\nROOT J\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n";
    int open = 1;
    for (int j = 1; j < joints; ++j) {
      text += "JOINT J\n{\nOFFSET 0 1 0\n";
      if (nested) {
        ++open;
      } else {
        text += "}\n";
      }
    }
    for (; open > 0; --open) text += "}\n";
    return text + "MOTION\nFrames: 1\nFrame Time: 0.01\n0\n";
  };
  const auto fault = [](const std::string& text) {
    const Expected<Capture> capture = ParseBvh(text, "x.bvh");
    return capture ? std::string("read") : std::string(capture.error().text);
  };
  EXPECT_THAT(fault(chain(kMaxJoints, false)), HasSubstr("no pair of legs"));
  EXPECT_THAT(fault(chain(kMaxJoints + 1, false)), HasSubstr("more joints than the limit"));
  EXPECT_THAT(fault(chain(kMaxBvhDepth, true)), HasSubstr("no pair of legs"));
  EXPECT_THAT(fault(chain(kMaxBvhDepth + 1, true)), HasSubstr("nested deeper than the limit"));
  EXPECT_THAT(fault(chain(100000, true)), HasSubstr("nested deeper than the limit"));

  std::string sites = "HIERARCHY\nROOT J\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\n";
  for (int i = 0; i <= kMaxJoints; ++i) sites += "End Site\n{\nOFFSET 0 0 0\n}\n";
  EXPECT_THAT(fault(sites), HasSubstr("more End Sites than the limit"));
  EXPECT_THAT(fault("HIERARCHY\nROOT " + std::string(300, 'n') + "\n{"),
              HasSubstr("name is longer than"));

  // With 256 joints, rows of two bytes reach the limit of rotations.
  std::string rows = chain(kMaxJoints, false);
  rows.replace(rows.find("Frames: 1"), 9, "Frames: 9999999");
  for (std::int64_t i = 0; i < kMaxBvhRotations / kMaxJoints + 10; ++i) rows += "0\n";
  EXPECT_THAT(fault(rows), HasSubstr("more frames than the limit"));
}

}  // namespace
}  // namespace stridewire
