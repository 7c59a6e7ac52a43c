#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "offline/build/pose_error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Ways to make a movement of given parameters from examples.
enum class BlendMethod : std::uint8_t {
  kCardinal = 0,         ///< Ours: weights by cardinal basis functions (paper, Section 3).
  kNearest = 1,          ///< The nearest example as it is.
  kInverseDistance = 2,  ///< The nearest d + 1, weighted by 1 / distance, as blend spaces do.
};
inline constexpr int kBlendMethodCount = 3;
[[nodiscard]] std::string_view BlendMethodName(BlendMethod method);  ///< "cardinal", …

/// How far made movements are from captured ones, means over the movements.
struct LeftOutMean {
  double pose_m = 0.0;                          ///< Mean distance of joints at equal generic times
  std::array<double, kBodyPartCount> part_m{};  ///< The same of a part's joints
  double foot_m = 0.0;                          ///< Of the moving foot's ball; of both in a jump
  double keytime_s = 0.0;                       ///< Of keytimes but the first
  double parameter_m = 0.0;  ///< What is asked less what is made, largest difference
};

struct LeaveOneOut {
  int movements = 0;
  std::array<LeftOutMean, kBlendMethodCount> means;  ///< By BlendMethod
  /// Share of the movements where ours is nearer to the truth than that method, 0 to 1.
  std::array<double, kBlendMethodCount> wins{};
};

/// Leaves each example of a group out, makes a movement of its parameters from the others and compares
/// it with the example. Ours is made as avatars make it: near duplicates averaged (complete linkage, all
/// parameters within `cluster_diameter_m`, a radian counts kMetresPerRadian), parameters brought onto
/// the hull of the others grown by a tenth, then corrected. Distances between parameters are scaled as
/// weights have it. Uses all processors, same result with any number of them. Nothing (movements 0)
/// below three examples.
[[nodiscard]] LeaveOneOut MeasureLeaveOneOut(const MotionLibrary& library, int group_index,
                                             double cluster_diameter_m = 0.05);

}  // namespace stridewire
