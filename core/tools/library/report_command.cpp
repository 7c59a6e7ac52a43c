#include <cstdio>
#include <filesystem>
#include <memory>
#include <span>

#include "command_line.h"
#include "commands.h"
#include "library_json.h"
#include "offline/extract/assemble.h"
#include "offline/inspect/inspect_json.h"
#include "progress.h"
#include "refinement_json.h"
#include "report/report.h"
#include "stridewire/offline/bvh_reader.h"
#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/open_library.h"
#include "summary_text.h"

namespace stridewire {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kInterrupted = "interrupted; no file written";

Json ReportToJson(const Report& report, const ReportCommand& command) {
  Json json;
  json["library"] = command.library;
  json["summary"] = SummaryToJson(report.summary);
  json["self_check"] = SelfCheckToJson(report.self_check);
  json["max_error_m"] = command.max_error_m;
  json["groups"] = Json::array();
  for (std::size_t g = 0; g < report.plain.size(); ++g) {
    Json group = RefinementToJson(report.refinement.library->groups()[g],
                                  report.refinement.groups[g], RefineOptions{}.samples);
    group["corrected_error_m"] = {{"max", report.plain[g].corrected_max_m},
                                  {"max_in_3", report.plain[g].corrected_in_3_max_m},
                                  {"mean", report.plain[g].corrected_mean_m},
                                  {"weight_sum_max", report.plain[g].corrected_weight_sum_max},
                                  {"iterations", report.plain[g].iterations}};
    json["groups"].push_back(std::move(group));
  }
  json["files"] = {"index.html"};
  for (const ReportPicture& picture : report.pictures) json["files"].push_back(picture.file);
  return json;
}

Json RealismToJson(const MotionLibrary& captured, const std::vector<LeaveOneOut>& realism) {
  Json json = Json::array();
  for (std::size_t g = 0; g < realism.size(); ++g) {
    const MotionGroup& group = captured.groups()[g];
    Json entry = {{"kind", MovementKindName(group.kind)},
                  {"parameters", group.parameter_count()},
                  {"movements", realism[g].movements}};
    for (std::size_t m = 0; m < realism[g].means.size(); ++m) {
      const LeftOutMean& mean = realism[g].means[m];
      Json parts = Json::object();
      for (std::size_t p = 0; p < mean.part_m.size(); ++p) {
        parts[std::string(BodyPartName(static_cast<BodyPart>(p)))] = mean.part_m[p];
      }
      entry[std::string(BlendMethodName(static_cast<BlendMethod>(m)))] = {
          {"pose_m", mean.pose_m},
          {"parts_m", std::move(parts)},
          {"planted_m", mean.planted_m},
          {"foot_m", mean.foot_m},
          {"keytime_s", mean.keytime_s},
          {"parameter_m", mean.parameter_m},
          {"won_by_cardinal", realism[g].wins[m]}};
    }
    json.push_back(std::move(entry));
  }
  return json;
}

// Reads every usable movement of the captures. Returns null if it printed an error or was
// interrupted.
std::shared_ptr<const MotionLibrary> ReadCaptures(const std::vector<std::string>& paths) {
  LibraryAssembler assembler;
  for (const std::string& path : paths) {
    if (InterruptSignal::IsRaised()) return nullptr;
    const auto capture = ReadBvh(path);
    if (!capture) {
      PrintInputError(capture.error());
      return nullptr;
    }
    const Extraction& extraction = assembler.Add(*capture);
    if (!extraction.error.empty()) {
      PrintError(path + ": " + extraction.error);
      return nullptr;
    }
  }
  const auto raw = assembler.Assemble();
  if (!raw) {
    PrintInputError(raw.error());
    return nullptr;
  }
  const auto library = LibraryBuilder::KeepingAll().Build(*raw);
  if (!library) {
    PrintInputError(library.error());
    return nullptr;
  }
  return *library;
}

// Writes the page last: if it exists, its pictures exist as well.
Status WriteReport(const Report& report, const std::filesystem::path& folder) {
  for (const ReportPicture& picture : report.pictures) {
    const auto bytes = std::as_bytes(std::span(picture.svg));
    if (Status status = WriteFile(folder / picture.file, bytes); !status) return status;
  }
  return WriteFile(folder / "index.html", std::as_bytes(std::span(report.html)));
}

}  // namespace

int RunReport(const ReportCommand& command) {
  const InterruptSignal interrupt_signal;
  std::error_code failed;
  const std::filesystem::path folder = command.out;
  if (std::filesystem::exists(folder, failed) && !std::filesystem::is_directory(folder, failed)) {
    return PrintError(command.out + ": exists and is not a folder", kExitFailure);
  }
  const auto library = OpenLibrary(command.library);
  if (!library) return PrintInputError(library.error());

  std::shared_ptr<const MotionLibrary> captured;
  if (!command.captures.empty()) {
    captured = ReadCaptures(command.captures);
    if (InterruptSignal::IsRaised()) return PrintError(kInterrupted, kExitFailure);
    if (captured == nullptr) return kExitBadInput;
  }

  Progress progress("drawing");
  const auto report =
      MakeReport(*library, {.name = std::filesystem::path(command.library).filename().string(),
                            .axes = command.axes,
                            .max_error_m = command.max_error_m,
                            .max_pseudoexamples = command.max_pseudoexamples,
                            .captured = captured,
                            .progress = [&](double done) {
                              progress.Update(done);
                              return !InterruptSignal::IsRaised();
                            }});
  progress.Clear();
  if (InterruptSignal::IsRaised()) return PrintError(kInterrupted, kExitFailure);
  if (!report) {
    return report.error().code == ErrorCode::kOutOfRange ? PrintInputError(report.error())
                                                         : PrintOutputError(report.error());
  }
  std::filesystem::create_directories(folder, failed);
  if (failed) return PrintError(command.out + ": cannot create the folder", kExitFailure);
  if (Status status = WriteReport(*report, folder); !status) {
    return PrintOutputError(status.error());
  }
  if (command.json) {
    Json json = ReportToJson(*report, command);
    if (captured != nullptr) json["realism"] = RealismToJson(*captured, report->realism);
    std::printf("%s\n", Dump(json).c_str());
  } else {
    std::printf("%s: index.html and %zu pictures\n", command.out.c_str(), report->pictures.size());
    PrintSummary(report->summary);
    PrintSelfCheck(report->self_check);
  }
  return kExitSuccess;
}

}  // namespace stridewire
