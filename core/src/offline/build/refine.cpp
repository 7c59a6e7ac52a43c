#include "offline/build/refine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "base/check.h"
#include "offline/build/hull_survey.h"
#include "offline/build/library_writer.h"
#include "offline/build/parameter_scales.h"
#include "runtime/library/cardinal_basis.h"
#include "runtime/weights/measure.h"

namespace stridewire {
namespace {

// Maximum error at a pseudoexample. Weights are floats, which limits the accuracy of foot positions
// to about 1 um.
constexpr double kMaxResidualM = 5e-6;
constexpr CorrectionLimits kSolve = {.max_iterations = 40, .tolerance_m = 1e-6};
// The largest error must decrease by at least this fraction to count as an improvement. Smaller
// changes are within the accuracy of SurveyHull.
constexpr double kMinGain = 1e-3;
// Fraction of the limit of the sum of |w| that is allowed at samples, because the sum may be larger
// between them.
constexpr double kSampledWeightShare = 0.96;
constexpr std::array kOwnRadiusFactors = {1.0, 1.5, 2.0, 0.7};
constexpr std::uint32_t kOtherSeed = 0x9e3779b9;
constexpr int kMaxChecks = 10;
constexpr std::size_t kNearSamples = 60;
// A new pseudoexample is first checked at this many samples with the largest errors, because most
// rejected ones already fail there.
constexpr std::size_t kHotSamples = 64;

// The sites of a group: its examples, and the pseudoexamples that have been found so far.
struct Sites {
  std::vector<double> parameters;
  std::vector<double> pseudo_weights;
  std::vector<double> radius_factors;
};

// A group with the motion of the library's group, but with other sites and therefore other weights.
struct Candidate {
  Sites sites;
  CardinalBasis basis;
  MotionGroup group;  // Its spans refer to `sites` and `basis`.
};

Expected<std::shared_ptr<const Candidate>> Fit(const MotionGroup& original, Sites sites,
                                               RadiusRule radii) {
  auto candidate = std::make_shared<Candidate>();
  candidate->sites = std::move(sites);
  const std::vector<double> scales = ScalesOf(original);
  Expected<CardinalBasis> basis =
      CardinalBasisFit{.parameter_count = original.parameter_count(),
                       .example_count = original.example_count,
                       .sites = candidate->sites.parameters,
                       .pseudo_weights = candidate->sites.pseudo_weights,
                       .scales = scales,
                       .radius_factors = candidate->sites.radius_factors,
                       .radii_from_all_sites = radii == RadiusRule::kAllSites}
          .Run();
  if (!basis) return std::unexpected(basis.error());
  candidate->basis = *std::move(basis);
  STRIDEWIRE_CHECK(candidate->basis.sites.size() == candidate->sites.parameters.size());
  STRIDEWIRE_CHECK(candidate->sites.radius_factors.size() == candidate->basis.dilations.size());
  MotionGroup& group = candidate->group;
  group = original;
  group.sites = candidate->basis.sites;
  group.site_count = static_cast<int>(candidate->basis.dilations.size());
  group.site_weights = candidate->sites.pseudo_weights;
  group.dilations = candidate->basis.dilations;
  group.linear = candidate->basis.linear;
  group.radial = candidate->basis.radial;
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    group.parameters[l].centre = candidate->basis.centres[l];
  }
  return candidate;
}

// Returns the examples as sites. Their radii are `factor` times those in the library.
Sites ExamplesOf(const MotionGroup& group, double factor) {
  const auto n = static_cast<std::size_t>(group.example_count);
  const std::span<const double> examples = group.sites.first(n * group.parameters.size());
  return {.parameters = {examples.begin(), examples.end()},
          .pseudo_weights = {},
          .radius_factors = std::vector<double>(n, factor * group.radius_factor)};
}

double DistanceToSites(const MotionGroup& group, const ParameterValues& p) {
  double nearest = HUGE_VAL;
  for (int s = 0; s < group.site_count; ++s) {
    nearest = std::min(nearest, ScaledDistance(group, group.site(s),
                                               std::span(p.values).first(group.parameters.size())));
  }
  return nearest;
}

GroupQuality QualityOf(const HullSurvey& survey, double condition) {
  return {.min_error_m = survey.min_m,
          .mean_error_m = survey.mean_m,
          .max_error_m = survey.max_m,
          .weight_sum_max = survey.weight_sum_max,
          .condition = condition};
}

// One pass of the amended rule (see Refine).
struct Pass {
  RadiusRule radii = RadiusRule::kExamples;
  double radius_factor = 1.0;  // Factor by which the radii of the examples are multiplied.
  // True if the pass also adds sites that increase the error, because later sites may reduce it
  // again.
  bool accepts_any = false;
  bool tries_own_radii = true;  // True if the pass tries several radii for each new site.
};

// Passes in the order in which they run. No further pass runs after one has reached the requested
// error.
constexpr std::array kAmendedPasses = {
    Pass{}, Pass{RadiusRule::kAllSites, 1.0, true, false}, Pass{RadiusRule::kAllSites, 1.0, true},
    Pass{RadiusRule::kExamples, 2.0}, Pass{RadiusRule::kExamples, 3.0}};

// Refines one group.
class GroupRefiner {
 public:
  GroupRefiner(const MotionGroup& group, const RefineOptions& options, std::span<GroupProbe> probes,
               const std::function<bool(double)>& progress)
      : original_(group),
        options_(options),
        probes_(probes),
        progress_(progress),
        samples_(SampleHull(group, options.samples, options.seed)) {}

