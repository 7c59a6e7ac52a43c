#include <algorithm>
#include <future>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "build_report.h"
#include "command_line.h"
#include "commands.h"
#include "offline/capture/conventions.h"
#include "offline/complete/complete_library.h"
#include "offline/extract/assemble.h"
#include "progress.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/library_builder.h"

namespace stridewire {
namespace {

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

// The files of a build in the order of the command line, and the movements found in them.
struct Captures {
  explicit Captures(const AssembleOptions& options) : assembler(options) {}

  LibraryAssembler assembler;  // Contains the readable files only.
  // Files that cannot be read. Only their path and error are set.
  std::vector<Extraction> unreadable;
  std::vector<bool> is_readable;             // Of each file.
  std::vector<FileConventions> conventions;  // Conventions of the readable files.
};

// Reads each file with its own options. Returns nullopt if the user interrupts the program.
std::optional<Captures> ReadCaptures(const std::vector<std::string>& paths,
                                     const std::vector<BvhReadOptions>& read,
                                     const AssembleOptions& options, Progress& progress) {
  Captures captures(options);
  // Reads the next file while the assembler extracts movements from the current one.
  const auto start_reading = [&](std::size_t i) {
    return i < paths.size()
               ? std::async(
                     std::launch::async, [&read, &paths, i] { return ReadBvh(paths[i], read[i]); })
               : std::future<Expected<Capture>>();
  };
  std::future<Expected<Capture>> reading = start_reading(0);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    progress.Update(static_cast<double>(i) / static_cast<double>(paths.size() + 1));
    const auto capture = reading.get();
    reading = start_reading(i + 1);
    if (InterruptSignal::IsRaised()) return std::nullopt;
    captures.is_readable.push_back(capture.has_value());
    if (capture) {
      captures.conventions.push_back(ConventionsOf(*capture));
      captures.assembler.Add(*capture);
    } else {
      captures.unreadable.emplace_back().path = paths[i];
      captures.unreadable.back().error = Describe(NameOption(capture.error()));
    }
  }
  return captures;
}

// Reads all files so that they agree on up axis and unit. If the first pass finds that files
// disagree, which is rare, reads all files again.
std::optional<Captures> ReadAgreeingCaptures(const std::vector<std::string>& paths,
                                             const BvhReadOptions& read,
                                             const AssembleOptions& options, Progress& progress) {
  std::vector<BvhReadOptions> own(paths.size(), read);
  std::optional<Captures> captures = ReadCaptures(paths, own, options, progress);
  if (!captures) return std::nullopt;
  const std::vector<AgreedConventions> agreed = AgreeOnConventions(captures->conventions);
  bool disagree = false;
  std::size_t readable = 0;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (!captures->is_readable[i]) continue;
    const AgreedConventions& file = agreed[readable++];
    if (file.up) own[i].up = file.up;
    if (file.unit_m) own[i].unit_m = file.unit_m;
    disagree |= file.up || file.unit_m;
  }
  if (disagree) captures = ReadCaptures(paths, own, options, progress);
  if (!captures) return std::nullopt;
  // With other options, a file that was readable may be rejected; its notes are then not needed.
  if (captures->conventions.size() == agreed.size()) {
    for (std::size_t i = 0; i < agreed.size(); ++i)
      captures->assembler.AddNotes(i, agreed[i].notes);
  }
  return captures;
}

}  // namespace

int RunBuild(const BuildCommand& command) {
  BuildReport report(command.json);
  AssembleOptions options;
  options.mirror = command.mirror;
  options.extract.derive_root_motion = command.root_motion;
  options.unsettled_jumps = command.all;
  if (const std::string wrong = ParseKinds(command.kinds, options); !wrong.empty()) {
    return report.Fail(wrong, kExitBadInput);
  }
  for (const std::string& path : command.files) {
    if (IsSameFile(command.out, path)) {
      return report.Fail(
          "--out: " + command.out + " is also an input file; choose another output path",
          kExitBadInput);
    }
  }
  if (Status status = CheckOutputFile(command.out); !status) {
    return report.Fail(Describe(status.error()), kExitFailure);
  }
  BvhReadOptions read;
  read.unit_m = command.unit_m;
  read.fps = command.fps;
  if (!command.up.empty()) {
    read.up = ParseAxis(command.up);
    if (!read.up) {
      return report.Fail("--up: expected x, y, z, -x, -y or -z, got \"" + command.up + "\"",
                         kExitBadInput);
    }
  }
  read.left_ankle = command.left_ankle;
  read.right_ankle = command.right_ankle;
  read.left_ball = command.left_ball;
  read.right_ball = command.right_ball;

  if (command.left_ankle.empty() != command.right_ankle.empty()) {
    return report.Fail("--left-ankle and --right-ankle: set both options or neither",
                       kExitBadInput);
  }

  const InterruptSignal interrupt_signal;
  Progress progress("building");
  const char* const stopped = "interrupted; no file written";
  const std::optional<Captures> captures =
      ReadAgreeingCaptures(command.files, read, options, progress);
  if (!captures) return report.Fail(stopped, kExitFailure);
  progress.Clear();
  std::size_t readable = 0;
  std::size_t unreadable = 0;
  for (const bool is_readable : captures->is_readable) {
    report.AddFile(
        is_readable ? captures->assembler.files()[readable++] : captures->unreadable[unreadable++],
        options);
  }

  progress.Update(static_cast<double>(command.files.size()) /
                  static_cast<double>(command.files.size() + 1));
  auto raw = captures->assembler.Assemble();
  if (!raw) return report.Fail(Describe(raw.error()), kExitBadInput);
  if (!command.no_complete && options.steps) report.AddCompletion(CompleteLibrary(*raw));
  LibraryBuilder builder = command.all ? LibraryBuilder::KeepingAll() : LibraryBuilder::Selecting();
  if (!command.all) builder.selection.max_pose_error_m = command.max_pose_error_m;
  const auto library = builder.Build(*raw);
  progress.Clear();
  if (!library) return report.Fail(Describe(library.error()), kExitBadInput);
  if (InterruptSignal::IsRaised()) return report.Fail(stopped, kExitFailure);
  if (Status status = WriteFile(command.out, (*library)->bytes()); !status) {
    return report.Fail(Describe(status.error()), kExitFailure);
  }
  report.AddLibrary(command.out, *library, builder, command.no_self_check);
  return report.Succeed();
}

}  // namespace stridewire
