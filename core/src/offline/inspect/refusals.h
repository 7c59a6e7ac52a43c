#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "stridewire/offline/synthesis.h"

namespace stridewire {

/// A request that was not met.
struct Refusal {
  using Values = std::vector<std::pair<std::string, double>>;

  std::uint64_t request_id = 0;
  std::string kind;  ///< "step", "jump", "stand" or "walk_to".
  /// The request and the result as values with units in their names, for example length_m. Both
  /// contain the same names.
  Values asked;
  Values got;
  double missed_m = 0.0;  ///< Distance between the requested and the actual result.
  /// Angle between their directions or between their headings, whichever is larger.
  double missed_rad = 0.0;
  /// A sentence whose subject, the movement, is left out: "did not arrive: ...".
  std::string reason;
};

/// Compares the movements of a synthesis with the requests in `input`. Lists each step, jump and
/// stand that misses the request by more than kMaxRequestErrorM or kMaxRequestErrorRad, walks that
/// did not arrive, and skipped steps and jumps. Ordered by request.
///
/// - Steps: position of the moving foot relative to the fixed foot in the heading after the step,
///   direction of the path of the moving foot, and change of heading. With `at`, the footprint.
/// - Jumps: movement of the base frame in the heading at its start, and change of heading.
/// - Stands: how far the relative position of the feet differs from that in the stand pose.
/// - Heights are compared on level ground only; a terrain determines them itself.
[[nodiscard]] std::vector<Refusal> FindRefusals(const SynthesisInput& input,
                                                const Synthesis& synthesis);

}  // namespace stridewire
