#include "runtime/skeleton/layer_clip.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.h"

namespace stridewire {
namespace {

// The four keys around a time and their Catmull-Rom weights. A clip that does not loop repeats its
// first and last key beyond its ends, so the motion slows down there.
struct KeyBlend {
  std::array<std::size_t, 4> frames;
  std::array<float, 4> weights;

  KeyBlend(const LayerClip& clip, double time_s) {
    const auto count = static_cast<double>(clip.frame_count());
    double position = std::isfinite(time_s) ? time_s * clip.fps : 0.0;
    if (clip.is_looping) {
      position -= std::floor(position / count) * count;
    } else {
      position = std::clamp(position, 0.0, count - 1.0);
    }
    // Due to rounding, the result may be `count`.
    const auto key = std::min(std::floor(position), count - 1.0);
    const auto u = static_cast<float>(std::min(position - key, 1.0));
    for (int i = 0; i < 4; ++i) {
      double frame = key + i - 1.0;
      if (clip.is_looping) {
        frame -= std::floor(frame / count) * count;
      } else {
        frame = std::clamp(frame, 0.0, count - 1.0);
      }
      frames[static_cast<std::size_t>(i)] = static_cast<std::size_t>(frame);
    }
    const float u2 = u * u;
    const float u3 = u2 * u;
    weights = {0.5f * (-u + 2.0f * u2 - u3), 0.5f * (2.0f - 5.0f * u2 + 3.0f * u3),
               0.5f * (u + 4.0f * u2 - 3.0f * u3), 0.5f * (-u2 + u3)};
  }
};

}  // namespace

bool IsLayerName(std::string_view name) {
  const auto is_fine = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  return !name.empty() && name.size() <= kMaxLayerNameBytes &&
         std::all_of(name.begin(), name.end(), is_fine);
}

std::vector<bool> JointsOfLegs(const Skeleton& skeleton) {
  const std::size_t joints = skeleton.joints.size();
  std::vector<bool> of_legs(joints, false);
  std::vector<bool> below_hip(joints, false);
  of_legs[0] = true;
  for (const Leg& leg : skeleton.legs) {
    for (const int end : {leg.hip, leg.knee, leg.ankle, leg.ball}) {
      for (int j = end; j >= 0; j = skeleton.joints[static_cast<std::size_t>(j)].parent) {
        of_legs[static_cast<std::size_t>(j)] = true;
      }
    }
    below_hip[static_cast<std::size_t>(leg.hip)] = true;
  }
  for (std::size_t j = 1; j < joints; ++j) {
    const auto parent = static_cast<std::size_t>(skeleton.joints[j].parent);
    below_hip[j] = below_hip[j] || below_hip[parent];
    of_legs[j] = of_legs[j] || below_hip[j];
  }
  return of_legs;
}

void ApplyLayer(const LayerClip& clip, double time_s, double weight, PoseSpan pose) {
  STRIDEWIRE_CHECK(clip.frame_count() > 0);
  const KeyBlend blend(clip, time_s);
  const std::size_t count = clip.joints.size();
  for (std::size_t i = 0; i < count; ++i) {
    const auto key = [&](std::size_t k) {
      const float* q = &clip.rotations[(blend.frames[k] * count + i) * 4];
      return Quat(q[3], q[0], q[1], q[2]);
    };
    // q and -q are the same rotation. The signs are chosen so that neighbouring keys are closest to
    // each other.
    const Quat q1 = key(1);
    Quat q0 = key(0);
    Quat q2 = key(2);
    Quat q3 = key(3);
    if (Dot(q0, q1) < 0.0f) q0 = -q0;
    if (Dot(q2, q1) < 0.0f) q2 = -q2;
    if (Dot(q3, q2) < 0.0f) q3 = -q3;
    const Quat played = Normalise(blend.weights[0] * q0 + blend.weights[1] * q1 +
                                  blend.weights[2] * q2 + blend.weights[3] * q3);
    Quat& rotation = pose.rotations[static_cast<std::size_t>(clip.joints[i])];
    const float share = static_cast<float>(weight) * clip.weights[i];
    rotation =
        share >= 1.0f
            ? played
            : Normalise(rotation * SlerpFromIdentity(glm::conjugate(rotation) * played, share));
  }
}

}  // namespace stridewire
