#include "stridewire/offline/library_builder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>
#include <optional>

#include "base/check.h"
#include "offline/base/text.h"
#include "offline/build/bend_toes.h"
#include "offline/build/grid_cells.h"
#include "offline/build/grid_example.h"
#include "offline/build/layers.h"
#include "offline/build/library_writer.h"
#include "offline/build/select_examples.h"
#include "offline/build/smooth_examples.h"
#include "offline/build/smooth_jolts.h"
#include "offline/build/variants.h"
#include "runtime/library/cardinal_basis.h"
#include "runtime/weights/measure.h"

namespace stridewire {
namespace {

std::string Where(const RawGroup& group, const RawExample& example) {
  return std::string(MovementKindName(group.kind)) + " example " + example.source;
}

Status ValidateExample(const RawGroup& group, const RawExample& example, int joint_count) {
  const auto failed = [&](ErrorCode code, const char* text) {
    return Fail(code, text, Where(group, example));
  };
  if (Status status = example.clip.Validate(); !status) {
    return failed(status.error().code, status.error().text);
  }
  if (example.clip.joint_count != joint_count) {
    return failed(ErrorCode::kShapeMismatch, "clip and skeleton have different numbers of joints");
  }
  if (Status status = ValidateKeytimes(example.keytimes_s); !status) {
    return failed(status.error().code, status.error().text);
  }
  if (example.keytimes_s.size() != group.examples.front().keytimes_s.size()) {
    return failed(ErrorCode::kShapeMismatch,
                  "the example has another number of keytimes than its group");
  }
  const std::vector<double>& frame_times_s = example.frame_times_s;
  if (!frame_times_s.empty() &&
      frame_times_s.size() != static_cast<std::size_t>(example.clip.frame_count())) {
    return failed(ErrorCode::kShapeMismatch, "expected one frame time per frame of the clip");
  }
  const double duration_s =
      frame_times_s.empty() ? example.clip.duration_s() : frame_times_s.back();
  if (example.keytimes_s.back() > duration_s + 1e-6) {
    return failed(ErrorCode::kOutOfRange, "the last keytime is after the end of the clip");
  }
  if (example.parameters.size() != group.parameters.size()) {
    return failed(ErrorCode::kShapeMismatch,
                  "the example has another number of parameters than its group");
  }
  for (const double parameter : example.parameters) {
    if (!std::isfinite(parameter)) {
      return failed(ErrorCode::kOutOfRange, "expected finite parameters");
    }
  }
  if (!std::isfinite(example.heading_change_rad)) {
    return failed(ErrorCode::kOutOfRange, "expected a finite heading change");
  }
  return {};
}

constexpr double kMinSpread = 1e-6;

struct ParameterRange {
  double min = HUGE_VAL;
  double max = -HUGE_VAL;
  double spread = 0.0;
};

ParameterRange RangeOf(const std::vector<GridExample>& examples, std::size_t l) {
  ParameterRange range;
  double mean = 0.0;
  const auto count = static_cast<double>(examples.size());
  for (const GridExample& example : examples) {
    range.min = std::min(range.min, example.parameters[l]);
    range.max = std::max(range.max, example.parameters[l]);
    mean += example.parameters[l] / count;
  }
  for (const GridExample& example : examples) {
    range.spread += (example.parameters[l] - mean) * (example.parameters[l] - mean) / count;
  }
  range.spread = std::sqrt(range.spread);
  return range;
}

// Returns parameters whose ranges are those of the examples and whose scales are their standard
// deviations, or 1 if all examples have nearly the same value. Does not set the centres.
std::vector<Parameter> ParametersOf(const RawGroup& group,
                                    const std::vector<GridExample>& examples) {
  std::vector<Parameter> parameters;
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    const ParameterRange range = RangeOf(examples, l);
    const double scale = range.spread > kMinSpread ? range.spread : 1.0;
    parameters.push_back({group.parameters[l], range.min, range.max, 0.0, scale});
  }
  return parameters;
}

// Owns the arrays of a group, in the order in which a library stores them.
struct StoredGroup {
  CardinalBasis basis;
  std::vector<int> cells;
  std::vector<double> sites;
  std::vector<double> keytimes_s;
  std::vector<double> heading_changes_rad;
  std::vector<float> grid;
  std::vector<std::string> sources;
  std::vector<std::uint8_t> mirrored;
  std::vector<double> variant_parameters;

