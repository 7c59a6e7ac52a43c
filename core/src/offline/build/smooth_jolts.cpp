#include "offline/build/smooth_jolts.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "offline/capture/joint_noise.h"

namespace stridewire {
namespace {

constexpr double kJoltRadPerS2 = 400.0;
// Standard deviation of the Gaussian mean: increment per round, and maximum.
constexpr double kDeviationGrowthS = 0.005;
constexpr double kMaxDeviationS = 0.06;
// The deviation falls to 0 within this time before and after a jolt.
constexpr double kJoltReachS = 0.15;
// The mean includes rotations up to this many standard deviations away.
constexpr double kMeanReach = 2.5;
constexpr int kMaxWidenings = 24;

// The rotations of a joint at successive grid points.
using JointTrack = std::vector<Quat>;

// Returns the small rotation from `a` to `b` as a rotation vector.
Vec3 SmallRotation(const Quat& a, const Quat& b) {
  const Quat turn = glm::conjugate(a) * b;
  return (turn.w < 0.0f ? -2.0f : 2.0f) * Vec3(turn.x, turn.y, turn.z);
}

// Returns one flag per joint: true if it may be smoothed.
std::vector<bool> SmoothedJoints(const Skeleton& skeleton) {
  std::vector<bool> is_smoothed(skeleton.joints.size(), true);
  is_smoothed[0] = false;
  for (std::size_t j = 1; j < skeleton.joints.size(); ++j) {
    if (IsLimbEnd(skeleton, static_cast<int>(j))) is_smoothed[j] = false;
  }
  // Excludes the joints of the legs and the joints between them and the root.
  for (const Leg& leg : skeleton.legs) {
    for (int j = leg.ball; j > 0; j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
      is_smoothed[static_cast<std::size_t>(j)] = false;
    }
  }
  return is_smoothed;
}

// Smooths the track of one joint.
class JoltFilter {
 public:
  // `parent` contains the world rotations of the parent.
  JoltFilter(JointTrack& track, const JointTrack& parent, double spacing_s)
      : track_(track),
        parent_(parent),
        original_(track),
        spacing_s_(spacing_s),
        deviation_s_(track.size(), 0.0) {}

  // Smooths the track. Returns false if it has no jolts, and then changes nothing.
  bool Run() {
    bool is_smoothed = false;
    for (int round = 0; round < kMaxWidenings && WidenAtJolts(); ++round) {
      is_smoothed = true;
      for (std::size_t p = 1; p + 1 < track_.size(); ++p) {
        if (deviation_s_[p] > 0.0) track_[p] = MeanAround(p);
      }
    }
    return is_smoothed;
  }

 private:
  [[nodiscard]] bool JoltsAt(std::size_t point) const {
    const auto exceeds = [&](const Quat& before, const Quat& at, const Quat& after) {
      const Vec3 change = SmallRotation(at, after) - SmallRotation(before, at);
      const double limit = kJoltRadPerS2 * spacing_s_ * spacing_s_;
      return static_cast<double>(glm::length(change)) > limit;
    };
    const auto world = [&](std::size_t p) { return parent_[p] * track_[p]; };
    return exceeds(track_[point - 1], track_[point], track_[point + 1]) &&
           exceeds(world(point - 1), world(point), world(point + 1));
  }

  // Increases the standard deviation of the filter around jolts. Returns false if there are none,
  // or if all of them have the maximum deviation.
  bool WidenAtJolts() {
    std::vector<double> wider = deviation_s_;
    bool has_changed = false;
    for (std::size_t p = 1; p + 1 < track_.size(); ++p) {
      if (deviation_s_[p] >= kMaxDeviationS || !JoltsAt(p)) continue;
      has_changed = true;
      const double top_s = std::min(deviation_s_[p] + kDeviationGrowthS, kMaxDeviationS);
      for (std::size_t q = 0; q < wider.size(); ++q) {
        const double away_s =
            spacing_s_ * std::fabs(static_cast<double>(q) - static_cast<double>(p));
        const double away = std::min(away_s / kJoltReachS, 1.0);
        wider[q] = std::max(wider[q], top_s * (1.0 - away) * (1.0 - away) * (1.0 + 2.0 * away));
      }
    }
    deviation_s_ = std::move(wider);
    return has_changed;
  }

  // Returns the mean over equally many rotations before and after a point. The first and the last
  // point have no neighbours on one side, so they remain unchanged.
  [[nodiscard]] Quat MeanAround(std::size_t point) const {
    const double deviation = deviation_s_[point] / spacing_s_;
    const auto reach = std::min({static_cast<std::size_t>(std::ceil(kMeanReach * deviation)), point,
                                 original_.size() - 1 - point});
    Quat sum = original_[point];
    for (std::size_t k = 1; k <= reach; ++k) {
      const double distance = static_cast<double>(k) / deviation;
      const auto weight = static_cast<float>(std::exp(-0.5 * distance * distance));
      for (const Quat& q : {original_[point - k], original_[point + k]}) {
        sum += q * (Dot(q, original_[point]) < 0.0f ? -weight : weight);
      }
    }
    return Normalise(sum);
  }

  JointTrack& track_;
  const JointTrack& parent_;
  JointTrack original_;
  double spacing_s_;                 // Mean time between grid points.
  std::vector<double> deviation_s_;  // [point]
};

}  // namespace

bool SmoothJolts(const Skeleton& skeleton, const GridLayout& layout, GridExample& example) {
  const auto row_floats = static_cast<std::size_t>(layout.row_floats);
  const std::size_t points = example.rows.size() / row_floats;
  const double duration_s = example.keytimes_s.back() - example.keytimes_s.front();
  if (points < 3) return false;
  const double spacing_s = duration_s / static_cast<double>(points - 1);
  const auto joints = static_cast<std::size_t>(skeleton.joint_count());
  const std::vector<bool> is_smoothed = SmoothedJoints(skeleton);
  // [joint][point]: world rotations after smoothing.
  std::vector<JointTrack> worlds(joints, JointTrack(points));
  bool has_changed = false;
  for (std::size_t j = 0; j < joints; ++j) {
    JointTrack track(points);
    for (std::size_t p = 0; p < points; ++p) {
      track[p] = GridLayout::RotationOf(&example.rows[p * row_floats], j);
    }
    if (j == 0) {
      worlds[0] = track;
      continue;
    }
    const auto parent = static_cast<std::size_t>(skeleton.joints[j].parent);
    const bool is_changed = is_smoothed[j] && JoltFilter(track, worlds[parent], spacing_s).Run();
    for (std::size_t p = 0; p < points; ++p) worlds[j][p] = worlds[parent][p] * track[p];
    if (!is_changed) continue;
    has_changed = true;
    for (std::size_t p = 0; p < points; ++p) {
      GridLayout::SetRotation(&example.rows[p * row_floats], j, track[p]);
    }
  }
  return has_changed;
}

}  // namespace stridewire
