#include <cstdio>

#include "command_line.h"
#include "commands.h"
#include "library_json.h"
#include "offline/inspect/inspect_json.h"
#include "stridewire/offline/open_library.h"
#include "summary_text.h"

namespace stridewire {

int RunInspect(const InspectCommand& command) {
  const auto library = OpenLibrary(command.library);
  if (!library) return PrintInputError(library.error());
  nlohmann::ordered_json json = LibraryToJson(**library, command.examples);
  const LibrarySummary summary = Summarize(**library);
  const SelfCheck check = CheckLibrary(*library);
  if (command.json) {
    json["summary"] = SummaryToJson(summary);
    json["self_check"] = SelfCheckToJson(check);
    std::printf("%s\n", Dump(json).c_str());
    return kExitSuccess;
  }
  std::printf("%s: format %d, %zu bytes, hash %s\n", command.library.c_str(),
              MotionLibrary::kFormatVersion, (*library)->bytes().size(),
              (*library)->hash().c_str());
  std::printf("skeleton: %d joints, feet %s and %s\n", (*library)->skeleton().joint_count(),
              json["skeleton"]["left_foot"].get<std::string>().c_str(),
              json["skeleton"]["right_foot"].get<std::string>().c_str());
  PrintLayers(**library);
  PrintSummary(summary);
  PrintSelfCheck(check);
  for (std::size_t g = 0; g < (*library)->groups().size(); ++g) {
    const MotionGroup& group = (*library)->groups()[g];
    const auto& entry = json["groups"][g];
    std::printf("\ngroup %zu: %s, %d examples, %.2f to %.2f s\n", g,
                entry["kind"].get<std::string>().c_str(), group.example_count,
                entry["duration_s"]["min"].get<double>(), entry["duration_s"]["max"].get<double>());
    for (const Parameter& parameter : group.parameters) {
      std::printf("  %-10s %7.3f to %7.3f\n", std::string(ParameterText(parameter.name)).c_str(),
                  parameter.min, parameter.max);
    }
    std::printf("  error %.1f mm max, %.1f mm mean (%d samples); %.2f mm max after correction\n",
                1000.0 * entry["error_m"]["max"].get<double>(),
                1000.0 * entry["error_m"]["mean"].get<double>(),
                entry["error_m"]["samples"].get<int>(),
                1000.0 * entry["corrected_error_m"]["max"].get<double>());
    std::printf("  sum of |w| %.2f max; condition %.1f\n",
                entry["weights"]["sum_max"].get<double>(),
                entry["weights"]["condition"].get<double>());
    if (group.variant_count > 0) {
      std::printf("  %d variants, blended only to vary equal steps\n", group.variant_count);
    }
    if (entry.contains("unrefined_error_m")) {
      std::printf("  %d pseudoexamples; without them error %.1f mm max, %.1f mm mean\n",
                  group.site_count - group.example_count,
                  1000.0 * entry["unrefined_error_m"]["max"].get<double>(),
                  1000.0 * entry["unrefined_error_m"]["mean"].get<double>());
    }
    if (!command.examples) continue;
    for (int e = 0; e < group.site_count; ++e) {
      std::printf("  %3d ", e);
      for (const double value : group.site(e)) std::printf(" %7.3f", value);
      if (e >= group.example_count) {
        std::printf("  pseudoexample\n");
        continue;
      }
      std::printf("  %s%s\n", std::string(group.sources[static_cast<std::size_t>(e)]).c_str(),
                  group.mirrored[static_cast<std::size_t>(e)] != 0 ? " (mirrored)" : "");
    }
  }
  PrintTransitions(**library, command.examples);
  return kExitSuccess;
}

}  // namespace stridewire
