#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stridewire/runtime/motion_library.h"

namespace stridewire {

enum class CheckVerdict : std::uint8_t {
  kPassed,
  kFailed,
  kNotApplicable,  ///< The library has no such movement, or nothing was measured. See `text`.
};

/// Returns "passed", "failed" or "not_applicable".
[[nodiscard]] std::string_view CheckVerdictName(CheckVerdict verdict);

/// The result of one check.
struct CheckResult {
  std::string name;   ///< Identifier for programs, for example "three_steps".
  std::string title;  ///< Title for users, for example "Three plain steps".
  CheckVerdict verdict = CheckVerdict::kNotApplicable;
  std::optional<double> measured;  ///< nullopt if nothing could be measured.
  double bound = 0.0;              ///< The check fails if `measured` is larger.
  std::string unit;                ///< Unit of `measured` and `bound`: "m" or "degrees".
  std::string text;    ///< Sentence that states what was measured, or why nothing was measured.
  std::string advice;  ///< Advice for the user if the check failed or a stop is missing, or empty.
};

/// The results of all checks, always in the same order.
struct SelfCheck {
  std::vector<CheckResult> checks;
  [[nodiscard]] bool passed() const;  ///< True if no check failed.
};

/// Plays a few movements with a library, on level ground at 30 frames per second, and checks them:
///
///   three_steps  Three alternating steps of a comfortable length are possible without steps in
///                between, and miss this length by at most 0.2 m.
///   stop         A stand after these steps brings the feet together: measured forward, they are
///                within 3 cm of their positions in the stand pose.
///   walk_to      A walk to a goal 3 m straight ahead ends within 5 cm of it. If the library has
///                no stop, the walk ends within half a step of the goal.
///   knees        Knees bend forward: bent knees point at most 60 degrees away from the direction
///                of their feet.
///   soles        Soles of standing feet are at most 1 cm above the ground, and the ball of a foot
///                is never more than 1 cm below it.
///
/// The same library always gives the same results. The checks take from a few milliseconds to a few
/// tenths of a second. `library` must not be null.
[[nodiscard]] SelfCheck CheckLibrary(const std::shared_ptr<const MotionLibrary>& library);

/// Returns the overall result in one sentence, for example "Self-check passed."
[[nodiscard]] std::string DescribeVerdict(const SelfCheck& check);

}  // namespace stridewire