  struct Outcome {
    std::shared_ptr<const Candidate> candidate;
    GroupRefinement report;
  };

  Expected<Outcome> Run() {
    const auto plain = Fit(original_, ExamplesOf(original_, 1.0), RadiusRule::kExamples);
    if (!plain) return std::unexpected(plain.error());
    const HullSurvey survey = SurveyHull((*plain)->group, samples_, probes_);
    GroupQuality before = QualityOf(survey, (*plain)->basis.condition);
    Verify((*plain)->group, before);
    max_weight_sum_ = std::max(kMaxRefinedWeightSum, before.weight_sum_max);
    sampled_weight_sum_ =
        std::max(kSampledWeightShare * kMaxRefinedWeightSum, before.weight_sum_max);
    max_condition_ = std::max(kMaxRefinedCondition, before.condition);

    const bool is_bare = options_.rule == RefineRule::kBare;
    const std::size_t passes = is_bare ? 1 : kAmendedPasses.size();
    Outcome best;
    for (std::size_t i = 0; i < passes; ++i) {
      const Pass pass = is_bare ? kAmendedPasses[1] : kAmendedPasses[i];
      done_ = static_cast<double>(i) / static_cast<double>(passes);
      share_ = 1.0 / static_cast<double>(passes);
      std::shared_ptr<const Candidate> start = *plain;
      HullSurvey start_survey = survey;
      if (pass.radius_factor != 1.0) {
        const auto wider = Fit(original_, ExamplesOf(original_, pass.radius_factor), pass.radii);
        if (!wider) break;
        start = *wider;
        start_survey = SurveyHull(start->group, samples_, probes_);
        // If this radius exceeds the limits, wider radii exceed them as well.
        if (!IsWithinBounds(start_survey, start->basis.condition)) break;
      }
      Expected<Outcome> outcome = RunPass(pass, std::move(start), std::move(start_survey));
      if (!outcome) return outcome;
      GroupRefinement& report = outcome->report;
      report.before = before;
      Verify(outcome->candidate->group, report.after);
      if (report.end == RefineEnd::kErrorReached &&
          report.after.max_error_m >= options_.max_error_m) {
        report.end = RefineEnd::kNothingHelps;
      }
      const bool is_within = is_bare || report.after.weight_sum_max <= max_weight_sum_;
      if (best.candidate == nullptr ||
          (is_within && report.after.max_error_m < best.report.after.max_error_m)) {
        best = *std::move(outcome);
      }
      if (best.report.end == RefineEnd::kErrorReached) break;
    }
    if (!is_bare && best.report.after.max_error_m > before.max_error_m) {
      // Verify measures errors at other samples than the passes. Even the best pass has increased
      // the largest error there, so the group stays unrefined.
      best.candidate = *plain;
      best.report = {.before = before,
                     .after = before,
                     .rejected = best.report.rejected,
                     .max_error_curve_m = {survey.max_m},
                     .end = RefineEnd::kNothingHelps};
    }
    STRIDEWIRE_CHECK(best.candidate != nullptr && !best.report.max_error_curve_m.empty());
    return best;
  }

 private:
  // Measures the group with samples that refinement has not used. Refinement reduces the error most
  // at its own samples, which may miss a peak.
  void Verify(const MotionGroup& group, GroupQuality& quality) const {
    const std::vector<ParameterValues> others =
        SampleHull(group, 2 * options_.samples, options_.seed + kOtherSeed);
    const HullSurvey survey = SurveyHull(group, others, probes_);
    quality.min_error_m = survey.min_m;
    quality.mean_error_m = survey.mean_m;
    quality.max_error_m = std::max(quality.max_error_m, survey.max_m);
    quality.weight_sum_max = std::max(quality.weight_sum_max, survey.weight_sum_max);
  }

