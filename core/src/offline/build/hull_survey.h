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

// Points in the hull of a group's examples: convex combinations of them, half of all and half of
// but a few, so that faces and corners are met as well; the examples themselves come first.
[[nodiscard]] std::vector<ParameterValues> SampleHull(const MotionGroup& group, int samples,
                                                      std::uint32_t seed);

// What there is to know of a group at one point.
struct HullPoint {
  ParameterValues p;
  double error_m = 0.0;     // e(p) = |p - a(p)|
  double weight_sum = 0.0;  // of |w(p)|
};

// Evaluates groups that belong to a skeleton but perhaps to no library yet. One thread's.
class GroupProbe {
 public:
  GroupProbe(const Skeleton& skeleton, int max_example_count);

  [[nodiscard]] HullPoint At(const MotionGroup& group, const ParameterValues& p);

  [[nodiscard]] Correction Correct(const MotionGroup& group, const ParameterValues& wanted,
                                   const CorrectionLimits& limits);

  // Of the last that was corrected [n].
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

// One a thread. `threads` 0: one a processor.
[[nodiscard]] std::vector<GroupProbe> MakeProbes(const MotionLibrary& library, int threads);

// e over the hull of a group's examples.
struct HullSurvey {
  double min_m = 0.0;
  double mean_m = 0.0;  // over the samples
  double max_m = 0.0;
  double weight_sum_max = 0.0;
  std::vector<HullPoint> points;  // as sampled
  std::vector<HullPoint> peaks;   // local maxima found from the worst of them, worst first
};

// Evaluates all samples, then climbs from the worst of them, apart from each other, by steepest
// ascent inside the hull. One probe a thread; the result is the same for any number of them.
[[nodiscard]] HullSurvey SurveyHull(const MotionGroup& group,
                                    std::span<const ParameterValues> samples,
                                    std::span<GroupProbe> probes);

}  // namespace stridewire
