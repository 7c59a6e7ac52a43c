// Gives every joint an arbitrary constant rotation of its own frame. The figure then moves as
// before, so every world position that a library plays must stay the same.
//
// STRIDEWIRE_REFRAMINGS sets the number of random changes per library; the default is 1.

#include "reframing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "captured_library.h"
#include "offline/build/layers.h"
#include "offline/builtin/builtin_library.h"
#include "offline/complete/complete_library.h"
#include "rough_ground.h"
#include "stridewire/offline/bvh_writer.h"
#include "stridewire/offline/choreography.h"
#include "stridewire/offline/synthesis.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;

constexpr double kMostM = 1e-4;
constexpr double kMostWithoutToesM = 1e-3;
constexpr int kFailingWalk = 300;  // Frames of a failing walk that are compared.

unsigned ReframingCount() {
  const char* asked = std::getenv("STRIDEWIRE_REFRAMINGS");
  return asked == nullptr ? 1u : static_cast<unsigned>(std::atoi(asked));
}

// One choreography of each kind of movement that a library may have.
struct Choice {
  const char* name;
  std::vector<MovementRequest> requests;
  bool has_terrain = false;
  bool has_layer = false;
};

// Generated steps last for multiples of 1/120 s. At 60 Hz, frames could coincide with the ends of
// movements, and rounding errors would decide to which movement a frame belongs and how many frames
// there are.
constexpr double kFps = 59.3;

std::vector<Choice> Choreographies() {
  const std::vector<MovementRequest> steps = {
      {1, StepRequest{.length_m = 0.4}},
      {2, StepRequest{.length_m = 0.5, .turn_rad = 0.2}},
      {3, StepRequest{.length_m = 0.45}},
      {4, StepRequest{.length_m = 0.3, .side_m = 0.2, .turn_rad = -0.3}},
      {5, StandRequest{0.3}}};
  const std::vector<MovementRequest> walk = {
      {1, WalkRequest{.position_m = {0.4, 0.0, 2.0}, .heading_rad = 0.3}}};
  return {{"steps", steps},
          {"walk_to", walk},
          {"jump", {{1, JumpRequest{.length_m = 0.5}}, {2, StandRequest{0.2}}}},
          {"rough ground", steps, true},
          {"layer", steps, false, true}};
}

Expected<Synthesis> Play(const Library& library, const Choice& choice) {
  SynthesisInput input{.library = library, .requests = choice.requests, .fps = kFps};
  Random random(5);
  if (choice.has_terrain) input.options.terrain = RoughGround(random);
  std::vector<LayerCue> cues;
  if (choice.has_layer && !library->layers().empty()) {
    cues.push_back({.before = 1, .layer = std::string(library->layers()[0].name), .weight = 0.8});
  }
  input.layers = cues;
  return Synthesize(input);
}

// Positions of all joints, tips of bones, balls and toes in a pose.
std::vector<Vec3> PointsOf(const Skeleton& skeleton, ConstPoseSpan pose) {
  std::vector<Vec3> points(skeleton.joints.size());
  std::vector<Quat> rotations(skeleton.joints.size());
  ForwardKinematics(skeleton, pose, points, rotations);
  for (const EndSite& site : skeleton.end_sites) {
    const auto joint = static_cast<std::size_t>(site.joint);
    points.push_back(points[joint] + rotations[joint] * site.offset_m);
  }
  for (const Leg& leg : skeleton.legs) {
    points.push_back(PointPosition(skeleton, pose, leg.ball, leg.ball_offset_m));
    points.push_back(PointPosition(skeleton, pose, leg.ball, leg.toe_tip_offset_m));
  }
  return points;
}

