#include "offline/capture/glitch_repair.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/check.h"
#include "offline/base/text.h"
#include "offline/capture/joint_noise.h"

namespace stridewire {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
// Faster rotations are glitches. In a jump, arms rotate by up to about 1000 degrees/s.
constexpr double kJumpRadPerS = 1800.0 * kDegree;
// Smaller rotations are noise of captures at 240 Hz and above, not glitches.
constexpr double kJumpMinRad = 12.0 * kDegree;
// Larger rotations per frame are always glitches. Below 30 Hz, kJumpRadPerS alone would permit
// them.
constexpr double kJumpMaxRad = 60.0 * kDegree;
constexpr double kSpikeS = 0.04;
constexpr double kSpreadS = 0.08;
constexpr double kRootOffPathM = 0.01;
constexpr double kRootAcceleration_m_s2 = 40.0;
constexpr int kMedianReach = 2;
constexpr double kSmallJumpRad = 45.0 * kDegree;

class Track {
 public:
  Track(Clip& clip, int joint) : clip_(clip), joint_(joint) {}
  Quat& operator[](int frame) {
    return clip_
        .rotations[static_cast<std::size_t>(frame) * static_cast<std::size_t>(clip_.joint_count) +
                   static_cast<std::size_t>(joint_)];
  }

 private:
  Clip& clip_;
  int joint_;
};

// Interpolates the frames strictly between `before` and `after` by slerp.
void Interpolate(Track& track, int before, int after) {
  STRIDEWIRE_CHECK(before < after);
  const Quat from = track[before];
  const Quat turn = glm::conjugate(from) * track[after];
  for (int f = before + 1; f < after; ++f) {
    const float fraction = static_cast<float>(f - before) / static_cast<float>(after - before);
    track[f] = Normalise(from * SlerpFromIdentity(turn, fraction));
  }
}

void RepairJoint(const Skeleton& skeleton, int joint, int first_frame, Clip& clip,
                 GlitchReport& report) {
  Track track(clip, joint);
  const int end = clip.frame_count();
  const double limit = std::clamp(kJumpRadPerS / clip.fps, kJumpMinRad, kJumpMaxRad);
  const int spike = std::max(2, static_cast<int>(std::lround(kSpikeS * clip.fps)));
  const int spread = std::max(1, static_cast<int>(std::lround(0.5 * kSpreadS * clip.fps)));
  // The jump at f is the angle between the rotations of frames f and f + 1.
  const auto jump = [&](int f) { return AngleBetween(track[f], track[f + 1]); };
  for (int f = first_frame; f + 1 < end; ++f) {
    const double angle = jump(f);
    if (angle <= limit) continue;
    // If the joint soon returns to its earlier rotation, all frames in between are glitches.
    int back = -1;
    double largest = angle;
    for (int g = f + 1; g < std::min(f + 1 + spike, end - 1); ++g) {
      const double there = jump(g);
      if (there > limit && AngleBetween(track[f], track[g + 1]) < 0.5 * std::max(angle, there)) {
        back = g + 1;
        largest = std::max(angle, there);
      }
    }
    if (back > 0) {
      Interpolate(track, f, back);
      report.repaired.push_back({joint, {f + 1, back}, largest});
      f = back - 1;
    } else if (f - first_frame < spike) {
      for (int g = first_frame; g <= f; ++g) track[g] = track[f + 1];
      report.repaired.push_back({joint, {first_frame, f + 1}, angle});
    } else if (end - 1 - f <= spike) {
      for (int g = f + 1; g < end; ++g) track[g] = track[f];
      report.repaired.push_back({joint, {f + 1, end}, angle});
    } else {
      const int before = std::max(first_frame, f - spread);
      const int after = std::min(end - 1, f + 1 + spread);
      const JointFlip flip{joint, {before, after + 1}, angle};
      if (angle <= kSmallJumpRad || IsLimbEnd(skeleton, joint)) {
        Interpolate(track, before, after);
        report.repaired.push_back(flip);
      } else {
        report.left.push_back(flip);
      }
      f = after - 1;
    }
  }
}

// Repairs single frames in which the root leaves its path. The motion capture software sometimes
// attributes motion of the root to another joint. In take 16_17, for example, the pelvis moves by 4
// cm and turns by 30 degrees for one frame.
void RepairRootPath(int first_frame, Clip& clip, GlitchReport& report) {
  std::vector<Vec3>& path = clip.root_positions_m;
  const int end = clip.frame_count();
  const double limit = std::max(kRootOffPathM, kRootAcceleration_m_s2 / (clip.fps * clip.fps));
  std::vector<double> off(path.size(), 0.0);
  for (int f = first_frame + kMedianReach; f + kMedianReach < end; ++f) {
    Vec3 median;
    for (int axis = 0; axis < 3; ++axis) {
      std::array<float, 2 * kMedianReach + 1> values;
      for (int k = -kMedianReach; k <= kMedianReach; ++k) {
        values[static_cast<std::size_t>(k + kMedianReach)] =
            path[static_cast<std::size_t>(f + k)][axis];
      }
      std::ranges::nth_element(values, values.begin() + kMedianReach);
      median[axis] = values[kMedianReach];
    }
    off[static_cast<std::size_t>(f)] = glm::length(path[static_cast<std::size_t>(f)] - median);
  }
  // In a fast walk, the root moves by 2 cm per frame at 120 Hz. The median moves by the same
  // amount, so the distance between them is small.
  for (int f = first_frame + 1; f + 1 < end; ++f) {
    if (off[static_cast<std::size_t>(f)] <= limit) continue;
    int last = f;
    double largest = 0.0;
    while (last + 1 < end && off[static_cast<std::size_t>(last)] > limit) {
      largest = std::max(largest, off[static_cast<std::size_t>(last)]);
      ++last;
    }
    const Vec3 from = path[static_cast<std::size_t>(f - 1)];
    const Vec3 to = path[static_cast<std::size_t>(last)];
    for (int g = f; g < last; ++g) {
      const float fraction = static_cast<float>(g - f + 1) / static_cast<float>(last - f + 1);
      path[static_cast<std::size_t>(g)] = from + fraction * (to - from);
    }
    report.repaired.push_back({0, {f, last}, 0.0, largest});
    f = last;
  }
}

}  // namespace

