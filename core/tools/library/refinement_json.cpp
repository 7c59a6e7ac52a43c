#include "refinement_json.h"

namespace stridewire {
using Json = nlohmann::ordered_json;

namespace {

Json QualityToJson(const GroupQuality& quality) {
  return {{"error_m",
           {{"min", quality.min_error_m},
            {"mean", quality.mean_error_m},
            {"max", quality.max_error_m}}},
          {"weight_sum_max", quality.weight_sum_max},
          {"condition", quality.condition}};
}

}  // namespace

Json RefinementToJson(const MotionGroup& group, const GroupRefinement& refined, int samples) {
  Json json;
  json["kind"] = MovementKindName(group.kind);
  json["examples"] = group.example_count;
  json["pseudoexamples"] = group.site_count - group.example_count;
  Json parameters = Json::array();
  for (const Parameter& parameter : group.parameters) {
    parameters.push_back(ParameterText(parameter.name));
  }
  json["parameters"] = std::move(parameters);
  json["samples"] = samples + group.example_count;
  json["before"] = QualityToJson(refined.before);
  json["after"] = QualityToJson(refined.after);
  json["pseudoexample_error_m"] = refined.pseudoexample_error_m;
  json["max_error_curve_m"] = refined.max_error_curve_m;
  json["radii"] = refined.radii == RadiusRule::kAllSites ? "all_sites" : "examples";
  json["radius_factor"] = refined.radius_factor;
  json["rejected"] = refined.rejected;
  json["end"] = RefineEndText(refined.end);
  return json;
}

}  // namespace stridewire
