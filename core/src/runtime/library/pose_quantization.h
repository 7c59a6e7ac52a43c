#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stridewire/base/rotation_quantization.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

/// Where the rotations of a joint are: the components x, y, z of conj(reference) q lie between `low` and `high`,
/// its w is `least_w` or more.
struct RotationRange {
  Quat reference = kIdentityQuat;
  Vec3 low = Vec3(-1.0f);
  Vec3 high = Vec3(1.0f);
  double least_w = 0.0;  ///< Below RotationQuantization::kMinLeastW: it turns every way
};

/// The range of each joint in a library: its examples, layers and stand pose, and a good deal more, since movements are
/// blended, planted and eased into one another. The root turns every way.
[[nodiscard]] std::vector<RotationRange> FindRotationRanges(const MotionLibrary& library);

/// Codes for all joints of a skeleton, and the bound they keep.
struct PoseQuantization {
  std::vector<RotationQuantization> joints;
  double largest_error_m =
      0.0;  ///< Of any joint or end site against the root, in a pose within the ranges
};

/// Chooses as few bits as keep every joint and end site within `largest_error_m` of where it is against the root, for
/// who encodes joints from the root on and lets each make up for the errors of those above it: then a joint's own error
/// (an angle) moves only what its bones reach, and the bound is the sum over a chain of bone times angle. No angle is
/// off by more than 0.23 degrees. `largest_error_m` of the result is larger than asked for only if no bits were left to
/// give: bones of many metres. `ranges` has one entry a joint. Same bytes on every machine.
[[nodiscard]] PoseQuantization ChoosePoseQuantization(const Skeleton& skeleton,
                                      std::span<const RotationRange> ranges,
                                      double largest_error_m);

/// The joints that are worth telling of who is seen from afar, growing. Left out are those that, shown with everything
/// below them as their ranges' references, move no joint or end site by more than `largest_shift_m` within the ranges: a
/// joint's turn from its reference, as a chord, times the reach of what hangs from it, and the sum of that along a chain.
/// The root is never left out, nor is the parent of one that is told. Same on every machine.
[[nodiscard]] std::vector<std::uint16_t> ChooseFewerJoints(const Skeleton& skeleton,
                                                           std::span<const RotationRange> ranges,
                                                           double largest_shift_m);
/// The largest shift of those left out of a library's poses.
inline constexpr double kFewerJointsShiftM = 0.12;
[[nodiscard]] std::vector<std::uint16_t> ChooseFewerJoints(const MotionLibrary& library);

/// Both, so that with the root in steps of 2^-14 m everything is within 1 mm of where it is in the world.
[[nodiscard]] PoseQuantization ChoosePoseQuantization(const MotionLibrary& library);

}  // namespace stridewire
