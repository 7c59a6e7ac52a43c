#include "offline/build/hull_survey.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "offline/base/parallel.h"
#include "offline/build/parameter_scales.h"
#include "runtime/library/convex_hull.h"
#include "runtime/weights/measure.h"

namespace stridewire {
namespace {

constexpr int kPeaks = 8;
// Minimum distance between the points from which Climb starts, in scaled parameters.
constexpr double kPeakDistance = 0.3;
constexpr int kClimbRounds = 24;
constexpr double kSlopeStep = 1e-3;  // In scaled parameters.
constexpr double kFirstStride = 0.1;
constexpr double kLastStride = 2e-3;

// Returns a uniform random number in (0, 1). The distributions of the standard library are not
// used, because they differ between implementations.
double Uniform(std::mt19937& random) {
  return (static_cast<double>(random()) + 0.5) / 4294967296.0;
}

HullPoint Climb(const MotionGroup& group, HullPoint at, GroupProbe& probe) {
  const std::size_t d = group.parameters.size();
  const std::span<const double> examples =
      group.sites.first(static_cast<std::size_t>(group.example_count) * d);
  const std::vector<double> metric = MetricOf(group);
  double stride = kFirstStride;
  for (int round = 0; round < kClimbRounds && stride > kLastStride; ++round) {
    std::array<double, kMaxParameters> slope{};
    double size = 0.0;
    for (std::size_t l = 0; l < d; ++l) {
      ParameterValues p = at.p;
      p.values[l] += kSlopeStep * group.parameters[l].scale;
      slope[l] = (probe.At(group, p).error_m - at.error_m) / kSlopeStep;
      size += slope[l] * slope[l];
    }
    size = std::sqrt(size);
    if (!(size > 1e-12)) break;
    bool is_higher = false;
    while (!is_higher && stride > kLastStride) {
      ParameterValues p = at.p;
      for (std::size_t l = 0; l < d; ++l) {
        p.values[l] += stride * slope[l] / size * group.parameters[l].scale;
      }
      ParameterValues inside = p;
      ProjectOntoHull(examples, metric, 0.0, std::span(p.values).first(d),
                      std::span(inside.values).first(d));
      const HullPoint next = probe.At(group, inside);
      if (next.error_m > at.error_m) {
        at = next;
        is_higher = true;
      } else {
        stride *= 0.5;
      }
    }
  }
  return at;
}

}  // namespace

std::vector<ParameterValues> SampleHull(const MotionGroup& group, int samples, std::uint32_t seed) {
  const auto n = static_cast<std::size_t>(group.example_count);
  const std::size_t d = group.parameters.size();
  std::mt19937 random(seed);
  STRIDEWIRE_CHECK(n > 0 && d > 0 && samples >= 0);
  std::vector<ParameterValues> points;
  for (std::size_t e = 0; e < n; ++e) {
    points.push_back(ValuesOf(group.site(static_cast<int>(e))));
  }
  std::vector<double> share(n);
  for (int s = 0; s < samples; ++s) {
    // Uses a Dirichlet distribution with alpha = 1/2, so that few examples dominate each sample.
    // Every other sample mixes only two to d + 1 examples. Otherwise, samples of large groups would
    // hardly reach the edges, where errors are often largest.
    std::fill(share.begin(), share.end(), 0.0);
    const bool takes_all = s % 2 == 0;
    const std::size_t count = takes_all ? n : 2 + static_cast<std::size_t>(s / 2) % d;
    double sum = 0.0;
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t e =
          takes_all
              ? k
              : std::min(n - 1, static_cast<std::size_t>(Uniform(random) * static_cast<double>(n)));
      const double normal = std::sqrt(-2.0 * std::log(Uniform(random))) *
                            std::cos(6.283185307179586 * Uniform(random));
      share[e] += normal * normal;
      sum += normal * normal;
    }
    ParameterValues& point = points.emplace_back();
    point.count = static_cast<int>(d);
    for (std::size_t e = 0; e < n; ++e) {
      for (std::size_t l = 0; l < d; ++l) {
        point.values[l] += share[e] / sum * group.sites[e * d + l];
      }
    }
  }
  return points;
}

GroupProbe::GroupProbe(const Skeleton& skeleton, int max_row_count)
    : skeleton_(skeleton),
      layout_(skeleton.joint_count()),
      cache_(layout_),
      pose_(skeleton.joint_count()),
      scratch_(skeleton, layout_, max_row_count) {}

HullPoint GroupProbe::At(const MotionGroup& group, const ParameterValues& p) {
  SetWeights(group, -1, std::span(p.values).first(group.parameters.size()), scratch_.weights(group),
             movement_);
  cache_.Clear();
  HullPoint point{.p = p};
  for (const float weight : movement_.weights) {
    point.weight_sum += std::fabs(static_cast<double>(weight));
  }
  point.error_m = LargestDifference(
      group, p, MeasureMovement(skeleton_, layout_, group, movement_, cache_, pose_));
  return point;
}

Correction GroupProbe::Correct(const MotionGroup& group, const ParameterValues& wanted,
                               const CorrectionLimits& limits) {
  return CorrectWeights(group, wanted, limits, scratch_, movement_);
}

std::vector<GroupProbe> MakeProbes(const MotionLibrary& library, int threads) {
  std::vector<GroupProbe> probes;
  for (int i = 0; i < ThreadCount(threads); ++i) {
    probes.emplace_back(library.skeleton(), library.max_row_count());
  }
  return probes;
}

HullSurvey SurveyHull(const MotionGroup& group, std::span<const ParameterValues> samples,
                      std::span<GroupProbe> probes) {
  const int threads = static_cast<int>(probes.size());
  STRIDEWIRE_CHECK(!probes.empty() && !samples.empty());
  HullSurvey survey;
  survey.points.resize(samples.size());
  ParallelFor(static_cast<int>(samples.size()), 32, threads, [&](int i, int thread) {
    survey.points[static_cast<std::size_t>(i)] =
        probes[static_cast<std::size_t>(thread)].At(group, samples[static_cast<std::size_t>(i)]);
  });
  survey.min_m = HUGE_VAL;
  for (const HullPoint& point : survey.points) {
    survey.min_m = std::min(survey.min_m, point.error_m);
    survey.mean_m += point.error_m / static_cast<double>(samples.size());
    survey.weight_sum_max = std::max(survey.weight_sum_max, point.weight_sum);
  }

  std::vector<std::size_t> order(samples.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return survey.points[a].error_m > survey.points[b].error_m;
  });
  for (const std::size_t i : order) {
    const HullPoint& point = survey.points[i];
    const bool is_apart =
        std::all_of(survey.peaks.begin(), survey.peaks.end(), [&](const HullPoint& peak) {
          return ScaledDistance(group, peak.p.values, point.p.values) > kPeakDistance;
        });
    if (is_apart) survey.peaks.push_back(point);
    if (survey.peaks.size() == kPeaks) break;
  }
  ParallelFor(static_cast<int>(survey.peaks.size()), 1, threads, [&](int i, int thread) {
    HullPoint& peak = survey.peaks[static_cast<std::size_t>(i)];
    peak = Climb(group, peak, probes[static_cast<std::size_t>(thread)]);
  });
  std::stable_sort(survey.peaks.begin(), survey.peaks.end(),
                   [](const HullPoint& a, const HullPoint& b) { return a.error_m > b.error_m; });
  for (const HullPoint& peak : survey.peaks) {
    survey.max_m = std::max(survey.max_m, peak.error_m);
    survey.weight_sum_max = std::max(survey.weight_sum_max, peak.weight_sum);
  }
  return survey;
}

}  // namespace stridewire
