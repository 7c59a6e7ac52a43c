#pragma once

#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "runtime/movement/movement.h"
#include "stridewire/base/error.h"
#include "stridewire/runtime/clip.h"
#include "stridewire/runtime/pose.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Parts of the body for which PoseError contains separate distances.
enum class BodyPart : std::uint8_t { kTrunk = 0, kHead = 1, kArms = 2, kLegs = 3 };
inline constexpr int kBodyPartCount = 4;

/// Returns "trunk", "head", "arms" or "legs".
[[nodiscard]] std::string_view BodyPartName(BodyPart part);

/// Returns the part of the body to which each joint belongs:
///
/// - Legs: the hips and all joints below them.
/// - Arms: all other joints of the left or right side, according to FindMirrorJoints. If a skeleton
///   has no mirror joints: all other joints that are more than 3 cm to the side of the root in the
///   stand pose, and the joints below them.
/// - Head: joints of neither side above the joint at which the arms branch off. There are none if
///   the arms branch off at the root.
/// - Trunk: all other joints, including those between root and hips.
[[nodiscard]] std::vector<BodyPart> FindBodyParts(const Skeleton& skeleton,
                                                  ConstPoseSpan stand_pose);

/// Distances between the joints of two movements, in metres.
struct PoseError {
  double mean_m = 0.0;  ///< Mean distance over all joints and all poses.
  /// Mean distance over one part of the body; 0 if it has no joints.
  std::array<double, kBodyPartCount> part_m{};
  double max_m = 0.0;  ///< Largest distance of a joint.
};

/// Compares movements pose by pose. Both must start with the root at x = z = 0 and heading 0. Poses
/// are not aligned, so deviations of the root count. Borrows the skeleton. Not thread-safe.
class PoseComparison {
 public:
  PoseComparison(const Skeleton& skeleton, ConstPoseSpan stand_pose);

  /// Returns the distances between corresponding joints of poses with the same index. The caller
  /// must sample both movements at equal generic times. Fails with kShapeMismatch if the numbers of
  /// poses or joints differ, or if there are no poses.
  [[nodiscard]] Expected<PoseError> Measure(std::span<const Pose> truth,
                                            std::span<const Pose> other);

  [[nodiscard]] std::span<const BodyPart> parts() const { return parts_; }

 private:
  const Skeleton& skeleton_;
  std::vector<BodyPart> parts_;
  std::vector<Vec3> positions_[2];
  std::vector<Quat> rotations_;
};

/// Samples a clip at the grid points of a group. The times of the grid points follow from the
/// keytimes of the clip (TimeWarp). `cells[i]` is the number of cells of keytime interval i.
/// `keytimes_s` must have one more value than `cells`.
[[nodiscard]] std::vector<Pose> PosesAtGridPoints(const Clip& clip,
                                                  std::span<const double> keytimes_s,
                                                  std::span<const int> cells);

/// Returns the poses at the grid points of a blend with `weights` [example]. The blend starts at
/// the origin with heading 0.
[[nodiscard]] std::vector<Pose> PosesAtGridPoints(const MotionGroup& group,
                                                  const GridLayout& layout,
                                                  std::span<const double> weights);

}  // namespace stridewire
