#pragma once

#include <cstddef>
#include <optional>

#include "runtime/plan/request_error.h"
#include "runtime/plan/request_plan.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Maximum number of successive steps that an avatar inserts before a movement that cannot start
/// without them, or before a stand.
inline constexpr int kMaxInsertedSteps = 3;

/// Returns true if the feet are apart: the vector between them differs from that of the stand pose
/// by more than a stand allows, forward or sideways. The sideways limit is larger, because few
/// libraries have steps that bring the feet together sideways.
[[nodiscard]] bool AreFeetApart(const FootState& feet, const FootState& stand);

/// Returns true if the request is a step or jump with `allow_nearest`.
[[nodiscard]] bool AllowsNearest(const MovementRequest& request);

/// The state from which a movement starts.
struct Stance {
  FootState feet;
  Foot last_moved = Foot::kRight;
  /// Group of the previous movement. After a stand, the number of groups.
  std::size_t group = 0;
  int inserted_steps = 0;  ///< Number of steps inserted so far.
  LandingConditions conditions;
};

/// The next movement on the path to a requested step or jump. It is either the request itself or an
/// inserted step.
struct TransitionPath {
  std::optional<RequestPlan> plan;  ///< Plan of the next movement. nullopt if there is no path.
  bool is_inserted = false;
};

/// Finds the path with the fewest inserted steps, at most kMaxInsertedSteps. Each inserted step
/// brings a foot beside the other one, or as close to it as the library allows. `direct` is the
/// plan of the request from the current stance.
///
/// - A movement may follow another if MayFollow is true for their groups. If the best group for a
///   step may not follow, the step uses the best group that may, provided that the request is then
///   within reach.
/// - If the feet are apart, they must come together before a jump, and before a step of the foot
///   that moved last. This is not necessary if the forward distance between the feet differs by at
///   most 0.25 m from that at the start of the planned movement. In this case, if the request is in
///   reach, a step is inserted only if it brings the feet closer together by 3 cm (before a jump)
///   or reduces the cost of the request by 0.25 m (before a step).
/// - No steps are inserted before steps to footprints.
/// - No step is inserted if the request would still be out of reach after it (RequestError). If no
///   step is inserted, the returned plan may be out of reach.
///
/// The search tries one inserted step first, then two, then three. It plans at most 22 inserted
/// steps, and the request at most 15 times. Never allocates.
[[nodiscard]] TransitionPath FindTransitionPath(const MotionLibrary& library,
                                                const MovementRequest& request,
                                                const std::optional<RequestPlan>& direct,
                                                const Stance& stance);

/// Returns why there is no path, for example "this library has no transition path from step_left to
/// jump". `to` is not kStand. The text is in static storage.
[[nodiscard]] const char* NoPathReason(MovementKind from, MovementKind to);

}  // namespace stridewire
