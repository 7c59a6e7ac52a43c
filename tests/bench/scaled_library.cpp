#include "scaled_library.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "base/check.h"
#include "offline/builtin/builtin_library.h"
#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "stridewire/offline/library_builder.h"

namespace stridewire {
namespace {

constexpr double kFps = 120.0;
constexpr int kJointsOfAChain = 10;

// Returns a step that blends three random examples of a group.
RawExample BlendOf(const MotionLibrary& library, int group_index, std::mt19937& random) {
  const MotionGroup& group = library.group(group_index);
  constexpr int kMixed = 3;
  std::vector<double> parameters(group.parameters.size());
  for (int i = 0; i < kMixed; ++i) {
    const auto site =
        group.site(static_cast<int>(random() % static_cast<unsigned>(group.example_count)));
    for (std::size_t l = 0; l < parameters.size(); ++l) parameters[l] += site[l] / kMixed;
  }
  std::vector<double> scratch(static_cast<std::size_t>(group.example_count));
  Movement movement;
  StartMovement(group, group_index, parameters, {}, scratch, movement);
  RawExample made;
  made.source = "blended";
  made.parameters = parameters;
  made.heading_change_rad = movement.heading_change_rad;
  made.keytimes_s = movement.warp.Keytimes();
  made.clip.fps = kFps;
  made.clip.Resize(static_cast<int>(std::ceil(movement.duration_s() * kFps)) + 1,
                   library.skeleton().joint_count());
  GridCache cache(library.layout());
  Pose pose(library.skeleton().joint_count());
  for (int f = 0; f < made.clip.frame_count(); ++f) {
    EvaluateBlend(group, library.layout(), movement, f / kFps, cache, pose);
    const PoseSpan frame = made.clip.frame(f);
    frame.root_position_m = pose.root_position_m;
    std::ranges::copy(pose.rotations, frame.rotations.begin());
  }
  return made;
}

void SetExampleCount(const MotionLibrary& library, int group, int count, RawGroup& raw) {
  const std::vector<RawExample> all = raw.examples;
  const int there = static_cast<int>(all.size());
  raw.examples.clear();
  for (int i = 0; i < std::min(count, there); ++i) {
    raw.examples.push_back(all[static_cast<std::size_t>(count < there ? i * there / count : i)]);
  }
  std::mt19937 random(1);
  while (static_cast<int>(raw.examples.size()) < count) {
    raw.examples.push_back(BlendOf(library, group, random));
  }
}

// Returns the joint whose rotations the additional joint `joint` copies. `there` is the original
// number of joints.
std::size_t Twin(std::size_t joint, std::size_t there) { return 1 + joint % (there - 1); }

void AddJoints(int joints, RawLibrary& raw) {
  const std::size_t there = raw.skeleton.joints.size();
  for (int j = static_cast<int>(there); j < joints; ++j) {
    const int more = j - static_cast<int>(there);
    raw.skeleton.joints.push_back({.name = "more" + std::to_string(more),
                                   .parent = more % kJointsOfAChain == 0 ? 0 : j - 1,
                                   .offset_m = Vec3(0.0f, 0.03f, 0.0f)});
  }
  const std::size_t wanted = raw.skeleton.joints.size();
  for (std::size_t j = there; j < wanted; ++j) {
    raw.stand_pose.rotations.push_back(raw.stand_pose.rotations[Twin(j, there)]);
  }
  for (RawGroup& group : raw.groups) {
    for (RawExample& example : group.examples) {
      const Clip few = std::move(example.clip);
      example.clip = {.fps = few.fps};
      example.clip.Resize(few.frame_count(), static_cast<int>(wanted));
      for (int f = 0; f < few.frame_count(); ++f) {
        const PoseSpan frame = example.clip.frame(f);
        frame.root_position_m = few.frame(f).root_position_m;
        for (std::size_t j = 0; j < wanted; ++j) {
          frame.rotations[j] = few.frame(f).rotations[j < there ? j : Twin(j, there)];
        }
      }
    }
  }
}

}  // namespace

std::shared_ptr<const MotionLibrary> MakeScaledLibrary(int examples, int joints) {
  RawLibrary raw = GenerateBuiltinLibrary();
  STRIDEWIRE_CHECK(examples >= 4 && joints >= raw.skeleton.joint_count());
  raw.layers.clear();
  raw.groups.resize(2);
  const auto library = LibraryBuilder().Build(raw);
  STRIDEWIRE_CHECK(library.has_value());
  for (std::size_t g = 0; g < raw.groups.size(); ++g) {
    SetExampleCount(**library, static_cast<int>(g), examples, raw.groups[g]);
  }
  AddJoints(joints, raw);
  const auto scaled = LibraryBuilder().Build(raw);
  STRIDEWIRE_CHECK(scaled.has_value());
  return *scaled;
}

}  // namespace stridewire