GlitchReport RepairGlitches(const Skeleton& skeleton, int first_frame, Clip& clip) {
  STRIDEWIRE_CHECK(skeleton.joint_count() == clip.joint_count);
  GlitchReport report;
  for (int joint = 0; joint < clip.joint_count; ++joint) {
    RepairJoint(skeleton, joint, std::max(0, first_frame), clip, report);
  }
  RepairRootPath(std::max(0, first_frame), clip, report);
  if (!report.repaired.empty()) MakeSignContinuous(clip);
  return report;
}

std::string DescribeFlip(const Skeleton& skeleton, const JointFlip& flip, double fps) {
  STRIDEWIRE_CHECK(flip.joint >= 0 && flip.joint < skeleton.joint_count());
  STRIDEWIRE_CHECK(flip.frames.size() > 0 && fps > 0.0);
  const double middle_s = 0.5 * (flip.frames.begin + flip.frames.end - 1) / fps;
  return skeleton.joints[static_cast<std::size_t>(flip.joint)].name +
         (flip.distance_m > 0.0
              ? Text(" moves %.1f cm in one frame at %.2f s", 100.0 * flip.distance_m, middle_s)
              : Text(" turns %.0f degrees in one frame at %.2f s", flip.angle_rad / kDegree,
                     middle_s));
}

std::vector<std::string> DescribeRepairs(const Skeleton& skeleton, const GlitchReport& report,
                                         double fps) {
  std::vector<std::string> sentences;
  for (int joint = 0; joint < skeleton.joint_count(); ++joint) {
    int count = 0;
    const JointFlip* worst = nullptr;
    for (const JointFlip& flip : report.repaired) {
      if (flip.joint != joint || flip.distance_m > 0.0) continue;
      ++count;
      if (worst == nullptr || flip.angle_rad > worst->angle_rad) worst = &flip;
    }
    if (count == 0) continue;
    std::string sentence = DescribeFlip(skeleton, *worst, fps) + ": repaired";
    if (count > 1)
      sentence +=
          ", with " + std::to_string(count - 1) + (count == 2 ? " smaller flip" : " smaller flips");
    sentences.push_back(std::move(sentence));
  }
  for (const JointFlip& flip : report.repaired) {
    if (flip.distance_m > 0.0) {
      sentences.push_back(DescribeFlip(skeleton, flip, fps) + ": repaired");
    }
  }
  return sentences;
}

}  // namespace stridewire
