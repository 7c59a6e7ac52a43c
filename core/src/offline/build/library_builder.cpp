#include "stridewire/offline/library_builder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>
#include <optional>

#include "base/check.h"
#include "offline/base/text.h"
#include "offline/build/grid_cells.h"
#include "offline/build/grid_example.h"
#include "offline/build/layers.h"
#include "offline/build/library_writer.h"
#include "offline/build/select_examples.h"
#include "offline/build/smooth_examples.h"
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
  if (example.keytimes_s.back() > example.clip.duration_s() + 1e-6) {
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

// Returns parameters with the ranges of the examples and their spreads as scales, but without
// centres.
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

// Owns the numbers of a group, in the order in which a library stores them.
struct StoredGroup {
  CardinalBasis basis;
  std::vector<int> cells;
  std::vector<double> sites;
  std::vector<double> keytimes_s;
  std::vector<double> heading_changes_rad;
  std::vector<float> grid;
  std::vector<std::string> sources;
  std::vector<std::uint8_t> mirrored;

  StoredGroup(const std::vector<GridExample>& examples, std::vector<int> of_cells,
              const GridLayout& layout)
      : cells(std::move(of_cells)) {
    const std::size_t n = examples.size();
    const auto row_floats = static_cast<std::size_t>(layout.row_floats);
    const std::size_t points = examples.front().rows.size() / row_floats;
    STRIDEWIRE_CHECK(examples.front().rows.size() == points * row_floats);
    grid.resize(points * n * row_floats);
    for (std::size_t e = 0; e < n; ++e) {
      const GridExample& example = examples[e];
      keytimes_s.insert(keytimes_s.end(), example.keytimes_s.begin(), example.keytimes_s.end());
      heading_changes_rad.push_back(example.heading_change_rad);
      mirrored.push_back(example.mirrored ? 1 : 0);
      sources.push_back(example.source);
      sites.insert(sites.end(), example.parameters.begin(), example.parameters.end());
      for (std::size_t p = 0; p < points; ++p) {
        std::memcpy(&grid[(p * n + e) * row_floats], &example.rows[p * row_floats],
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
    return view;
  }
};

// Replaces the selected examples by smooth functions of their parameters, which are fitted to all
// examples except outliers.
std::optional<Smoothness> Smooth(const RawGroup& group, std::vector<GridExample> found,
                                 const GroupSelection& selection, const std::vector<int>& cells,
                                 const GridLayout& layout, const Skeleton& skeleton,
                                 std::vector<GridExample>& examples) {
  std::size_t i = 0;
  std::erase_if(found, [&](const GridExample&) {
    return selection.examples[i++].fate == ExampleFate::kOutlier;
  });
  const StoredGroup stored(found, cells, layout);
  MotionGroup view = stored.View();
  view.kind = group.kind;
  view.parameters = ParametersOf(group, found);
  return SmoothExamples(view, layout, skeleton, examples);
}

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

template <typename Note>
void NoteSelection(const GroupSelection& selection, std::size_t stored, const Note& note) {
  const int averaged = selection.Count(ExampleFate::kAveraged);
  const int kept = selection.Count(ExampleFate::kKept);
  if (averaged > 0) {
    note(std::to_string(averaged + kept) + " examples averaged to " + std::to_string(stored));
  }
  const int redundant = selection.Count(ExampleFate::kRedundant);
  if (redundant > 0) {
    note(std::to_string(redundant) + " redundant examples dropped; the " + std::to_string(stored) +
         " stored examples reproduce them");
  }
  for (const SelectedExample& example : selection.examples) {
    if (example.fate != ExampleFate::kOutlier) continue;
    note(example.source + (example.mirrored ? ", mirrored" : "") +
         " dropped as an outlier: " + example.reason);
  }
}

}  // namespace

// Averaging is necessary because captured steps with equal parameters differ by centimetres, so
// weights would change abruptly between them. The error bound of 2.5 cm is a compromise: of subject
// 16 it keeps a fifth of the straight and half of the general steps, and reproduces left-out steps
// as well as all steps do. A bound of 4 cm reproduces them 5 to 10 % worse. The limit of five
// deviations drops a recovery after a jump and the last step before a sharp turn. A limit of three
// would also drop the first steps of walks.
LibraryBuilder LibraryBuilder::Selecting() {
  LibraryBuilder builder;
  builder.cluster_diameter = 0.05;
  builder.smooths = true;
  builder.selection = {.max_pose_error_m = 0.025, .outlier_deviations = 5.0};
  return builder;
}

Expected<std::shared_ptr<const MotionLibrary>> LibraryBuilder::Build(const RawLibrary& raw) {
  notes.clear();
  selections.clear();
  if (Status status = raw.skeleton.Validate(); !status) return std::unexpected(status.error());
  const int joint_count = raw.skeleton.joint_count();
  if (static_cast<int>(raw.stand_pose.rotations.size()) != joint_count) {
    return Fail(ErrorCode::kShapeMismatch, "stand_pose and skeleton have different joints");
  }
  const GridLayout layout(joint_count);
  const Quat& stand_root = raw.stand_pose.rotations[0];

  std::vector<std::unique_ptr<StoredGroup>> groups;  // Own the data that `views` refers to.
  std::vector<MotionGroup> views;
  for (std::size_t g = 0; g < raw.groups.size(); ++g) {
    const RawGroup& group = raw.groups[g];
    if (group.examples.empty()) continue;
    const auto note = [&](std::string text) {
      notes.push_back({static_cast<int>(g), std::move(text)});
    };
    for (const RawExample& example : group.examples) {
      if (Status status = ValidateExample(group, example, joint_count); !status) {
        return std::unexpected(status.error());
      }
    }

    const std::vector<int> cells = ChooseCells(group, grid_fps, layout, stand_root);
    std::vector<GridExample> found;
    found.reserve(group.examples.size());
    for (const RawExample& example : group.examples) {
      found.push_back(ResampleOnGrid(example, cells, layout, stand_root));
    }
    AlignHemispheres(found, layout, joint_count);

    std::vector<double> units(group.parameters.size(), 1.0);
    for (std::size_t l = 0; l < units.size(); ++l) {
      if (group.parameters[l] == ParameterName::kTurn) units[l] = kMetresPerRadian;
    }
    // Generated examples have no individual variation, so there is nothing to average or to drop.
    const bool selects = !group.is_completed;
    const double diameter = std::max(selects ? cluster_diameter : 0.0, 10.0 * kMinSiteDistance);
    const SelectionOptions& options = selects ? selection : SelectionOptions();
    Selected selected =
        SelectExamplesJob{found, units, diameter, options, layout, raw.skeleton, group}.Run();
    std::vector<GridExample> examples = std::move(selected.examples);
    selected.report.group = static_cast<int>(g);
    STRIDEWIRE_CHECK(!examples.empty() && examples.size() == selected.clusters.size());
    NoteSelection(selected.report, examples.size(), note);
    std::optional<Smoothness> smoothness;
    if (smooths && selects) {
      smoothness =
          Smooth(group, std::move(found), selected.report, cells, layout, raw.skeleton, examples);
    }
    if (smoothness) {
      selected.report.ridge = smoothness->ridge;
      selected.report.ridge_radius = smoothness->radius;
      note(Text("smoothed over their parameters, ridge %g", smoothness->ridge));
    }
    STRIDEWIRE_CHECK(selected.report.examples.size() == group.examples.size());
    selections.push_back(std::move(selected.report));

    StoredGroup& stored =
        *groups.emplace_back(std::make_unique<StoredGroup>(examples, cells, layout));
    MotionGroup view = stored.View();
    view.kind = group.kind;
    view.parameters = ParametersOf(group, examples);
    std::vector<double> scales;
    for (const Parameter& parameter : view.parameters) {
      scales.push_back(parameter.scale);
      if (examples.size() > 1 && parameter.max - parameter.min <= kMinSpread) {
        note(std::string(ParameterText(parameter.name)) +
             " is equal in all examples: requests for other values have no effect");
      }
    }
    if (Status status = smoothness ? FitSmoothWeights(scales, stored, view.radius_factor)
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
    views.push_back(std::move(view));
  }
  STRIDEWIRE_CHECK(views.size() == groups.size() && views.size() == selections.size());
  Expected<StoredLayers> layers = StoreLayers(raw.layers, raw.skeleton);
  if (!layers) return std::unexpected(layers.error());
  return WriteLibrary({raw.skeleton, raw.stand_pose, views, layers->views()});
}

}  // namespace stridewire
