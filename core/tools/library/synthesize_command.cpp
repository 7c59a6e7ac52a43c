#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <span>
#include <string>

#include "command_line.h"
#include "commands.h"
#include "library_json.h"
#include "offline/inspect/inspect_json.h"
#include "offline/inspect/refusals.h"
#include "stridewire/offline/bvh_writer.h"
#include "stridewire/offline/choreography.h"
#include "stridewire/offline/open_library.h"
#include "stridewire/offline/synthesis.h"
#include "stridewire/runtime/avatar.h"

namespace stridewire {
namespace {

using Json = nlohmann::ordered_json;

Json MeasuresToJson(const StepMeasures& step) {
  return {{"length_m", step.length_m},
          {"side_m", step.side_m},
          {"height_m", step.height_m},
          {"turn_rad", step.turn_rad}};
}

Json RecordToJson(const MotionLibrary& library, const MovementRecord& record) {
  Json json;
  json["kind"] = MovementKindName(record.kind);
  json["start_s"] = record.start_s;
  json["end_s"] = record.end_s;
  if (record.group >= 0) {
    const MotionGroup& group = library.group(record.group);
    json["keytimes_s"] = record.keytimes_s;
    json["requested"] = ParametersToJson(group, record.requested);
    json["applied"] = ParametersToJson(group, record.applied);
    json["corrected"] = ParametersToJson(group, record.corrected);
    json["measured"] = ParametersToJson(group, record.measured);
    json["extrapolated"] = record.extrapolated;
    json["clamped"] = record.clamped;
    json["group"] = record.group;
    json["weights"] = record.weights;
    Json plants = Json::array();
    for (const PlantRecord& plant : record.plants) {
      plants.push_back({{"foot", plant.foot == Foot::kLeft ? "left" : "right"},
                        {"from_s", plant.from_s},
                        {"to_s", plant.to_s},
                        {"anchor_m", {plant.anchor_m.x, plant.anchor_m.y, plant.anchor_m.z}},
                        {"drift_m", plant.drift_m}});
    }
    json["plants"] = std::move(plants);
    if (IsStep(record.kind)) {
      json["landing_error_m"] = record.landing_error_m;
      json["landing_error_rad"] = record.landing_error_rad;
    }
  }
  json["request"] = record.request_id == 0 ? Json(nullptr) : Json(record.request_id - 1);
  json["base"] = BaseToJson(record.base);
  return json;
}

std::optional<double> RequestedSpeed(const WalkRecord& record,
                                     std::span<const MovementRequest> requests) {
  const auto request = std::ranges::find(requests, record.request_id, &MovementRequest::id);
  if (request == requests.end()) return std::nullopt;
  const auto* walk = std::get_if<WalkRequest>(&request->movement);
  return walk != nullptr ? walk->speed_m_s : std::nullopt;
}

// Returns a note on the possible speeds if the library cannot walk at the requested one. Otherwise,
// returns an empty string.
std::string SpeedNote(const WalkSpeeds& speeds, const std::optional<double>& requested_m_s) {
  if (!requested_m_s || !speeds.IsOutside(*requested_m_s)) return {};
  char text[100];
  std::snprintf(text, sizeof text, "the library walks at %.2f to %.2f m/s", speeds.slowest_m_s,
                speeds.fastest_m_s);
  return text;
}

// Returns the report of a choreography that the library cannot play. `error.where` contains the
// movement, for example "c.json: movements[3].jump".
Json FailureToJson(const Error& error) {
  Json refusals = Json::array();
  const std::size_t at = error.where.find("movements[");
  if (error.code == ErrorCode::kUnsupported && at != std::string::npos) {
    const auto request =
        std::strtoull(error.where.c_str() + at + std::strlen("movements["), nullptr, 10);
    refusals.push_back({{"request", request}, {"reason", error.text}});
  }
  return {{"error", Describe(error)}, {"refusals", std::move(refusals)}};
}

}  // namespace

int RunSynthesize(const SynthesizeCommand& command) {
  if (IsSameFile(command.out, command.choreography) || IsSameFile(command.out, command.library)) {
    return PrintError("--out: " + command.out +
                      " is also an input file; choose another output path");
  }
  if (Status status = CheckOutputFile(command.out); !status) {
    return PrintOutputError(status.error());
  }
  const auto choreography = ReadChoreography(command.choreography);
  if (!choreography) return PrintInputError(choreography.error());
  const auto library = OpenLibrary(command.library);
  if (!library) return PrintInputError(library.error());
  const SynthesisInput input{.library = *library,
                             .start = choreography->start,
                             .requests = choreography->movements,
                             .fps = command.fps,
                             .options = {.run_time_correction = !command.no_correction,
                                         .foot_planting = !command.no_planting,
                                         .idle_motion = !command.no_idle,
                                         .stride_variation = !command.no_variation,
                                         .seed = command.seed,
                                         .terrain = choreography->terrain},
                             .layers = choreography->layers};
  const auto synthesis = Synthesize(input);
  if (!synthesis) {
    Error error = synthesis.error();
    std::string where = command.choreography;
    if (error.index >= 0) where += ": movements[" + std::to_string(error.index) + "]";
    if (!error.where.empty()) where += (error.index >= 0 ? "." : ": ") + error.where;
    error.where = std::move(where);
    error.index = -1;
    if (command.json) std::printf("%s\n", Dump(FailureToJson(error)).c_str());
    return PrintInputError(error);
  }
  const std::vector<Refusal> refusals = FindRefusals(input, *synthesis);
  if (Status status =
          WriteBvh((*library)->skeleton(), synthesis->clip, std::filesystem::path(command.out));
      !status) {
    return PrintOutputError(status.error());
  }
  const std::vector<MovementRequest>& requests = choreography->movements;
  const bool has_speeds = std::ranges::any_of(synthesis->walks, [&](const WalkRecord& walk) {
    return RequestedSpeed(walk, requests).has_value();
  });
  const WalkSpeeds speeds = has_speeds ? MeasureWalkSpeeds(*library) : WalkSpeeds{};
  if (command.json) {
    Json json;
    json["fps"] = command.fps;
    json["frames"] = synthesis->clip.frame_count();
    json["movements"] = Json::array();
    for (const MovementRecord& record : synthesis->movements) {
      json["movements"].push_back(RecordToJson(**library, record));
    }
    json["walks"] = Json::array();
    for (const WalkRecord& walk : synthesis->walks) {
      const auto requested_m_s = RequestedSpeed(walk, requests);
      json["walks"].push_back(
          {{"request", walk.request_id - 1},
           {"arrived", walk.arrived},
           {"reason", walk.reason},
           {"end_s", walk.end_s},
           {"base", BaseToJson(walk.base)},
           {"requested_m_s", requested_m_s ? Json(*requested_m_s) : Json(nullptr)},
           {"speed_m_s", walk.speed_m_s},
           {"speed_note", SpeedNote(speeds, requested_m_s)}});
    }
    json["skipped"] = Json::array();
    for (const SkippedRequest& request : synthesis->skipped) {
      const Footprint& nearest = request.missed.nearest;
      json["skipped"].push_back(
          {{"request", request.request_id - 1},
           {"reason", request.reason},
           {"time_s", request.time_s},
           {"nearest",
            {{"at_m", {nearest.position_m.x, nearest.position_m.y, nearest.position_m.z}},
             {"heading_rad", nearest.heading_rad}}},
           {"requested", MeasuresToJson(request.missed.requested)},
           {"reached", MeasuresToJson(request.missed.reached)},
           {"missed_m", request.missed.distance_m},
           {"missed_rad", request.missed.turn_rad}});
    }
    json["refusals"] = RefusalsToJson(refusals);
    json["stop_reason"] = synthesis->stop_reason;
    std::printf("%s\n", Dump(json).c_str());
    return kExitSuccess;
  }
  int clamped = 0;
  for (const MovementRecord& record : synthesis->movements) clamped += record.clamped ? 1 : 0;
  std::printf("%s: %d frames, %.1f s, %zu movements", command.out.c_str(),
              synthesis->clip.frame_count(), synthesis->clip.duration_s(),
              synthesis->movements.size());
  if (clamped > 0) std::printf(", %d of them clamped (use --json for details)", clamped);
  for (const Refusal& refusal : refusals) {
    const auto request = static_cast<unsigned long long>(refusal.request_id - 1);
    std::printf("; movements[%llu] %s", request, refusal.reason.c_str());
  }
  for (const WalkRecord& walk : synthesis->walks) {
    const auto requested_m_s = RequestedSpeed(walk, requests);
    const std::string note = SpeedNote(speeds, requested_m_s);
    if (note.empty()) continue;
    std::printf("; movements[%llu] walks at %.2f m/s instead of %g m/s: %s",
                static_cast<unsigned long long>(walk.request_id - 1), walk.speed_m_s,
                *requested_m_s, note.c_str());
  }
  if (!synthesis->stop_reason.empty()) {
    std::printf("; the feet are apart at the end: %s", synthesis->stop_reason.c_str());
  }
  std::printf("\n");
  return kExitSuccess;
}

}  // namespace stridewire
