#include "fail_if.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <vector>

namespace stridewire::load {
namespace {

std::string_view Trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

}  // namespace

Expected<FailIf> FailIf::Parse(std::string_view text) {
  constexpr std::size_t kMaxText = 128;
  const std::string where = "--fail-if '" + std::string(text.substr(0, kMaxText)) + "'";
  if (text.size() > kMaxText) {
    return Fail(ErrorCode::kMalformed, "is longer than 128 characters", where);
  }
  FailIf condition;
  condition.text_ = Trimmed(text);
  const std::size_t at = text.find_first_of("<>=!");
  if (at == std::string_view::npos) {
    return Fail(ErrorCode::kMalformed, "expected a comparison, for example ticks_missed>0", where);
  }
  condition.name_ = Trimmed(text.substr(0, at));
  const std::vector<std::string> names = ReportNumberNames();
  if (std::find(names.begin(), names.end(), condition.name_) == names.end()) {
    return Fail(ErrorCode::kMalformed,
                "unknown name; the report has for example poses_received, ticks_missed, "
                "tick_ms.p99, step_latency_ms.max, requests.rejected, reconnects, errors",
                where);
  }
  const std::string_view rest = text.substr(at);
  struct Symbol {
    std::string_view text;
    Operator meaning;
  };
  constexpr Symbol kSymbols[] = {{">=", Operator::kAtLeast}, {"<=", Operator::kAtMost},
                                 {"==", Operator::kEqual},   {"!=", Operator::kNotEqual},
                                 {">", Operator::kAbove},    {"<", Operator::kBelow}};
  const auto* const symbol =
      std::find_if(std::begin(kSymbols), std::end(kSymbols),
                   [rest](const Symbol& each) { return rest.starts_with(each.text); });
  if (symbol == std::end(kSymbols)) {
    return Fail(ErrorCode::kMalformed, "unknown comparison; expected > >= < <= == or !=", where);
  }
  condition.operator_ = symbol->meaning;
  const std::string_view number = Trimmed(rest.substr(symbol->text.size()));
  const auto [end, code] =
      std::from_chars(number.data(), number.data() + number.size(), condition.number_);
  if (code != std::errc() || end != number.data() + number.size() ||
      !std::isfinite(condition.number_)) {
    return Fail(ErrorCode::kMalformed, "expected a number after the comparison", where);
  }
  return condition;
}

bool FailIf::Fails(const LoadReport& report) const {
  const std::optional<double> value = ReportNumber(report, name_);
  if (!value) return true;
  switch (operator_) {
    case Operator::kAbove: return *value > number_;
    case Operator::kAtLeast: return *value >= number_;
    case Operator::kBelow: return *value < number_;
    case Operator::kAtMost: return *value <= number_;
    case Operator::kEqual: return *value == number_;
    case Operator::kNotEqual: return *value != number_;
  }
  return true;
}

std::string FailIf::Explain(const LoadReport& report) const {
  const std::optional<double> value = ReportNumber(report, name_);
  if (!value) return text_ + ": the value was not measured";
  char number[32];
  std::snprintf(number, sizeof number, "%.6g", *value);
  return text_ + ": the value is " + number;
}

}  // namespace stridewire::load
