#include <cstdio>

#include "command_line.h"
#include "commands.h"
#include "library_json.h"
#include "patience.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/offline/refine.h"

namespace stridewire {
namespace {

using Json = nlohmann::ordered_json;

Json QualityToJson(const GroupQuality& quality) {
  return {{"error_m",
           {{"min", quality.min_error_m},
            {"mean", quality.mean_error_m},
            {"max", quality.max_error_m}}},
          {"weight_sum_max", quality.weight_sum_max},
          {"condition", quality.condition}};
}

Json GroupToJson(const MotionGroup& group, const GroupRefinement& refined, int samples) {
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

void PrintGroup(std::size_t index, const MotionGroup& group, const GroupRefinement& refined) {
  std::printf("group %zu: %s, %d examples, %d parameters, %d pseudoexamples (%s)\n", index,
              std::string(MovementKindName(group.kind)).c_str(), group.example_count,
              group.parameter_count(), group.site_count - group.example_count,
              refined.end == RefineEnd::kErrorReached   ? "error reached"
              : refined.end == RefineEnd::kCountReached ? "no more allowed"
                                                        : "no further one helps");
  const auto print = [](const char* when, const GroupQuality& quality) {
    std::printf(
        "  %-7s misses by %.2f mm at most, %.2f mm in the mean; |w| sum to %.2f at most, "
        "condition %.1f\n",
        when, 1000.0 * quality.max_error_m, 1000.0 * quality.mean_error_m, quality.weight_sum_max,
        quality.condition);
  };
  print("before", refined.before);
  print("after", refined.after);
  if (group.site_count > group.example_count) {
    std::printf("  at pseudoexamples by %.5f mm\n", 1000.0 * refined.pseudoexample_error_m);
  }
}

}  // namespace

int RunRefine(const RefineCommand& command) {
  const Interrupt interrupt;
  if (IsSameFile(command.out, command.library)) {
    return Complain("--out: " + command.out + " is the library to refine");
  }
  if (Status status = CheckOutputFile(command.out); !status) {
    return ComplainOfOutput(status.error());
  }
  const auto library = OpenLibrary(command.library);
  if (!library) return ComplainOfInput(library.error());

  Progress progress("refining");
  RefineOptions options;
  options.rule = command.rule == "bare" ? RefineRule::kBare : RefineRule::kAmended;
  options.max_error_m = command.max_error_m;
  options.max_pseudoexamples = command.max_pseudoexamples;
  options.progress = [&](double done) {
    progress.Show(done);
    return !Interrupt::IsAsked();
  };
  const auto refined = Refine(*library, options);
  progress.Hide();
  if (Interrupt::IsAsked()) return Complain("stopped; nothing was written", kExitFailure);
  if (!refined) return ComplainOfInput(refined.error());
  if (Status status = WriteFile(command.out, refined->library->bytes()); !status) {
    return ComplainOfOutput(status.error());
  }

  if (command.json) {
    Json json;
    json["rule"] = command.rule;
    json["max_error_m"] = command.max_error_m;
    json["groups"] = Json::array();
    for (std::size_t g = 0; g < refined->groups.size(); ++g) {
      json["groups"].push_back(
          GroupToJson(refined->library->groups()[g], refined->groups[g], options.samples));
    }
    json["library"] = LibraryToJson(*refined->library, false);
    std::printf("%s\n", Dump(json).c_str());
    return kExitDone;
  }
  for (std::size_t g = 0; g < refined->groups.size(); ++g) {
    PrintGroup(g, refined->library->groups()[g], refined->groups[g]);
  }
  std::printf("%s: %zu bytes\n", command.out.c_str(), refined->library->bytes().size());
  return kExitDone;
}

}  // namespace stridewire
