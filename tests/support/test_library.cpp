#include "test_library.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "stridewire/offline/library_builder.h"

namespace stridewire {
namespace {

constexpr double kLegM = 0.9;
constexpr double kFps = 120.0;
constexpr double kHipHalfM = 0.1;

Quat PitchRotation(double angle_rad) {  // About +X; positive turns +Y towards +Z.
  return Quat(static_cast<float>(std::cos(angle_rad / 2)),
              static_cast<float>(std::sin(angle_rad / 2)), 0.0f, 0.0f);
}

Skeleton MakeSkeleton() {
  Skeleton skeleton;
  const auto hip = static_cast<float>(kHipHalfM);
  const auto half_leg = static_cast<float>(-kLegM / 2);
  skeleton.joints = {{"Hips", -1, {}},
                     {"LeftUpLeg", 0, {hip, 0, 0}},
                     {"LeftLeg", 1, {0, half_leg, 0}},
                     {"LeftFoot", 2, {0, half_leg, 0}},
                     {"RightUpLeg", 0, {-hip, 0, 0}},
                     {"RightLeg", 4, {0, half_leg, 0}},
                     {"RightFoot", 5, {0, half_leg, 0}}};
  skeleton.end_sites = {{3, {0, 0, 0.2f}}, {6, {0, 0, 0.2f}}};
  skeleton.legs[0] = {1, 2, 3, 3, {}, {0, 0, 0.2f}};
  skeleton.legs[1] = {4, 5, 6, 6, {}, {0, 0, 0.2f}};
  return skeleton;
}

// Sets the hips at a height above two level feet, given the z of each foot relative to the hips.
void SetLegs(double left_from_hip_m, double right_from_hip_m, double hip_height_m, Pose& pose) {
  pose.root_position_m.y = static_cast<float>(hip_height_m);
  pose.rotations[1] = PitchRotation(-std::asin(left_from_hip_m / kLegM));
  pose.rotations[4] = PitchRotation(-std::asin(right_from_hip_m / kLegM));
}

RawExample MakeStep(Foot moving, double l0, double l1) {
  const double duration_s = 0.5 + 0.1 * (l0 + l1);
  const int frames = static_cast<int>(std::lround(duration_s * kFps)) + 1;
  RawExample example;
  example.clip.fps = kFps;
  example.clip.Resize(frames, 7);
  const double last_s = (frames - 1) / kFps;
  example.keytimes_s = {0.0, 0.15 * last_s, 0.85 * last_s, last_s};
  example.parameters = {-l0, l1};
  for (int f = 0; f < frames; ++f) {
    // The fixed foot is l0/2 ahead of the start. The hips move forward above it, and the moving
    // foot passes it.
    const double s = static_cast<double>(f) / (frames - 1);
    const double ease = s * s * (3 - 2 * s);
    const double hips = ease * (l0 + l1) / 2;
    const double fixed = l0 / 2 - hips;
    const double moving_foot = -l0 / 2 + ease * (l0 + l1) - hips;
    Pose pose(7);
    const double left = moving == Foot::kLeft ? moving_foot : fixed;
    const double right = moving == Foot::kLeft ? fixed : moving_foot;
    SetLegs(left, right, std::sqrt(kLegM * kLegM - fixed * fixed), pose);
    pose.root_position_m.z = static_cast<float>(hips);
    PoseSpan frame = example.clip.frame(f);
    frame.root_position_m = pose.root_position_m;
    std::copy(pose.rotations.begin(), pose.rotations.end(), frame.rotations.begin());
  }
  example.source = "toy step";
  return example;
}

RawExample MakeJump(double length_m) {
  RawExample example;
  const int frames = 121;
  example.clip.fps = kFps;
  example.clip.Resize(frames, 7);
  example.keytimes_s = {0.0, 0.4, 0.7, 1.0};
  example.parameters = {length_m};
  for (int f = 0; f < frames; ++f) {
    const double s = static_cast<double>(f) / (frames - 1);
    const double flight = std::clamp((s - 0.4) / 0.3, 0.0, 1.0);
    Vec3& root = example.clip.root_positions_m[static_cast<std::size_t>(f)];
    root.z = static_cast<float>(length_m * flight * flight * (3 - 2 * flight));
    root.y = static_cast<float>(kLegM + 0.3 * length_m * 4 * flight * (1 - flight));
  }
  example.source = "toy jump";
  return example;
}

}  // namespace

RawLibrary MakeTestRawLibrary() {
  RawLibrary raw;
  raw.skeleton = MakeSkeleton();
  raw.stand_pose = Pose(7);
  raw.stand_pose.root_position_m.y = static_cast<float>(kLegM);
  const std::array<double, 4> lengths = {0.0, 0.2, 0.4, 0.6};
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    RawGroup group{StepKind(foot), {ParameterName::kStartZ, ParameterName::kEndZ}, {}};
    for (const double l0 : lengths) {
      for (const double l1 : lengths) {
        if (l0 + l1 > 0.0) group.examples.push_back(MakeStep(foot, l0, l1));
      }
    }
    raw.groups.push_back(std::move(group));
  }
  RawGroup jumps{MovementKind::kJump, {ParameterName::kLength}, {}};
  for (const double length_m : {0.3, 0.6, 0.9, 1.2}) jumps.examples.push_back(MakeJump(length_m));
  raw.groups.push_back(std::move(jumps));
  return raw;
}

std::shared_ptr<const MotionLibrary> MakeTestLibrary() {
  LibraryBuilder builder;
  auto library = builder.Build(MakeTestRawLibrary());
  if (!library) {
    std::fprintf(stderr, "MakeTestLibrary: %s\n", Describe(library.error()).c_str());
    std::abort();
  }
  return *library;
}

}  // namespace stridewire
