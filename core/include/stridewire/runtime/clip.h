#pragma once

#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Sampled motion M(t) = {t(t), r_j(t)}: frame f is at f / fps seconds.
struct Clip {
  double fps = 0.0;
  int joint_count = 0;
  std::vector<Vec3> root_positions_m;  ///< [frame]
  std::vector<Quat> rotations;         ///< [frame * joint_count + joint]

  [[nodiscard]] int frame_count() const { return static_cast<int>(root_positions_m.size()); }
  [[nodiscard]] double duration_s() const {
    return frame_count() < 2 ? 0.0 : (frame_count() - 1) / fps;
  }
  [[nodiscard]] ConstPoseSpan frame(int f) const {
    return {root_positions_m[static_cast<std::size_t>(f)],
            std::span(rotations).subspan(
                static_cast<std::size_t>(f) * static_cast<std::size_t>(joint_count),
                static_cast<std::size_t>(joint_count))};
  }
  [[nodiscard]] PoseSpan frame(int f) {
    return {root_positions_m[static_cast<std::size_t>(f)],
            std::span(rotations).subspan(
                static_cast<std::size_t>(f) * static_cast<std::size_t>(joint_count),
                static_cast<std::size_t>(joint_count))};
  }
  void Resize(int frames, int joints) {
    joint_count = joints;
    root_positions_m.resize(static_cast<std::size_t>(frames), Vec3(0.0f));
    rotations.resize(static_cast<std::size_t>(frames) * static_cast<std::size_t>(joints),
                     kIdentityQuat);
  }

  /// kOutOfRange: fps not in (0, 10000], no frame, no joint; kShapeMismatch: rotation count;
  /// kInvalidArgument: a number not finite or a rotation off unit length by more than 1e-3
  /// (index: the frame).
  [[nodiscard]] Status Validate() const;
};

/// Flips quaternions so that each joint's track is continuous in sign over time.
void MakeSignContinuous(Clip& clip);

/// Pose at `time_s`, clamped to the clip: C1 (Catmull-Rom on positions and on sign-continuous
/// rotations, then normalised). Linear 30 Hz would kink the velocity at every sample.
void SampleClip(const Clip& clip, double time_s, PoseSpan out);

}  // namespace stridewire
