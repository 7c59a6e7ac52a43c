#include "load_report.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace stridewire::load {
namespace {

const char* ModeName(protocol::PoseMode mode) {
  switch (mode) {
    case protocol::PoseMode::kFull: return "full";
    case protocol::PoseMode::kQuantised:
    case protocol::PoseMode::kCompact: return "quantised";
    case protocol::PoseMode::kCompactReduced: return "quantised, reduced joints";
    case protocol::PoseMode::kCompactRoot: return "quantised, root only";
    case protocol::PoseMode::kMovement: return "movement";
  }
  return "";
}

using nlohmann::ordered_json;

/// Rounds to three decimals.
double Rounded(double value) { return std::round(value * 1000.0) / 1000.0; }

ordered_json ToValue(const std::optional<Quantiles>& quantiles) {
  const auto value = [&quantiles](double Quantiles::* number) {
    return quantiles ? ordered_json(Rounded((*quantiles).*number)) : ordered_json(nullptr);
  };
  return {{"p50", value(&Quantiles::p50)},
          {"p99", value(&Quantiles::p99)},
          {"max", value(&Quantiles::max)}};
}

template <typename T>
ordered_json OrNull(const std::optional<T>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json ToDocument(const LoadReport& report) {
  ordered_json bytes_per_pose = nullptr;
  if (report.poses_received > 0) {
    bytes_per_pose = Rounded(static_cast<double>(report.bytes_received) /
                             static_cast<double>(report.poses_received));
  }
  return {{"avatars", report.avatars},
          {"observers", report.observers},
          {"mode", ModeName(report.mode)},
          {"seconds", Rounded(report.seconds)},
          {"poses_received", report.poses_received},
          {"poses_expected", report.poses_expected},
          {"bytes_received", report.bytes_received},
          {"bytes_per_pose", bytes_per_pose},
          {"tick_ms", ToValue(report.tick_ms)},
          {"ticks_missed", OrNull(report.ticks_missed)},
          {"step_latency_ms", ToValue(report.step_latency_ms)},
          {"requests",
           {{"sent", report.requests_sent},
            {"accepted", report.requests_accepted},
            {"rejected", report.requests_rejected}}},
          {"reconnects", report.reconnects},
          {"errors", report.errors},
          {"worlds", report.worlds},
          {"seed", report.seed},
          {"poses_invalid", report.poses_invalid},
          {"batches_dropped", report.batches_dropped},
          {"steps_measured", report.steps_measured},
          {"moving_share",
           report.moving_share ? ordered_json(Rounded(*report.moving_share)) : ordered_json()},
          {"self",
           {{"threads", report.threads},
            {"cpu_s", Rounded(report.own_cpu_s)},
            {"loop_late_ms", ToValue(report.own_loop_late_ms)},
            {"send_late_ms", ToValue(report.own_send_late_ms)}}},
          {"partial_observers", report.partial_observers},
          {"partial_avatars", report.partial_avatars}};
}

/// Finds a value by its path, for example "tick_ms.p99".
const ordered_json* Find(const ordered_json& document, std::string_view path) {
  const ordered_json* value = &document;
  while (!path.empty()) {
    const std::string_view key = path.substr(0, path.find('.'));
    path.remove_prefix(std::min(path.size(), key.size() + 1));
    const auto found = value->find(std::string(key));
    if (found == value->end()) return nullptr;
    value = &*found;
  }
  return value;
}

void AddNumberNames(const ordered_json& value, const std::string& prefix,
                    std::vector<std::string>& names) {
  for (const auto& item : value.items()) {
    const std::string name = prefix + item.key();
    if (item.value().is_object()) {
      AddNumberNames(item.value(), name + ".", names);
    } else if (item.value().is_number() || item.value().is_null() || name == "errors") {
      names.push_back(name);
    }
  }
}

std::string Format(const char* format, auto... values) {
  const int size = std::snprintf(nullptr, 0, format, values...);
  std::string text(static_cast<std::size_t>(size), '\0');
  std::snprintf(text.data(), text.size() + 1, format, values...);
  return text;
}

std::string Line(const char* name, const std::optional<Quantiles>& quantiles,
                 const char* if_missing) {
  if (!quantiles) return Format("%-15s %s\n", name, if_missing);
  return Format("%-15s p50 %.3f ms, p99 %.3f ms, max %.3f ms\n", name, quantiles->p50,
                quantiles->p99, quantiles->max);
}

}  // namespace

std::string ToJson(const LoadReport& report) {
  // Errors may contain text of the server that is not valid UTF-8.
  return ToDocument(report).dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

std::string ToText(const LoadReport& report) {
  const auto count = [](std::uint64_t n) { return static_cast<unsigned long long>(n); };
  std::string text =
      Format("load            %d avatars in %d worlds, %d observers, %s, %.1f s, seed %llu\n",
             report.avatars, report.worlds, report.observers, ModeName(report.mode), report.seconds,
             count(report.seed));
  if (report.partial_observers > 0) {
    text += Format("                %d observers of %d avatars each\n", report.partial_observers,
                   report.partial_avatars);
  }
  if (report.observers + report.partial_observers > 0) {
    const double share = report.poses_expected == 0
                             ? 0.0
                             : 100.0 * static_cast<double>(report.poses_received) /
                                   static_cast<double>(report.poses_expected);
    text += Format(
        "poses           %llu of %llu expected (%.2f %%), %llu invalid, %llu batches dropped\n",
        count(report.poses_received), count(report.poses_expected), share,
        count(report.poses_invalid), count(report.batches_dropped));
    if (report.poses_received > 0) {
      text += Format(
          "bytes           %llu, %.1f per pose; %.0f %% of the poses moved\n",
          count(report.bytes_received),
          static_cast<double>(report.bytes_received) / static_cast<double>(report.poses_received),
          100.0 * report.moving_share.value_or(0.0));
    }
  }
  text += Line("server tick", report.tick_ms, "unknown: no metrics");
  if (report.ticks_missed) text += Format("ticks missed    %llu\n", count(*report.ticks_missed));
  text += Line("step latency", report.step_latency_ms, "no steps were measured");
  text += Format("requests        %llu sent, %llu accepted, %llu rejected\n",
                 count(report.requests_sent), count(report.requests_accepted),
                 count(report.requests_rejected));
  text += Format("reconnects      %llu\n", count(report.reconnects));
  text += Format("this program    %.2f s processor time, late by p99 %.3f ms, max %.3f ms\n",
                 report.own_cpu_s, report.own_loop_late_ms.p99, report.own_loop_late_ms.max);
  for (const std::string& error : report.errors) text += "error           " + error + "\n";
  return text;
}

std::optional<double> ReportNumber(const LoadReport& report, std::string_view name) {
  const ordered_json document = ToDocument(report);
  const ordered_json* value = Find(document, name);
  if (value == nullptr || value->is_null()) return std::nullopt;
  if (value->is_array()) return static_cast<double>(value->size());
  return value->get<double>();
}

std::vector<std::string> ReportNumberNames() {
  std::vector<std::string> names;
  AddNumberNames(ToDocument({}), "", names);
  return names;
}

}  // namespace stridewire::load
