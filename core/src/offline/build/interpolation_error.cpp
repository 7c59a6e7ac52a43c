#include "offline/build/interpolation_error.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "offline/base/parallel.h"
#include "offline/build/hull_survey.h"

namespace stridewire {

InterpolationError MeasureInterpolationError(const MotionLibrary& library, int group_index,
                                             int samples, std::uint32_t seed) {
  const MotionGroup& group = library.group(group_index);
  std::vector<GroupProbe> probes = MakeProbes(library, 0);
  std::vector<ParameterValues> points = SampleHull(group, samples, seed);
  const HullSurvey survey = SurveyHull(group, points, probes);

  InterpolationError error;
  error.min_m = survey.min_m;
  error.mean_m = survey.mean_m;
  error.max_m = survey.max_m;
  error.weight_sum_max = survey.weight_sum_max;
  error.samples = static_cast<int>(points.size());
  const CorrectionLimits limits = DefaultCorrectionLimits(group);
  error.iterations = limits.max_iterations;
  for (const HullPoint& peak : survey.peaks) points.push_back(peak.p);
  struct Corrected {
    double error_m = 0.0;
    double in_3_m = 0.0;
    double weight_sum = 0.0;
  };
  std::vector<Corrected> corrected(points.size());
  ParallelFor(static_cast<int>(points.size()), 16, static_cast<int>(probes.size()),
              [&](int i, int thread) {
                const auto at = static_cast<std::size_t>(i);
                GroupProbe& probe = probes[static_cast<std::size_t>(thread)];
                Corrected& point = corrected[at];
                point.in_3_m = probe.Correct(group, points[at], {.max_iterations = 3}).error_m;
                point.error_m = probe.Correct(group, points[at], limits).error_m;
                for (const double weight : probe.Weights(group)) {
                  point.weight_sum += std::fabs(weight);
                }
              });
  for (const Corrected& point : corrected) {
    error.corrected_max_m = std::max(error.corrected_max_m, point.error_m);
    error.corrected_in_3_max_m = std::max(error.corrected_in_3_max_m, point.in_3_m);
    error.corrected_weight_sum_max = std::max(error.corrected_weight_sum_max, point.weight_sum);
  }
  for (int i = 0; i < error.samples; ++i) {
    error.corrected_mean_m += corrected[static_cast<std::size_t>(i)].error_m / error.samples;
  }
  return error;
}

}  // namespace stridewire
