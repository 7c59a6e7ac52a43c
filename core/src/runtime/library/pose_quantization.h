#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stridewire/base/rotation_quantization.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Range of the rotations of a joint. For every rotation q of the joint, the components x, y, z of
/// conj(reference) q are between `low` and `high`, and its w is at least `least_w`.
struct RotationRange {
  Quat reference = kIdentityQuat;
  Vec3 low = Vec3(-1.0f);
  Vec3 high = Vec3(1.0f);
  /// If it is below RotationQuantization::kMinLeastW, the joint may rotate in any direction.
  double least_w = 0.0;
};

/// Finds the range of each joint over the examples, layers, stand pose and idle motion of a
/// library. The ranges include wide margins, because avatars blend movements, plant feet and ease
/// from one movement into the next. The root may rotate in any direction.
[[nodiscard]] std::vector<RotationRange> FindRotationRanges(const MotionLibrary& library);

/// Quantization parameters for all joints of a skeleton.
struct PoseQuantization {
  std::vector<RotationQuantization> joints;
  /// Maximum error in the position of any joint or end site relative to the root, for poses within
  /// the ranges.
  double largest_error_m = 0.0;
};

/// Chooses few bits (greedily) with which every joint and end site is within `largest_error_m` of
/// its position relative to the root.
///
/// The encoder must process joints from the root on, and each joint must compensate for the errors
/// of those above it. The angular error of a joint then moves only its own bone, and the total
/// error is bounded by the sum of bone length times angle over a chain. No angle has an error of
/// more than 0.23 degrees. `largest_error_m` of the result exceeds the requested one only if all
/// joints above some joint or end site have the maximum number of bits. This happens only with
/// bones of many metres. `ranges` has one entry per joint. The result is the same on every machine.
[[nodiscard]] PoseQuantization ChoosePoseQuantization(const Skeleton& skeleton,
                                                      std::span<const RotationRange> ranges,
                                                      double largest_error_m);

/// Chooses the joints to send for avatars that are far away from the viewer, in increasing order.
///
/// A joint is omitted if no joint or end site shifts by more than `largest_shift_m` when the joint
/// and all joints below it are displayed in their reference rotations. The shift caused by one
/// joint is the chord of its largest rotation from the reference times the length of the chain
/// below it. Shifts add up along a chain. The root and the parents of chosen joints are never
/// omitted. The result is the same on every machine.
[[nodiscard]] std::vector<std::uint16_t> ChooseReducedJoints(const Skeleton& skeleton,
                                                             std::span<const RotationRange> ranges,
                                                             double largest_shift_m);
/// Maximum shift of a joint if only the reduced set of a library's joints is sent.
inline constexpr double kReducedJointsShiftM = 0.12;
[[nodiscard]] std::vector<std::uint16_t> ChooseReducedJoints(const MotionLibrary& library);

/// Finds the ranges of a library and chooses the bits. With the root position rounded to 2^-14 m,
/// every joint is then within 1 mm of its position in the world.
[[nodiscard]] PoseQuantization ChoosePoseQuantization(const MotionLibrary& library);

}  // namespace stridewire
