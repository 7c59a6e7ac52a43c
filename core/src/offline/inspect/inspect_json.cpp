#include "offline/inspect/inspect_json.h"

#include <string>

namespace stridewire {
namespace {

using Json = nlohmann::ordered_json;

Json OriginsToJson(const ExampleOrigins& origins) {
  return {{"captured", origins.captured},
          {"mirrored", origins.mirrored},
          {"generated", origins.generated},
          {"completed", origins.completed}};
}

Json RangeToJson(const ValueRange& range) { return {{"min", range.min}, {"max", range.max}}; }

// `name` is the name of the range, including its unit.
Json AbilityToJson(const Ability& ability, const char* name) {
  Json json = OriginsToJson(ability.origins);
  json[name] = ability.is_available() ? RangeToJson(ability.range) : Json(nullptr);
  return json;
}

Json SidesToJson(const LibrarySummary::Sides& sides, const char* name) {
  return {{"left", AbilityToJson(sides[0], name)}, {"right", AbilityToJson(sides[1], name)}};
}

Json ValuesToJson(const Refusal::Values& values) {
  Json json = Json::object();
  for (const auto& [name, value] : values) json[name] = value;
  return json;
}

}  // namespace

Json SummaryToJson(const LibrarySummary& summary) {
  Json json;
  json["sentences"] = DescribeSummary(summary);
  json["steps"] = OriginsToJson(summary.steps);
  json["steps"]["left"] = summary.feet[0];
  json["steps"]["right"] = summary.feet[1];
  json["stand_stride_m"] = summary.stand_stride_m;
  json["starts"] = SidesToJson(summary.starts, "length_m");
  json["stops"] = SidesToJson(summary.stops, "stride_m");
  json["strides"] = SidesToJson(summary.strides, "length_m");
  const bool has_strides = summary.strides[0].is_available() || summary.strides[1].is_available();
  json["speeds_m_s"] = has_strides ? RangeToJson(summary.speed_m_s) : Json(nullptr);
  json["turns"] = SidesToJson(summary.turns, "angle_deg");
  json["side_steps"] = SidesToJson(summary.side_steps, "side_m");
  json["back_steps"] = SidesToJson(summary.back_steps, "length_m");
  json["heights"] = {{"up", SidesToJson(summary.climbs, "height_m")},
                     {"down", SidesToJson(summary.descents, "height_m")}};
  json["jumps"] = AbilityToJson(summary.jumps, "length_m");
  const bool has_jumps = summary.jumps.is_available();
  json["jumps"]["height_m"] = has_jumps ? RangeToJson(summary.jump_up_m) : Json(nullptr);
  json["jumps"]["turn_deg"] = has_jumps ? RangeToJson(summary.jump_turn_deg) : Json(nullptr);
  Json missing = Json::array();
  for (const MissingAbility& ability : summary.missing) {
    missing.push_back({{"what", ability.what}, {"advice", ability.advice}});
  }
  json["missing"] = std::move(missing);
  return json;
}

Json SelfCheckToJson(const SelfCheck& check) {
  Json checks = Json::array();
  for (const CheckResult& result : check.checks) {
    checks.push_back({{"name", result.name},
                      {"title", result.title},
                      {"verdict", std::string(CheckVerdictName(result.verdict))},
                      {"measured", result.measured ? Json(*result.measured) : Json(nullptr)},
                      {"bound", result.bound},
                      {"unit", result.unit},
                      {"text", result.text},
                      {"advice", result.advice.empty() ? Json(nullptr) : Json(result.advice)}});
  }
  return {{"passed", check.passed()},
          {"verdict", DescribeVerdict(check)},
          {"checks", std::move(checks)}};
}

Json RefusalsToJson(const std::vector<Refusal>& refusals) {
  Json list = Json::array();
  for (const Refusal& refusal : refusals) {
    list.push_back({{"request", refusal.request_id - 1},
                    {"kind", refusal.kind},
                    {"asked", ValuesToJson(refusal.requested)},
                    {"got", ValuesToJson(refusal.actual)},
                    {"missed_m", refusal.missed_m},
                    {"missed_rad", refusal.missed_rad},
                    {"reason", refusal.reason}});
  }
  return list;
}

}  // namespace stridewire
