#include "offline/build/select_examples.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "offline/base/parallel.h"
#include "offline/base/statistics.h"
#include "offline/base/text.h"
#include "offline/build/example_clusters.h"
#include "offline/build/left_out_error.h"

namespace stridewire {
namespace {

// No outlier is dropped if fewer examples than this are left. With kExamplesPerOutlier = 10, this
// limit never decides.
constexpr std::size_t kOutlierExamplesMin = 8;
// At most one outlier is dropped per this number of examples, rounded down. Groups of fewer
// examples are therefore not tested.
constexpr std::size_t kExamplesPerOutlier = 10;
// Points outside the hull by at most this distance count as inside.
constexpr double kInsideM = 1e-3;
// Ratio of the standard deviation to the median absolute deviation (MAD).
constexpr double kDeviationOfMad = 1.4826;
// Lower limits of the estimated standard deviations. Without them, insignificant differences would
// count as outliers.
constexpr double kMinPoseDeviationM = 2e-3;
constexpr double kMinDurationDeviationS = 5e-3;

// The examples of a group, or averages of them, with the data needed to compare them.
class Candidates {
 public:
  Candidates(const std::vector<GridExample>& examples, std::span<const double> units,
             const GridLayout& layout, const Skeleton& skeleton)
      : examples_(examples) {
    for (int t = 0; t < ThreadCount(0); ++t) probes_.emplace_back(layout, skeleton, units);
    truths_.resize(examples.size());
    ParallelFor(count(), 1, ThreadCount(0), [&](int i, int) {
      truths_[Index(i)] = JointPositions(examples[Index(i)], layout, skeleton);
    });
  }

  [[nodiscard]] int count() const { return static_cast<int>(examples_.size()); }

  // Returns the error with which `set` reproduces each example. It is 0 for members of the set, and
  // infinite if the weights cannot be solved.
  [[nodiscard]] std::vector<LeftOutError> Errors(const std::vector<int>& set) {
    std::vector<LeftOutError> errors(examples_.size());
    const std::optional<BlendSet> blend = Blend(set);
    ParallelFor(count(), 1, ThreadCount(0), [&](int i, int thread) {
      if (std::ranges::binary_search(set, i)) return;
      errors[Index(i)] =
          blend ? probes_[Index(thread)].Measure(*blend, examples_[Index(i)], truths_[Index(i)])
                : LeftOutError{HUGE_VAL, HUGE_VAL, HUGE_VAL, 0.0};
    });
    return errors;
  }

  // Returns the error with which each example in `of` is reproduced by the other examples in `of`.
  // It is 0 if the weights cannot be solved.
  [[nodiscard]] std::vector<LeftOutError> LeaveOneOut(const std::vector<int>& of) {
    std::vector<LeftOutError> errors(of.size());
    ParallelFor(static_cast<int>(of.size()), 1, ThreadCount(0), [&](int k, int thread) {
      std::vector<int> set = of;
      set.erase(set.begin() + k);
      const int i = of[Index(k)];
      if (const std::optional<BlendSet> blend = Blend(set)) {
        errors[Index(k)] =
            probes_[Index(thread)].Measure(*blend, examples_[Index(i)], truths_[Index(i)]);
      }
    });
    return errors;
  }

  // Returns the example nearest to the mean parameters.
  [[nodiscard]] int Middle(std::span<const double> units) const {
    int best = 0;
    double nearest = HUGE_VAL;
    for (int i = 0; i < count(); ++i) {
      double sum = 0.0;
      for (std::size_t l = 0; l < units.size(); ++l) {
        double mean = 0.0;
        for (const GridExample& example : examples_) mean += example.parameters[l] / count();
        const double difference = (examples_[Index(i)].parameters[l] - mean) * units[l];
        sum += difference * difference;
      }
      if (sum < nearest) {
        nearest = sum;
        best = i;
      }
    }
    return best;
  }

 private:
  static std::size_t Index(int i) { return static_cast<std::size_t>(i); }

