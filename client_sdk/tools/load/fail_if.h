#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "load_report.h"
#include "stridewire/base/error.h"

namespace stridewire::load {

/// A condition on one of the numbers of the report, for example `step_latency_ms.p99 >= 50`. Its
/// form is NAME OPERATOR NUMBER, where OPERATOR is >, >=, <, <=, == or !=.
class FailIf {
 public:
  /// Fails with kMalformed. Error::where is then "--fail-if 'TEXT'".
  [[nodiscard]] static Expected<FailIf> Parse(std::string_view text);

  /// Returns true if the condition is true, or if its number could not be measured, so that a
  /// missing measurement does not count as a success.
  [[nodiscard]] bool Fails(const LoadReport& report) const;

  /// Describes the failure, for example "ticks_missed>0: the value is 3".
  [[nodiscard]] std::string Explain(const LoadReport& report) const;

  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  enum class Operator { kAbove, kAtLeast, kBelow, kAtMost, kEqual, kNotEqual };

  std::string text_;
  std::string name_;
  Operator operator_ = Operator::kAbove;
  double number_ = 0.0;
};

}  // namespace stridewire::load
