#include "distorted_library.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "runtime/skeleton/foot_vector.h"
#include "stridewire/offline/library_builder.h"

namespace stridewire {
namespace {

constexpr double kThighM = 0.45;
constexpr double kShinM = 0.45;
constexpr double kHipHalfM = 0.1;

constexpr std::array kOrder = {ParameterName::kEndZ,  ParameterName::kStartZ, ParameterName::kTurn,
                               ParameterName::kEndX,  ParameterName::kStartX, ParameterName::kEndY,
                               ParameterName::kStartY};

Quat AboutX(double angle_rad) {
  return Quat(static_cast<float>(std::cos(angle_rad / 2)),
              static_cast<float>(std::sin(angle_rad / 2)), 0.0f, 0.0f);
}

Quat AboutZ(double angle_rad) {
  return Quat(static_cast<float>(std::cos(angle_rad / 2)), 0.0f, 0.0f,
              static_cast<float>(std::sin(angle_rad / 2)));
}

Skeleton MakeSkeleton() {
  Skeleton skeleton;
  const auto hip = static_cast<float>(kHipHalfM);
  const auto thigh = static_cast<float>(-kThighM);
  const auto shin = static_cast<float>(-kShinM);
  skeleton.joints = {{"Hips", -1, {}},
                     {"LeftUpLeg", 0, {hip, 0, 0}},
                     {"LeftLeg", 1, {0, thigh, 0}},
                     {"LeftFoot", 2, {0, shin, 0}},
                     {"RightUpLeg", 0, {-hip, 0, 0}},
                     {"RightLeg", 4, {0, thigh, 0}},
                     {"RightFoot", 5, {0, shin, 0}}};
  skeleton.end_sites = {{3, {0, 0, 0.2f}}, {6, {0, 0, 0.2f}}};
  skeleton.legs[0] = {1, 2, 3, 3, {}, {0, 0, 0.2f}};
  skeleton.legs[1] = {4, 5, 6, 6, {}, {0, 0, 0.2f}};
  return skeleton;
}

// Sets hip and knee of one leg such that its foot is sideways, below and ahead of the hip by these
// distances.
void SetLeg(std::size_t hip, double aside_m, double below_m, double ahead_m, PoseSpan pose) {
  const double far_m = std::sqrt(aside_m * aside_m + below_m * below_m);
  const double reach_m = std::min(std::hypot(far_m, ahead_m), 0.999 * (kThighM + kShinM));
  const double half = std::acos(reach_m / (kThighM + kShinM));  // Thigh and shin have equal length.
  const double swing = std::atan2(ahead_m, far_m);
  pose.rotations[hip] = Normalise(AboutZ(std::atan2(aside_m, below_m)) * AboutX(-swing - half));
  pose.rotations[hip + 1] = AboutX(2.0 * half);
}

// Places the feet symmetrically to the hips, with the given left minus right position. The height
// of the hips varies, so that blends of two examples bend the knees differently from both.
void SetLegs(const DVec3& apart_m, PoseSpan pose) {
  const double height_m = 0.72 + 0.08 * std::sin(6.0 * (apart_m.z + 2.0 * apart_m.x - apart_m.y));
  pose.root_position_m.y = static_cast<float>(height_m);
  SetLeg(1, apart_m.x / 2 - kHipHalfM, height_m - apart_m.y / 2, apart_m.z / 2, pose);
  SetLeg(4, -apart_m.x / 2 + kHipHalfM, height_m + apart_m.y / 2, -apart_m.z / 2, pose);
}

double Uniform(std::mt19937& random, double low, double high) {
  return low + (high - low) * (static_cast<double>(random()) + 0.5) / 4294967296.0;
}

RawLibrary DrawLibrary(int parameter_count, int example_count, double reach_m,
                       std::mt19937& random) {
  RawLibrary raw;
  raw.skeleton = MakeSkeleton();
  raw.stand_pose = Pose(7);
  raw.stand_pose.root_position_m.y = static_cast<float>(kThighM + kShinM);
  RawGroup group;
  group.kind = MovementKind::kStepLeft;
  for (std::size_t l = 0; l < static_cast<std::size_t>(parameter_count); ++l) {
    group.parameters.push_back(kOrder[l]);
  }
  while (static_cast<int>(group.examples.size()) < example_count) {
    // Quantities that are not parameters are the same in all examples.
    DVec3 start(0.2, 0.0, -0.3 * reach_m);
    DVec3 end(0.2, 0.0, 0.0);
    double turn_rad = 0.0;
    for (const ParameterName name : group.parameters) {
      switch (name) {
        case ParameterName::kEndZ: end.z = Uniform(random, 0.0, reach_m); break;
        case ParameterName::kStartZ: start.z = Uniform(random, -reach_m, 0.0); break;
        case ParameterName::kTurn: turn_rad = Uniform(random, -1.0, 1.0); break;
        case ParameterName::kEndX: end.x = Uniform(random, 0.1, 0.4); break;
        case ParameterName::kStartX: start.x = Uniform(random, 0.1, 0.4); break;
        case ParameterName::kEndY: end.y = Uniform(random, -0.2, 0.2); break;
        default: start.y = Uniform(random, -0.2, 0.2);
      }
    }
    RawExample example;
    example.source = "distorted " + std::to_string(group.examples.size());
    example.clip.fps = 30.0;
    example.clip.Resize(16, 7);
    example.keytimes_s = {0.0, 0.1, 0.4, 0.5};
    example.heading_change_rad = turn_rad;
    for (int f = 0; f < 16; ++f) {
      const double s = f / 15.0;
      PoseSpan frame = example.clip.frame(f);
      SetLegs((1.0 - s) * start + s * end, frame);
      frame.root_position_m.z = static_cast<float>(0.5 * reach_m * s);
      frame.rotations[0] = YawRotation(turn_rad * s);
    }
    const DVec3 first = FootVector(raw.skeleton, example.clip.frame(0), Foot::kLeft, 0.0);
    const DVec3 last = FootVector(raw.skeleton, example.clip.frame(15), Foot::kLeft, turn_rad);
    for (const ParameterName name : group.parameters) {
      switch (name) {
        case ParameterName::kEndZ: example.parameters.push_back(last.z); break;
        case ParameterName::kStartZ: example.parameters.push_back(first.z); break;
        case ParameterName::kTurn: example.parameters.push_back(turn_rad); break;
        case ParameterName::kEndX: example.parameters.push_back(last.x); break;
        case ParameterName::kStartX: example.parameters.push_back(first.x); break;
        case ParameterName::kEndY: example.parameters.push_back(last.y); break;
        default: example.parameters.push_back(first.y);
      }
    }
    // Avoids near duplicates, which would make the weights jump.
    const bool is_near =
        std::any_of(group.examples.begin(), group.examples.end(), [&](const RawExample& other) {
          double largest = 0.0;
          for (std::size_t l = 0; l < other.parameters.size(); ++l) {
            largest = std::max(largest, std::fabs(other.parameters[l] - example.parameters[l]));
          }
          return largest < 0.04;
        });
    if (!is_near) group.examples.push_back(std::move(example));
  }
  raw.groups.push_back(std::move(group));
  return raw;
}

}  // namespace

std::shared_ptr<const MotionLibrary> MakeDistortedLibrary(int parameter_count, int example_count,
                                                          double reach_m, std::uint32_t seed) {
  std::mt19937 random(seed);
  // With d + 1 examples the sites may be almost coplanar, which the builder rejects. Then new
  // examples are drawn.
  constexpr int kMaxDraws = 20;
  for (int draw = 1;; ++draw) {
    auto library =
        LibraryBuilder{}.Build(DrawLibrary(parameter_count, example_count, reach_m, random));
    if (library) return *library;
    if (draw < kMaxDraws) continue;
    std::fprintf(stderr, "MakeDistortedLibrary: %s\n", Describe(library.error()).c_str());
    std::abort();
  }
}

ParameterValues PointInHull(const MotionGroup& group, std::mt19937& random) {
  std::vector<double> shares;
  double sum = 0.0;
  for (int e = 0; e < group.example_count; ++e) {
    const double u = Uniform(random, 0.0, 1.0);
    shares.push_back(u * u * u * u);
    sum += shares.back();
  }
  ParameterValues point{.count = group.parameter_count()};
  for (int e = 0; e < group.example_count; ++e) {
    const std::span<const double> site = group.site(e);
    for (std::size_t l = 0; l < site.size(); ++l) {
      point.values[l] += shares[static_cast<std::size_t>(e)] / sum * site[l];
    }
  }
  return point;
}

}  // namespace stridewire
