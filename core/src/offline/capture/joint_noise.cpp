#include "offline/capture/joint_noise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace stridewire {
namespace {

constexpr double kLimbEndM = 0.15;

// A filter for noisy joint rotations: a median filter, followed by a Gaussian filter that is
// truncated at two standard deviations.
struct NoiseFilter {
  // The filter applies only to joints whose 99th percentile of angular acceleration is at least
  // this.
  double least_rad_s2;
  double median_reach_s;  // Half the length of the median's window.
  double deviation_s;     // Standard deviation of the Gaussian.
};
constexpr NoiseFilter kLimbEndFilter = {1000.0, 1.0 / 30, 0.025};
constexpr NoiseFilter kAnkleFilter = {2000.0, 0.0, 0.010};
constexpr double kAccelerationPercentile = 0.99;
// Maximum number of samples before, and also after, the centre of a window.
constexpr int kMaxReachSamples = 8;

// Returns how far the body extends beyond a joint.
double ReachBeyond(const Skeleton& skeleton, int joint) {
  std::vector<double> distance(skeleton.joints.size(), -1.0);
  distance[static_cast<std::size_t>(joint)] = 0.0;
  double reach = 0.0;
  for (std::size_t j = static_cast<std::size_t>(joint) + 1; j < distance.size(); ++j) {
    const double before = distance[static_cast<std::size_t>(skeleton.joints[j].parent)];
    if (before < 0.0) continue;
    distance[j] = before + glm::length(skeleton.joints[j].offset_m);
    reach = std::max(reach, distance[j]);
  }
  for (const EndSite& site : skeleton.end_sites) {
    const double before = distance[static_cast<std::size_t>(site.joint)];
    if (before >= 0.0) reach = std::max<double>(reach, before + glm::length(site.offset_m));
  }
  return reach;
}

bool IsAnkle(const Skeleton& skeleton, int joint) {
  return std::ranges::any_of(skeleton.legs, [&](const Leg& leg) { return leg.ankle == joint; });
}

// The rotations of a joint in successive frames.
using RotationTrack = std::vector<Quat>;

// [frame][k - 1]: angle between the rotation of a frame and that of the k-th sample after it.
// Angles are stored because overlapping windows use them many times.
using PairAngles = std::vector<std::array<double, 2 * kMaxReachSamples>>;

PairAngles AnglesOf(const RotationTrack& track, int stride) {
  PairAngles angles(track.size());
  for (std::size_t f = 0; f < track.size(); ++f) {
    std::size_t other = f;
    for (double& angle : angles[f]) {
      other += static_cast<std::size_t>(stride);
      if (other >= track.size()) break;
      angle = AngleBetween(track[f], track[other]);
    }
  }
  return angles;
}

// A window on a track: the rotations at most `reach` frames from a central frame. Long windows
// contain only every n-th rotation, because the median compares all pairs.
class Window {
 public:
  Window(const RotationTrack& track, int frame, int reach)
      : track_(track),
        frame_(frame),
        stride_(std::max(1, (reach + kMaxReachSamples - 1) / kMaxReachSamples)),
        begin_(frame - std::min(reach, frame) / stride_ * stride_),
        end_(std::min(frame + reach + 1, static_cast<int>(track.size()))) {}

  [[nodiscard]] int stride() const { return stride_; }

  // Returns the rotation with the smallest sum of angles to all others.
  [[nodiscard]] Quat Median(const PairAngles& angles) const {
    Quat best = At(frame_);
    double least = HUGE_VAL;
    for (int f = begin_; f < end_; f += stride_) {
      double sum = 0.0;
      for (int g = begin_; g < end_; g += stride_) {
        if (g == f) continue;
        const auto apart = static_cast<std::size_t>(std::abs(f - g) / stride_);
        sum += angles[static_cast<std::size_t>(std::min(f, g))][apart - 1];
      }
      if (sum < least) {
        least = sum;
        best = At(f);
      }
    }
    return best;
  }

