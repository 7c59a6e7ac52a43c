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
  /// Requested and actual values, by name. Both lists have the same names in the same order. The
  /// names end in units, for example "length_m". If a step or jump was skipped, `actual` describes
  /// the nearest one within reach.
  Values requested;
  Values actual;
  double missed_m = 0.0;  ///< Distance between the requested and the actual result.
  /// Angle between the requested and the actual direction of travel, or between the headings,
  /// whichever is larger. Walks: angle between the headings. Stands: 0.
  double missed_rad = 0.0;
  /// A sentence without its subject, which is the movement: "did not arrive: ...".
  std::string reason;
};

/// Compares the movements of a synthesis with the requests in `input`. Returns the requests that
/// were not met, in their order: walks that did not arrive, steps and jumps that were skipped, and
/// steps, jumps and stands that differ from the request by more than kMaxRequestErrorM or
/// kMaxRequestErrorRad. These values are compared:
///
/// - Steps with `at`: position of the moving foot, without its height; direction of its path;
///   heading after the step, compared with the heading of the footprint.
/// - Other steps: position of the moving foot relative to the fixed foot and to the heading after
///   the step; direction of the moving foot's path; change of heading.
/// - Jumps: displacement of the base frame, relative to the heading before the jump; direction of
///   this displacement; change of heading.
/// - Stands: relative position of the feet, without heights, compared with the stand pose.
///
/// Directions are compared only if the position differs by more than 5 cm. Heights in other steps
/// and in jumps are compared only without a terrain, because a terrain determines them.
[[nodiscard]] std::vector<Refusal> FindRefusals(const SynthesisInput& input,
                                                const Synthesis& synthesis);

}  // namespace stridewire
