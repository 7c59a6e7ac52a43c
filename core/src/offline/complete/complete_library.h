#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stridewire/offline/raw_library.h"

namespace stridewire {

/// Describes which movements the captures of a library do not contain, and what was generated
/// instead.
struct Completion {
  /// Movements that the captures lack, for example "stops with the left foot".
  std::vector<std::string> lacking;
  int example_count = 0;            ///< Number of generated examples.
  bool has_composed_stand = false;  ///< The stand pose was composed, because none was captured.
  std::string stand_reason;         ///< Reason why the stillest captured pose is not a stand.
  /// True if the captures contain no level stride straight ahead. The generated steps then follow
  /// the strides of the library `builtin`.
  bool has_generic_strides = false;
  std::optional<Foot> only_foot;  ///< Set if all captured steps are steps of this foot.
  std::string failure;  ///< Reason why no steps could be generated; empty if there is none.
};

/// Completes a library with steps that its captures lack: starts, stops, small steps, turns on the
/// spot and while walking, steps sideways and steps backward. Generated steps begin and end in the
/// poses of captured strides or in the stand pose, and have the proportions, the posture and the
/// cadence of the person. Adds neither steps that climb nor jumps.
///
/// Generated steps are added in groups of their own (RawGroup::is_completed) after the captured
/// groups, which do not change. The sources of their examples begin with kCompletedSource. If the
/// captures contain no stand with both feet side by side, the stand pose is composed from the mean
/// posture of the steps.
Completion CompleteLibrary(RawLibrary& library);

/// Returns sentences for people, for example "The captures lack stops and steps backward."
[[nodiscard]] std::vector<std::string> DescribeCompletion(const Completion& completion);

}  // namespace stridewire
