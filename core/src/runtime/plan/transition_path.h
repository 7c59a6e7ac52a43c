#pragma once

#include <cstddef>
#include <optional>

#include "runtime/plan/request_plan.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// Steps of its own an avatar takes in a row at most: before a movement that could not begin without, and
/// before it stands.
inline constexpr int kMaxInsertedSteps = 3;

/// Feet not where the stand pose has them: forward or aside by more than a stand may. Few libraries have steps
/// that bring feet together sideways, so a wide stand is left alone for longer.
[[nodiscard]] bool AreFeetApart(const FootState& feet, const FootState& stand);

/// What a movement begins from.
struct Stance {
  FootState feet;
  Foot last_moved = Foot::kRight;
  std::size_t group =
      0;  ///< Of the movement that ended there; as many as there are groups: the stand
  int inserted_steps = 0;  ///< That led there
};

/// What comes next on the way to a step or jump: the movement asked for, or a step that has to go before it.
struct TransitionPath {
  std::optional<RequestPlan> plan;  ///< Empty: there is no way
  bool is_inserted = false;
};

/// The way of fewest steps, at most kMaxInsertedSteps, each of which brings a foot beside the other or as near
/// as the library does. `direct` is the movement asked for as it would be from here.
///
/// - A movement may follow if the library's ends and starts meet (Transition::distance_m), at 0.15 m or half as
///   far again as it is from the stand, from which anything begins.
/// - Feet that are apart must come together before a jump, and before a step of the foot that moved last the other
///   one must step. Within 0.25 m of where the movement's examples have them they need not, and do if one step
///   brings them together by 3 cm, or makes what was asked for better by 0.25 m.
/// - Footprints are met as they are, by the foot that they are for.
///
/// Searched in breadth: at most 14 calls of PlanStep and 14 more for the request. Never allocates.
[[nodiscard]] TransitionPath FindTransitionPath(const MotionLibrary& library,
                                                const MovementRequest& request,
                                                const std::optional<RequestPlan>& direct,
                                                const Stance& stance);

/// Why there is none: "this library has no transition path from step_left to jump". Static storage.
[[nodiscard]] const char* NoPathReason(MovementKind from, MovementKind to);

}  // namespace stridewire
