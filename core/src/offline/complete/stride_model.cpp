#include "offline/complete/stride_model.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/easing.h"
#include "offline/base/statistics.h"
#include "offline/extract/mirror.h"
#include "runtime/library/keytimes.h"
#include "runtime/skeleton/foot_vector.h"

namespace stridewire::complete {
namespace {

// Limits on the steps that are averaged: they are level and straight, and neither start nor end in
// a stand.
constexpr double kMinLengthM = 0.25;
constexpr double kMaxRiseM = 0.06;
constexpr double kMaxTurnRad = 0.2;
constexpr double kMaxWidthM = 0.4;
// In a walk, the ball of the foot rises by 0.02 to 0.09 m. It rises further in steps over or onto
// obstacles.
constexpr double kPlainLiftM = 0.11;
// Strides whose length differs from the median by more than this are not averaged.
constexpr double kSameLengthM = 0.12;
// Half the width of the window that smooths the root of a single stride. For the mean of n strides,
// it is divided by sqrt(n).
constexpr double kRoughWindowS = 0.15;

struct Stride {
  const RawExample* example = nullptr;
  DVec3 start_m;  // Vector from the fixed to the moving foot, in the heading frame.
  DVec3 end_m;
  [[nodiscard]] double length_m() const { return 0.5 * (end_m.z - start_m.z); }
};

// Returns the feet of a step example at both ends.
Stride Measure(const Skeleton& skeleton, const RawExample& example, Foot moving) {
  Pose last(skeleton.joint_count());
  SampleClip(example.clip, example.keytimes_s.back(), last);
  return {&example, FootVector(skeleton, example.clip.frame(0), moving, 0.0),
          FootVector(skeleton, last, moving, example.heading_change_rad)};
}

// Returns how far the ball of the moving foot rises above its final height.
double Lift(const Skeleton& skeleton, const RawExample& example, Foot moving) {
  Pose pose(skeleton.joint_count());
  const auto height_m = [&](double time_s) {
    SampleClip(example.clip, time_s, pose);
    return static_cast<double>(BallPosition(skeleton, pose, moving).y);
  };
  const double end_m = height_m(example.keytimes_s.back());
  double lift_m = 0.0;
  for (std::size_t p = kPointsPerInterval; p < 2 * kPointsPerInterval; p += 2) {
    lift_m = std::max(lift_m, height_m(TimeAtPoint(example.keytimes_s, p)) - end_m);
  }
  return lift_m;
}

bool IsStraightStride(const Stride& stride, Foot moving) {
  const auto is_beside = [&](const DVec3& d) {
    return SideSign(moving) * d.x > 0.0 && SideSign(moving) * d.x < kMaxWidthM &&
           std::fabs(d.y) < kMaxRiseM;
  };
  return stride.example->keytimes_s.size() == kIntervals + 1 && -stride.start_m.z > kMinLengthM &&
         stride.end_m.z > kMinLengthM && is_beside(stride.start_m) && is_beside(stride.end_m) &&
         std::fabs(stride.example->heading_change_rad) < kMaxTurnRad;
}

// Returns the straight strides in which foot `moving` moves, from the first captured group that
// contains any. Groups of straight steps come first. Omits steps over obstacles, and strides whose
// length differs from the median by more than kSameLengthM.
std::vector<Stride> FindStrides(const RawLibrary& library, Foot moving) {
  for (const RawGroup& group : library.groups) {
    if (group.is_completed || group.kind != StepKind(moving)) continue;
    std::vector<Stride> strides;
    for (const RawExample& example : group.examples) {
      const Stride stride = Measure(library.skeleton, example, moving);
      if (!IsStraightStride(stride, moving)) continue;
      if (Lift(library.skeleton, example, moving) > kPlainLiftM) continue;
      strides.push_back(stride);
    }
    if (strides.empty()) continue;
    std::vector<double> lengths;
    for (const Stride& stride : strides) lengths.push_back(stride.length_m());
    const double median_m = Median(lengths);
    std::erase_if(strides, [&](const Stride& stride) {
      return std::fabs(stride.length_m() - median_m) > kSameLengthM;
    });
    return strides;
  }
  return {};
}

// Returns the point before a generic time, and the fraction of the way to the next point.
std::pair<std::size_t, double> PointAt(double generic_time) {
  const double at =
      std::clamp(generic_time, 0.0, static_cast<double>(kIntervals)) * kPointsPerInterval;
  const int i = std::min(static_cast<int>(at), kPointCount - 2);
  return {static_cast<std::size_t>(i), at - i};
}

// Returns the root at a time that may be outside the stride. Beyond an end, its path is continued
// by point reflection about that end.
DVec3 RootAround(const StrideModel& model, double time_s) {
  const double first_s = model.keytimes_s.front();
  const double last_s = model.keytimes_s.back();
  const auto root_at = [&](double at_s) {
    const auto [k, share] = PointAt(GenericTime(model.keytimes_s, at_s));
    return model.points[k].root_m + share * (model.points[k + 1].root_m - model.points[k].root_m);
  };
  const bool is_before = time_s < first_s;
  if (!is_before && time_s <= last_s) return root_at(time_s);
  const PostureSample& end = is_before ? model.points.front() : model.points.back();
  const double inside_s = 2.0 * (is_before ? first_s : last_s) - time_s;
  return 2.0 * end.root_m - root_at(std::clamp(inside_s, first_s, last_s));
}

// Smooths the path of the root over time. Both ends of the stride remain unchanged. The joints are
// not smoothed: their fast movements make a walk look alive.
void SmoothRoot(double window_s, StrideModel& model) {
  // Number of samples on each side of a point. The points are not evenly spaced in time, but the
  // samples are, so that uniform motion remains uniform.
  constexpr int kSide = 8;
  const StrideModel rough = model;
  for (std::size_t p = 1; p + 1 < rough.points.size(); ++p) {
    const double time_s = TimeAtPoint(model.keytimes_s, p);
    DVec3& root_m = model.points[p].root_m;
    double sum = 0.0;
    for (int k = -kSide; k <= kSide; ++k) {
      const double away = static_cast<double>(k) / (kSide + 1);
      const double weight = 1.0 - std::fabs(away);
      sum += weight;
      root_m += weight / sum * (RootAround(rough, time_s + away * window_s) - root_m);
    }
  }
}

StrideModel Average(const Skeleton& skeleton, const std::vector<Stride>& strides, Foot moving) {
  const auto fixed = static_cast<std::size_t>(OtherFoot(moving));
  StrideModel model;
  model.points.resize(kPointCount);
  double count = 0.0;
  for (const Stride& stride : strides) {
    const RawExample& example = *stride.example;
    Clip clip = example.clip;
    MakeSignContinuous(clip);
    Pose pose(skeleton.joint_count());
    count += 1.0;
    for (std::size_t p = 0; p < model.points.size(); ++p) {
      SampleClip(clip, TimeAtPoint(example.keytimes_s, p), pose);
      PostureSample sample = SampleOf(
          skeleton, pose,
          SmoothStep(static_cast<double>(p) / (kPointCount - 1)) * example.heading_change_rad);
      DVec3 origin = sample.balls_m[fixed];
      origin.y = 0.0;
      sample.root_m -= origin;
      for (DVec3& ball : sample.balls_m) ball -= origin;
      if (count == 1.0) {
        model.points[p] = std::move(sample);
      } else {
        Blend(model.points[p], sample, 1.0 / count, model.points[p]);
      }
    }
    for (std::size_t k = 0; k < model.keytimes_s.size(); ++k) {
      model.keytimes_s[k] += example.keytimes_s[k];
    }
    model.start_length_m -= stride.start_m.z;
    model.end_length_m += stride.end_m.z;
    model.width_m += 0.5 * SideSign(moving) * (stride.start_m.x + stride.end_m.x);
  }
  for (double& keytime : model.keytimes_s) keytime /= count;
  model.start_length_m /= count;
  model.end_length_m /= count;
  model.width_m /= count;
  // The average of few strides contains more individual variation, so its root is smoothed more.
  SmoothRoot(kRoughWindowS / std::sqrt(count), model);
  return model;
}

// Returns the mirror images of examples, or an empty list if the skeleton cannot be mirrored.
std::vector<RawExample> MirrorImages(const RawLibrary& library, const std::vector<Stride>& strides,
                                     Foot moving) {
  std::vector<ExtractedExample> sources;
  for (const Stride& stride : strides) sources.push_back({StepKind(moving), *stride.example});
  std::vector<const ExtractedExample*> pointers;
  for (ExtractedExample& source : sources) {
    source.example.parameters.clear();
    pointers.push_back(&source);
  }
  const auto mirror =
      FindSkeletonMirror(library.skeleton, MeasurePosture(library.skeleton, pointers));
  std::vector<RawExample> images;
  if (!mirror) return images;
  for (const ExtractedExample& source : sources) {
    images.push_back(MirrorExample(library.skeleton, *mirror, {}, source).example);
  }
  return images;
}

}  // namespace

double TimeAtPoint(std::span<const double> keytimes_s, std::size_t point) {
  const std::size_t interval = std::min<std::size_t>(point / kPointsPerInterval, kIntervals - 1);
  const double part =
      static_cast<double>(point - interval * kPointsPerInterval) / kPointsPerInterval;
  return keytimes_s[interval] + part * (keytimes_s[interval + 1] - keytimes_s[interval]);
}

PostureSample StrideModel::At(double generic_time) const {
  PostureSample sample;
  Sample(generic_time, sample);
  return sample;
}

void StrideModel::Sample(double generic_time, PostureSample& out) const {
  const auto [k, share] = PointAt(generic_time);
  Blend(points[k], points[k + 1], share, out);
}

void StrideModel::Sample(double generic_time, std::span<const std::size_t> joints,
                         PostureSample& out) const {
  const auto [k, share] = PointAt(generic_time);
  const PostureSample& a = points[k];
  const PostureSample& b = points[k + 1];
  BlendFeet(a, b, share, out);
  out.rotations.resize(a.rotations.size());
  for (const std::size_t j : joints) {
    out.rotations[j] = Blend(a.rotations[j], b.rotations[j], share);
  }
}

double StrideModel::LegAt(double generic_time) const {
  const auto [k, share] = PointAt(generic_time);
  return leg_m[k] + share * (leg_m[k + 1] - leg_m[k]);
}

DVec3 StrideModel::MeasuredStartVelocity() const {
  constexpr int kSpan = kPointsPerInterval / 2;
  return (points[kSpan].root_m - points[0].root_m) / (keytimes_s[1] * kSpan / kPointsPerInterval);
}

DVec3 StrideModel::MeasuredEndVelocity() const {
  constexpr int kSpan = kPointsPerInterval / 2;
  return (points[kPointCount - 1].root_m - points[kPointCount - 1 - kSpan].root_m) /
         ((keytimes_s[3] - keytimes_s[2]) * kSpan / kPointsPerInterval);
}

void JoinStrides(std::array<StrideModel, 2>& strides) {
  constexpr double kShare = 0.5;
  constexpr double kFadePart = 0.45;
  for (const Foot ahead : {Foot::kLeft, Foot::kRight}) {
    StrideModel& before = strides[static_cast<std::size_t>(ahead)];
    StrideModel& after = strides[static_cast<std::size_t>(OtherFoot(ahead))];
    const PostureSample end = before.points.back();
    const PostureSample start = after.points.front();
    const auto correct = [&](const PostureSample& from, const PostureSample& to, double weight,
                             double foot_weight, PostureSample& point) {
      for (std::size_t j = 0; j < point.rotations.size(); ++j) {
        const DQuat target = Blend(from.rotations[j], to.rotations[j], kShare);
        const DQuat& q = point.rotations[j];
        point.rotations[j] = Blend(q, target * glm::conjugate(from.rotations[j]) * q, weight);
      }
      for (std::size_t f = 0; f < 2; ++f) {
        const DQuat target = Blend(from.ankles[f], to.ankles[f], kShare);
        const DQuat& q = point.ankles[f];
        point.ankles[f] = Blend(q, target * glm::conjugate(from.ankles[f]) * q, foot_weight);
        point.balls_m[f].y += foot_weight * kShare * (to.balls_m[f].y - from.balls_m[f].y);
      }
      point.root_m += weight * kShare * (RootFromFeet(to) - RootFromFeet(from));
    };
    // The correction fades out over the fraction kFadePart of the stride's duration, and not over a
    // fraction of its points. Points are not evenly spaced in time: a third of them are in the
    // double support at each end of the stride, which may be very short.
    const auto weight_at = [](const StrideModel& stride, std::size_t point, double end_s) {
      const double fade_s = kFadePart * (stride.keytimes_s.back() - stride.keytimes_s.front());
      return 1.0 - SmoothStep(std::fabs(TimeAtPoint(stride.keytimes_s, point) - end_s) / fade_s);
    };
    for (std::size_t i = 0; i < kPointCount; ++i) {
      // Feet are corrected in double support only, so that a standing foot stays flat.
      const double foot_weight = 1.0 - SmoothStep(static_cast<double>(i) / kPointsPerInterval);
      const std::size_t last = kPointCount - 1 - i;
      correct(end, start, weight_at(before, last, before.keytimes_s.back()), foot_weight,
              before.points[last]);
      correct(start, end, weight_at(after, i, after.keytimes_s.front()), foot_weight,
              after.points[i]);
    }
    before.end_velocity = after.start_velocity =
        0.5 * (before.MeasuredEndVelocity() + after.MeasuredStartVelocity());
  }
}

void MeasureLegs(const Skeleton& skeleton, const LegRig& rig, std::array<StrideModel, 2>& strides) {
  for (const Foot moving : {Foot::kLeft, Foot::kRight}) {
    StrideModel& stride = strides[static_cast<std::size_t>(moving)];
    stride.leg_m.clear();
    for (const PostureSample& point : stride.points) {
      stride.leg_m.push_back(LegLength(skeleton, rig, point, OtherFoot(moving)));
    }
  }
}

std::optional<StrideModel> MeasureStride(const RawLibrary& library, Foot moving) {
  const std::vector<Stride> strides = FindStrides(library, moving);
  if (!strides.empty()) return Average(library.skeleton, strides, moving);
  const std::vector<Stride> others = FindStrides(library, OtherFoot(moving));
  const std::vector<RawExample> images = MirrorImages(library, others, OtherFoot(moving));
  std::vector<Stride> mirrored;
  for (const RawExample& image : images) {
    mirrored.push_back(Measure(library.skeleton, image, moving));
  }
  if (mirrored.empty()) return std::nullopt;
  return Average(library.skeleton, mirrored, moving);
}

}  // namespace stridewire::complete
