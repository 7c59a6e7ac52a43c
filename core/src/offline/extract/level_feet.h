#pragma once

#include <array>

#include "offline/extract/extract.h"
#include "runtime/skeleton/leg_rig.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {

/// Puts the feet of examples on level ground.
///
/// The floor of a recording is never exactly level. Markers, tilted floors and drifting sensors
/// move the ground below successive contacts by one or two centimetres. Feet of blends would hover
/// or sink by as much. Each foot is therefore moved up or down by the error of its current contact,
/// which changes during the swing. The root follows the feet in proportion to the weight that they
/// carry. The legs bend to absorb the remaining difference.
class FeetLeveller {
 public:
  /// `any_pose` may be any pose of the skeleton. `ball_height_m` [foot]: height at which the balls
  /// of standing feet rest. `hinges` [foot]: see LegRig::Side::hinge. If the legs do not support
  /// planting, the leveller only shifts the roots of examples and does not change standing poses.
  FeetLeveller(const Skeleton& skeleton, ConstPoseSpan any_pose, const std::array<Vec3, 2>& hinges,
               const std::array<double, 2>& ball_height_m);

  /// Moves the feet of a step or jump by -`example.ground_m`. Measures the parameters `names` of a
  /// step again.
  void Level(ExtractedExample& example, std::span<const ParameterName> names) const;

  /// Puts both balls of a standing pose at their resting height. Leaves the pose unchanged if a
  /// foot is too far from the ground to stand on it.
  void Level(PoseSpan stand) const;

 private:
  // Raises the balls by `feet_m` [foot] and the root by `root_m`.
  void Raise(const std::array<double, 2>& feet_m, double root_m, PoseSpan pose) const;

  const Skeleton& skeleton_;
  std::array<double, 2> ball_height_m_;
  LegRig rig_;
};

}  // namespace stridewire
