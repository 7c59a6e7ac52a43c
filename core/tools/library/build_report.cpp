#include "build_report.h"

#include <cstdio>

#include "command_line.h"
#include "library_json.h"
#include "offline/inspect/empty_file.h"
#include "offline/inspect/inspect_json.h"
#include "summary_text.h"

namespace stridewire {
namespace {

using Json = nlohmann::ordered_json;

Json TextOrNull(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

Json FileToJson(const Extraction& extraction, const std::string& reason) {
  Json rejected = Json::array();
  for (const RejectedTime& time : extraction.rejected) {
    rejected.push_back({{"from_s", time.from_s}, {"to_s", time.to_s}, {"reason", time.reason}});
  }
  return {{"path", extraction.path},
          {"frames", extraction.frames},
          {"fps", extraction.fps},
          {"unit_m", extraction.unit_m},
          {"steps_left", extraction.steps_left},
          {"steps_right", extraction.steps_right},
          {"jumps", extraction.jumps},
          {"rejected", std::move(rejected)},
          {"notes", extraction.notes},
          {"reason", TextOrNull(reason)},
          {"error", TextOrNull(extraction.error)}};
}

Json SelectionToJson(const std::vector<GroupSelection>& selections) {
  Json groups = Json::array();
  for (const GroupSelection& selection : selections) {
    Json group = {{"group", selection.group},
                  {"kind", std::string(MovementKindName(selection.kind))},
                  {"found", selection.examples.size()},
                  {"ridge", selection.ridge},
                  {"ridge_radius", selection.ridge_radius}};
    for (const ExampleFate fate : {ExampleFate::kKept, ExampleFate::kAveraged,
                                   ExampleFate::kRedundant, ExampleFate::kOutlier}) {
      group[std::string(ExampleFateName(fate))] = selection.Count(fate);
    }
    Json examples = Json::array();
    for (const SelectedExample& example : selection.examples) {
      const bool is_out = example.example < 0;
      examples.push_back({{"source", example.source},
                          {"mirrored", example.mirrored},
                          {"fate", std::string(ExampleFateName(example.fate))},
                          {"example", is_out ? Json(nullptr) : Json(example.example)},
                          {"error_m", is_out ? Json(example.error_m) : Json(nullptr)},
                          {"reason", example.reason}});
    }
    group["examples"] = std::move(examples);
    groups.push_back(std::move(group));
  }
  return groups;
}

void PrintFile(const Extraction& extraction, const std::string& reason) {
  if (!extraction.error.empty()) {
    // PrintError has already printed the reason on stderr.
    std::printf("%s: left out\n", extraction.path.c_str());
    return;
  }
  std::printf("%s: %d frames at %.0f per second; %d left and %d right steps, %d jumps\n",
              extraction.path.c_str(), extraction.frames, extraction.fps, extraction.steps_left,
              extraction.steps_right, extraction.jumps);
  if (!reason.empty()) std::printf("  nothing to use: %s\n", reason.c_str());
  for (const std::string& note : extraction.notes) std::printf("  note: %s\n", note.c_str());
  for (const RejectedTime& time : extraction.rejected) {
    std::printf("  rejected %.2f-%.2f s: %s\n", time.from_s, time.to_s, time.reason.c_str());
  }
}

// Returns why a file was left out, in a sentence that begins with its path.
std::string WithPath(const Extraction& extraction) {
  return extraction.error.starts_with(extraction.path) ? extraction.error
                                                       : extraction.path + ": " + extraction.error;
}

}  // namespace

BuildReport::BuildReport(bool as_json) : as_json_(as_json) {
  json_["error"] = nullptr;
  json_["files"] = Json::array();
  for (const char* key : {"completion", "summary", "self_check"}) json_[key] = nullptr;
  json_["notes"] = Json::array();
  json_["selection"] = Json::array();
  json_["library"] = nullptr;
}

void BuildReport::AddFile(const Extraction& extraction, const AssembleOptions& options) {
  const std::string reason = ReasonForNoMovements(extraction, options.steps, options.jumps);
  json_["files"].push_back(FileToJson(extraction, reason));
  if (!as_json_) PrintFile(extraction, reason);
  if (!extraction.error.empty()) PrintError(WithPath(extraction));
}

void BuildReport::AddCompletion(const Completion& completion) {
  const std::vector<std::string> sentences = DescribeCompletion(completion);
  json_["completion"] = {{"sentences", sentences},
                         {"lacking", completion.lacking},
                         {"examples", completion.example_count},
                         {"composed_stand", completion.has_composed_stand}};
  if (as_json_) return;
  std::printf("\nCompletion:\n");
  for (const std::string& sentence : sentences) std::printf("  %s\n", sentence.c_str());
}

void BuildReport::AddLibrary(const std::string& path,
                             const std::shared_ptr<const MotionLibrary>& library,
                             const LibraryBuilder& builder, bool skips_self_check) {
  const LibrarySummary summary = Summarize(*library);
  std::optional<SelfCheck> check;
  if (!skips_self_check) check = CheckLibrary(library);
  if (as_json_) {
    json_["summary"] = SummaryToJson(summary);
    if (check) json_["self_check"] = SelfCheckToJson(*check);
    for (const LibraryBuilder::Note& note : builder.notes) {
      json_["notes"].push_back({{"group", note.group}, {"text", note.text}});
    }
    json_["selection"] = SelectionToJson(builder.selections);
    json_["library"] = LibraryToJson(*library, false);
    return;
  }
  std::printf("\n%s: %zu bytes\n", path.c_str(), library->bytes().size());
  for (std::size_t g = 0; g < library->groups().size(); ++g) {
    const MotionGroup& group = library->groups()[g];
    std::printf("  group %zu: %s, %d examples, parameters", g,
                std::string(MovementKindName(group.kind)).c_str(), group.example_count);
    for (const Parameter& parameter : group.parameters) {
      std::printf(" %s", std::string(ParameterText(parameter.name)).c_str());
    }
    std::printf("\n");
  }
  for (const LibraryBuilder::Note& note : builder.notes) {
    std::printf("  group %d: %s\n", note.group, note.text.c_str());
  }
  PrintSummary(summary);
  if (check) PrintSelfCheck(*check);
}

int BuildReport::Fail(const std::string& sentence, int exit_code) {
  json_["error"] = sentence;
  if (as_json_) std::printf("%s\n", Dump(json_).c_str());
  return PrintError(sentence, exit_code);
}

int BuildReport::Succeed() {
  if (as_json_) std::printf("%s\n", Dump(json_).c_str());
  return kExitSuccess;
}

}  // namespace stridewire