  // Returns the mean with Gaussian weights. `deviation` is in frames.
  [[nodiscard]] Quat Mean(double deviation) const {
    Quat sum(0.0f, 0.0f, 0.0f, 0.0f);
    for (int f = begin_; f < end_; f += stride_) {
      const double distance = (f - frame_) / deviation;
      const auto weight = static_cast<float>(std::exp(-0.5 * distance * distance));
      sum += At(f) * (Dot(At(f), At(frame_)) < 0.0f ? -weight : weight);
    }
    return Normalise(sum);
  }

 private:
  [[nodiscard]] const Quat& At(int frame) const { return track_[static_cast<std::size_t>(frame)]; }

  const RotationTrack& track_;
  int frame_;
  int stride_;
  int begin_;
  int end_;
};

// Returns the small rotation from `a` to `b` as a rotation vector.
Vec3 RotationVector(const Quat& a, const Quat& b) {
  const Quat turn = glm::conjugate(a) * b;
  return (turn.w < 0.0f ? -2.0f : 2.0f) * Vec3(turn.x, turn.y, turn.z);
}

// Returns the 99th percentile of the angular acceleration.
double LargestAcceleration(const RotationTrack& track, double fps) {
  std::vector<double> accelerations;
  for (std::size_t f = 1; f + 1 < track.size(); ++f) {
    const Vec3 change =
        RotationVector(track[f], track[f + 1]) - RotationVector(track[f - 1], track[f]);
    accelerations.push_back(fps * fps * static_cast<double>(glm::length(change)));
  }
  if (accelerations.empty()) return 0.0;
  const auto last = static_cast<double>(accelerations.size() - 1);
  const auto rank = static_cast<std::ptrdiff_t>(kAccelerationPercentile * last);
  std::ranges::nth_element(accelerations, accelerations.begin() + rank);
  return accelerations[static_cast<std::size_t>(rank)];
}

void Apply(const NoiseFilter& filter, double fps, RotationTrack& track) {
  const auto frames = [&](double seconds) { return static_cast<int>(std::lround(seconds * fps)); };
  RotationTrack medians = track;
  const auto count = static_cast<int>(track.size());
  if (const int reach = frames(filter.median_reach_s); reach > 0) {
    const PairAngles angles = AnglesOf(track, Window(track, 0, reach).stride());
    for (int f = 0; f < count; ++f) {
      medians[static_cast<std::size_t>(f)] = Window(track, f, reach).Median(angles);
    }
  }
  for (int f = 0; f < count; ++f) {
    track[static_cast<std::size_t>(f)] =
        Window(medians, f, frames(2.0 * filter.deviation_s)).Mean(filter.deviation_s * fps);
  }
}

}  // namespace

bool IsLimbEnd(const Skeleton& skeleton, int joint) {
  return ReachBeyond(skeleton, joint) < kLimbEndM;
}

std::vector<int> RemoveJointNoise(const Skeleton& skeleton, int first_frame, Clip& clip) {
  std::vector<int> filtered;
  const int count = std::max(0, clip.frame_count() - first_frame);
  RotationTrack track(static_cast<std::size_t>(count));
  for (int joint = 1; joint < skeleton.joint_count(); ++joint) {
    const bool is_ankle = IsAnkle(skeleton, joint);
    if (!is_ankle && !IsLimbEnd(skeleton, joint)) continue;
    const NoiseFilter& filter = is_ankle ? kAnkleFilter : kLimbEndFilter;
    const auto rotation = [&](int frame) -> Quat& {
      return clip.frame(first_frame + frame).rotations[static_cast<std::size_t>(joint)];
    };
    for (int f = 0; f < count; ++f) track[static_cast<std::size_t>(f)] = rotation(f);
    if (LargestAcceleration(track, clip.fps) < filter.least_rad_s2) continue;
    Apply(filter, clip.fps, track);
    for (int f = 0; f < count; ++f) rotation(f) = track[static_cast<std::size_t>(f)];
    filtered.push_back(joint);
  }
  return filtered;
}

}  // namespace stridewire
