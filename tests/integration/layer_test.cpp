// Layers over walks. Legs and root must keep the same bits as without layers, the arms must play
// the clip, and weights must change smoothly.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <sstream>

#include "captured_library.h"
#include "counted_memory.h"
#include "instruction_sets.h"
#include "offline/build/layers.h"
#include "offline/build/library_writer.h"
#include "offline/build/refine.h"
#include "offline/builtin/builtin_library.h"
#include "random.h"
#include "runtime/avatar/avatar_simulation.h"
#include "runtime/pose/apply_layer.h"
#include "runtime/skeleton/layer_clip.h"
#include "stridewire/offline/bvh_writer.h"
#include "stridewire/offline/synthesis.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {
namespace {

using Library = std::shared_ptr<const MotionLibrary>;
constexpr double kTickS = 1.0 / 60.0;

struct Walker {
  const char* name;
  std::vector<std::string> subjects;  // Captured subjects; empty: the built-in library.
  bool on_terrain;
};
void PrintTo(const Walker& walker, std::ostream* out) { *out << walker.name; }

// Captured libraries get layers that are cut from their own first capture.
Library LibraryWithLayers(const std::vector<std::string>& subjects) {
  const Library library = LibraryOf(subjects);
  if (subjects.empty()) return library;
  const Capture capture = ReadBvh(TakesOf(subjects).front()).value();
  std::vector<RawLayer> layers;
  layers.push_back(CutLayer(capture, library->skeleton(), {.name = "wave"}).value());
  layers.push_back(
      CutLayer(capture, library->skeleton(), {.name = "carry", .to_s = 1.0, .is_looping = false})
          .value());
  return AddLayers(*library, layers).value();
}

std::shared_ptr<const Terrain> Slabs() {
  TerrainData data;
  for (int i = 0; i < 12; ++i) {
    const double z = 0.6 * i;
    data.boxes.push_back({{-2.0, z + 0.6}, {2.0, z + 1.2}, 0.1 * (i % 3)});
  }
  return Terrain::Make(std::move(data)).value();
}

template <typename T>
bool SameBits(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof(T)) == 0;
}

class Layers : public testing::TestWithParam<Walker> {};
INSTANTIATE_TEST_SUITE_P(Libraries, Layers,
                         testing::Values(Walker{"Builtin", {}, false},
                                         Walker{"BuiltinOnTerrain", {}, true},
                                         Walker{"Subject16", {"16"}, false},
                                         Walker{"Subject16OnTerrain", {"16"}, true},
                                         Walker{"DebianTakes", {kDebianTakes}, false}),
                         [](const auto& walker) { return walker.param.name; });

