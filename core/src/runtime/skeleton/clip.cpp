#include "stridewire/runtime/clip.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace stridewire {
namespace {

bool IsFinite(const Vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// Catmull-Rom weights of four successive samples, for the position `u`, in [0, 1), between the two
// middle ones. A sample before the start of the clip is extrapolated linearly as 2 p_0 - p_1. Its
// weight is added to the weights of the two samples from which it is extrapolated. The same applies
// at the end.
struct CubicWeights {
  float w[4];

  CubicWeights(float u, bool is_first, bool is_last) {
    const float u2 = u * u;
    const float u3 = u2 * u;
    w[0] = 0.5f * (-u + 2.0f * u2 - u3);
    w[1] = 0.5f * (2.0f - 5.0f * u2 + 3.0f * u3);
    w[2] = 0.5f * (u + 4.0f * u2 - 3.0f * u3);
    w[3] = 0.5f * (-u2 + u3);
    if (is_first) {
      w[1] += 2.0f * w[0];
      w[2] -= w[0];
      w[0] = 0.0f;
    }
    if (is_last) {
      w[2] += 2.0f * w[3];
      w[1] -= w[3];
      w[3] = 0.0f;
    }
  }
};

}  // namespace

Status Clip::Validate() const {
  if (!(fps > 0.0 && fps <= 10000.0)) {
    return Fail(ErrorCode::kOutOfRange,
                "a clip's frame rate must be above 0 and at most 10000 per second");
  }
  if (frame_count() < 1) return Fail(ErrorCode::kOutOfRange, "a clip has no frames");
  if (joint_count < 1) return Fail(ErrorCode::kOutOfRange, "a clip has no joints");
  const std::size_t joints = static_cast<std::size_t>(joint_count);
  if (rotations.size() / joints != root_positions_m.size() || rotations.size() % joints != 0) {
    return Fail(ErrorCode::kShapeMismatch, "a clip needs one rotation per joint and frame",
                static_cast<std::int64_t>(rotations.size()));
  }
  for (int f = 0; f < frame_count(); ++f) {
    const ConstPoseSpan pose = frame(f);
    if (!IsFinite(pose.root_position_m)) {
      return Fail(ErrorCode::kInvalidArgument, "a root position is not finite", f);
    }
    for (const Quat& q : pose.rotations) {
      const float norm = std::sqrt(Dot(q, q));
      if (!(std::fabs(norm - 1.0f) <= 1e-3f)) {  // Written this way so that NaN is rejected.
        return Fail(ErrorCode::kInvalidArgument, "a rotation is not of unit length", f);
      }
    }
  }
  return {};
}

void MakeSignContinuous(Clip& clip) {
  const std::size_t joints = static_cast<std::size_t>(clip.joint_count);
  for (std::size_t i = joints; i < clip.rotations.size(); ++i) {
    if (Dot(clip.rotations[i - joints], clip.rotations[i]) < 0.0f) {
      clip.rotations[i] = -clip.rotations[i];
    }
  }
}

void SampleClip(const Clip& clip, double time_s, PoseSpan out) {
  const int last = clip.frame_count() - 1;
  STRIDEWIRE_CHECK(last >= 0);
  STRIDEWIRE_CHECK(out.rotations.size() == static_cast<std::size_t>(clip.joint_count));
  // Written this way so that NaN samples the clip at 0 s.
  const double position =
      time_s > 0.0 ? std::min(time_s * clip.fps, static_cast<double>(last)) : 0.0;
  const int f1 = std::min(static_cast<int>(position), std::max(last - 1, 0));
  const float u = static_cast<float>(position - f1);
  const auto copy = [&](int f) {
    const ConstPoseSpan source = clip.frame(f);
    out.root_position_m = source.root_position_m;
    std::copy(source.rotations.begin(), source.rotations.end(), out.rotations.begin());
  };
  // At the time of a sample, returns that sample without any change.
  if (u <= 0.0f || last == 0) return copy(f1);
  if (u >= 1.0f) return copy(f1 + 1);

  const CubicWeights k(u, f1 == 0, f1 + 1 == last);
  const ConstPoseSpan p0 = clip.frame(std::max(f1 - 1, 0));
  const ConstPoseSpan p1 = clip.frame(f1);
  const ConstPoseSpan p2 = clip.frame(f1 + 1);
  const ConstPoseSpan p3 = clip.frame(std::min(f1 + 2, last));
  out.root_position_m = k.w[0] * p0.root_position_m + k.w[1] * p1.root_position_m +
                        k.w[2] * p2.root_position_m + k.w[3] * p3.root_position_m;
  for (std::size_t j = 0; j < out.rotations.size(); ++j) {
    // q and -q are the same rotation. The signs are aligned here, because callers may not have
    // called MakeSignContinuous.
    const Quat q1 = p1.rotations[j];
    const Quat q0 = Dot(p0.rotations[j], q1) < 0.0f ? -p0.rotations[j] : p0.rotations[j];
    const Quat q2 = Dot(p2.rotations[j], q1) < 0.0f ? -p2.rotations[j] : p2.rotations[j];
    const Quat q3 = Dot(p3.rotations[j], q2) < 0.0f ? -p3.rotations[j] : p3.rotations[j];
    out.rotations[j] = Normalise(k.w[0] * q0 + k.w[1] * q1 + k.w[2] * q2 + k.w[3] * q3);
  }
}

}  // namespace stridewire
