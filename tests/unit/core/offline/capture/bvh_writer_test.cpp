#include "stridewire/offline/bvh_writer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "bvh_text.h"
#include "stridewire/offline/bvh_reader.h"

namespace stridewire {
namespace {

constexpr double kDegree = 0.017453292519943295;

Capture Figure() {
  Expected<Capture> capture = ParseBvh(test::BvhText().Text(), "figure.bvh");
  EXPECT_TRUE(capture.has_value());
  return *capture;
}

std::string Written(const Skeleton& skeleton, const Clip& clip) {
  std::ostringstream out;
  const Status status = WriteBvh(skeleton, clip, out);
  EXPECT_TRUE(status.has_value()) << (status ? "" : Describe(status.error()));
  return out.str();
}

Capture ReadInMetres(const std::string& text) {
  BvhReadOptions options;
  options.unit_m = 1.0;
  options.up = BvhAxis::kPlusY;
  Expected<Capture> capture = ParseBvh(text, "written.bvh", options);
  EXPECT_TRUE(capture.has_value()) << (capture ? "" : Describe(capture.error()));
  return capture ? std::move(*capture) : Capture{};
}

double WorstAngle(const Clip& a, const Clip& b) {
  if (a.rotations.size() != b.rotations.size()) return 1e9;
  double worst = 0.0;
  for (std::size_t i = 0; i < a.rotations.size(); ++i)
    worst = std::max(worst, AngleBetween(a.rotations[i], b.rotations[i]));
  return worst;
}

void ExpectSame(const Capture& a, const Skeleton& skeleton, const Clip& clip) {
  ASSERT_EQ(a.skeleton.joint_count(), skeleton.joint_count());
  for (std::size_t j = 0; j < skeleton.joints.size(); ++j) {
    EXPECT_EQ(a.skeleton.joints[j].name, skeleton.joints[j].name);
    EXPECT_EQ(a.skeleton.joints[j].parent, skeleton.joints[j].parent);
    EXPECT_EQ(a.skeleton.joints[j].offset_m, j == 0 ? Vec3(0.0f) : skeleton.joints[j].offset_m);
  }
  ASSERT_EQ(a.skeleton.end_sites.size(), skeleton.end_sites.size());
  EXPECT_EQ(a.clip.root_positions_m, clip.root_positions_m);
  EXPECT_NEAR(a.clip.fps, clip.fps, 1e-6 * clip.fps);
  EXPECT_LT(WorstAngle(a.clip, clip), 0.001 * kDegree);
}

TEST(WriteBvh, RoundTripsWithTheReader) {
  const Capture figure = Figure();
  ExpectSame(ReadInMetres(Written(figure.skeleton, figure.clip)), figure.skeleton, figure.clip);
}

TEST(WriteBvh, RoundTripsAnyRotation) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::normal_distribution<float> normal;
  Capture figure = Figure();
  figure.clip.Resize(500, figure.skeleton.joint_count());
  figure.clip.fps = 1000.0 / 7.0;
  for (Vec3& p : figure.clip.root_positions_m)
    p = Vec3(normal(random), normal(random), normal(random)) * 1e3f;
  for (Quat& q : figure.clip.rotations) {
    q = Normalise(Quat(normal(random), normal(random), normal(random), normal(random)));
  }
  // The root is upright, so that the reader does not turn the figure.
  for (int f = 0; f < 500; ++f) figure.clip.frame(f).rotations[0] = YawRotation(0.05 * f);
  ExpectSame(ReadInMetres(Written(figure.skeleton, figure.clip)), figure.skeleton, figure.clip);
}

TEST(WriteBvh, KeepsRotationsAtAndNearGimbalLock) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> angle(-3.1, 3.1);
  const auto turn = [](int axis, double a) {
    Vec3 v(0.0f);
    v[axis] = 1.0f;
    return glm::angleAxis(static_cast<float>(a), v);
  };
  Capture figure = Figure();
  const double pitches[] = {90.0,        -90.0,       90.0 - 1e-6,  -90.0 + 1e-5,
                            90.0 - 1e-4, 90.0 + 1e-3, -90.0 - 1e-2, 89.9};
  figure.clip.Resize(400, figure.skeleton.joint_count());
  for (int f = 0; f < 400; ++f) {
    for (std::size_t j = 1; j < figure.skeleton.joints.size(); ++j) {
      const double pitch = pitches[random() % std::size(pitches)] * kDegree;
      figure.clip.frame(f).rotations[j] =
          Normalise(turn(2, angle(random)) * turn(1, pitch) * turn(0, angle(random)));
    }
    figure.clip.frame(f).rotations[0] = kIdentityQuat;
    figure.clip.frame(f).root_position_m = Vec3(0, 1, 0);
  }
  ExpectSame(ReadInMetres(Written(figure.skeleton, figure.clip)), figure.skeleton, figure.clip);
}

