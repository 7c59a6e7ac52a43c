#include "library_json.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <limits>

#include "offline/build/interpolation_error.h"
#include "offline/build/refine.h"
#include "runtime/library/transition.h"
#include "runtime/skeleton/layer_clip.h"

namespace stridewire {
namespace {

using Json = nlohmann::ordered_json;

struct DurationRange {
  double min = std::numeric_limits<double>::infinity();
  double max = 0.0;
};

DurationRange DurationsOf(const MotionGroup& group) {
  DurationRange range;
  const auto keys = static_cast<std::size_t>(group.interval_count() + 1);
  for (std::size_t e = 0; e < static_cast<std::size_t>(group.example_count); ++e) {
    const double duration_s = group.keytimes_s[e * keys + keys - 1];
    range.min = std::min(range.min, duration_s);
    range.max = std::max(range.max, duration_s);
  }
  return range;
}

void AddSites(const MotionGroup& group, Json& json) {
  Json sites = Json::array();
  const auto n = static_cast<std::size_t>(group.example_count);
  const auto keys = static_cast<std::size_t>(group.interval_count() + 1);
  for (std::size_t s = 0; s < static_cast<std::size_t>(group.site_count); ++s) {
    const bool is_example = s < n;
    Json site;
    site["parameters"] = group.site(static_cast<int>(s));
    site["source"] = is_example ? Json(group.sources[s]) : Json(nullptr);
    site["mirrored"] = is_example && group.mirrored[s] != 0;
    site["keytimes_s"] =
        is_example ? Json(group.keytimes_s.subspan(s * keys, keys)) : Json(nullptr);
    site["pseudoexample"] = !is_example;
    site["weights"] = is_example ? Json(nullptr) : Json(group.site_weights.subspan((s - n) * n, n));
    sites.push_back(std::move(site));
  }
  json["sites"] = std::move(sites);
  json["dilations"] = group.dilations;
  json["radius_factor"] = group.radius_factor;
  Json centre = Json::array();
  for (const Parameter& parameter : group.parameters) centre.push_back(parameter.centre);
  json["centre"] = std::move(centre);
}

}  // namespace

std::string Dump(const Json& json) {
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

Json ParametersToJson(const MotionGroup& group, const ParameterValues& values) {
  Json json = Json::object();
  for (std::size_t l = 0; l < group.parameters.size(); ++l) {
    json[std::string(ParameterText(group.parameters[l].name))] = values.values[l];
  }
  return json;
}

Json BaseToJson(const BaseFrame& base) {
  return {{"position_m", {base.position_m.x, base.position_m.y, base.position_m.z}},
          {"heading_rad", base.heading_rad}};
}

Json LibraryToJson(const MotionLibrary& library, bool examples) {
  Json json;
  json["format_version"] = MotionLibrary::kFormatVersion;
  json["hash"] = library.hash();
  json["bytes"] = library.bytes().size();
  const Skeleton& skeleton = library.skeleton();
  Json names = Json::array();
  for (const Joint& joint : skeleton.joints) names.push_back(joint.name);
  const auto ball_name = [&](Foot foot) {
    return skeleton.joints[static_cast<std::size_t>(skeleton.leg(foot).ball)].name;
  };
  json["skeleton"] = {{"joints", skeleton.joint_count()},
                      {"names", std::move(names)},
                      {"left_foot", ball_name(Foot::kLeft)},
                      {"right_foot", ball_name(Foot::kRight)}};
  Json groups = Json::array();
  for (std::size_t g = 0; g < library.groups().size(); ++g) {
    const MotionGroup& group = library.groups()[g];
    Json entry;
    entry["kind"] = MovementKindName(group.kind);
    entry["examples"] = group.example_count;
    entry["pseudoexamples"] = group.site_count - group.example_count;
    entry["variants"] = group.variant_count;
    Json parameters = Json::array();
    for (const Parameter& parameter : group.parameters) {
      parameters.push_back({{"name", ParameterText(parameter.name)},
                            {"min", parameter.min},
                            {"max", parameter.max},
                            {"scale", parameter.scale}});
    }
    entry["parameters"] = std::move(parameters);
    const DurationRange durations = DurationsOf(group);
    entry["duration_s"] = {{"min", durations.min}, {"max", durations.max}};
    const InterpolationError error = MeasureInterpolationError(library, static_cast<int>(g));
    entry["error_m"] = {{"max", error.max_m},
                        {"mean", error.mean_m},
                        {"min", error.min_m},
                        {"samples", error.samples}};
    entry["corrected_error_m"] = {{"max", error.corrected_max_m},
                                  {"mean", error.corrected_mean_m},
                                  {"iterations", error.iterations}};
    const GroupQuality plain = MeasureGroupQuality(library, static_cast<int>(g), false);
    const bool is_refined = group.site_count > group.example_count;
    const GroupQuality quality =
        is_refined ? MeasureGroupQuality(library, static_cast<int>(g), true) : plain;
    entry["weights"] = {{"sum_max", quality.weight_sum_max}, {"condition", quality.condition}};
    if (is_refined) {
      entry["unrefined_error_m"] = {
          {"max", plain.max_error_m}, {"mean", plain.mean_error_m}, {"min", plain.min_error_m}};
    }
    if (examples) AddSites(group, entry);
    groups.push_back(std::move(entry));
  }
  json["groups"] = std::move(groups);
  json["layers"] = LayersToJson(library);
  json["transitions"] = TransitionsToJson(library);
  return json;
}

namespace {

// Returns "group 4, 16_01.bvh 0.93-1.47 s" or "stand".
std::string ExampleText(const MotionLibrary& library, std::size_t node, int example) {
  if (node == library.groups().size()) return "stand";
  const MotionGroup& group = library.groups()[node];
  const auto e = static_cast<std::size_t>(example);
  return "group " + std::to_string(node) + ", " + std::string(group.sources[e]) +
         (group.mirrored[e] != 0 ? " (mirrored)" : "");
}

std::string_view NodeKind(const MotionLibrary& library, std::size_t node) {
  return MovementKindName(node == library.groups().size() ? MovementKind::kStand
                                                          : library.groups()[node].kind);
}

}  // namespace

Json TransitionsToJson(const MotionLibrary& library) {
  Json transitions = Json::array();
  const std::size_t nodes = library.groups().size() + 1;
  for (std::size_t i = 0; i < library.transitions().size(); ++i) {
    const Transition& t = library.transitions()[i];
    const auto node_to_json = [&](std::size_t node) {
      return node + 1 == nodes ? Json(nullptr) : Json(node);
    };
    transitions.push_back({{"from", NodeKind(library, i / nodes)},
                           {"from_group", node_to_json(i / nodes)},
                           {"to", NodeKind(library, i % nodes)},
                           {"to_group", node_to_json(i % nodes)},
                           {"distance_m", t.distance_m},
                           {"end", ExampleText(library, i / nodes, t.end_example)},
                           {"start", ExampleText(library, i % nodes, t.start_example)}});
  }
  return transitions;
}

void PrintTransitions(const MotionLibrary& library, bool examples) {
  if (library.transitions().empty()) {
    std::printf("\nno transitions (the library was built by an older version)\n");
    return;
  }
  // Several groups may have the same kind: print the best transition between any of them.
  const std::size_t nodes = library.groups().size() + 1;
  constexpr std::array kKinds{MovementKind::kStepLeft, MovementKind::kStepRight,
                              MovementKind::kJump, MovementKind::kStand};
  std::printf("\nbest transition between each two kinds, distance of the poses in metres:\n");
  for (const MovementKind from : kKinds) {
    for (const MovementKind to : kKinds) {
      if (from == to && from == MovementKind::kStand) continue;
      const Transition* best = nullptr;
      std::size_t best_at = 0;
      for (std::size_t i = 0; i < library.transitions().size(); ++i) {
        const Transition& t = library.transitions()[i];
        if (NodeKind(library, i / nodes) != MovementKindName(from) ||
            NodeKind(library, i % nodes) != MovementKindName(to) ||
            (best != nullptr && best->distance_m <= t.distance_m)) {
          continue;
        }
        best = &t;
        best_at = i;
      }
      if (best == nullptr) continue;
      std::printf("  %-10s to %-10s %6.3f m", std::string(MovementKindName(from)).c_str(),
                  std::string(MovementKindName(to)).c_str(), best->distance_m);
      if (examples) {
        std::printf("  %s; %s", ExampleText(library, best_at / nodes, best->end_example).c_str(),
                    ExampleText(library, best_at % nodes, best->start_example).c_str());
      }
      std::printf("\n");
    }
  }
}

Json LayersToJson(const MotionLibrary& library) {
  Json layers = Json::array();
  for (const LayerClip& layer : library.layers()) {
    Json mask = Json::object();
    for (std::size_t i = 0; i < layer.joints.size(); ++i) {
      mask[library.skeleton().joints[static_cast<std::size_t>(layer.joints[i])].name] =
          layer.weights[i];
    }
    layers.push_back({{"name", layer.name},
                      {"source", layer.source},
                      {"loop", layer.is_looping},
                      {"duration_s", layer.duration_s()},
                      {"keys", layer.frame_count()},
                      {"mask", std::move(mask)}});
  }
  return layers;
}

void PrintLayers(const MotionLibrary& library) {
  for (const LayerClip& layer : library.layers()) {
    std::printf(
        "layer %s: %.2f s, %s, %zu joints from %s on, source: %s\n",
        std::string(layer.name).c_str(), layer.duration_s(),
        layer.is_looping ? "looping" : "plays once", layer.joints.size(),
        library.skeleton().joints[static_cast<std::size_t>(layer.joints.front())].name.c_str(),
        std::string(layer.source).c_str());
  }
}

}  // namespace stridewire
