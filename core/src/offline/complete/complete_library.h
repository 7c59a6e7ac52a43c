#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stridewire/offline/raw_library.h"

namespace stridewire {

/// What the captures of a library lack, and what was generated instead.
struct Completion {
  /// Movements that the captures lack, for example "stops with the left foot".
  std::vector<std::string> lacking;
  int example_count = 0;            ///< Number of generated examples.
  bool has_composed_stand = false;  ///< The stand pose was composed, because none was captured.
  std::string stand_reason;         ///< Why the captured stand pose was not used.
  /// The captures contain no level stride straight ahead, so that the generated steps follow those
  /// of the generated figure of the library `builtin`.
  bool has_generic_strides = false;
  std::optional<Foot> only_foot;  ///< The foot that moves in all captured steps, if it is one.
  std::string failure;  ///< Why nothing could be completed although something is lacking, or empty.
};

/// Completes a library with steps that its captures lack: starts, stops, small steps, turns on the
/// spot and while walking, steps sideways and steps backward. Generated steps join the captured
/// strides and the stand pose, and have the proportions, the posture and the cadence of the person.
///
/// They become groups of their own (RawGroup::is_completed) after the captured groups, which do
/// not change, and the sources of their examples begin with kCompletedSource. If the captures
/// contain no stand with both feet side by side, the stand pose is composed from the mean posture
/// of the steps. Does not add steps that climb, and no jumps.
Completion CompleteLibrary(RawLibrary& library);

/// Returns sentences for people, for example "The captures lack stops and steps backward."
[[nodiscard]] std::vector<std::string> DescribeCompletion(const Completion& completion);

}  // namespace stridewire