// Returns the largest distance between corresponding points in `frames` frames of two clips.
double LargestDistance(const Skeleton& skeleton, const Clip& clip, const Skeleton& other_skeleton,
                       const Clip& other_clip, int frames) {
  double worst_m = 0.0;
  for (int f = 0; f < frames; ++f) {
    const std::vector<Vec3> from = PointsOf(skeleton, clip.frame(f));
    const std::vector<Vec3> to = PointsOf(other_skeleton, other_clip.frame(f));
    for (std::size_t i = 0; i < from.size(); ++i) {
      worst_m = std::max(worst_m, static_cast<double>(glm::length(from[i] - to[i])));
    }
  }
  return worst_m;
}

// Plays all choreographies with both libraries. Returns the largest distance between corresponding
// points.
double CompareLibraries(const Library& library, const Library& reframed,
                        double tolerance_m = kMostM) {
  double most_m = 0.0;
  for (const Choice& choice : Choreographies()) {
    SCOPED_TRACE(choice.name);
    const Expected<Synthesis> before = Play(library, choice);
    const Expected<Synthesis> after = Play(reframed, choice);
    EXPECT_EQ(before.has_value(), after.has_value())
        << (before ? Describe(after.error()) : Describe(before.error()));
    if (!before || !after) continue;
    EXPECT_EQ(before->clip.frame_count(), after->clip.frame_count());
    EXPECT_EQ(before->movements.size(), after->movements.size());
    int frames = std::min(before->clip.frame_count(), after->clip.frame_count());
    // A walk that fails repeats its last steps many times. Which of two equally good steps it takes
    // then depends on rounding errors.
    if (!before->walks.empty() && !before->walks[0].arrived)
      frames = std::min(frames, kFailingWalk);
    const double worst_m = LargestDistance(library->skeleton(), before->clip, reframed->skeleton(),
                                           after->clip, frames);
    EXPECT_LE(worst_m, tolerance_m);
    most_m = std::max(most_m, worst_m);
  }
  return most_m;
}

