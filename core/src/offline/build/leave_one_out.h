#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "offline/build/pose_error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Methods that synthesize a movement with given parameters from examples.
enum class BlendMethod : std::uint8_t {
  kCardinal = 0,  ///< Weights by cardinal basis functions (paper, Section 3).
  kNearest = 1,   ///< The nearest example without changes.
  /// The nearest d + 1 examples, weighted by 1 / distance, as in blend spaces. d is the number of
  /// parameters.
  kInverseDistance = 2,
};
inline constexpr int kBlendMethodCount = 3;
/// Returns "cardinal", "nearest" or "inverse_distance".
[[nodiscard]] std::string_view BlendMethodName(BlendMethod method);

/// Differences between synthesized and captured movements, averaged over the movements.
struct LeftOutMean {
  double pose_m = 0.0;  ///< Distance of joints at equal generic times.
  /// Distance of the joints of each part of the body.
  std::array<double, kBodyPartCount> part_m{};
  /// Value of `pose_m` if the feet are planted on the footprints of the captured step, like those
  /// of avatars. 0 for jumps, and if the feet of the skeleton cannot be planted.
  double planted_m = 0.0;
  double foot_m = 0.0;     ///< Distance of the ball of the moving foot, or of both balls in a jump.
  double keytime_s = 0.0;  ///< Difference between keytimes, except the first.
  /// Largest difference between a requested and a synthesized parameter of a movement.
  double parameter_m = 0.0;
};

struct LeaveOneOut {
  int movements = 0;
  /// Mean differences of each method, indexed by BlendMethod.
  std::array<LeftOutMean, kBlendMethodCount> means;
  /// For each method, the fraction of the movements for which kCardinal is nearer to the capture.
  std::array<double, kBlendMethodCount> wins{};
};

/// Leaves out each example of a group, synthesizes a movement with its parameters from the others
/// and compares it with the example. kCardinal works as in libraries and avatars: near duplicates
/// among the other examples are averaged (CompleteLinkage with the diameter `cluster_diameter_m`,
/// where a radian counts as kMetresPerRadian), the averages are smoothed if there are enough
/// examples (ChooseSmoothness), parameters are projected onto the hull of the averages, enlarged by
/// 10 %, and weights are corrected. Distances of parameters are scaled as for the weights. Uses all
/// processors; the result does not depend on their number. Groups with fewer than three examples
/// give an empty result (movements 0).
[[nodiscard]] LeaveOneOut MeasureLeaveOneOut(const MotionLibrary& library, int group_index,
                                             double cluster_diameter_m = 0.05);

}  // namespace stridewire