// Three full turns about an oblique axis and a spinning root: no angle may jump by 360 degrees.
TEST(WriteBvh, AnglesAreContinuous) {
  Capture figure = Figure();
  const int frames = 360;
  figure.clip.Resize(frames, figure.skeleton.joint_count());
  for (int f = 0; f < frames; ++f) {
    figure.clip.frame(f).root_position_m = Vec3(0, 1, 0);
    for (std::size_t j = 0; j < figure.skeleton.joints.size(); ++j) {
      const double a = 3.0 * 360.0 * kDegree * f / frames;
      figure.clip.frame(f).rotations[j] =
          j == 0
              ? YawRotation(a)
              : glm::angleAxis(static_cast<float>(a),
                               glm::normalize(Vec3(0.2f, 0.1f * static_cast<float>(j % 4), 1.0f)));
    }
  }
  const std::string text = Written(figure.skeleton, figure.clip);
  std::istringstream in(text.substr(text.find('\n', text.find("Frame Time")) + 1));
  std::vector<double> before, now(3 + 3 * figure.skeleton.joints.size());
  double largest = 0.0;
  double furthest = 0.0;
  for (int f = 0; f < frames; ++f) {
    for (double& value : now) ASSERT_TRUE(in >> value);
    for (std::size_t i = 3; i < now.size(); ++i) {
      furthest = std::max(furthest, std::fabs(now[i]));
      if (!before.empty()) largest = std::max(largest, std::fabs(now[i] - before[i]));
    }
    before = now;
  }
  EXPECT_LT(largest, 5.0);  // Three degrees per frame, slightly more for the oblique axis.
  EXPECT_GT(furthest, 1000.0);
}

TEST(WriteBvh, RoundTripsEveryCapture) {
  std::vector<std::filesystem::path> paths = test::SharedCaptures();
  if (paths.empty()) paths = test::PackagedCaptures();
  if (paths.empty()) GTEST_SKIP() << "no captures at " << MocapDir() << " and no assimp-testmodels";
  for (const std::filesystem::path& path : paths) {
    SCOPED_TRACE(path.string());
    const Expected<Capture> capture = ReadBvh(path);
    ASSERT_TRUE(capture.has_value());
    const Capture again = ReadInMetres(Written(capture->skeleton, capture->clip));
    ExpectSame(again, capture->skeleton, capture->clip);
    EXPECT_EQ(again.clip.fps, capture->clip.fps);
    for (int side = 0; side < 2; ++side) {
      EXPECT_EQ(again.skeleton.legs[side].ankle, capture->skeleton.legs[side].ankle);
      EXPECT_EQ(again.skeleton.legs[side].ball_offset_m,
                capture->skeleton.legs[side].ball_offset_m);
      EXPECT_EQ(again.skeleton.legs[side].toe_tip_offset_m,
                capture->skeleton.legs[side].toe_tip_offset_m);
    }
  }
}

