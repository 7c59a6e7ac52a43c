#include "stridewire/offline/interpolation_error.h"

#include <algorithm>
#include <vector>

#include "hull_survey.h"
#include "parallel.h"

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
  std::vector<double> corrected(points.size());
  ParallelFor(
      static_cast<int>(points.size()), 16, static_cast<int>(probes.size()), [&](int i, int thread) {
        const auto at = static_cast<std::size_t>(i);
        corrected[at] =
            probes[static_cast<std::size_t>(thread)].Correct(group, points[at], limits).error_m;
      });
  error.corrected_max_m = *std::max_element(corrected.begin(), corrected.end());
  for (int i = 0; i < error.samples; ++i) {
    error.corrected_mean_m += corrected[static_cast<std::size_t>(i)] / error.samples;
  }
  return error;
}

}  // namespace stridewire
