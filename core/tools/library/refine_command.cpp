#include <cstdio>

#include "command_line.h"
#include "commands.h"
#include "library_json.h"
#include "offline/build/refine.h"
#include "progress.h"
#include "refinement_json.h"
#include "stridewire/offline/open_library.h"

namespace stridewire {
namespace {

void PrintGroup(std::size_t index, const MotionGroup& group, const GroupRefinement& refined) {
  std::printf("group %zu: %s, %d examples, %d parameters, %d pseudoexamples (%s)\n", index,
              std::string(MovementKindName(group.kind)).c_str(), group.example_count,
              group.parameter_count(), group.site_count - group.example_count,
              refined.end == RefineEnd::kErrorReached   ? "target error reached"
              : refined.end == RefineEnd::kCountReached ? "maximum number reached"
                                                        : "no further improvement");
  const auto print = [](const char* when, const GroupQuality& quality) {
    std::printf(
        "  %-7s error %.2f mm max, %.2f mm mean; sum of |w| %.2f max; "
        "condition %.1f\n",
        when, 1000.0 * quality.max_error_m, 1000.0 * quality.mean_error_m, quality.weight_sum_max,
        quality.condition);
  };
  print("before", refined.before);
  print("after", refined.after);
  if (group.site_count > group.example_count) {
    std::printf("  at pseudoexamples: error %.5f mm\n", 1000.0 * refined.pseudoexample_error_m);
  }
}

}  // namespace

int RunRefine(const RefineCommand& command) {
  const InterruptSignal interrupt_signal;
  if (IsSameFile(command.out, command.library)) {
    return PrintError("--out: " + command.out +
                      " is the input library; choose another output path");
  }
  if (Status status = CheckOutputFile(command.out); !status) {
    return PrintOutputError(status.error());
  }
  const auto library = OpenLibrary(command.library);
  if (!library) return PrintInputError(library.error());

  Progress progress("refining");
  RefineOptions options;
  options.rule = command.rule == "bare" ? RefineRule::kBare : RefineRule::kAmended;
  options.max_error_m = command.max_error_m;
  options.max_pseudoexamples = command.max_pseudoexamples;
  options.progress = [&](double done) {
    progress.Update(done);
    return !InterruptSignal::IsRaised();
  };
  const auto refined = Refine(*library, options);
  progress.Clear();
  if (InterruptSignal::IsRaised()) return PrintError("interrupted; no file written", kExitFailure);
  if (!refined) return PrintInputError(refined.error());
  if (Status status = WriteFile(command.out, refined->library->bytes()); !status) {
    return PrintOutputError(status.error());
  }

  if (command.json) {
    nlohmann::ordered_json json;
    json["rule"] = command.rule;
    json["max_error_m"] = command.max_error_m;
    json["groups"] = nlohmann::ordered_json::array();
    for (std::size_t g = 0; g < refined->groups.size(); ++g) {
      json["groups"].push_back(
          RefinementToJson(refined->library->groups()[g], refined->groups[g], options.samples));
    }
    json["library"] = LibraryToJson(*refined->library, false);
    std::printf("%s\n", Dump(json).c_str());
    return kExitSuccess;
  }
  for (std::size_t g = 0; g < refined->groups.size(); ++g) {
    PrintGroup(g, refined->library->groups()[g], refined->groups[g]);
  }
  std::printf("%s: %zu bytes\n", command.out.c_str(), refined->library->bytes().size());
  return kExitSuccess;
}

}  // namespace stridewire
