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
  /// The request and the result. Both contain the same values, with units in their names, for
  /// example length_m.
  Values asked;
  Values got;
  double missed_m = 0.0;  ///< Distance between the requested and the actual result.
  /// Angle between their directions of travel or between their headings, whichever is larger.
  double missed_rad = 0.0;
  /// A sentence without its subject, which is the movement: "did not arrive: ...".
  std::string reason;
};

/// Compares the movements of a synthesis with the requests in `input`. Returns the requests that
/// were not met, in their order: walks that did not arrive, steps and jumps that were skipped, and
/// steps, jumps and stands that differ from the request by more than kMaxRequestErrorM or
/// kMaxRequestErrorRad. These values are compared:
///
/// - Steps with `at`: the footprint. Other steps: position of the moving foot relative to the fixed
///   foot, in the heading after the step; direction of the moving foot's path; change of heading.
/// - Jumps: motion of the base frame, in the heading at its start; change of heading.
/// - Stands: relative position of the feet, compared with the stand pose.
///
/// Heights are compared only without a terrain, which would determine them, and not for steps with
/// `at`.
[[nodiscard]] std::vector<Refusal> FindRefusals(const SynthesisInput& input,
                                                const Synthesis& synthesis);

}  // namespace stridewire
