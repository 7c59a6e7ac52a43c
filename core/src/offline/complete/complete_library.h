#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stridewire/offline/library_builder.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire {

/// Lists the movements that the captures of a library lack, and describes what was generated
/// instead.
struct Completion {
  /// Movements that the captures lack, for example "stops with the left foot".
  std::vector<std::string> lacking;
  int example_count = 0;  ///< Number of generated examples.
  /// True if the stand pose was composed because none was captured.
  bool has_composed_stand = false;
  std::string stand_reason;  ///< Reason why the stillest captured pose is not a stand.
  /// True if the captures do not contain level strides straight ahead for both feet. Mirror images
  /// count. The generated steps then follow the strides of the library `builtin`.
  bool has_generic_strides = false;
  std::optional<Foot> only_foot;  ///< The moving foot, if it is the same in all captured steps.
  std::string failure;  ///< Why no steps could be generated. Empty if there was no failure.
};

/// Completes a library with steps that its captures lack: starts, stops, small steps, turns on the
/// spot and while walking, steps sideways and steps backward. Generated steps have the proportions,
/// the posture and the cadence of the captured person. They begin and end in the stand pose, in
/// poses of the captured strides, or between the two. There are four groups of basic steps:
/// straight, backward, turning and sideways. If one step of a group is missing, for example a turn
/// to the left, the whole group is generated for both feet. The function adds neither climbing
/// steps nor jumps.
///
/// Generated steps form separate groups (RawGroup::is_completed) after the captured groups, which
/// do not change. The sources of their examples begin with kCompletedSource. If the captures
/// contain no stand with both feet side by side, the stand pose is composed from the mean posture
/// of the steps.
///
/// The clips of generated examples have a frame at each grid point of a library that LibraryBuilder
/// builds with this `grid_fps`.
Completion CompleteLibrary(RawLibrary& library, double grid_fps = LibraryBuilder().grid_fps);

/// Returns sentences for users, for example "The captures lack stops and steps backward."
[[nodiscard]] std::vector<std::string> DescribeCompletion(const Completion& completion);

}  // namespace stridewire