  [[nodiscard]] bool IsWithinBounds(const HullSurvey& survey, double condition) const {
    return survey.weight_sum_max <= sampled_weight_sum_ && condition <= max_condition_;
  }

  [[nodiscard]] bool ReportProgress(double fraction) const {
    return !progress_ || progress_(done_ + share_ * std::min(1.0, fraction));
  }

  // Adds samples at the current peaks and around the newest site, where new peaks develop.
  void AddNearSamples(const Candidate& current, const HullSurvey& survey) {
    for (const HullPoint& peak : survey.peaks) samples_.push_back(peak.p);
    const MotionGroup& group = current.group;
    const std::span<const double> site = group.site(group.site_count - 1);
    STRIDEWIRE_CHECK(group.site_count > group.example_count);
    const double radius = 2.0 * group.dilations.back();
    for (std::size_t i = 0; i < kNearSamples; ++i) {
      // The sample is moved towards another point of the hull, so that it stays inside the hull.
      const ParameterValues& other =
          samples_[(i * 7919) % static_cast<std::size_t>(options_.samples)];
      double squared = 0.0;
      for (std::size_t l = 0; l < site.size(); ++l) {
        squared += std::pow((other.values[l] - site[l]) / group.parameters[l].scale, 2);
      }
      const double share = static_cast<double>(i + 1) / static_cast<double>(kNearSamples);
      const double part = std::min(1.0, share * radius / std::max(std::sqrt(squared), 1e-9));
      ParameterValues near = other;
      for (std::size_t l = 0; l < site.size(); ++l) {
        near.values[l] = site[l] + part * (other.values[l] - site[l]);
      }
      samples_.push_back(near);
    }
  }

  // Measures the group with samples of another seed. If these samples exceed the requested error
  // or the limits, adds the worst of them to the samples and updates `survey`. Returns true if the
  // largest error in `survey` is then too large.
  bool OtherSamplesFindMore(const Candidate& current, int check, HullSurvey& survey) {
    const std::vector<ParameterValues> others = SampleHull(
        current.group, 2 * options_.samples, options_.seed + static_cast<std::uint32_t>(check));
    const HullSurvey found = SurveyHull(current.group, others, probes_);
    if (found.max_m < options_.max_error_m && IsWithinBounds(found, current.basis.condition)) {
      return false;
    }
    const std::vector<ParameterValues> worst = HotPoints(found);
    samples_.insert(samples_.end(), worst.begin(), worst.end());
    survey = SurveyHull(current.group, samples_, probes_);
    return survey.max_m >= options_.max_error_m;
  }

  Expected<Outcome> RunPass(const Pass& pass, std::shared_ptr<const Candidate> current,
                            HullSurvey survey) {
    const bool is_bare = options_.rule == RefineRule::kBare;
    Outcome outcome;
    GroupRefinement& report = outcome.report;
    report.radii = pass.radii;
    report.radius_factor = pass.radius_factor;
    const auto keep = [&] {
      outcome.candidate = current;
      report.after = QualityOf(survey, current->basis.condition);
    };
    keep();
    report.max_error_curve_m.push_back(survey.max_m);
    int checks = 0;
    for (int added = 0;; ++added) {
      if (survey.max_m < options_.max_error_m &&
          (is_bare || IsWithinBounds(survey, current->basis.condition))) {
        // The samples may miss a narrow peak, so the limit must also hold at other samples.
        if (is_bare || checks >= kMaxChecks || !OtherSamplesFindMore(*current, ++checks, survey)) {
          report.end = RefineEnd::kErrorReached;
          break;
        }
        report.max_error_curve_m.back() = survey.max_m;
        report.after.max_error_m = std::max(report.after.max_error_m, survey.max_m);
      }
      if (added >= options_.max_pseudoexamples) {
        report.end = RefineEnd::kCountReached;
        break;
      }
      if (!ReportProgress(static_cast<double>(added) / options_.max_pseudoexamples)) {
        return Fail(ErrorCode::kUnsupported, "stopped");
      }
      std::shared_ptr<const Candidate> next =
          is_bare ? AddWorst(*current, survey, report) : AddBest(pass, *current, survey, report);
      if (next == nullptr) {
        report.end = RefineEnd::kNothingHelps;
        break;
      }
      current = std::move(next);
      if (!is_bare) AddNearSamples(*current, survey);
      report.max_error_curve_m.push_back(survey.max_m);
      const bool is_better = survey.max_m < report.after.max_error_m &&
                             IsWithinBounds(survey, current->basis.condition);
      if (is_bare || is_better) keep();
    }
    // `outcome` contains the best state. The sites that were added after it count as rejected.
    const MotionGroup& group = outcome.candidate->group;
    STRIDEWIRE_CHECK(group.site_count >= group.example_count);
    const auto kept = static_cast<std::size_t>(group.site_count - group.example_count + 1);
    if (kept < report.max_error_curve_m.size()) {
      report.rejected += static_cast<int>(report.max_error_curve_m.size() - kept);
      report.max_error_curve_m.resize(kept);
      report.end = RefineEnd::kNothingHelps;
    }
    for (int s = group.example_count; s < group.site_count; ++s) {
      report.pseudoexample_error_m = std::max(
          report.pseudoexample_error_m, probes_[0].At(group, ValuesOf(group.site(s))).error_m);
    }
    return outcome;
  }