  StoredGroup(const std::vector<GridExample>& examples, const std::vector<GridExample>& variants,
              std::vector<int> of_cells, const GridLayout& layout)
      : cells(std::move(of_cells)) {
    const std::size_t row_count = examples.size() + variants.size();
    const auto row_floats = static_cast<std::size_t>(layout.row_floats);
    const std::size_t points = examples.front().rows.size() / row_floats;
    STRIDEWIRE_CHECK(examples.front().rows.size() == points * row_floats);
    grid.resize(points * row_count * row_floats);
    for (const GridExample& example : examples) {
      mirrored.push_back(example.mirrored ? 1 : 0);
      sources.push_back(example.source);
      sites.insert(sites.end(), example.parameters.begin(), example.parameters.end());
    }
    for (const GridExample& variant : variants) {
      variant_parameters.insert(variant_parameters.end(), variant.parameters.begin(),
                                variant.parameters.end());
    }
    for (std::size_t i = 0; i < row_count; ++i) {
      const GridExample& row = i < examples.size() ? examples[i] : variants[i - examples.size()];
      keytimes_s.insert(keytimes_s.end(), row.keytimes_s.begin(), row.keytimes_s.end());
      heading_changes_rad.push_back(row.heading_change_rad);
      for (std::size_t p = 0; p < points; ++p) {
        std::memcpy(&grid[(p * row_count + i) * row_floats], &row.rows[p * row_floats],
                    row_floats * sizeof(float));
      }
    }
  }

  // Returns a view without kind and parameters. It has no weights until `basis` is set.
  [[nodiscard]] MotionGroup View() const {
    MotionGroup view;
    view.example_count = view.site_count = static_cast<int>(mirrored.size());
    view.grid_point_count = 1 + std::accumulate(cells.begin(), cells.end(), 0);
    view.sites = sites;
    view.dilations = basis.dilations;
    view.linear = basis.linear;
    view.radial = basis.radial;
    view.cells = cells;
    view.keytimes_s = keytimes_s;
    view.heading_change_rad = heading_changes_rad;
    view.grid = grid;
    view.sources.assign(sources.begin(), sources.end());
    view.mirrored = mirrored;
    view.variant_parameters = variant_parameters;
    view.variant_count = static_cast<int>(heading_changes_rad.size() - mirrored.size());
    return view;
  }
};

Status FitWeights(std::span<const double> scales, StoredGroup& stored) {
  const std::size_t d = scales.size();
  Expected<CardinalBasis> basis =
      CardinalBasisFit{
          static_cast<int>(d), static_cast<int>(stored.sites.size() / d), stored.sites, {}, scales}
          .Run();
  if (!basis) return std::unexpected(basis.error());
  stored.basis = *std::move(basis);
  return {};
}

// Fits the weights of smooth examples, which allow wider radii.
Status FitSmoothWeights(std::span<const double> scales, StoredGroup& stored,
                        double& radius_factor) {
  Expected<SmoothBasis> wide = FitSmoothBasis(stored.sites, scales);
  if (!wide) return std::unexpected(wide.error());
  stored.basis = std::move(wide->basis);
  radius_factor = wide->radius_factor;
  return {};
}

Status ValidateExamples(const RawLibrary& raw) {
  for (const RawGroup& group : raw.groups) {
    for (const RawExample& example : group.examples) {
      Status status = ValidateExample(group, example, raw.skeleton.joint_count());
      if (!status) return status;
    }
  }
  return {};
}

// Converts the groups of a raw library to the form in which library files contain them.
class GroupConverter {
 public:
  // All examples of `raw` must be valid. The converter appends its notes and selections to those of
  // `builder`.
  GroupConverter(const RawLibrary& raw, LibraryBuilder& builder)
      : raw_(raw), builder_(builder), layout_(raw.skeleton.joint_count()) {
    if (builder.bends_toes) toes_.emplace(raw);
  }

  // Converts a group of the library. Groups without examples are skipped.
  Status Add(std::size_t index) {
    const RawGroup& group = raw_.groups[index];
    if (group.examples.empty()) return {};
    index_ = static_cast<int>(index);
    const std::vector<int> cells = ChooseCells(group, builder_.grid_fps, layout_, stand_root());
    SelectedSteps selected = SelectExamples(group, cells);
    std::vector<GridExample> variants;
    if (!selected.variants.empty()) {
      StoredGroup stored(selected.examples, {}, cells, layout_);
      if (Status status = AddView(group, selected.examples, selected.is_smooth, stored); !status) {
        return status;
      }
      for (const auto& [i, captured] : selected.variants) {
        variants.push_back(MakeVariant(views_.back(), group.examples[i], captured));
      }
      views_.pop_back();
    }
    StoredGroup& stored = *groups_.emplace_back(
        std::make_unique<StoredGroup>(selected.examples, variants, cells, layout_));
    return AddView(group, selected.examples, selected.is_smooth, stored);
  }

  [[nodiscard]] const std::vector<MotionGroup>& views() const { return views_; }

