#include "app/library_pages.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "offline/inspect/inspect_json.h"
#include "runtime/library/convex_hull.h"
#include "runtime/movement/movement.h"
#include "runtime/plan/request_plan.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/weights/correction.h"
#include "runtime/weights/measure.h"
#include "stridewire/base/error.h"

namespace stridewire::server {
namespace {

using Json = nlohmann::ordered_json;

// Maximum absolute value of a parameter, in metres or radians. Larger values are probably typos.
constexpr double kMaxParameter = 20.0;

// Rounds to 0.01 mm, so that the JSON text is shorter.
double Round(double value) { return std::round(value * 1e5) / 1e5; }

template <typename Values>
Json List(const Values& values) {
  Json list = Json::array();
  for (const auto value : values) list.push_back(Round(value));
  return list;
}
Json Triple(const auto& v) { return {Round(v.x), Round(v.y), Round(v.z)}; }

HttpAnswer Refuse(unsigned status, std::string why) {
  return {.status = status, .body = std::move(why) + "\n"};
}
HttpAnswer Refuse(const Error& error) { return Refuse(400, Describe(error)); }
HttpAnswer JsonAnswer(const Json& json) {
  return {.content_type = "application/json",
          .body = json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n"};
}

// Returns the value of field `name` in a query string.
std::optional<std::string_view> ValueOf(std::string_view query, std::string_view name) {
  while (!query.empty()) {
    const std::string_view field = query.substr(0, query.find('&'));
    query.remove_prefix(std::min(query.size(), field.size() + 1));
    if (field.size() > name.size() && field.starts_with(name) && field[name.size()] == '=') {
      return field.substr(name.size() + 1);
    }
  }
  return std::nullopt;
}

template <typename Number>
bool Parse(std::string_view text, Number& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size();
}

// Returns the value of an index field: 0 to `count` - 1.
Expected<int> IndexOf(std::string_view query, std::string_view name, int count) {
  int value = -1;
  const auto text = ValueOf(query, name);
  if (!text || !Parse(*text, value) || value < 0 || value >= count) {
    return Fail(ErrorCode::kOutOfRange, "index is out of range", std::string(name));
  }
  return value;
}

Expected<bool> Correction(std::string_view query) {
  const auto text = ValueOf(query, "correction");
  if (!text || *text == "1") return true;
  if (*text == "0") return false;
  return Fail(ErrorCode::kInvalidArgument, "expected 0 or 1", "correction");
}

Expected<ParameterValues> Parameters(std::string_view query, const MotionGroup& group) {
  const auto wrong = [] {
    return Fail(ErrorCode::kInvalidArgument,
                "expected one number per parameter, separated by commas, each within -20 and 20",
                "p");
  };
  const auto text = ValueOf(query, "p");
  if (!text) return wrong();
  ParameterValues p;
  std::string_view rest = *text;
  while (true) {
    const std::size_t comma = rest.find(',');
    double value = 0.0;
    if (p.count == group.parameter_count() || !Parse(rest.substr(0, comma), value) ||
        !(std::fabs(value) <= kMaxParameter)) {
      return wrong();
    }
    p.values[static_cast<std::size_t>(p.count++)] = value;
    if (comma == std::string_view::npos) break;
    rest.remove_prefix(comma + 1);
  }
  if (p.count != group.parameter_count()) return wrong();
  return p;
}

std::span<const double> Span(const ParameterValues& p) {
  return std::span(p.values).first(static_cast<std::size_t>(p.count));
}

// Synthesizes movements of one group of a library. Contains the scratch memory.
class MovementPreview {
 public:
  MovementPreview(const MotionLibrary& library, int group_index)
      : library_(library),
        group_index_(group_index),
        group_(library.group(group_index)),
        scratch_(library),
        cache_(library.layout()),
        pose_(library.skeleton().joint_count()) {
    metric_.fill(1.0);
    for (int l = 0; l < group_.parameter_count(); ++l) {
      metric_[static_cast<std::size_t>(l)] =
          1.0 / group_.parameters[static_cast<std::size_t>(l)].scale;
    }
  }

  // Projects the parameters onto the hull of the examples, enlarged by the fraction `growth`.
  // Writes the nearest point to `nearest` and returns its scaled distance.
  double Project(const ParameterValues& p, double growth, ParameterValues& nearest) const {
    const auto d = static_cast<std::size_t>(p.count);
    nearest = p;
    return ProjectOntoHull(group_.sites.first(static_cast<std::size_t>(group_.example_count) * d),
                           std::span(metric_).first(d), growth, Span(p),
                           std::span(nearest.values).first(d));
  }

  // Sets the weights of the movement, corrected as for an avatar if `is_corrected`. Returns the
  // number of iterations of the correction.
  int ComputeWeights(const ParameterValues& p, bool is_corrected) {
    if (is_corrected) {
      const stridewire::Correction correction =
          CorrectWeights(group_, p, DefaultCorrectionLimits(group_), scratch_, movement_);
      movement_.group = group_index_;
      return correction.iterations;
    }
    SetWeights(group_, group_index_, Span(p), scratch_.weights(group_), movement_);
    return 0;
  }

  // Starts the movement. Returns its measured parameters.
  ParameterValues Start() {
    StartWeighted(group_, BaseFrame{}, movement_);
    cache_.Clear();
    return MeasureMovement(library_, movement_, cache_, pose_);
  }

  double Error(const ParameterValues& p, bool is_corrected) {
    ComputeWeights(p, is_corrected);
    cache_.Clear();
    return LargestDifference(group_, p, MeasureMovement(library_, movement_, cache_, pose_));
  }

  // Returns the frames of the movement as flat lists of times, root positions and rotations (x, y,
  // z, w), with its keytimes, heading change and weights.
  Json Frames() {
    const double duration_s = movement_.duration_s();
    const int last =
        std::max(1, static_cast<int>(std::ceil(duration_s * LibraryPages::kFramesPerS)));
    Json roots = Json::array();
    Json rotations = Json::array();
    Json times = Json::array();
    for (int f = 0; f <= last; ++f) {
      const double time_s = std::min(duration_s, f / LibraryPages::kFramesPerS);
      EvaluateBlend(group_, library_.layout(), movement_, time_s, cache_, pose_);
      times.push_back(Round(time_s));
      for (int k = 0; k < 3; ++k) roots.push_back(Round(pose_.root_position_m[k]));
      for (const Quat& q : pose_.rotations) {
        for (const float value : {q.x, q.y, q.z, q.w}) rotations.push_back(Round(value));
      }
    }
    double weight_sum = 0.0;
    for (const float w : movement_.weights) weight_sum += std::fabs(w);
    return {{"times_s", times},
            {"roots_m", roots},
            {"rotations", rotations},
            {"keytimes_s", List(movement_.warp.Keytimes())},
            {"heading_change_rad", Round(movement_.heading_change_rad)},
            {"weights", List(movement_.weights)},
            {"weight_sum", Round(weight_sum)}};
  }

 private:
  const MotionLibrary& library_;
  int group_index_;
  const MotionGroup& group_;
  CorrectionScratch scratch_;
  GridCache cache_;
  Pose pose_;
  Movement movement_;
  std::array<double, kMaxParameters> metric_{};
};

HttpAnswer SkeletonPage(const MotionLibrary& library) {
  const Skeleton& skeleton = library.skeleton();
  Json names = Json::array();
  Json parents = Json::array();
  Json offsets = Json::array();
  for (const Joint& joint : skeleton.joints) {
    names.push_back(joint.name);
    parents.push_back(joint.parent);
    for (int k = 0; k < 3; ++k) offsets.push_back(Round(joint.offset_m[k]));
  }
  Json ends = Json::array();
  for (const EndSite& site : skeleton.end_sites) {
    ends.push_back({{"joint", site.joint}, {"offset_m", Triple(site.offset_m)}});
  }
  Json legs = Json::array();
  for (const Leg& leg : skeleton.legs) {
    legs.push_back({{"hip", leg.hip},
                    {"knee", leg.knee},
                    {"ankle", leg.ankle},
                    {"ball", leg.ball},
                    {"ball_offset_m", Triple(leg.ball_offset_m)},
                    {"toe_tip_offset_m", Triple(leg.toe_tip_offset_m)}});
  }
  return JsonAnswer({{"names", names},
                     {"parents", parents},
                     {"offsets_m", offsets},
                     {"end_sites", ends},
                     {"legs", legs}});
}

HttpAnswer SummaryPage(const std::shared_ptr<const MotionLibrary>& library) {
  return JsonAnswer({{"summary", SummaryToJson(Summarize(*library))},
                     {"self_check", SelfCheckToJson(CheckLibrary(library))}});
}

HttpAnswer SitesPage(const MotionGroup& group) {
  Json parameters = Json::array();
  for (const Parameter& parameter : group.parameters) {
    parameters.push_back({{"name", ParameterText(parameter.name)},
                          {"min", Round(parameter.min)},
                          {"max", Round(parameter.max)}});
  }
  Json sites = Json::array();
  for (int s = 0; s < group.site_count; ++s) {
    Json site = {{"p", List(group.site(s))}, {"is_example", s < group.example_count}};
    if (s < group.example_count) {
      site["source"] = std::string(group.sources[static_cast<std::size_t>(s)]);
      site["mirrored"] = group.mirrored[static_cast<std::size_t>(s)] != 0;
    }
    sites.push_back(std::move(site));
  }
  return JsonAnswer(
      {{"kind", MovementKindName(group.kind)}, {"parameters", parameters}, {"sites", sites}});
}

HttpAnswer StepPage(const MotionLibrary& library, int group_index, std::string_view query) {
  const MotionGroup& group = library.group(group_index);
  const auto wanted = Parameters(query, group);
  if (!wanted) return Refuse(wanted.error());
  const auto is_corrected = Correction(query);
  if (!is_corrected) return Refuse(is_corrected.error());
  MovementPreview preview(library, group_index);
  ParameterValues applied;
  ParameterValues inside;
  preview.Project(*wanted, kHullGrowth, applied);
  const bool extrapolated = preview.Project(*wanted, 0.0, inside) > 1e-6;
  const double uncorrected_m = preview.Error(applied, false);
  const int iterations = preview.ComputeWeights(applied, *is_corrected);
  const ParameterValues measured = preview.Start();
  Json json = {{"requested", List(Span(*wanted))},
               {"applied", List(Span(applied))},
               {"measured", List(Span(measured))},
               {"error_m", LargestDifference(group, applied, measured)},
               {"uncorrected_error_m", uncorrected_m},
               {"iterations", iterations},
               {"extrapolated", extrapolated}};
  json.update(preview.Frames());
  return JsonAnswer(json);
}

HttpAnswer ExamplePage(const MotionLibrary& library, int group_index, std::string_view query) {
  const MotionGroup& group = library.group(group_index);
  const auto index = IndexOf(query, "index", group.example_count);
  if (!index) return Refuse(index.error());
  ParameterValues p;
  p.count = group.parameter_count();
  std::ranges::copy(group.site(*index), p.values.begin());
  MovementPreview preview(library, group_index);
  preview.ComputeWeights(p, false);
  const ParameterValues measured = preview.Start();
  Json json = {{"applied", List(Span(p))}, {"measured", List(Span(measured))}};
  json.update(preview.Frames());
  return JsonAnswer(json);
}

HttpAnswer ErrorsPage(const MotionLibrary& library, int group_index, std::string_view query) {
  const MotionGroup& group = library.group(group_index);
  const auto held = Parameters(query, group);
  const auto x = IndexOf(query, "x", group.parameter_count());
  const auto y = IndexOf(query, "y", group.parameter_count());
  int cells = 0;
  const auto cells_text = ValueOf(query, "cells");
  const bool has_cells =
      cells_text && Parse(*cells_text, cells) && cells >= 2 && cells <= LibraryPages::kMaxCells;
  const auto is_corrected = Correction(query);
  if (!held) return Refuse(held.error());
  for (const auto* index : {&x, &y}) {
    if (!*index) return Refuse(index->error());
  }
  if (!is_corrected) return Refuse(is_corrected.error());
  if (!has_cells) return Refuse(400, "cells: expected 2 to 64");
  MovementPreview preview(library, group_index);
  const Parameter& px = group.parameters[static_cast<std::size_t>(*x)];
  const Parameter& py = group.parameters[static_cast<std::size_t>(*y)];
  const auto range = [](const Parameter& parameter) {
    const double grown = kHullGrowth * (parameter.max - parameter.min);
    return std::pair(parameter.min - grown, parameter.max + grown);
  };
  const auto [x0, x1] = range(px);
  const auto [y0, y1] = range(py);
  Json errors = Json::array();  // At the centres of cells, row by row. Null: out of range.
  double largest_m = 0.0;
  for (int row = 0; row < cells; ++row) {
    for (int column = 0; column < cells; ++column) {
      ParameterValues p = *held;
      p.values[static_cast<std::size_t>(*y)] = y0 + (row + 0.5) / cells * (y1 - y0);
      p.values[static_cast<std::size_t>(*x)] = x0 + (column + 0.5) / cells * (x1 - x0);
      ParameterValues nearest;
      if (preview.Project(p, kHullGrowth, nearest) > 1e-6) {
        errors.push_back(nullptr);
        continue;
      }
      const double error_m = preview.Error(p, *is_corrected);
      largest_m = std::max(largest_m, error_m);
      errors.push_back(Round(error_m * 1e3));
    }
  }
  return JsonAnswer({{"x", {Round(x0), Round(x1)}},
                     {"y", {Round(y0), Round(y1)}},
                     {"cells", cells},
                     {"errors_mm", errors},
                     {"largest_m", largest_m}});
}

}  // namespace

void LibraryPages::Add(std::string name, std::shared_ptr<const MotionLibrary> library) {
  const std::string hash = library->hash();
  libraries_.try_emplace(hash, std::move(name), std::move(library));
}

HttpAnswer LibraryPages::List() const {
  Json libraries = Json::array();
  for (const auto& [hash, entry] : libraries_) {
    Json groups = Json::array();
    for (const MotionGroup& group : entry.library->groups()) {
      Json parameters = Json::array();
      for (const Parameter& parameter : group.parameters) {
        parameters.push_back(ParameterText(parameter.name));
      }
      groups.push_back({{"kind", MovementKindName(group.kind)},
                        {"parameters", parameters},
                        {"examples", group.example_count},
                        {"pseudoexamples", group.site_count - group.example_count}});
    }
    libraries.push_back({{"name", entry.name}, {"hash", hash}, {"groups", groups}});
  }
  return JsonAnswer(libraries);
}

std::optional<HttpAnswer> LibraryPages::Answer(const HttpQuery& query) const {
  std::string_view rest = query.path;
  if (rest == "/libraries.json") return List();
  constexpr std::string_view kFolder = "/libraries/";
  if (!rest.starts_with(kFolder)) return std::nullopt;
  rest.remove_prefix(kFolder.size());
  const std::string_view hash = rest.substr(0, rest.find('/'));
  const auto entry = libraries_.find(hash);
  if (entry == libraries_.end()) return Refuse(404, "no library has this hash");
  const MotionLibrary& library = *entry->second.library;
  rest.remove_prefix(std::min(rest.size(), hash.size() + 1));
  if (rest == "skeleton.json") return SkeletonPage(library);
  if (rest == "summary.json") return SummaryPage(entry->second.library);
  const std::string_view number = rest.substr(0, rest.find('/'));
  rest.remove_prefix(std::min(rest.size(), number.size() + 1));
  int group = -1;
  if (!Parse(number, group) || group < 0 || group >= static_cast<int>(library.groups().size())) {
    return Refuse(404, "the library has no such page or group");
  }
  if (rest == "sites.json") return SitesPage(library.group(group));
  if (rest == "step.json") return StepPage(library, group, query.fields);
  if (rest == "example.json") return ExamplePage(library, group, query.fields);
  if (rest == "errors.json") return ErrorsPage(library, group, query.fields);
  return Refuse(404, "the library has no such page or group");
}

}  // namespace stridewire::server
