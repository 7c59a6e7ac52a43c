#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <future>
#include <optional>
#include <sstream>

#include "command_line.h"
#include "commands.h"
#include "library_json.h"
#include "offline/extract/assemble.h"
#include "progress.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/library_builder.h"

namespace stridewire {
namespace {

using Json = nlohmann::ordered_json;

std::optional<BvhAxis> ParseAxis(const std::string& text) {
  const std::pair<const char*, BvhAxis> axes[] = {
      {"x", BvhAxis::kPlusX}, {"+x", BvhAxis::kPlusX}, {"-x", BvhAxis::kMinusX},
      {"y", BvhAxis::kPlusY}, {"+y", BvhAxis::kPlusY}, {"-y", BvhAxis::kMinusY},
      {"z", BvhAxis::kPlusZ}, {"+z", BvhAxis::kPlusZ}, {"-z", BvhAxis::kMinusZ}};
  for (const auto& [name, axis] : axes) {
    if (text == name) return axis;
  }
  return std::nullopt;
}

Json FileToJson(const Extraction& extraction) {
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
          {"error", extraction.error.empty() ? Json(nullptr) : Json(extraction.error)}};
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

void PrintFile(const Extraction& extraction) {
  if (!extraction.error.empty()) {
    // PrintError has already printed the reason on stderr.
    std::printf("%s: left out\n", extraction.path.c_str());
    return;
  }
  std::printf("%s: %d frames at %.0f per second; %d left and %d right steps, %d jumps\n",
              extraction.path.c_str(), extraction.frames, extraction.fps, extraction.steps_left,
              extraction.steps_right, extraction.jumps);
  for (const std::string& note : extraction.notes) std::printf("  note: %s\n", note.c_str());
  for (const RejectedTime& time : extraction.rejected) {
    std::printf("  rejected %.2f-%.2f s: %s\n", time.from_s, time.to_s, time.reason.c_str());
  }
}

// Translates an option name of the BVH reader to that of the command line: unit_m to --unit-m.
Error NameOption(Error error) {
  for (const char* field :
       {"unit_m", "fps", "left_ankle", "right_ankle", "left_ball", "right_ball"}) {
    if (error.where != field) continue;
    std::string option = std::string("--") + field;
    std::replace(option.begin(), option.end(), '_', '-');
    error.where = option;
    break;
  }
  return error;
}

// Returns why a file was left out, in a sentence that begins with its path.
std::string WithPath(const Extraction& extraction) {
  return extraction.error.starts_with(extraction.path) ? extraction.error
                                                       : extraction.path + ": " + extraction.error;
}

// Parses "step,jump". Returns an error message, or an empty string on success.
std::string ParseKinds(const std::string& kinds, AssembleOptions& options) {
  options.steps = options.jumps = false;
  std::istringstream list(kinds);
  for (std::string kind; std::getline(list, kind, ',');) {
    if (kind == "step") {
      options.steps = true;
    } else if (kind == "jump") {
      options.jumps = true;
    } else {
      return "--kinds: expected step, jump or both separated by a comma, got \"" + kind + "\"";
    }
  }
  return options.steps || options.jumps ? "" : "--kinds: expected step or jump, got nothing";
}

}  // namespace

int RunBuild(const BuildCommand& command) {
  AssembleOptions options;
  options.mirror = command.mirror;
  options.unsettled_jumps = command.all;
  if (const std::string wrong = ParseKinds(command.kinds, options); !wrong.empty()) {
    return PrintError(wrong);
  }
  for (const std::string& path : command.files) {
    if (IsSameFile(command.out, path)) {
      return PrintError("--out: " + command.out +
                        " is also an input file; choose another output path");
    }
  }
  if (Status status = CheckOutputFile(command.out); !status) {
    return PrintOutputError(status.error());
  }
  BvhReadOptions read;
  read.unit_m = command.unit_m;
  read.fps = command.fps;
  if (!command.up.empty()) {
    read.up = ParseAxis(command.up);
    if (!read.up) {
      return PrintError("--up: expected x, y, z, -x, -y or -z, got \"" + command.up + "\"");
    }
  }
  read.left_ankle = command.left_ankle;
  read.right_ankle = command.right_ankle;
  read.left_ball = command.left_ball;
  read.right_ball = command.right_ball;

  if (command.left_ankle.empty() != command.right_ankle.empty()) {
    return PrintError("--left-ankle and --right-ankle: set both options or neither");
  }

  const InterruptSignal interrupt_signal;
  Progress progress("building");
  const char* const stopped = "interrupted; no file written";
  LibraryAssembler assembler(options);
  Json files = Json::array();
  // Reads the next file while the assembler extracts movements from the current one.
  const auto start_reading = [&](std::size_t i) {
    return i < command.files.size()
               ? std::async(
                     std::launch::async,
                     [&read, &path = command.files[i]] { return ReadBvh(path, read); })
               : std::future<Expected<Capture>>();
  };
  std::future<Expected<Capture>> reading = start_reading(0);
  for (std::size_t i = 0; i < command.files.size(); ++i) {
    const std::string& path = command.files[i];
    progress.Update(static_cast<double>(i) / static_cast<double>(command.files.size() + 1));
    const auto capture = reading.get();
    reading = start_reading(i + 1);
    if (InterruptSignal::IsRaised()) return PrintError(stopped, kExitFailure);
    Extraction unreadable;
    if (!capture) {
      unreadable.path = path;
      unreadable.error = Describe(NameOption(capture.error()));
    }
    const Extraction& extraction = capture ? assembler.Add(*capture) : unreadable;
    files.push_back(FileToJson(extraction));
    progress.Clear();
    if (!command.json) PrintFile(extraction);
    if (!extraction.error.empty()) {
      PrintError(WithPath(extraction));
    }
  }

  progress.Update(static_cast<double>(command.files.size()) /
                  static_cast<double>(command.files.size() + 1));
  const auto raw = assembler.Assemble();
  if (!raw) return PrintInputError(raw.error());
  LibraryBuilder builder = command.all ? LibraryBuilder() : LibraryBuilder::Selecting();
  if (!command.all) builder.selection.max_pose_error_m = command.max_pose_error_m;
  const auto library = builder.Build(*raw);
  progress.Clear();
  if (!library) return PrintInputError(library.error());
  if (InterruptSignal::IsRaised()) return PrintError(stopped, kExitFailure);
  if (Status status = WriteFile(command.out, (*library)->bytes()); !status) {
    return PrintOutputError(status.error());
  }
  if (command.json) {
    Json json;
    json["files"] = std::move(files);
    json["selection"] = SelectionToJson(builder.selections);
    json["library"] = LibraryToJson(**library, false);
    std::printf("%s\n", Dump(json).c_str());
    return kExitSuccess;
  }
  std::printf("\n%s: %zu bytes\n", command.out.c_str(), (*library)->bytes().size());
  for (std::size_t g = 0; g < (*library)->groups().size(); ++g) {
    const MotionGroup& group = (*library)->groups()[g];
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
  return kExitSuccess;
}

}  // namespace stridewire
