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

/// Parts of a body whose errors are told apart.
enum class BodyPart : std::uint8_t { kTrunk = 0, kHead = 1, kArms = 2, kLegs = 3 };
inline constexpr int kBodyPartCount = 4;

/// "trunk", "head", "arms", "legs".
[[nodiscard]] std::string_view BodyPartName(BodyPart part);

/// The part each joint belongs to [joint]. Legs: the hips and all below them. Arms: of the rest what
/// is on one side (FindMirrorJoints; without it, what sits more than 3 cm beside the root at identity
/// rotations). Head: what is in the middle above the joint the arms hang from. Trunk: the rest.
[[nodiscard]] std::vector<BodyPart> FindBodyParts(const Skeleton& skeleton);

/// How far the joints of one movement are from those of another, metres.
struct PoseError {
  double mean_m = 0.0;                          ///< Over all joints and all poses.
  std::array<double, kBodyPartCount> part_m{};  ///< The same over a part's joints; 0 without any.
  double max_m = 0.0;                           ///< The furthest joint of all.
};

/// Compares movements pose by pose. Both must be normalised (root at x = z = 0 and heading 0 at the
/// start): no frame is fitted, so a root that goes astray counts. Borrows the skeleton. One thread's.
class PoseComparison {
 public:
  explicit PoseComparison(const Skeleton& skeleton);

  /// Mean distance of equal joints over equal generic times. kShapeMismatch: another number of poses
  /// or joints, or no pose.
  [[nodiscard]] Expected<PoseError> Measure(std::span<const Pose> truth,
                                            std::span<const Pose> other);

  [[nodiscard]] std::span<const BodyPart> parts() const { return parts_; }

 private:
  const Skeleton& skeleton_;
  std::vector<BodyPart> parts_;
  std::vector<Vec3> positions_[2];
  std::vector<Quat> rotations_;
};

/// Poses of a normalised clip at the grid points of a group, cells[i] to keytime interval i: where
/// Eq. (3) puts them with the example's own keytimes. `keytimes_s` has one value more than `cells`.
[[nodiscard]] std::vector<Pose> PosesAtGridPoints(const Clip& clip,
                                                  std::span<const double> keytimes_s,
                                                  std::span<const int> cells);

/// The same of a blend, from the origin with heading 0 whatever the movement's base is. `weights` [n].
[[nodiscard]] std::vector<Pose> PosesAtGridPoints(const MotionGroup& group,
                                                  const GridLayout& layout,
                                                  std::span<const double> weights);

}  // namespace stridewire
