#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "load_report.h"
#include "stridewire/base/error.h"

namespace stridewire::load {

/// A threshold on a number of the report: `ticks_missed>0`, `step_latency_ms.p99 >= 50`.
///
///   NAME OPERATOR NUMBER      OPERATOR: > >= < <= == !=
class FailIf {
 public:
  /// kMalformed with `where` = "--fail-if 'TEXT'".
  [[nodiscard]] static Expected<FailIf> Parse(std::string_view text);

  /// Whether the run fails by it. A number that could not be measured fails, too: what nobody has
  /// seen was not within its threshold.
  [[nodiscard]] bool Fails(const LoadReport& report) const;

  /// Why it failed: "ticks_missed>0: it is 3".
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