  [[nodiscard]] std::optional<BlendSet> Blend(const std::vector<int>& set) const {
    std::vector<const GridExample*> members;
    for (const int i : set) members.push_back(&examples_[Index(i)]);
    return MakeBlendSet(std::move(members));
  }

  const std::vector<GridExample>& examples_;
  std::vector<std::vector<Vec3>> truths_;
  std::vector<LeftOutProbe> probes_;  // One probe per thread.
};

struct Deviation {
  double usual = 0.0;  // Median.
  double one = 0.0;    // Standard deviation, estimated as 1.4826 MAD.
};

Deviation DeviationOf(const std::vector<double>& values, double least) {
  Deviation deviation;
  deviation.usual = Median(values);
  std::vector<double> distances;
  for (const double value : values) distances.push_back(std::fabs(value - deviation.usual));
  deviation.one = std::max(least, kDeviationOfMad * Median(std::move(distances)));
  return deviation;
}

// Removes the outliers from `left`, starting with the worst: at most one per kExamplesPerOutlier
// examples, rounded down.
void DropOutliers(const std::vector<GridExample>& examples, Candidates& candidates,
                  double deviations, std::vector<int>& left, GroupSelection& report) {
  const std::size_t most = examples.size() / kExamplesPerOutlier;
  while (left.size() >= kOutlierExamplesMin && examples.size() - left.size() < most) {
    const std::vector<LeftOutError> errors = candidates.LeaveOneOut(left);
    std::vector<double> poses, durations;
    for (const LeftOutError& error : errors) {
      poses.push_back(error.pose_m);
      durations.push_back(error.duration_s);
    }
    const Deviation pose = DeviationOf(poses, kMinPoseDeviationM);
    const Deviation duration = DeviationOf(durations, kMinDurationDeviationS);
    std::size_t worst = 0;
    double worst_by = deviations;
    bool by_duration = false;
    for (std::size_t k = 0; k < errors.size(); ++k) {
      if (errors[k].outside_m > kInsideM) continue;
      const double by_pose = (errors[k].pose_m - pose.usual) / pose.one;
      const double by_time = std::fabs(errors[k].duration_s - duration.usual) / duration.one;
      if (std::max(by_pose, by_time) <= worst_by) continue;
      worst_by = std::max(by_pose, by_time);
      worst = k;
      by_duration = by_time > by_pose;
    }
    if (worst_by <= deviations) return;
    SelectedExample& dropped = report.examples[static_cast<std::size_t>(left[worst])];
    STRIDEWIRE_CHECK(dropped.fate == ExampleFate::kKept);
    dropped.fate = ExampleFate::kOutlier;
    dropped.error_m = errors[worst].pose_m;
    if (by_duration) {
      const double longer_s = -errors[worst].duration_s;
      dropped.reason = Text(
          longer_s > 0.0 ? "takes %.2f s longer than the others predict, with a duration of %.2f s"
                         : "takes %.2f s less than the others predict, with a duration of %.2f s",
          std::fabs(longer_s), examples[static_cast<std::size_t>(left[worst])].keytimes_s.back());
    } else {
      dropped.reason = Text(
          "the mean distance of its joints from the prediction of the others is %.3f m, where "
          "%.3f m is typical",
          errors[worst].pose_m, pose.usual);
    }
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(worst));
  }
}

// Chooses few candidates that reproduce all others within the error bound, sorted by index. Writes
// the errors of all candidates to `errors`.
std::vector<int> ChooseFew(Candidates& candidates, std::span<const double> units, double bound_m,
                           std::vector<LeftOutError>& errors) {
  std::vector<int> chosen = {candidates.Middle(units)};
  std::vector<int> order = chosen;
  for (;;) {
    errors = candidates.Errors(chosen);
    int worst = -1;
    double worst_m = bound_m;
    for (int i = 0; i < candidates.count(); ++i) {
      if (errors[static_cast<std::size_t>(i)].worst_m() > worst_m) {
        worst_m = errors[static_cast<std::size_t>(i)].worst_m();
        worst = i;
      }
    }
    if (worst < 0) break;
    chosen.insert(std::ranges::upper_bound(chosen, worst), worst);
    order.push_back(worst);
  }
  // Candidates that were chosen early may be redundant, because later ones reproduce them.
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t k = 0; k < order.size() && chosen.size() > 1; ++k) {
      std::vector<int> fewer = chosen;
      std::erase(fewer, order[k]);
      std::vector<LeftOutError> without = candidates.Errors(fewer);
      const bool is_enough = std::ranges::all_of(
          without, [&](const LeftOutError& error) { return error.worst_m() <= bound_m; });
      if (!is_enough) continue;
      chosen = std::move(fewer);
      errors = std::move(without);
      order.erase(order.begin() + static_cast<std::ptrdiff_t>(k));
      --k;
      changed = true;
    }
  }
  return chosen;
}

}  // namespace