 private:
  [[nodiscard]] const Quat& stand_root() const { return raw_.stand_pose.rotations[0]; }
  void Note(std::string text) { builder_.notes.push_back({index_, std::move(text)}); }

  std::vector<GridExample> Resample(const RawGroup& group, const std::vector<int>& cells) const {
    std::vector<GridExample> examples;
    examples.reserve(group.examples.size());
    for (const RawExample& example : group.examples) {
      examples.push_back(ResampleOnGrid(example, cells, layout_, stand_root()));
    }
    AlignHemispheres(examples, layout_, raw_.skeleton.joint_count());
    return examples;
  }

  // A captured step that becomes a variant: its index in the raw group, and the step on the grid.
  struct CapturedStep {
    std::size_t index = 0;
    GridExample step;
  };
  struct SelectedSteps {
    std::vector<GridExample> examples;  // The examples that are stored.
    std::vector<CapturedStep> variants;
    bool is_smooth = false;  // True if the examples were smoothed over their parameters.
  };

  SelectedSteps SelectExamples(const RawGroup& group, const std::vector<int>& cells) {
    std::vector<GridExample> found = Resample(group, cells);
    std::vector<double> units(group.parameters.size(), 1.0);
    for (std::size_t l = 0; l < units.size(); ++l) {
      if (group.parameters[l] == ParameterName::kTurn) units[l] = kMetresPerRadian;
    }
    // Generated examples have no individual variation, so there is nothing to average or to drop.
    const bool selects = !group.is_completed;
    const double diameter =
        std::max(selects ? builder_.cluster_diameter : 0.0, 10.0 * kMinSiteDistance);
    const SelectionOptions& options = selects ? builder_.selection : SelectionOptions();
    Selected selected =
        SelectExamplesJob{found, units, diameter, options, layout_, raw_.skeleton, group}.Run();
    SelectedSteps steps{std::move(selected.examples), {}, false};
    std::vector<GridExample>& examples = steps.examples;
    GroupSelection& report = selected.report;
    report.group = index_;
    STRIDEWIRE_CHECK(!examples.empty() && examples.size() == selected.clusters.size());
    NoteSelection(report, examples.size());
    if (builder_.smooths && selects) {
      const std::optional<Smoothness> smoothness = Smooth(group, found, report, cells, examples);
      if (smoothness) {
        steps.is_smooth = true;
        report.ridge = smoothness->ridge;
        report.ridge_radius = smoothness->radius;
        Note(Text("smoothed over their parameters, ridge %g", smoothness->ridge));
      }
      if (IsStep(group.kind)) {
        for (const std::size_t i : ChooseVariants(found, report.examples, units, steps.is_smooth)) {
          steps.variants.push_back({i, found[i]});
        }
        SmoothNoise(examples);
      }
    }
    // The toes bend last, so that the selection does not depend on them.
    if (toes_ && selects) {
      for (GridExample& example : examples) toes_->Bend(group.kind, cells, layout_, 0.0, example);
    }
    STRIDEWIRE_CHECK(report.examples.size() == group.examples.size());
    builder_.selections.push_back(std::move(report));
    return steps;
  }

  // Smooths `examples` over their parameters: replaces the motion of each with the value, at its
  // parameters, of smooth functions fitted to all examples in `found` that are not outliers.
  std::optional<Smoothness> Smooth(const RawGroup& group, std::vector<GridExample> found,
                                   const GroupSelection& report, const std::vector<int>& cells,
                                   std::vector<GridExample>& examples) const {
    std::size_t i = 0;
    std::erase_if(found, [&](const GridExample&) {
      return report.examples[i++].fate == ExampleFate::kOutlier;
    });
    const StoredGroup stored(found, {}, cells, layout_);
    MotionGroup view = stored.View();
    view.kind = group.kind;
    view.parameters = ParametersOf(group, found);
    return SmoothExamples(view, layout_, raw_.skeleton, examples);
  }

  // Creates a variant of a group from an example. `captured` is this example resampled on the grid.
  GridExample MakeVariant(const MotionGroup& group, const RawExample& example,
                          const GridExample& captured) const {
    const std::vector<double> times_s = TimesOfBlend(group, layout_, raw_.skeleton, captured);
    GridExample variant = ResampleAt(example, times_s, layout_, stand_root());
    AlignHemisphere(captured, layout_, raw_.skeleton.joint_count(), variant);
    AdaptToBlend(group, layout_, variant);
    SmoothJolts(raw_.skeleton, layout_, variant);
    if (toes_) toes_->Bend(group.kind, group.cells, layout_, kVariantToeMarginM, variant);
    return variant;
  }

  void SmoothNoise(std::vector<GridExample>& examples) {
    int smoothed = 0;
    for (GridExample& example : examples) {
      smoothed += SmoothJolts(raw_.skeleton, layout_, example) ? 1 : 0;
    }
    if (smoothed > 0) {
      Note(std::to_string(smoothed) + " examples smoothed where joints jolt");
    }
  }

