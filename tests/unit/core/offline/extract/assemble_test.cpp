#include "offline/extract/assemble.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "capture_files.h"
#include "offline/builtin/builtin_library.h"
#include "offline/extract/mirror.h"
#include "offline/extract/mirror_joints.h"
#include "reframing.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/library/keytimes.h"
#include "runtime/skeleton/foot_vector.h"
#include "stridewire/offline/library_builder.h"
#include "synthetic_walker.h"

namespace stridewire {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

Capture PlainWalk() {
  return SyntheticWalker{}.Walk({{Foot::kLeft, 0.5},
                                 {Foot::kRight, 0.6},
                                 {Foot::kLeft, 0.55},
                                 {Foot::kRight, 0.5},
                                 {Foot::kLeft, 0.0}});
}

Capture StairWalk() {
  return SyntheticWalker{}.Walk({{Foot::kLeft, 0.4, 0.2},
                                 {Foot::kRight, 0.4, 0.2},
                                 {Foot::kLeft, 0.4, 0.2},
                                 {Foot::kRight, 0.0},
                                 {Foot::kLeft, 0.35, -0.2},
                                 {Foot::kRight, 0.35, -0.2},
                                 {Foot::kLeft, 0.4, -0.2},
                                 {Foot::kRight, 0.0}});
}

// Expects the properties that raw_library.h documents.
void ExpectWellFormed(const RawLibrary& library) {
  EXPECT_TRUE(library.skeleton.Validate().has_value());
  EXPECT_EQ(library.stand_pose.rotations.size(), library.skeleton.joints.size());
  for (const RawGroup& group : library.groups) {
    ASSERT_FALSE(group.examples.empty());
    EXPECT_LE(group.parameters.size(), static_cast<std::size_t>(kMaxParameters));
    for (const RawExample& example : group.examples) {
      EXPECT_TRUE(example.clip.Validate().has_value()) << example.source;
      EXPECT_EQ(example.clip.joint_count, library.skeleton.joint_count());
      EXPECT_TRUE(ValidateKeytimes(example.keytimes_s).has_value()) << example.source;
      EXPECT_EQ(example.keytimes_s.size(), group.examples[0].keytimes_s.size());
      EXPECT_NEAR(example.keytimes_s.back(), example.clip.duration_s(), 1e-9);
      EXPECT_EQ(example.parameters.size(), group.parameters.size());
      EXPECT_NEAR(example.clip.root_positions_m[0].x, 0.0, 1e-6);
      EXPECT_NEAR(example.clip.root_positions_m[0].z, 0.0, 1e-6);
      EXPECT_FALSE(example.source.empty());
    }
  }
}

std::vector<std::string> GroupTexts(const RawLibrary& library) {
  std::vector<std::string> texts;
  for (const RawGroup& group : library.groups) {
    std::string text = std::string(MovementKindName(group.kind)) + " " +
                       std::to_string(group.examples.size()) + ":";
    for (const ParameterName name : group.parameters) {
      text.append(" ").append(ParameterText(name));
    }
    texts.push_back(std::move(text));
  }
  return texts;
}

TEST(LibraryAssembler, StraightWalksGiveTwoParameterGroupsOnly) {
  LibraryAssembler assembler;
  assembler.Add(PlainWalk());
  assembler.Add(SyntheticWalker{}.Jump(0.6));
  assembler.Add(SyntheticWalker{}.Jump(0.9));
  const Expected<RawLibrary> library = assembler.Assemble();
  ASSERT_TRUE(library.has_value()) << Describe(library.error());
  ExpectWellFormed(*library);
  EXPECT_THAT(GroupTexts(*library),
              ElementsAre("step_left 3: start_z_m end_z_m", "step_right 2: start_z_m end_z_m",
                          "jump 2: length_m"));
}

TEST(LibraryAssembler, StairsGiveGroupsWithHeight) {
  LibraryAssembler assembler;
  for (int i = 0; i < 3; ++i) assembler.Add(StairWalk());
  assembler.Add(PlainWalk());
  const Expected<RawLibrary> library = assembler.Assemble();
  ASSERT_TRUE(library.has_value()) << Describe(library.error());
  ExpectWellFormed(*library);
  // The steps go up, down and ahead, without turns. The level steps are those of the plain walk.
  // Its two right steps span no area, so they belong to the general group.
  EXPECT_THAT(GroupTexts(*library),
              ElementsAre("step_left 3: start_z_m end_z_m",
                          "step_left 15: start_y_m start_z_m end_y_m end_z_m",
                          "step_right 14: start_y_m start_z_m end_y_m end_z_m"));
}

// One walk over stairs has too few steps of each foot for the height parameters. Its climbing steps
// must not be blended with level ones.
TEST(LibraryAssembler, FewClimbingStepsAreLeftOut) {
  LibraryAssembler assembler;
  assembler.Add(StairWalk());
  assembler.Add(PlainWalk());
  std::size_t level = 0;
  std::size_t all = 0;
  for (const Extraction& file : assembler.files()) {
    for (const ExtractedExample& step : file.general_steps) {
      ++all;
      level += step.level ? 1 : 0;
    }
  }
  ASSERT_GT(all, level);
  const Expected<RawLibrary> library = assembler.Assemble();
  ASSERT_TRUE(library.has_value()) << Describe(library.error());
  ExpectWellFormed(*library);
  for (const RawGroup& group : library->groups) {
    const bool has_heights =
        std::ranges::find(group.parameters, ParameterName::kEndY) != group.parameters.end() &&
        std::ranges::find(group.parameters, ParameterName::kStartY) != group.parameters.end();
    if (has_heights) {
      EXPECT_GT(group.examples.size(), group.parameters.size());
    } else {
      EXPECT_LE(group.examples.size(), level);
    }
    for (const RawExample& example : group.examples) {
      if (has_heights) continue;
      // The root of a level step neither rises nor falls.
      const std::vector<Vec3>& root = example.clip.root_positions_m;
      EXPECT_NEAR(root.front().y, root.back().y, 0.05) << example.source;
    }
  }
}

TEST(LibraryAssembler, ClimbingStepsAloneNeedHeights) {
  for (const int walks : {1, 3}) {
    LibraryAssembler assembler;
    for (int i = 0; i < walks; ++i) assembler.Add(StairWalk());
    const Expected<RawLibrary> library = assembler.Assemble();
    if (!library) continue;
    for (const RawGroup& group : library->groups) {
      const auto climbs = [](const RawExample& example) {
        const std::vector<Vec3>& root = example.clip.root_positions_m;
        return std::fabs(root.front().y - root.back().y) > 0.08;
      };
      if (std::ranges::none_of(group.examples, climbs)) continue;
      EXPECT_NE(std::ranges::find(group.parameters, ParameterName::kEndY), group.parameters.end());
    }
  }
}

TEST(LibraryAssembler, ExtractsOnlyTheRequestedKinds) {
  AssembleOptions options;
  options.steps = false;
  LibraryAssembler jumps(options);
  jumps.Add(PlainWalk());
  EXPECT_EQ(jumps.Assemble().error().code, ErrorCode::kNotFound);
  jumps.Add(SyntheticWalker{}.Jump(0.7));
  ASSERT_TRUE(jumps.Assemble().has_value());
  EXPECT_THAT(GroupTexts(*jumps.Assemble()), ElementsAre("jump 1: length_m"));
}

TEST(LibraryAssembler, RejectsCapturesWithAnotherJointTree) {
  LibraryAssembler assembler;
  assembler.Add(PlainWalk());
  Capture other = PlainWalk();
  other.skeleton.joints[3].name = "Ankle";
  EXPECT_EQ(assembler.Add(other).error, "its joint 3 is Ankle where synthetic.bvh has LeftFoot");
  Capture rehung = PlainWalk();
  rehung.skeleton.joints[3].parent = 0;
  EXPECT_THAT(assembler.Add(rehung).error,
              testing::MatchesRegex(
                  "its joint LeftFoot has the parent .+ where in synthetic.bvh the parent is .+"));
  Capture fewer = PlainWalk();
  fewer.skeleton.joints.pop_back();
  EXPECT_EQ(assembler.Add(fewer).error, "it has 11 joints, synthetic.bvh has 12");
  const Expected<RawLibrary> library = assembler.Assemble();
  ASSERT_TRUE(library.has_value());
  EXPECT_EQ(library->groups[0].examples.size(), 3u);
  EXPECT_EQ(assembler.files().size(), 4u);
}

// Two people of different size on one skeleton: rotations are those of the capture, and the path of
// the root is scaled by the length of the legs.
TEST(LibraryAssembler, RetargetsSubject14ToSubject03) {
  const auto first = MocapFiles("cmu/03");
  const auto second = MocapFiles("cmu/14");
  STRIDEWIRE_SKIP_WITHOUT(first);
  STRIDEWIRE_SKIP_WITHOUT(second);
  const auto leg_length = [](const Skeleton& skeleton) {
    double length = 0.0;
    for (const Leg& leg : skeleton.legs) {
      for (const int joint : {leg.knee, leg.ankle}) {
        length += glm::length(skeleton.joints[static_cast<std::size_t>(joint)].offset_m) / 2.0;
      }
    }
    return length;
  };
  LibraryAssembler assembler;
  for (const auto& path : first) ASSERT_TRUE(assembler.Add(ReadBvh(path).value()).error.empty());
  int compared = 0;
  for (const auto& path : second) {
    const Capture capture = ReadBvh(path).value();
    const Extraction own = Extract(capture);
    const Extraction& fitted = assembler.Add(capture);
    ASSERT_TRUE(fitted.error.empty()) << fitted.error;
    const double scale = leg_length(fitted.skeleton) / leg_length(own.skeleton);
    EXPECT_GT(std::fabs(scale - 1.0), 0.01) << scale << ": the sizes must differ";
    ASSERT_EQ(fitted.general_steps.size(), own.general_steps.size());
    for (std::size_t i = 0; i < own.general_steps.size(); ++i) {
      const RawExample& a = own.general_steps[i].example;
      const RawExample& b = fitted.general_steps[i].example;
      EXPECT_EQ(a.keytimes_s, b.keytimes_s);
      ASSERT_EQ(a.clip.frame_count(), b.clip.frame_count());
      for (int f = 0; f < a.clip.frame_count(); ++f) {
        for (std::size_t j = 1; j < own.skeleton.joints.size(); ++j) {
          ASSERT_EQ(a.clip.frame(f).rotations[j], b.clip.frame(f).rotations[j]);
        }
        const Vec3& from = a.clip.root_positions_m[static_cast<std::size_t>(f)];
        const Vec3& to = b.clip.root_positions_m[static_cast<std::size_t>(f)];
        ASSERT_NEAR(std::hypot(to.x, to.z), scale * std::hypot(from.x, from.z), 1e-4);
      }
      // The proportions of thigh and shank differ, so feet land only approximately at the scaled
      // position.
      for (std::size_t l = 0; l < 6; ++l) {
        EXPECT_NEAR(b.parameters[l], scale * a.parameters[l], 0.06) << b.source << " " << l;
      }
      ++compared;
    }
  }
  EXPECT_GE(compared, 12);
  const RawLibrary library = assembler.Assemble().value();
  ExpectWellFormed(library);
  // One level step of the left foot and two of the right span no area.
  EXPECT_EQ(library.groups.size(), 2u);
  const RawGroup& general = library.groups.back();
  EXPECT_EQ(general.parameters.size(), 7u);
  for (const char* subject : {"03_", "14_"}) {
    EXPECT_TRUE(std::ranges::any_of(general.examples, [&](const RawExample& example) {
      return example.source.starts_with(subject);
    })) << subject;
  }
}

TEST(LibraryAssembler, IgnoresTheSkeletonOfAnUnusableFirstCapture) {
  LibraryAssembler assembler;
  Capture empty = PlainWalk();
  empty.clip = Clip{};
  EXPECT_NE(assembler.Add(empty).error, "");
  EXPECT_EQ(assembler.Add(PlainWalk()).error, "");
  EXPECT_TRUE(assembler.Assemble().has_value());
}

TEST(LibraryAssembler, FailsWithoutMovements) {
  LibraryAssembler none;
  EXPECT_EQ(none.Assemble().error().code, ErrorCode::kNotFound);
  none.Add(SyntheticWalker{}.Stand(2.0));
  EXPECT_EQ(none.Assemble().error().code, ErrorCode::kNotFound);
}

TEST(LibraryAssembler, RetargetsOtherBoneLengths) {
  SyntheticWalker tall;
  tall.leg_scale = 1.15;
  LibraryAssembler assembler;
  assembler.Add(PlainWalk());
  assembler.Add(tall.Walk({{Foot::kLeft, 0.5}, {Foot::kRight, 0.6}, {Foot::kLeft, 0.0}}));
  const Expected<RawLibrary> library = assembler.Assemble();
  ASSERT_TRUE(library.has_value());
  ExpectWellFormed(*library);
  EXPECT_EQ(library->groups[0].examples.size(), 5u);
  for (const RawGroup& group : library->groups) {
    const Foot fixed = OtherFoot(MovingFoot(group.kind));
    for (const RawExample& example : group.examples) {
      EXPECT_NEAR(BallPosition(library->skeleton, example.clip.frame(0), fixed).y,
                  kWalkerBallHeightM, 0.005)
          << example.source;
    }
  }
}

TEST(LibraryAssembler, AlignsFloorsOfRecordings) {
  LibraryAssembler assembler;
  for (const float rise : {0.0f, 0.02f, -0.01f, 0.5f}) {
    Capture capture = PlainWalk();
    for (Vec3& position : capture.clip.root_positions_m) position.y += rise;
    assembler.Add(capture);
  }
  const Expected<RawLibrary> library = assembler.Assemble();
  ASSERT_TRUE(library.has_value());
  const float height = library->stand_pose.root_position_m.y;
  for (const RawGroup& group : library->groups) {
    for (const RawExample& example : group.examples) {
      EXPECT_NEAR(example.clip.root_positions_m[0].y, height, 0.005) << example.source;
    }
  }
}

TEST(LibraryAssembler, MirroringGivesBothFeetTheSameSteps) {
  AssembleOptions options;
  options.mirror = true;
  LibraryAssembler assembler(options);
  assembler.Add(PlainWalk());
  const Expected<RawLibrary> library = assembler.Assemble();
  ASSERT_TRUE(library.has_value()) << Describe(library.error());
  ExpectWellFormed(*library);
  ASSERT_EQ(library->groups.size(), 2u);
  for (const RawGroup& group : library->groups) {
    EXPECT_EQ(group.examples.size(), 5u);
    const Foot moving = MovingFoot(group.kind);
    int mirrored = 0;
    for (const RawExample& example : group.examples) {
      mirrored += example.mirrored;
      const DVec3 start = FootVector(library->skeleton, example.clip.frame(0), moving, 0.0);
      EXPECT_NEAR(example.parameters[0], start.z, 1e-5);
      EXPECT_GT(start.x * (moving == Foot::kLeft ? 1.0 : -1.0), 0.1);
    }
    EXPECT_EQ(mirrored, group.kind == MovementKind::kStepLeft ? 2 : 3);
  }
}

TEST(LibraryAssembler, MirroringFailsForAsymmetricSkeletons) {
  AssembleOptions options;
  options.mirror = true;
  LibraryAssembler assembler(options);
  Capture capture = PlainWalk();
  capture.skeleton.joints[1].name = "LeftThing";
  capture.skeleton.joints[1].offset_m.x *= 1.5f;
  assembler.Add(capture);
  EXPECT_EQ(assembler.Assemble().error().code, ErrorCode::kUnsupported);
}

// Pairing by shape must give the same result as pairing by names.
TEST(FindMirrorJoints, PairsByShapeWithoutNames) {
  std::vector<Skeleton> skeletons = {PlainWalk().skeleton, GenerateBuiltinLibrary().skeleton};
  for (const char* folder : {"cmu/01", "cmu/03", "cmu/16"}) {
    const std::vector<std::filesystem::path> captures = MocapFiles(folder);
    if (!captures.empty()) skeletons.push_back(ReadBvh(captures.front())->skeleton);
  }
  for (Skeleton& skeleton : skeletons) {
    const Pose rest(skeleton.joint_count());
    const std::optional<std::vector<int>> by_name = FindMirrorJoints(skeleton, rest);
    ASSERT_TRUE(by_name.has_value());
    for (std::size_t j = 0; j < skeleton.joints.size(); ++j) {
      skeleton.joints[j].name = "joint " + std::to_string(j);
    }
    EXPECT_EQ(FindMirrorJoints(skeleton, rest), by_name) << skeleton.joints.size() << " joints";
    // This makes the skeleton asymmetric.
    skeleton.joints[static_cast<std::size_t>(skeleton.leg(Foot::kLeft).knee)].offset_m.y *= 1.3f;
    EXPECT_EQ(FindMirrorJoints(skeleton, rest), std::nullopt);
  }
}

// Subject 16 starts only with the left foot and stops with both. With mirroring, both feet do both.
// Mirrored examples must pass the checks of captured ones: parameters at the balls, feet planted as
// well as in the capture, and the same order of contacts.
TEST(LibraryAssembler, MirroredSubject16StartsAndStopsOnBothFeet) {
  const std::vector<std::filesystem::path> captures = MocapFiles("cmu/16");
  STRIDEWIRE_SKIP_WITHOUT(captures);
  AssembleOptions options;
  options.mirror = true;
  LibraryAssembler assembler(options);
  for (const std::filesystem::path& file : captures) assembler.Add(*ReadBvh(file));
  const Expected<RawLibrary> library = assembler.Assemble();
  ASSERT_TRUE(library.has_value()) << Describe(library.error());
  ExpectWellFormed(*library);
  for (const RawGroup& group : library->groups) {
    if (!IsStep(group.kind)) continue;
    const Foot moving = MovingFoot(group.kind), fixed = OtherFoot(moving);
    const auto index = [&](ParameterName name) {
      return static_cast<std::size_t>(std::ranges::find(group.parameters, name) -
                                      group.parameters.begin());
    };
    int mirrored = 0, starts = 0, stops = 0;
    double slide_m[2] = {
        0.0, 0.0};  // Slide of the fixed ball in single support, of captured and mirrored steps.
    for (const RawExample& example : group.examples) {
      SCOPED_TRACE(example.source);
      mirrored += example.mirrored;
      starts += std::fabs(example.parameters[index(ParameterName::kStartZ)]) < 0.1;
      stops += std::fabs(example.parameters[index(ParameterName::kEndZ)]) < 0.1;
      const int last = example.clip.frame_count() - 1;
      const DVec3 start = FootVector(library->skeleton, example.clip.frame(0), moving, 0.0);
      const DVec3 end = FootVector(library->skeleton, example.clip.frame(last), moving,
                                   example.heading_change_rad);
      EXPECT_NEAR(example.parameters[index(ParameterName::kStartZ)], start.z, 1e-4);
      EXPECT_NEAR(example.parameters[index(ParameterName::kEndZ)], end.z, 1e-4);
      if (index(ParameterName::kEndX) < group.parameters.size()) {
        EXPECT_NEAR(example.parameters[index(ParameterName::kEndX)], end.x, 1e-4);
      }
      if (index(ParameterName::kTurn) < group.parameters.size()) {
        EXPECT_EQ(example.parameters[index(ParameterName::kTurn)], example.heading_change_rad);
      }
      const auto frame_at = [&](std::size_t key) {
        return static_cast<int>(std::lround(example.keytimes_s[key] * example.clip.fps));
      };
      const DVec3 planted(BallPosition(library->skeleton, example.clip.frame(frame_at(1)), fixed));
      double slide = 0.0;
      for (int f = frame_at(1); f <= frame_at(2); ++f) {
        const DVec3 ball(BallPosition(library->skeleton, example.clip.frame(f), fixed));
        slide = std::max(slide, std::hypot(ball.x - planted.x, ball.z - planted.z));
      }
      EXPECT_LE(slide, 0.12);  // The limit of the segmentation.
      slide_m[example.mirrored ? 1 : 0] = std::max(slide_m[example.mirrored ? 1 : 0], slide);
    }
    EXPECT_GE(mirrored, 20);
    EXPECT_GE(starts, 2) << MovementKindName(group.kind);
    EXPECT_GE(stops, 2) << MovementKindName(group.kind);
    std::printf(
        "%s, %zu parameters: %zu examples, %d mirrored, %d starts, %d stops, slide %.3f m "
        "captured, %.3f m mirrored\n",
        std::string(MovementKindName(group.kind)).c_str(), group.parameters.size(),
        group.examples.size(), mirrored, starts, stops, slide_m[0], slide_m[1]);
  }
}

std::optional<SkeletonMirror> MirrorOf(const Extraction& found) {
  std::vector<const ExtractedExample*> steps;
  for (const ExtractedExample& step : found.general_steps) steps.push_back(&step);
  return FindSkeletonMirror(found.skeleton, MeasurePosture(found.skeleton, steps));
}

// Bones of equal length on both sides must end at the exact mirror images.
TEST(MirrorExample, MirrorsThePositionOfEveryJoint) {
  Capture capture = PlainWalk();
  for (const unsigned seed : {1u, 2u, 3u}) {
    const Extraction found = Extract(capture);
    ASSERT_FALSE(found.general_steps.empty());
    const std::optional<SkeletonMirror> mirror = MirrorOf(found);
    ASSERT_TRUE(mirror.has_value());
    const ExtractedExample& step = found.general_steps.front();
    const ExtractedExample image =
        MirrorExample(found.skeleton, *mirror, kGeneralStepParameters, step);
    const std::size_t count = found.skeleton.joints.size();
    std::vector<Vec3> from(count), to(count);
    std::vector<Quat> rotations(count);
    for (int f = 0; f < step.example.clip.frame_count(); ++f) {
      ForwardKinematics(found.skeleton, step.example.clip.frame(f), from, rotations);
      ForwardKinematics(found.skeleton, image.example.clip.frame(f), to, rotations);
      for (std::size_t j = 0; j < count; ++j) {
        const Vec3& partner = from[static_cast<std::size_t>(mirror->partners[j])];
        EXPECT_LT(glm::length(to[j] - Vec3(-partner.x, partner.y, partner.z)), 2e-5f)
            << found.skeleton.joints[j].name << ", frame " << f << ", " << seed - 1
            << " changes of axes";
      }
    }
    capture = Reframed(capture, RandomFrames(capture.skeleton, seed));
  }
}

TEST(MirrorExample, IsItsOwnInverse) {
  const Extraction found = Extract(PlainWalk());
  const std::optional<SkeletonMirror> mirror = MirrorOf(found);
  ASSERT_TRUE(mirror.has_value());
  for (const ExtractedExample& step : found.general_steps) {
    const ExtractedExample once =
        MirrorExample(found.skeleton, *mirror, kGeneralStepParameters, step);
    EXPECT_NE(once.kind, step.kind);
    EXPECT_TRUE(once.example.mirrored);
    const ExtractedExample twice =
        MirrorExample(found.skeleton, *mirror, kGeneralStepParameters, once);
    EXPECT_EQ(twice.kind, step.kind);
    EXPECT_FALSE(twice.example.mirrored);
    ASSERT_EQ(twice.example.clip.rotations.size(), step.example.clip.rotations.size());
    for (std::size_t i = 0; i < step.example.clip.rotations.size(); ++i) {
      EXPECT_LT(AngleBetween(twice.example.clip.rotations[i], step.example.clip.rotations[i]),
                1e-5);
    }
    EXPECT_TRUE(twice.example.clip.root_positions_m == step.example.clip.root_positions_m);
    for (std::size_t i = 0; i < 7; ++i) {
      EXPECT_NEAR(twice.example.parameters[i], step.example.parameters[i], 1e-6);
    }
  }
}

TEST(FindMirrorJoints, RecognizesCommonNames) {
  const auto partners = [](const std::vector<std::string>& names) {
    Skeleton skeleton;
    for (const std::string& name : names) {
      skeleton.joints.push_back({name, skeleton.joints.empty() ? -1 : 0, Vec3(0.0f)});
    }
    return FindMirrorJoints(skeleton, Pose(skeleton.joint_count()));
  };
  EXPECT_EQ(partners({"Hips", "LHipJoint", "RHipJoint", "LowerBack", "LThumb", "RThumb"}),
            (std::vector<int>{0, 2, 1, 3, 5, 4}));
  EXPECT_EQ(partners({"hip", "lThigh", "rThigh", "neck", "rEye", "lEye"}),
            (std::vector<int>{0, 2, 1, 3, 5, 4}));
  EXPECT_EQ(partners({"root", "mixamorig:LeftUpLeg", "mixamorig:RightUpLeg"}),
            (std::vector<int>{0, 2, 1}));
  EXPECT_EQ(partners({"root", "LeftUpLeg"}), std::nullopt);
  EXPECT_EQ(partners({"pelvis", "thigh_l", "thigh_r", "calf.L", "calf.R", "Ball"}),
            (std::vector<int>{0, 2, 1, 4, 3, 5}));
  EXPECT_EQ(partners({"Bip01", "Bip01 L Thigh", "Bip01 R Thigh", "J_Bip_R_Foot", "J_Bip_L_Foot"}),
            (std::vector<int>{0, 2, 1, 4, 3}));
  EXPECT_EQ(partners({"Hips", "AnkleLeft", "AnkleRight", "HandR", "HandL", "Spine"}),
            (std::vector<int>{0, 2, 1, 4, 3, 5}));
  EXPECT_EQ(partners({"Hips", "LeftArm_L", "RightArm_R", "Ribs", "Lung"}),
            (std::vector<int>{0, 2, 1, 3, 4}));
}

// Level steps blended from a walk over blocks of all heights must stay on their floor, although the
// heights of rolling balls differ by centimetres where steps join.
TEST(LibraryAssembler, LevelWalksDoNotClimb) {
  const std::vector<std::filesystem::path> captures = MocapFiles("cmu/03");
  STRIDEWIRE_SKIP_WITHOUT(captures);
  LibraryAssembler assembler;
  for (const std::filesystem::path& file : captures) assembler.Add(*ReadBvh(file));
  const Expected<RawLibrary> raw = assembler.Assemble();
  ASSERT_TRUE(raw.has_value());
  LibraryBuilder builder;
  const auto library = builder.Build(*raw);
  ASSERT_TRUE(library.has_value()) << Describe(library.error());
  AvatarSimulation avatar(*library, BaseFrame{});
  constexpr int kSteps = 40;
  for (int i = 0; i < kSteps; ++i) {
    ASSERT_TRUE(avatar.Enqueue({static_cast<std::uint64_t>(i), StepRequest{.length_m = 0.3}}));
  }
  int finished = 0;
  for (int tick = 0; tick < 60 * 2 * kSteps && finished < kSteps; ++tick) {
    avatar.Advance(1.0 / 60.0);
    for (const AvatarEvent& event : avatar.events()) {
      finished += event.type == AvatarEventType::kFinished;
    }
    ASSERT_NEAR(avatar.base().position_m.y, 0.0, 1e-9) << "after " << finished << " steps";
    // The height ranges from 0.92 m, in the first step after standing, to 0.99 m.
    ASSERT_NEAR(avatar.pose().root_position_m.y, 0.96, 0.06) << "after " << finished << " steps";
  }
  EXPECT_EQ(finished, kSteps);
}

// Sideways distances between the feet at both ends of a step.
struct FootSides {
  double start_m = 0.0;
  double end_m = 0.0;
};

FootSides MeasureFootSides(const Skeleton& skeleton, const RawExample& example, Foot moving) {
  Pose last(skeleton.joint_count());
  SampleClip(example.clip, example.keytimes_s.back(), last);
  const DVec3 start = FootVector(skeleton, example.clip.frame(0), moving, 0.0);
  const DVec3 end = FootVector(skeleton, last, moving, 0.0);
  return {start.x, end.x};
}

TEST(LibraryAssembler, CombinesAllCapturesOfASubject) {
  const std::vector<std::filesystem::path> captures = MocapFiles("cmu/16");
  STRIDEWIRE_SKIP_WITHOUT(captures);
  LibraryAssembler assembler;
  for (const std::filesystem::path& file : captures) {
    const Expected<Capture> capture = ReadBvh(file);
    ASSERT_TRUE(capture.has_value());
    EXPECT_EQ(assembler.Add(*capture).error, "");
  }
  const Expected<RawLibrary> library = assembler.Assemble();
  ASSERT_TRUE(library.has_value());
  ExpectWellFormed(*library);
  ASSERT_EQ(library->groups.size(), 5u);
  EXPECT_GE(library->groups[0].examples.size(), 25u);
  EXPECT_GE(library->groups[1].examples.size(), 20u);
  EXPECT_EQ(library->groups[4].kind, MovementKind::kJump);
  EXPECT_EQ(library->groups[4].examples.size(), 5u);
  // A row of straight steps must not veer: the moving foot ends on the line on which it started. On
  // average, the root moves as far to the left in steps of one foot as to the right in steps of the
  // other.
  double root_m = 0.0;
  for (std::size_t g = 0; g < 2; ++g) {
    const RawGroup& group = library->groups[g];
    const auto count = static_cast<double>(group.examples.size());
    for (const RawExample& example : group.examples) {
      EXPECT_EQ(example.heading_change_rad, 0.0);
      const FootSides sides = MeasureFootSides(library->skeleton, example, MovingFoot(group.kind));
      EXPECT_NEAR(sides.end_m, sides.start_m, 0.05) << example.source;
      root_m += example.clip.root_positions_m.back().x / count;
    }
  }
  EXPECT_NEAR(root_m, 0.0, 0.01);
  const DVec3 feet = FootVector(library->skeleton, library->stand_pose, Foot::kLeft, 0.0);
  EXPECT_NEAR(feet.z, 0.0, 0.06);
  EXPECT_NEAR(library->stand_pose.root_position_m.y, 1.0, 0.03);
}

}  // namespace
}  // namespace stridewire