TEST(Reframing, GeneratedLibraryPlaysTheSame) {
  const RawLibrary raw = GenerateBuiltinLibrary();
  const Library library = LibraryBuilder{}.Build(raw).value();
  for (unsigned seed = 1; seed <= ReframingCount(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const RawLibrary other = Reframed(raw, RandomFrames(raw.skeleton, seed));
    const double most_m = CompareLibraries(library, LibraryBuilder{}.Build(other).value());
    std::printf("builtin, seed %u: %.4f mm\n", seed, 1000.0 * most_m);
  }
}

struct Subject {
  const char* name;
  bool mirrors;
};

class ReframedCaptures : public testing::TestWithParam<Subject> {};

// Builds a library as `stridewire-library build` does.
Library Build(const std::vector<Capture>& captures, bool mirrors) {
  LibraryAssembler assembler({.mirror = mirrors});
  for (const Capture& capture : captures) assembler.Add(capture);
  RawLibrary raw = assembler.Assemble().value();
  CompleteLibrary(raw);
  raw.layers.push_back(CutLayer(captures[0], raw.skeleton, {.name = "layer"}).value());
  return LibraryBuilder::Selecting().Build(raw).value();
}

TEST_P(ReframedCaptures, PlayTheSame) {
  const std::vector<std::string> subjects = {GetParam().name};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  std::vector<Capture> captures;
  for (const auto& take : TakesOf(subjects)) captures.push_back(ReadBvh(take).value());
  const Library library = Build(captures, GetParam().mirrors);
  for (unsigned seed = 1; seed <= ReframingCount(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const JointFrames frames = RandomFrames(captures[0].skeleton, seed);
    std::vector<Capture> reframed;
    for (const Capture& capture : captures) reframed.push_back(Reframed(capture, frames));
    const double most_m = CompareLibraries(library, Build(reframed, GetParam().mirrors));
    std::printf("%s%s, seed %u: %.4f mm\n", GetParam().name, GetParam().mirrors ? " mirrored" : "",
                seed, 1000.0 * most_m);
  }
}

// Writes a capture as a file and reads it again.
Capture ThroughFile(const Capture& capture) {
  std::ostringstream text;
  EXPECT_TRUE(WriteBvh(capture.skeleton, capture.clip, text).has_value());
  return ParseBvh(text.str(), "walk.bvh").value();
}

// In a file with turned joint frames, the bones of the rest pose point in arbitrary directions, so
// the reader must not rely on the rest pose.
TEST(ReframedFiles, PlayTheSame) {
  const std::vector<std::string> subjects = {kDebianTakes};
  STRIDEWIRE_SKIP_WITHOUT_TAKES(subjects);
  std::vector<Capture> captures;
  for (const auto& take : TakesOf(subjects)) captures.push_back(ReadBvh(take).value());
  std::vector<Capture> files;
  for (const Capture& capture : captures) files.push_back(ThroughFile(capture));
  const Library library = Build(files, true);
  for (unsigned seed = 1; seed <= ReframingCount(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const JointFrames frames = RandomFrames(captures[0].skeleton, seed);
    std::vector<Capture> reframed;
    for (const Capture& capture : captures) {
      reframed.push_back(ThroughFile(Reframed(capture, frames)));
    }
    const double most_m = CompareLibraries(library, Build(reframed, true));
    std::printf("files, seed %u: %.4f mm\n", seed, 1000.0 * most_m);
  }
}

// A walk of the generated figure, with an End Site at the tip of each foot instead of toes.
Capture WalkWithoutToes() {
  const Library library = OpenLibrary("builtin").value();
  std::vector<MovementRequest> requests;
  for (std::uint64_t id = 1; id <= 6; ++id) requests.push_back({id, StepRequest{.length_m = 0.5}});
  const Synthesis walk = Synthesize({.library = library, .requests = requests}).value();
  const Skeleton& figure = library->skeleton();
  Capture capture;
  capture.path = "walk.bvh";
  std::vector<std::size_t> kept;
  std::vector<int> new_index(figure.joints.size(), -1);
  for (std::size_t j = 0; j < figure.joints.size(); ++j) {
    Joint joint = figure.joints[j];
    const bool is_toe = joint.name.ends_with("ToeBase");
    if (joint.parent >= 0) joint.parent = new_index[static_cast<std::size_t>(joint.parent)];
    if (is_toe) {
      capture.skeleton.end_sites.push_back({joint.parent, 1.5f * joint.offset_m});
      continue;
    }
    new_index[j] = capture.skeleton.joint_count();
    kept.push_back(j);
    capture.skeleton.joints.push_back(joint);
  }
  for (std::size_t f = 0; f < 2; ++f) {
    const auto index = [&](int joint) { return new_index[static_cast<std::size_t>(joint)]; };
    const Leg& leg = figure.legs[f];
    // The reader finds the ball and the toes.
    capture.skeleton.legs[f] = {
        index(leg.hip), index(leg.knee), index(leg.ankle), index(leg.ankle), {}, {}};
  }
  capture.clip.fps = walk.clip.fps;
  capture.clip.Resize(walk.clip.frame_count(), static_cast<int>(kept.size()));
  for (int f = 0; f < walk.clip.frame_count(); ++f) {
    const PoseSpan pose = capture.clip.frame(f);
    pose.root_position_m = walk.clip.frame(f).root_position_m;
    for (std::size_t k = 0; k < kept.size(); ++k) {
      pose.rotations[k] = walk.clip.frame(f).rotations[kept[k]];
    }
  }
  return capture;
}

TEST(ReframedFiles, FeetWithoutToesPlayTheSame) {
  const Capture capture = WalkWithoutToes();
  const Library library = Build({ThroughFile(capture)}, true);
  for (unsigned seed = 1; seed <= ReframingCount(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const JointFrames frames = RandomFrames(capture.skeleton, seed);
    const Library other = Build({ThroughFile(Reframed(capture, frames))}, true);
    // The flat sole is found in the rest pose of one file and in the motion of the other.
    const double most_m = CompareLibraries(library, other, kMostWithoutToesM);
    std::printf("without toes, seed %u: %.4f mm\n", seed, 1000.0 * most_m);
  }
}

// Returns how far a knee is in front of the line from hip to ankle, in the direction that the
// pelvis faces. Negative if the knee bends backward.
double KneeAhead(const Skeleton& skeleton, const std::vector<Vec3>& points, Foot foot) {
  const auto at = [&](int joint) { return DVec3(points[static_cast<std::size_t>(joint)]); };
  const Leg& leg = skeleton.leg(foot);
  const DVec3 left = at(skeleton.leg(Foot::kLeft).hip) - at(skeleton.leg(Foot::kRight).hip);
  const DVec3 line = glm::normalize(at(leg.ankle) - at(leg.hip));
  const DVec3 knee = at(leg.knee) - at(leg.hip);
  return glm::dot(knee - glm::dot(knee, line) * line,
                  glm::normalize(glm::cross(left, DVec3(0.0, 1.0, 0.0))));
}

// The same walk as m00_base, with other axes of the leg joints.
TEST(ReframedCases, PlayTheSameWithKneesForward) {
  const std::filesystem::path cases = MocapDir().parent_path() / "cases";
  if (!std::filesystem::exists(cases / "m00_base.bvh")) {
    GTEST_SKIP() << "no cases in " << cases.string();
  }
  const Choreography choreography = ReadChoreography(cases / "c_four_steps.json").value();
  struct Played {
    Library library;
    Synthesis synthesis;
  };
  const auto play = [&](const char* name) {
    LibraryAssembler assembler;
    EXPECT_EQ(assembler.Add(ReadBvh(cases / name).value()).steps_left, 3) << name;
    EXPECT_EQ(assembler.files().back().steps_right, 3) << name;
    const Library library = LibraryBuilder::Selecting().Build(assembler.Assemble().value()).value();
    return Played{library,
                  Synthesize({.library = library, .requests = choreography.movements}).value()};
  };
  const Played base = play("m00_base.bvh");
  for (const char* name : {"m04_knee_z180.bvh", "m06_knee_y90.bvh"}) {
    SCOPED_TRACE(name);
    const Played other = play(name);
    const Skeleton& skeleton = other.library->skeleton();
    ASSERT_EQ(other.synthesis.clip.frame_count(), base.synthesis.clip.frame_count());
    EXPECT_LE(LargestDistance(base.library->skeleton(), base.synthesis.clip, skeleton,
                              other.synthesis.clip, base.synthesis.clip.frame_count()),
              0.005);
    for (int f = 0; f < other.synthesis.clip.frame_count(); ++f) {
      const std::vector<Vec3> points = PointsOf(skeleton, other.synthesis.clip.frame(f));
      for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
        EXPECT_GE(KneeAhead(skeleton, points, foot), -0.002) << "frame " << f;
      }
    }
  }
}

std::vector<Subject> Subjects() {
  std::vector<Subject> subjects;
  for (const bool mirrors : {false, true}) {
    for (const char* name : {"01", "03", "05", "06", "09", "14", "16", "29", "32", kDebianTakes,
                             "gaits/07", "gaits/08", "gaits/127", "gaits/135", "gaits/16",
                             "gaits/17", "other/animated-drawings", "other/daz", "other/pymo"}) {
      subjects.push_back({name, mirrors});
    }
  }
  return subjects;
}

// Returns a name such as "Subject01Mirrored" or "gaits07".
std::string TestName(const testing::TestParamInfo<Subject>& of) {
  std::string name = of.param.name;
  if (name == kDebianTakes) {
    name = "Debian";
  } else if (!name.contains('/')) {
    name = "Subject" + name;
  }
  std::erase_if(name, [](char c) { return std::isalnum(c) == 0; });
  return name + (of.param.mirrors ? "Mirrored" : "");
}

INSTANTIATE_TEST_SUITE_P(Subjects, ReframedCaptures, testing::ValuesIn(Subjects()), TestName);

}  // namespace
}  // namespace stridewire
