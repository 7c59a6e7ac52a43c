#pragma once

#include <span>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Sampled motion: the positions of the root and the rotations of all joints over time, M(t) in the
/// paper. The time of frame f is f / fps seconds.
struct Clip {
  double fps = 0.0;  ///< Frames per second, in (0, 10000].
  int joint_count = 0;
  std::vector<Vec3> root_positions_m;  ///< [frame]: position of the root.
  std::vector<Quat> rotations;         ///< [frame * joint_count + joint]: rotation of a joint.

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

  /// Checks the clip. Errors: kOutOfRange if fps is not in (0, 10000] or there are no frames or no
  /// joints. kShapeMismatch if the number of rotations is not frames times joints.
  /// kInvalidArgument, with the frame as index, if a number is not finite or the length of a
  /// rotation differs from 1 by more than 1e-3.
  [[nodiscard]] Status Validate() const;
};

/// Negates quaternions where necessary, so that the sign of each joint's quaternion does not change
/// between successive frames.
void MakeSignContinuous(Clip& clip);

/// Samples the pose at `time_s`, clamped to the duration of the clip. Interpolates positions and
/// rotations with Catmull-Rom splines, so that velocities are continuous. The signs of successive
/// quaternions in the clip may differ.
void SampleClip(const Clip& clip, double time_s, PoseSpan out);

}  // namespace stridewire