TEST_P(Layers, PlayTheClipAndKeepTheBitsOfLegsAndRoot) {
  const Walker& walker = GetParam();
  STRIDEWIRE_SKIP_WITHOUT_TAKES(walker.subjects);
  const Library library = LibraryWithLayers(walker.subjects);
  const int wave = library->FindLayer("wave");
  const int carry = library->FindLayer("carry");
  ASSERT_GE(wave, 0);
  ASSERT_GE(carry, 0);
  AvatarOptions options;
  if (walker.on_terrain) options.terrain = Slabs();
  AvatarSimulation plain(library, {}, options);
  AvatarSimulation layered(library, {}, options);
  Random random(7);
  for (int i = 0; i < 12; ++i) {
    MovementRequest request{
        static_cast<std::uint64_t>(i + 1),
        StepRequest{.length_m = random.Draw(0.4, 0.6), .turn_rad = random.Draw(-0.2, 0.2)}};
    if (i == 6) request.movement = StandRequest{0.4};
    if (i == 9) request.movement = WalkRequest{.position_m = {0.5, 0.0, 5.0}};
    ASSERT_TRUE(plain.Enqueue(request).has_value());
    ASSERT_TRUE(layered.Enqueue(request).has_value());
  }
  const std::vector<bool> of_legs = JointsOfLegs(library->skeleton());
  const LayerClip& clip = library->layers()[static_cast<std::size_t>(wave)];
  Pose clip_pose(library->skeleton().joint_count());
  std::size_t differing = 0;
  int ticks = 0;
  for (; ticks < 3000 && !plain.idle(); ++ticks) {
    if (ticks % 150 == 20) {
      ASSERT_TRUE(layered.SetLayer({.layer = wave, .blend_s = 0.3}).has_value());
    }
    if (ticks % 150 == 60) {
      ASSERT_TRUE(layered.SetLayer({.layer = carry, .weight = 0.7, .blend_s = 0.2}).has_value());
      ASSERT_TRUE(layered.SetLayer({.layer = wave, .enabled = false, .blend_s = 0.5}).has_value());
    }
    if (ticks % 150 == 100) {
      ASSERT_TRUE(layered.SetLayer({.layer = carry, .enabled = false}).has_value());
    }
    plain.Advance(kTickS);
    layered.Advance(kTickS);
    const ConstPoseSpan a = plain.pose();
    const ConstPoseSpan b = layered.pose();
    ASSERT_TRUE(SameBits(a.root_position_m, b.root_position_m)) << "tick " << ticks;
    for (std::size_t j = 0; j < of_legs.size(); ++j) {
      const bool is_same = SameBits(a.rotations[j], b.rotations[j]);
      if (of_legs[j]) {
        ASSERT_TRUE(is_same) << "tick " << ticks << ", joint " << j;
      }
      differing += !is_same;
      ASSERT_NEAR(glm::length(b.rotations[j]), 1.0f, 1e-4f);
    }
    ASSERT_EQ(plain.events().size(), layered.events().size());
    if (ticks % 150 == 55) {  // The layer has faded in: joints of full weight play the clip.
      ASSERT_EQ(layered.layers().playing().size(), 1u);
      ApplyLayer(clip, layered.layers().playing()[0].time_s, 1.0, clip_pose);
      int full = 0;
      for (std::size_t i = 0; i < clip.joints.size(); ++i) {
        if (clip.weights[i] < 1.0f) continue;
        const auto j = static_cast<std::size_t>(clip.joints[i]);
        ASSERT_TRUE(SameBits(clip_pose.rotations[j], b.rotations[j]));
        ++full;
      }
      ASSERT_GE(full, 4);
    }
    if (ticks % 150 == 149) {
      ASSERT_TRUE(layered.layers().empty());
    }
  }
  ASSERT_GT(ticks, 300);
  EXPECT_GT(differing, 1000u);
  EXPECT_TRUE(SameBits(plain.base().position_m, layered.base().position_m));
}

// At the time of a key, the blend has the exact formula of decision 0012.
TEST(LayerBlends, FollowTheFormulaWithTheSameBytesOnEveryInstructionSet) {
  constexpr unsigned kSeed = 19;
  std::printf("seed %u\n", kSeed);
  Random random(kSeed);
  const Library library = LibraryOf({});
  const std::vector<std::int64_t> sets = InstructionSets();
  for (const LayerClip& clip : library->layers()) {
    for (int round = 0; round < 200; ++round) {
      Pose before(library->skeleton().joint_count());
      for (Quat& q : before.rotations) {
        q = Normalise(Quat(random.Draw(-1.0, 1.0), random.Draw(-1.0, 1.0), random.Draw(-1.0, 1.0),
                           random.Draw(-1.0, 1.0)));
      }
      const int key = round % clip.frame_count();
      const double weight = round % 10 == 0 ? 1.0 : random.Draw(0.0, 1.0);
      std::vector<Pose> after(sets.size(), before);
      for (std::size_t s = 0; s < sets.size(); ++s) {
        const OnlyInstructionSet only(sets[s]);
        ApplyLayer(clip, key / clip.fps, weight, after[s]);
        for (std::size_t j = 0; j < before.rotations.size(); ++j) {
          ASSERT_TRUE(SameBits(after[s].rotations[j], after[0].rotations[j])) << "joint " << j;
        }
      }
      for (std::size_t i = 0; i < clip.joints.size(); ++i) {
        const std::size_t at = (static_cast<std::size_t>(key) * clip.joints.size() + i) * 4;
        const auto q = clip.rotations.subspan(at, 4);
        const auto j = static_cast<std::size_t>(clip.joints[i]);
        const Quat& from = before.rotations[j];
        const Quat expected =
            from * SlerpFromIdentity(glm::conjugate(from) * Quat(q[3], q[0], q[1], q[2]),
                                     static_cast<float>(weight) * clip.weights[i]);
        ASSERT_LE(AngleBetween(expected, after[0].rotations[j]), 2e-6) << "joint " << j;
      }
    }
  }
}