Selected SelectExamplesJob::Run() const {
  STRIDEWIRE_CHECK(!examples.empty() && units.size() == group.parameters.size());
  STRIDEWIRE_CHECK(examples.size() == group.examples.size());
  Selected selected;
  selected.report.kind = group.kind;
  for (const GridExample& example : examples) {
    selected.report.examples.push_back({example.source, example.mirrored});
  }
  std::vector<int> left(examples.size());
  std::iota(left.begin(), left.end(), 0);
  if (options.outlier_deviations > 0.0) {
    Candidates all(examples, units, layout, skeleton);
    DropOutliers(examples, all, options.outlier_deviations, left, selected.report);
  }

  // Near duplicates would cause spikes in the weights, so they are averaged at equal generic times.
  std::vector<GridExample> usable;
  for (const int i : left) usable.push_back(examples[static_cast<std::size_t>(i)]);
  std::vector<std::vector<int>> clusters = CompleteLinkage(usable, units, diameter);
  std::vector<GridExample> averages;
  for (std::vector<int>& cluster : clusters) {
    averages.push_back(AverageExamples(usable, cluster, layout, skeleton, group));
    for (int& member : cluster) member = left[static_cast<std::size_t>(member)];
  }

  std::vector<int> chosen(clusters.size());
  std::iota(chosen.begin(), chosen.end(), 0);
  std::vector<LeftOutError> errors(clusters.size());
  if (options.max_pose_error_m > 0.0) {
    Candidates candidates(averages, units, layout, skeleton);
    chosen = ChooseFew(candidates, units, options.max_pose_error_m, errors);
    STRIDEWIRE_CHECK(!chosen.empty() && std::ranges::is_sorted(chosen));
  }
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    const auto found = std::ranges::lower_bound(chosen, static_cast<int>(c));
    const bool is_chosen = found != chosen.end() && *found == static_cast<int>(c);
    const std::size_t others = clusters[c].size() - 1;
    for (const int member : clusters[c]) {
      SelectedExample& example = selected.report.examples[static_cast<std::size_t>(member)];
      if (!is_chosen) {
        example.fate = ExampleFate::kRedundant;
        example.error_m = errors[c].pose_m;
        example.reason = Text("the stored examples reproduce it within %.3f m (limit %.3f m)",
                              errors[c].worst_m(), options.max_pose_error_m);
        continue;
      }
      example.example = static_cast<int>(found - chosen.begin());
      example.fate = others > 0 ? ExampleFate::kAveraged : ExampleFate::kKept;
      example.reason =
          others > 0 ? "averaged with " + std::to_string(others) + " examples of similar parameters"
                     : "kept";
    }
    if (is_chosen) {
      selected.clusters.push_back(clusters[c]);
      selected.examples.push_back(std::move(averages[c]));
    }
  }
  STRIDEWIRE_CHECK(selected.examples.size() == chosen.size() &&
                   selected.clusters.size() == chosen.size());
  return selected;
}

std::string_view ExampleFateName(ExampleFate fate) {
  constexpr std::string_view kNames[] = {"kept", "averaged", "redundant", "outlier"};
  return kNames[static_cast<std::size_t>(fate)];
}

int GroupSelection::Count(ExampleFate fate) const {
  return static_cast<int>(std::ranges::count(examples, fate, &SelectedExample::fate));
}

}  // namespace stridewire
