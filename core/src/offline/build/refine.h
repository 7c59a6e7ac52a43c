#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

/// Rules by which pseudoexamples are chosen.
enum class RefineRule : std::uint8_t {
  kAmended,  ///< Tries several passes. Keeps only pseudoexamples that reduce the largest error.
  kBare,     ///< The rule of the paper: all sites determine the radii, all pseudoexamples are kept.
};

/// Defines the radius of a site.
enum class RadiusRule : std::uint8_t {
  /// For an example, distance to the nearest other example. For a pseudoexample, to the nearest
  /// site.
  kExamples,
  /// Distance to the nearest other site. Pseudoexamples thus reduce the radii of their neighbours.
  kAllSites,
};

/// Limits of the amended rule. If a group exceeds a limit even without pseudoexamples, the limit is
/// the value of the group instead.
inline constexpr double kMaxRefinedWeightSum = 2.5;  ///< Largest sum of |w| over the hull.
inline constexpr double kMaxRefinedCondition = 1e3;  ///< GroupQuality::condition.
/// Minimum distance between a pseudoexample and any other site, in scaled parameters.
inline constexpr double kMinPseudoexampleDistance = 0.03;

struct RefineOptions {
  RefineRule rule = RefineRule::kAmended;
  double max_error_m = 0.01;  ///< Groups whose largest error is smaller are not refined.
  /// Maximum number of pseudoexamples per group, 0 to kMaxPseudoexamples.
  int max_pseudoexamples = 32;
  int samples = 3000;  ///< Number of samples of the hull, 1 to kMaxSamples.
  std::uint32_t seed = 1;
  int threads = 0;  ///< Number of threads; 0: one per processor. It does not affect the result.
  /// Called repeatedly, on the thread that called Refine, with the estimated fraction of the work
  /// that is done, 0 to 1. Return false to stop.
  std::function<bool(double)> progress;

  static constexpr int kMaxPseudoexamples = 1024;
  static constexpr int kMaxSamples = 1'000'000;
};

/// Quality of a group over the hull of its examples, measured at samples and at the peaks found by
/// steepest ascent from the worst samples.
struct GroupQuality {
  double min_error_m = 0.0;
  double mean_error_m = 0.0;
  double max_error_m = 0.0;
  double weight_sum_max = 0.0;  ///< Largest sum of |w|.
  double condition = 1.0;       ///< Condition number of the matrix of the radial part.
};

/// Why the refinement of a group ended.
enum class RefineEnd : std::uint8_t {
  kErrorReached,  ///< The largest error is below max_error_m.
  kCountReached,  ///< The group has max_pseudoexamples.
  kNothingHelps,  ///< No further pseudoexample reduces the largest error within the limits.
};
/// Returns "error_reached", "count_reached" or "nothing_helps".
[[nodiscard]] std::string_view RefineEndText(RefineEnd end);

struct GroupRefinement {
  GroupQuality before;  ///< Quality without pseudoexamples, measured with samples of another seed.
  GroupQuality after;   ///< Quality with pseudoexamples, measured with the same samples.
  double pseudoexample_error_m = 0.0;        ///< Largest error at a pseudoexample.
  RadiusRule radii = RadiusRule::kExamples;  ///< Radius rule of the best pass (see Refine).
  double radius_factor = 1.0;  ///< Factor by which the radii of the examples were multiplied.
  int rejected = 0;            ///< Number of pseudoexamples that were tried and rejected.
  std::vector<double> max_error_curve_m;  ///< Largest error with 0, 1, ... pseudoexamples.
  RefineEnd end = RefineEnd::kErrorReached;
};

struct Refinement {
  std::shared_ptr<const MotionLibrary> library;
  std::vector<GroupRefinement> groups;  ///< One entry per group, in the order of the library.
};

/// Adds pseudoexamples where the error of synthesized movements is largest (paper, Section 4). They
/// are sites with weights instead of motion. In the notation of the paper, w(p) are the weights for
/// the parameters p, a(p) the measured parameters of the movement, and e(p) its error. The paper
/// repeats these steps until the largest error is below max_error_m, or until the group has
/// max_pseudoexamples:
///
/// - Find the parameters p^ in the hull of the examples where e is largest, by sampling the hull
///   and then by steepest ascent.
/// - Find p* with a(p*) = p^ (CorrectWeights). Add a site at p^ with the weights w(p*), and refit.
///
/// If this is all (RefineRule::kBare), the radii near a new site shrink, and sometimes the largest
/// error grows. RefineRule::kAmended keeps the condition number below kMaxRefinedCondition and the
/// sum of |w| below kMaxRefinedWeightSum. It runs the following passes until one reaches
/// max_error_m. If none does, it uses the pass whose largest error, measured with samples of
/// another seed, is smallest. If that error is larger than without pseudoexamples, it adds none.
///
/// 1. The radii of the examples do not change. Sites that do not reduce the error are rejected.
/// 2. Radii shrink near new sites, and sites are added even if they increase the error, unless they
///    exceed a limit. Finally, the sites added after the best state are dropped. A second run of
///    this pass tries several radii for each new site, as passes 1 and 3 do.
/// 3. Like 1, but with the radii of the examples 2 and 3 times as wide, which suits evenly spaced
///    examples.
///
/// Existing pseudoexamples are removed first.
///
/// Errors: kOutOfRange for an option, and those of WriteLibrary. With the group in Error::where:
/// kUnsupported, "stopped", if `progress` returned false, and the errors of CardinalBasisFit::Run.
[[nodiscard]] Expected<Refinement> Refine(const std::shared_ptr<const MotionLibrary>& library,
                                          const RefineOptions& options = {});

/// Measures the quality of a group, with its pseudoexamples or without them.
[[nodiscard]] GroupQuality MeasureGroupQuality(const MotionLibrary& library, int group_index,
                                               bool with_pseudoexamples, int samples = 1000,
                                               std::uint32_t seed = 1);

}  // namespace stridewire