TEST(LayerWeights, HaveContinuousSlopeUnderInterruptions) {
  const Library library = LibraryOf({});
  constexpr double kFineS = 1e-3;
  Random random(11);
  LayerStack stack;
  double before = 0.0;
  double slope_before = 0.0;
  double largest_bend = 0.0;
  double largest_weight = 0.0;
  for (int i = 0; i < 40'000; ++i) {
    if (i % 170 == 0) {
      ASSERT_TRUE(stack
                      .Set(*library, {.layer = 0,
                                      .enabled = random.Draw(0.0, 1.0) < 0.7,
                                      .weight = random.Draw(0.2, 1.0),
                                      .blend_s = random.Draw(0.2, 0.6),
                                      .speed = random.Draw(0.5, 2.0)})
                      .has_value());
    }
    stack.Advance(*library, kFineS);
    const double weight = stack.empty() ? 0.0 : stack.playing()[0].weight;
    const double slope = (weight - before) / kFineS;
    largest_bend = std::max(largest_bend, std::fabs(slope - slope_before));
    largest_weight = std::max(largest_weight, weight);
    before = weight;
    slope_before = slope;
  }
  // The second derivative of a weight is at most 6 / 0.2 s^2 = 150 per s^2, and fading out the old
  // slope adds as much again. So the slope changes by about 0.6 per millisecond. If the slope were
  // not continued, it would change by more than 1.5 / 0.6 s.
  EXPECT_LT(largest_bend, 0.8);
  EXPECT_GT(largest_weight, 0.6);
}

TEST(LayerWeights, FadeOutBeforeTheEndOfANonLoopingClip) {
  RawLibrary raw = GenerateBuiltinLibrary();
  raw.layers[0].is_looping = false;
  LibraryBuilder builder;
  const Library library = builder.Build(raw).value();
  LayerStack stack;
  ASSERT_TRUE(stack.Set(*library, {.layer = 0, .blend_s = 0.25}).has_value());
  double time_s = 0.0;
  double heaviest = 0.0;
  while (!stack.empty() && time_s < 10.0) {
    heaviest = std::max(heaviest, stack.playing()[0].weight);
    stack.Advance(*library, kTickS);
    time_s += kTickS;
  }
  EXPECT_DOUBLE_EQ(heaviest, 1.0);
  EXPECT_NEAR(time_s, library->layers()[0].duration_s(), 2.5 * kTickS);
}

TEST(LayerRequests, InvalidRequestsAreRejectedWithoutEffect) {
  RawLibrary raw = GenerateBuiltinLibrary();
  for (int i = 0; i < 4; ++i) {
    raw.layers.push_back(raw.layers[0]);
    raw.layers.back().name = "wave" + std::to_string(i);
  }
  LibraryBuilder builder;
  const Library library = builder.Build(raw).value();
  LayerStack stack;
  const auto code = [&](const LayerRequest& request) {
    const Status status = stack.Set(*library, request);
    return status ? std::optional<ErrorCode>() : status.error().code;
  };
  EXPECT_EQ(code({.layer = -1}), ErrorCode::kNotFound);
  EXPECT_EQ(code({.layer = 6}), ErrorCode::kNotFound);
  EXPECT_EQ(code({.weight = 0.0}), ErrorCode::kOutOfRange);
  EXPECT_EQ(code({.weight = 1.01}), ErrorCode::kOutOfRange);
  EXPECT_EQ(code({.weight = NAN}), ErrorCode::kOutOfRange);
  EXPECT_EQ(code({.blend_s = -0.1}), ErrorCode::kOutOfRange);
  EXPECT_EQ(code({.blend_s = INFINITY}), ErrorCode::kOutOfRange);
  EXPECT_EQ(code({.enabled = false, .blend_s = NAN}), ErrorCode::kOutOfRange);
  EXPECT_EQ(code({.speed = 0.05}), ErrorCode::kOutOfRange);
  EXPECT_EQ(code({.speed = NAN}), ErrorCode::kOutOfRange);
  EXPECT_TRUE(stack.empty());
  // The layer is not playing, so this has no effect.
  EXPECT_EQ(code({.layer = 3, .enabled = false}), std::nullopt);
  EXPECT_TRUE(stack.empty());
  for (int i = 0; i < 4; ++i) EXPECT_EQ(code({.layer = i}), std::nullopt);
  EXPECT_EQ(code({.layer = 4}), ErrorCode::kLimitExceeded);
  // The layer is already playing and needs no free slot.
  EXPECT_EQ(code({.layer = 2, .weight = 0.5}), std::nullopt);
  EXPECT_EQ(stack.playing().size(), 4u);
}

TEST(LayerRequests, TicksDoNotAllocate) {
  const Library library = LibraryOf({});
  AvatarSimulation avatar(library, {});
  ASSERT_TRUE(avatar.Enqueue({1, StepRequest{.length_m = 0.5}}).has_value());
  // Only the first layer of an avatar allocates its layered pose.
  ASSERT_TRUE(avatar.SetLayer({.layer = 0}).has_value());
  avatar.Advance(kTickS);
  const std::size_t before = counted_memory::LiveBytes();
  counted_memory::ResetPeak();
  for (int i = 0; i < 200; ++i) {
    if (i % 20 == 0) static_cast<void>(avatar.SetLayer({.layer = i / 20 % 2}));
    if (i % 50 == 0) static_cast<void>(avatar.SetLayer({.layer = 0, .enabled = false}));
    avatar.Advance(kTickS);
  }
  EXPECT_LE(counted_memory::PeakBytes(), before);
}