  // Returns the sites with the pseudoexample (p^, w(p*)) added, in the notation of Refine. Returns
  // nullopt if p* is not found.
  std::optional<Sites> WithPseudoexample(const Candidate& current, const ParameterValues& wanted,
                                         double radius_factor) {
    const Correction solved = probes_[0].Correct(current.group, wanted, kSolve);
    if (solved.error_m > kMaxResidualM) return std::nullopt;
    const std::size_t d = original_.parameters.size();
    const std::span<const double> weights = probes_[0].Weights(current.group);
    Sites sites = current.sites;
    sites.parameters.insert(sites.parameters.end(), wanted.values.begin(),
                            wanted.values.begin() + static_cast<std::ptrdiff_t>(d));
    sites.pseudo_weights.insert(sites.pseudo_weights.end(), weights.begin(), weights.end());
    sites.radius_factors.push_back(radius_factor);
    return sites;
  }

  // Adds a pseudoexample at the largest error, even if the largest error then increases.
  std::shared_ptr<const Candidate> AddWorst(const Candidate& current, HullSurvey& survey,
                                            GroupRefinement& report) {
    for (const HullPoint& peak : survey.peaks) {
      if (DistanceToSites(current.group, peak.p) < kMinPseudoexampleDistance) continue;
      std::optional<Sites> sites = WithPseudoexample(current, peak.p, 1.0);
      if (sites) {
        const auto next = Fit(original_, *std::move(sites), RadiusRule::kAllSites);
        if (next) {
          survey = SurveyHull((*next)->group, samples_, probes_);
          return *next;
        }
      }
      ++report.rejected;
    }
    return nullptr;
  }

  // The amended rule: adds a pseudoexample at the largest peak of the error at which the group
  // stays within the limits and its largest error decreases. If the pass accepts increases, the
  // error need not decrease. Chooses the radius that minimizes the largest error. Returns null if
  // there is no such peak.
  std::shared_ptr<const Candidate> AddBest(const Pass& pass, const Candidate& current,
                                           HullSurvey& survey, GroupRefinement& report) {
    const std::vector<ParameterValues> hot = HotPoints(survey);
    std::shared_ptr<const Candidate> best;
    HullSurvey best_survey;
    for (const HullPoint& peak : survey.peaks) {
      if (DistanceToSites(current.group, peak.p) < kMinPseudoexampleDistance) continue;
      for (const double factor : kOwnRadiusFactors) {
        if (factor != 1.0 && !pass.tries_own_radii) continue;
        std::optional<Sites> sites = WithPseudoexample(current, peak.p, factor);
        if (!sites) break;
        const auto next = Fit(original_, *std::move(sites), pass.radii);
        if (!next || (*next)->basis.condition > max_condition_) continue;
        const double below_m = best != nullptr    ? best_survey.max_m
                               : pass.accepts_any ? HUGE_VAL
                                                  : survey.max_m * (1.0 - kMinGain);
        // Checks the samples with the largest errors first, because most candidates fail there.
        const bool is_worse = std::any_of(hot.begin(), hot.end(), [&](const ParameterValues& p) {
          const HullPoint point = probes_[0].At((*next)->group, p);
          return point.error_m >= below_m || point.weight_sum > sampled_weight_sum_;
        });
        if (is_worse) continue;
        HullSurvey next_survey = SurveyHull((*next)->group, samples_, probes_);
        if (next_survey.max_m >= below_m ||
            !IsWithinBounds(next_survey, (*next)->basis.condition)) {
          continue;
        }
        best = *next;
        best_survey = std::move(next_survey);
      }
      if (best != nullptr) {
        survey = std::move(best_survey);
        return best;
      }
      ++report.rejected;
    }
    return nullptr;
  }