  void NoteSelection(const GroupSelection& selection, std::size_t stored) {
    const int averaged = selection.Count(ExampleFate::kAveraged);
    const int kept = selection.Count(ExampleFate::kKept);
    if (averaged > 0) {
      Note(std::to_string(averaged + kept) + " examples averaged to " + std::to_string(stored));
    }
    const int redundant = selection.Count(ExampleFate::kRedundant);
    if (redundant > 0) {
      Note(std::to_string(redundant) + " redundant examples dropped; the " +
           std::to_string(stored) + " stored examples reproduce them");
    }
    for (const SelectedExample& example : selection.examples) {
      if (example.fate != ExampleFate::kOutlier) continue;
      Note(example.source + (example.mirrored ? ", mirrored" : "") +
           " dropped as an outlier: " + example.reason);
    }
  }

  // Fits the weights of the stored examples of a group and appends its view to `views_`.
  Status AddView(const RawGroup& group, const std::vector<GridExample>& examples, bool is_smooth,
                 StoredGroup& stored) {
    MotionGroup view = stored.View();
    view.kind = group.kind;
    view.parameters = ParametersOf(group, examples);
    std::vector<double> scales;
    for (const Parameter& parameter : view.parameters) {
      scales.push_back(parameter.scale);
      if (examples.size() > 1 && parameter.max - parameter.min <= kMinSpread) {
        Note(std::string(ParameterText(parameter.name)) +
             " is equal in all examples: requests for other values have no effect");
      }
    }
    if (Status status = is_smooth ? FitSmoothWeights(scales, stored, view.radius_factor)
                                  : FitWeights(scales, stored);
        !status) {
      Error error = status.error();
      error.where = "group " + std::string(MovementKindName(group.kind));
      return std::unexpected(error);
    }
    STRIDEWIRE_CHECK(stored.basis.centres.size() == scales.size());
    view.dilations = stored.basis.dilations;
    view.linear = stored.basis.linear;
    view.radial = stored.basis.radial;
    for (std::size_t l = 0; l < scales.size(); ++l) {
      view.parameters[l].centre = stored.basis.centres[l];
    }
    views_.push_back(std::move(view));
    return {};
  }

  const RawLibrary& raw_;
  LibraryBuilder& builder_;
  GridLayout layout_;
  std::optional<ToeBender> toes_;
  int index_ = 0;                                     // Index of the current group.
  std::vector<std::unique_ptr<StoredGroup>> groups_;  // Own the data to which `views_` refer.
  std::vector<MotionGroup> views_;
};

}  // namespace

LibraryBuilder LibraryBuilder::KeepingAll() {
  LibraryBuilder builder;
  builder.bends_toes = true;
  return builder;
}

// Captured steps with equal parameters differ by centimetres. Without averaging, weights would
// change abruptly between them. The error bound of 2.5 cm is a compromise: of CMU subject 16, it
// keeps one fifth of the straight and half of the general steps, and these reproduce left-out steps
// as well as all steps do. A bound of 4 cm reproduces them 5 to 10 % worse. The outlier limit of
// five deviations drops a recovery after a jump and the last step before a sharp turn. A limit of
// three would also drop the first steps of walks.
LibraryBuilder LibraryBuilder::Selecting() {
  LibraryBuilder builder = KeepingAll();
  builder.cluster_diameter = 0.05;
  builder.smooths = true;
  builder.selection = {.max_pose_error_m = 0.025, .outlier_deviations = 5.0};
  return builder;
}

Expected<std::shared_ptr<const MotionLibrary>> LibraryBuilder::Build(const RawLibrary& raw) {
  notes.clear();
  selections.clear();
  if (Status status = raw.skeleton.Validate(); !status) return std::unexpected(status.error());
  if (static_cast<int>(raw.stand_pose.rotations.size()) != raw.skeleton.joint_count()) {
    return Fail(ErrorCode::kShapeMismatch, "stand_pose and skeleton have different joints");
  }
  if (Status status = ValidateExamples(raw); !status) return std::unexpected(status.error());
  GroupConverter converter(raw, *this);
  for (std::size_t g = 0; g < raw.groups.size(); ++g) {
    if (Status status = converter.Add(g); !status) return std::unexpected(status.error());
  }
  STRIDEWIRE_CHECK(converter.views().size() == selections.size());
  Expected<StoredLayers> layers = StoreLayers(raw.layers, raw.skeleton);
  if (!layers) return std::unexpected(layers.error());
  return WriteLibrary({raw.skeleton, raw.stand_pose, converter.views(), layers->views()});
}

}  // namespace stridewire