TEST(LayerFiles, MasksWithLegsOrTheRootAreRejected) {
  LibraryBuilder builder;
  for (const char* joint : {"Hips", "LeftUpLeg", "RightFoot", "LeftToeBase"}) {
    RawLibrary raw = GenerateBuiltinLibrary();
    const int index = raw.skeleton.FindJoint(joint);
    raw.layers[0].weights[static_cast<std::size_t>(index)] = 0.01f;
    const auto built = builder.Build(raw);
    ASSERT_FALSE(built.has_value()) << joint;
    EXPECT_EQ(built.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(Describe(built.error()).find(joint), std::string::npos) << Describe(built.error());
  }
  // The library's own checks must reject it as well, without the builder.
  const Library library = LibraryOf({});
  for (const int joint : {0, library->skeleton().leg(Foot::kLeft).hip, 500, -1}) {
    LayerClip layer = library->layers()[0];
    std::vector<int> joints(layer.joints.begin(), layer.joints.end());
    joints.front() = joint;
    layer.joints = joints;
    const std::vector<LayerClip> layers = {layer};
    const auto written =
        WriteLibrary({library->skeleton(), library->stand_pose(), library->groups(), layers});
    ASSERT_FALSE(written.has_value()) << joint;
    EXPECT_EQ(written.error().code, ErrorCode::kMalformed);
  }
}

TEST(LayerFiles, LayersAffectTheHashAndSurviveRefinement) {
  RawLibrary raw = GenerateBuiltinLibrary();
  LibraryBuilder builder;
  const Library with = builder.Build(raw).value();
  raw.layers[1].weights[static_cast<std::size_t>(raw.skeleton.FindJoint("Spine1"))] = 0.7f;
  const Library other = builder.Build(raw).value();
  raw.layers.clear();
  const Library without = builder.Build(raw).value();
  EXPECT_NE(with->hash(), without->hash());
  EXPECT_NE(with->hash(), other->hash());
  EXPECT_EQ(without->layers().size(), 0u);
  EXPECT_EQ(without->FindLayer("wave"), -1);
  EXPECT_EQ(with->FindLayer("wave"), 0);
  EXPECT_EQ(with->FindLayer("carry"), 1);
  const Library again = AddLayers(*with, {}).value();
  EXPECT_EQ(again->hash(), with->hash());
  const auto refined = Refine(with, {.max_pseudoexamples = 0, .samples = 20});
  ASSERT_TRUE(refined.has_value());
  EXPECT_EQ(refined->library->hash(), with->hash());
}

TEST(LayerFiles, OtherSkeletonsAndTimesOutsideTheCaptureAreRejected) {
  const Library library = LibraryOf({});
  std::ostringstream text;
  Clip clip;
  clip.fps = 30.0;
  clip.Resize(61, library->skeleton().joint_count());
  for (Vec3& position : clip.root_positions_m) position.y = 0.926f;
  ASSERT_TRUE(WriteBvh(library->skeleton(), clip, text).has_value());
  Capture capture = ParseBvh(text.str(), "still.bvh").value();
  const auto layer = CutLayer(capture, library->skeleton(), {.name = "still"});
  ASSERT_TRUE(layer.has_value());
  EXPECT_NEAR(layer->clip.duration_s(), 1.6, 1e-9);  // 2 s minus the seam of 0.4 s.
  const auto error = [&](const LayerCut& cut) {
    const auto made = CutLayer(capture, library->skeleton(), cut);
    return made ? std::string("none") : Describe(made.error());
  };
  EXPECT_NE(error({.name = "a", .from_s = 1.0, .to_s = 2.5}).find("outside the capture"),
            std::string::npos);
  EXPECT_NE(error({.name = "a", .from_s = 1.0, .to_s = 1.05}).find("0.1 s"), std::string::npos);
  capture.skeleton.joints[12].name = "Nape";
  EXPECT_NE(error({.name = "a"}).find("Nape"), std::string::npos) << error({.name = "a"});
  const std::vector<std::string> leg = {"LeftLeg"};
  EXPECT_FALSE(MaskOfJoints(library->skeleton(), leg).has_value());
  const std::vector<std::string> arm = {"RightArm"};
  const auto mask = MaskOfJoints(library->skeleton(), arm);
  ASSERT_TRUE(mask.has_value());
  EXPECT_EQ(std::ranges::count(*mask, 1.0f), 3);
}

TEST(LayerFiles, CapturedLoopsCloseSmoothly) {
  const std::filesystem::path take = ModelFile("01_01.bvh");
  if (take.empty()) GTEST_SKIP() << "no captures of Debian's package assimp-testmodels";
  const Capture capture = ReadBvh(take).value();
  const RawLayer layer =
      CutLayer(capture, capture.skeleton, {.name = "cut", .from_s = 1.0, .to_s = 3.0}).value();
  const int frames = layer.clip.frame_count();
  double inside = 0.0;
  for (int f = 1; f + 1 < frames; ++f) {
    inside = std::max(inside, LargestJointAngle(layer.clip.frame(f - 1), layer.clip.frame(f)));
  }
  EXPECT_LT(LargestJointAngle(layer.clip.frame(frames - 2), layer.clip.frame(frames - 1)),
            1.2 * inside);
  // The default mask of the upper body: graded weights for the spine and full weights for the arms.
  const std::vector<float> mask = UpperBodyMask(capture.skeleton);
  const auto of = [&](const char* name) {
    return mask[static_cast<std::size_t>(capture.skeleton.FindJoint(name))];
  };
  EXPECT_FLOAT_EQ(of("Hips"), 0.0f);
  EXPECT_FLOAT_EQ(of("LHipJoint"), 0.0f);
  EXPECT_FLOAT_EQ(of("LeftToeBase"), 0.0f);
  EXPECT_FLOAT_EQ(of("LowerBack"), 0.25f);
  EXPECT_FLOAT_EQ(of("Spine1"), 0.75f);
  EXPECT_FLOAT_EQ(of("RightHand"), 1.0f);
}

TEST(LayersInChoreographies, BeginAndEndWithMovementsAndKeepTheLegs) {
  const auto library = OpenLibrary("builtin").value();
  const std::vector<MovementRequest> requests = {{1, StepRequest{.length_m = 0.5}},
                                                 {3, StepRequest{.length_m = 0.5}},
                                                 {4, StepRequest{.length_m = 0.5}},
                                                 {6, StepRequest{.length_m = 0.5}}};
  const std::vector<LayerCue> cues = {
      {.before = 1, .layer = "wave", .blend_s = 0.1},
      {.before = 3, .layer = "wave", .enabled = false, .blend_s = 0.1}};
  const auto plain = Synthesize({.library = library, .requests = requests}).value();
  const auto waving =
      Synthesize({.library = library, .requests = requests, .layers = cues}).value();
  ASSERT_EQ(plain.clip.frame_count(), waving.clip.frame_count());
  const auto joint = [&](std::string_view name) {
    std::size_t j = 0;
    while (library->skeleton().joints[j].name != name) ++j;
    return j;
  };
  const std::size_t arm = joint("RightArm");
  const double from_s = plain.movements[1].start_s;
  const double to_s = plain.movements[3].start_s;
  for (int frame = 0; frame < plain.clip.frame_count(); ++frame) {
    const ConstPoseSpan a = plain.clip.frame(frame);
    const ConstPoseSpan b = waving.clip.frame(frame);
    const double at_s = frame / 60.0;
    EXPECT_EQ(a.root_position_m, b.root_position_m);
    for (const char* leg : {"LeftUpLeg", "RightLeg", "LeftFoot"}) {
      EXPECT_EQ(a.rotations[joint(leg)], b.rotations[joint(leg)]) << leg << frame;
    }
    const bool is_same = a.rotations[arm] == b.rotations[arm];
    if (at_s <= from_s || at_s > to_s + 0.15) {
      EXPECT_TRUE(is_same) << at_s;
    }
    if (at_s > from_s + 0.1 && at_s < to_s) {
      EXPECT_FALSE(is_same) << at_s;
    }
  }

  const auto error = [&](LayerCue cue) {
    return Describe(
        Synthesize({.library = library, .requests = requests, .layers = {&cue, 1}}).error());
  };
  EXPECT_EQ(error({.before = 2, .layer = "dance"}),
            "movements[2].layer: the library has no such layer");
  std::vector<MovementRequest> bad = requests;
  bad[2].movement = StepRequest{.length_m = 50.0};
  EXPECT_THAT(Describe(Synthesize({.library = library, .requests = bad, .layers = cues}).error()),
              testing::HasSubstr("movements[3]."));
}

}  // namespace
}  // namespace stridewire