  // Returns the parameters at the peaks of the error and at the samples with the largest errors.
  static std::vector<ParameterValues> HotPoints(const HullSurvey& survey) {
    std::vector<ParameterValues> hot;
    for (const HullPoint& peak : survey.peaks) hot.push_back(peak.p);
    std::vector<HullPoint> points = survey.points;
    std::stable_sort(points.begin(), points.end(),
                     [](const HullPoint& a, const HullPoint& b) { return a.error_m > b.error_m; });
    points.resize(std::min(kHotSamples, points.size()));
    for (const HullPoint& point : points) hot.push_back(point.p);
    return hot;
  }

  const MotionGroup& original_;
  const RefineOptions& options_;
  std::span<GroupProbe> probes_;
  const std::function<bool(double)>& progress_;
  // Samples of the hull, followed by the peaks found so far and other points with large errors.
  std::vector<ParameterValues> samples_;
  double max_weight_sum_ = kMaxRefinedWeightSum;
  double sampled_weight_sum_ = kMaxRefinedWeightSum;
  double max_condition_ = kMaxRefinedCondition;
  double done_ = 0.0;
  double share_ = 1.0;
};

}  // namespace

std::string_view RefineEndText(RefineEnd end) {
  switch (end) {
    case RefineEnd::kErrorReached: return "error_reached";
    case RefineEnd::kCountReached: return "count_reached";
    case RefineEnd::kNothingHelps: return "nothing_helps";
  }
  return "unknown";
}

Expected<Refinement> Refine(const std::shared_ptr<const MotionLibrary>& library,
                            const RefineOptions& options) {
  if (!(options.max_error_m >= 0.0 && options.max_error_m <= 1e3)) {
    return Fail(ErrorCode::kOutOfRange, "max_error_m: expected a number from 0 to 1000");
  }
  if (options.max_pseudoexamples < 0 ||
      options.max_pseudoexamples > RefineOptions::kMaxPseudoexamples) {
    return Fail(ErrorCode::kOutOfRange, "max_pseudoexamples: expected 0 to 1024");
  }
  if (options.samples < 1 || options.samples > RefineOptions::kMaxSamples) {
    return Fail(ErrorCode::kOutOfRange, "samples: expected 1 to 1000000");
  }
  std::vector<GroupProbe> probes = MakeProbes(*library, options.threads);
  Refinement refinement;
  std::vector<std::shared_ptr<const Candidate>> candidates;
  std::vector<MotionGroup> groups;
  const auto count = static_cast<double>(library->groups().size());
  for (const MotionGroup& group : library->groups()) {
    std::function<bool(double)> progress;
    if (options.progress) {
      progress = [&, done = static_cast<double>(groups.size())](double fraction) {
        return options.progress((done + fraction) / count);
      };
    }
    Expected<GroupRefiner::Outcome> outcome = GroupRefiner(group, options, probes, progress).Run();
    if (!outcome) {
      Error error = outcome.error();
      error.where = "group " + std::to_string(groups.size());
      return std::unexpected(error);
    }
    groups.push_back(outcome->candidate->group);
    candidates.push_back(std::move(outcome->candidate));
    refinement.groups.push_back(std::move(outcome->report));
  }
  STRIDEWIRE_CHECK(groups.size() == library->groups().size() &&
                   refinement.groups.size() == groups.size());
  auto refined =
      WriteLibrary({library->skeleton(), library->stand_pose(), groups, library->layers()});
  if (!refined) return std::unexpected(refined.error());
  refinement.library = *std::move(refined);
  if (options.progress) static_cast<void>(options.progress(1.0));
  return refinement;
}

GroupQuality MeasureGroupQuality(const MotionLibrary& library, int group_index,
                                 bool with_pseudoexamples, int samples, std::uint32_t seed) {
  const MotionGroup& group = library.group(group_index);
  std::vector<GroupProbe> probes = MakeProbes(library, 0);
  const std::vector<ParameterValues> points = SampleHull(group, samples, seed);
  if (with_pseudoexamples || group.site_count == group.example_count) {
    return QualityOf(SurveyHull(group, points, probes),
                     RadialCondition(group.sites, group.dilations, ScalesOf(group)));
  }
  const auto plain = Fit(group, ExamplesOf(group, 1.0), RadiusRule::kExamples);
  if (!plain) return {};
  return QualityOf(SurveyHull((*plain)->group, points, probes), (*plain)->basis.condition);
}

}  // namespace stridewire
