#include "stridewire/offline/interpolation_error.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "stridewire/runtime/correction.h"

namespace stridewire {
namespace {

// Uniform in (0, 1): the standard distributions may differ between C++ libraries.
double Uniform(std::mt19937& random) {
  return (static_cast<double>(random()) + 0.5) / 4294967296.0;
}

}  // namespace

InterpolationError MeasureInterpolationError(const MotionLibrary& library, int group_index,
                                             int samples, std::uint32_t seed) {
  const MotionGroup& group = library.group(group_index);
  const auto n = static_cast<std::size_t>(group.example_count);
  const std::size_t d = group.parameters.size();
  std::mt19937 random(seed);
  GridCache cache(library.layout());
  Pose pose(library.skeleton().joint_count());
  Movement movement;
  std::vector<double> scratch(n);
  const CorrectionLimits limits = DefaultCorrectionLimits(group);
  InterpolationError error;
  error.iterations = limits.max_iterations;
  std::vector<double> share(n);
  for (int s = 0; s < samples + group.example_count; ++s) {
    // Few examples carry most of a sample (Dirichlet, alpha = 1/2), so that edges are met as well.
    double sum = 0.0;
    for (std::size_t e = 0; e < n; ++e) {
      const bool is_example = s < group.example_count;
      const double normal = std::sqrt(-2.0 * std::log(Uniform(random))) *
                            std::cos(6.283185307179586 * Uniform(random));
      share[e] = is_example ? (static_cast<int>(e) == s ? 1.0 : 0.0) : normal * normal;
      sum += share[e];
    }
    ParameterValues wanted;
    wanted.count = static_cast<int>(d);
    for (std::size_t e = 0; e < n; ++e) {
      for (std::size_t l = 0; l < d; ++l) {
        wanted.values[l] += share[e] / sum * group.sites[e * d + l];
      }
    }
    const Correction correction =
        CorrectParameters(library, group_index, wanted, limits, scratch, cache, pose, movement);
    error.max_m = std::max(error.max_m, correction.initial_error_m);
    error.mean_m += correction.initial_error_m;
    error.corrected_max_m = std::max(error.corrected_max_m, correction.error_m);
    error.corrected_mean_m += correction.error_m;
    ++error.samples;
  }
  error.mean_m /= error.samples;
  error.corrected_mean_m /= error.samples;
  return error;
}

}  // namespace stridewire
