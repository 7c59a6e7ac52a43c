#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include "stridewire/base/error.h"
#include "stridewire/runtime/motion_library.h"

namespace stridewire {

enum class RefineRule : std::uint8_t {
  kAmended,  ///< Several ways are tried; only what makes the largest error smaller stays.
  kBare,     ///< As the paper has it: radii from all sites, every pseudoexample is added.
};

/// What a site's radius is the distance to.
enum class RadiusRule : std::uint8_t {
  kExamples,  ///< Of an example the nearest other example, of a pseudoexample the nearest site.
  kAllSites,  ///< The nearest other site: radii shrink as pseudoexamples come.
};

/// The amended rule keeps these, or what a group without pseudoexamples has if that is more.
inline constexpr double kMaxRefinedWeightSum = 2.5;  ///< Of |w|, over the hull.
inline constexpr double kMaxRefinedCondition = 1e3;
/// Pseudoexamples keep this distance from every site, in scaled parameters.
inline constexpr double kMinPseudoexampleDistance = 0.03;

struct RefineOptions {
  RefineRule rule = RefineRule::kAmended;
  double max_error_m = 0.01;    ///< Below this a group is left as it is.
  int max_pseudoexamples = 32;  ///< A group; 0 to kMostPseudoexamples.
  int samples = 3000;           ///< Of the hull, 1 to kMostSamples.
  std::uint32_t seed = 1;
  int threads = 0;  ///< 0: one a processor. Changes no byte.
  /// Told from time to time how much is done (0 to 1, at a guess); false ends the refinement. Called on
  /// the thread that refines.
  std::function<bool(double)> progress;

  static constexpr int kMostPseudoexamples = 1024;
  static constexpr int kMostSamples = 1'000'000;
};

/// What a group is like all over the hull of its examples: sampled, and climbed from the worst samples.
struct GroupQuality {
  double min_error_m = 0.0;
  double mean_error_m = 0.0;
  double max_error_m = 0.0;
  double weight_sum_max = 0.0;  ///< Of |w|
  double condition = 1.0;       ///< Of the radial part
};

enum class RefineEnd : std::uint8_t {
  kErrorReached,  ///< Largest error below max_error_m.
  kCountReached,  ///< max_pseudoexamples are there.
  kNothingHelps,  ///< No further one makes the largest error smaller within the bounds.
};
[[nodiscard]] std::string_view RefineEndText(RefineEnd end);

struct GroupRefinement {
  GroupQuality before;  ///< Without any pseudoexample; both over samples of their own
  GroupQuality after;
  double pseudoexample_error_m = 0.0;        ///< Largest e at a pseudoexample
  RadiusRule radii = RadiusRule::kExamples;  ///< Of the way that led furthest, see Refine
  double radius_factor = 1.0;                ///< Of all examples' radii
  int rejected = 0;                          ///< Pseudoexamples found but not taken
  std::vector<double> max_error_curve_m;     ///< [pseudoexamples + 1]: largest error with so many
  RefineEnd end = RefineEnd::kErrorReached;
};

struct Refinement {
  std::shared_ptr<const MotionLibrary> library;
  std::vector<GroupRefinement> groups;  ///< As in the library
};

/// Adds pseudoexamples, sites with weights instead of motion, where synthesized movements miss most
/// what is asked (paper, Section 4):
///
///   repeat: p^ = argmax e over the hull V of the examples: samples, then steepest ascent
///           p* with a(p*) = p^ (CorrectWeights); add the site p^ with the weights w(p*); refit
///   until max e < max_error_m, or enough of them are there
///
/// The bare rule shrinks every radius near a new site, and now and then the largest error grows. The
/// amended one keeps the condition below kMaxRefinedCondition and the sum of |w| below
/// kMaxRefinedWeightSum, and goes these ways until one reaches
/// max_error_m; else the one with the smallest largest error counts, by samples of another seed:
///
///   1. the examples' radii stay as they are, a site is added only if the largest error falls
///   2. radii shrink, any site is added, and those after the smallest largest error are dropped; first
///      with the radii as they come, then with some tried for each new site
///   3. as 1 with the examples' radii 2 and 3 times as wide (evenly spaced examples bear that)
///
/// Pseudoexamples already there are replaced.
///
/// kOutOfRange: an option; kUnsupported, "stopped": `progress` said so.
[[nodiscard]] Expected<Refinement> Refine(const std::shared_ptr<const MotionLibrary>& library,
                                          const RefineOptions& options = {});

/// A group's quality as it stands, pseudoexamples included, or as if it had none.
[[nodiscard]] GroupQuality MeasureGroupQuality(const MotionLibrary& library, int group_index,
                                               bool with_pseudoexamples, int samples = 1000,
                                               std::uint32_t seed = 1);

}  // namespace stridewire