TEST(WriteBvh, AddsEndSitesAndReplacesInvalidCharacters) {
  Capture figure = Figure();
  figure.skeleton.end_sites.clear();
  figure.skeleton.joints[1].name = "Left {Up} Leg";
  const Capture again = ReadInMetres(Written(figure.skeleton, figure.clip));
  EXPECT_EQ(again.skeleton.end_sites.size(), 5u);  // Two toes, the head and two arms.
  EXPECT_GE(again.skeleton.FindJoint("Left__Up__Leg"), 0);
}

// A skeleton whose joints are sorted parents first, but not depth first.
TEST(WriteBvh, WritesJointsDepthFirst) {
  Skeleton skeleton;
  skeleton.joints = {{"root", -1, Vec3(0.0f)},
                     {"a", 0, Vec3(1, 0, 0)},
                     {"b", 0, Vec3(2, 0, 0)},
                     {"a1", 1, Vec3(3, 0, 0)}};
  for (Leg& leg : skeleton.legs) leg = {1, 1, 1, 1, Vec3(0.0f), Vec3(0.0f)};
  Clip clip;
  clip.fps = 30.0;
  clip.Resize(1, 4);
  clip.rotations[2] = YawRotation(20.0 * kDegree);
  clip.rotations[3] = YawRotation(30.0 * kDegree);
  const std::string text = Written(skeleton, clip);
  EXPECT_LT(text.find("JOINT a1"), text.find("JOINT b"));
  const std::size_t row = text.find('\n', text.find("Frame Time"));
  EXPECT_LT(text.find(" 30.0000", row), text.find(" 20.0000", row));
}

TEST(WriteBvh, RejectsInvalidClips) {
  const Capture figure = Figure();
  std::ostringstream out;
  Clip shorter = figure.clip;
  shorter.Resize(12, 3);
  EXPECT_EQ(WriteBvh(figure.skeleton, shorter, out).error().code, ErrorCode::kShapeMismatch);
  Clip empty = figure.clip;
  empty.Resize(0, figure.clip.joint_count);
  EXPECT_EQ(WriteBvh(figure.skeleton, empty, out).error().code, ErrorCode::kOutOfRange);
  Skeleton broken = figure.skeleton;
  broken.joints[3].parent = 7;
  EXPECT_EQ(WriteBvh(broken, figure.clip, out).error().code, ErrorCode::kOutOfRange);
  EXPECT_TRUE(out.str().empty());
  out.setstate(std::ios::badbit);
  EXPECT_EQ(WriteBvh(figure.skeleton, figure.clip, out).error().code, ErrorCode::kIo);
}

TEST(WriteBvh, FileIsCompleteOrUnchanged) {
  const Capture figure = Figure();
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) /
                                       ("stridewire_bvh_" + std::to_string(std::random_device{}()));
  std::filesystem::create_directory(folder);
  const std::filesystem::path path = folder / "walk.bvh";
  ASSERT_TRUE(WriteBvh(figure.skeleton, figure.clip, path).has_value());
  EXPECT_EQ(test::FileText(path), Written(figure.skeleton, figure.clip));

  Clip bad = figure.clip;
  bad.root_positions_m[3].x = std::nanf("");
  const Status status = WriteBvh(figure.skeleton, bad, path);
  ASSERT_FALSE(status.has_value());
  EXPECT_EQ(status.error().where, path.string());
  EXPECT_EQ(test::FileText(path), Written(figure.skeleton, figure.clip));

  const Status nowhere = WriteBvh(figure.skeleton, figure.clip, folder / "no" / "walk.bvh");
  ASSERT_FALSE(nowhere.has_value());
  EXPECT_EQ(nowhere.error().code, ErrorCode::kIo);
  // The path is a folder, so the writer must remove its temporary file.
  std::filesystem::create_directory(folder / "taken.bvh");
  EXPECT_EQ(WriteBvh(figure.skeleton, figure.clip, folder / "taken.bvh").error().code,
            ErrorCode::kIo);

  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  EXPECT_EQ(names, (std::vector<std::string>{"taken.bvh", "walk.bvh"}));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace stridewire
