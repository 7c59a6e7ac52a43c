#pragma once

#include <cstdint>
#include <random>
#include <span>
#include <vector>

#include "runtime/movement/movement.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/weights/correction.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

// Samples the hull of the examples of a group. Returns the examples first, and then `samples`
// random convex combinations. Half of these combine all examples. The others combine at most d + 1
// of them, where d is the number of parameters, to reach faces and corners of the hull.
[[nodiscard]] std::vector<ParameterValues> SampleHull(const MotionGroup& group, int samples,
                                                      std::uint32_t seed);

// Properties of a group at one point of its parameter space.
struct HullPoint {
  ParameterValues p;
  double error_m = 0.0;     // e(p) = |p - a(p)|
  double weight_sum = 0.0;  // Sum of |w(p)|.
};

// Evaluates groups with one skeleton. They need not belong to a library. Not thread-safe.
class GroupProbe {
 public:
  GroupProbe(const Skeleton& skeleton, int max_row_count);

  [[nodiscard]] HullPoint At(const MotionGroup& group, const ParameterValues& p);

  [[nodiscard]] Correction Correct(const MotionGroup& group, const ParameterValues& wanted,
                                   const CorrectionLimits& limits);

  // Returns the weights [n] that the last call of Correct computed.
  [[nodiscard]] std::span<const double> Weights(const MotionGroup& group) {
    return scratch_.weights(group);
  }

 private:
  const Skeleton& skeleton_;
  GridLayout layout_;
  GridCache cache_;
  Pose pose_;
  Movement movement_;
  CorrectionScratch scratch_;
};

// Creates one probe per thread. `threads` = 0: one per processor.
[[nodiscard]] std::vector<GroupProbe> MakeProbes(const MotionLibrary& library, int threads);

// The errors e(p) of synthesized movements, for parameters p in the hull of a group's examples.
struct HullSurvey {
  double min_m = 0.0;
  double mean_m = 0.0;  // Mean error over the samples.
  double max_m = 0.0;
  double weight_sum_max = 0.0;
  std::vector<HullPoint> points;  // [sample]: measurements.
  // Local maxima found by ascent from the worst samples, largest first.
  std::vector<HullPoint> peaks;
};

// Evaluates all samples, and then follows the steepest ascent inside the hull from the worst ones.
// The starting points have a minimum distance from each other. Uses one thread per probe; the
// result does not depend on their number.
[[nodiscard]] HullSurvey SurveyHull(const MotionGroup& group,
                                    std::span<const ParameterValues> samples,
                                    std::span<GroupProbe> probes);

}  // namespace stridewire
