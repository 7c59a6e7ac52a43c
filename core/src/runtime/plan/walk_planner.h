#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>

#include "runtime/plan/request_plan.h"
#include "stridewire/runtime/motion_library.h"
#include "stridewire/runtime/movement_request.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {

/// An avatar between two steps, as far as a walk is concerned.
struct WalkStance {
  std::array<Footprint, 2> feet;  ///< Where they stand, by Foot
  double heading_rad = 0.0;       ///< Of the body, unwrapped
  Foot last_moved = Foot::kRight;
  FootState vector;          ///< As PlanStep needs it
  double last_step_s = 0.0;  ///< How long the step before took; 0: none
  bool is_exact = true;      ///< Feet land where they are sent; not so without planting
};

/// How far a walk has got; a new one starts with a new value.
struct WalkProgress {
  std::size_t next_waypoint = 0;
  int steps = 0;
  int steps_without = 0;  ///< Since it last came nearer
  double least_left = std::numeric_limits<double>::infinity();
};

enum class WalkOutcome : std::uint8_t { kStep, kArrived, kRefused };

struct WalkDecision {
  WalkOutcome outcome = WalkOutcome::kArrived;
  RequestPlan plan;         ///< kStep
  const char* reason = "";  ///< kRefused: a sentence, static storage
};

/// Limits of a walk. Who does not come nearer in kMaxStepsWithout steps gives up.
inline constexpr int kMaxWalkSteps = 10'000;
inline constexpr int kMaxStepsWithout = 16;
/// Footprints are on ground no steeper than this (cosine of 20 degrees) …
inline constexpr double kLeastWalkNormalY = 0.9396926;
/// … and no further above or below the foot that stands.
inline constexpr double kMaxWalkClimbM = 0.26;
/// Footprints whose ground is looked at for one step at most, twice over.
inline constexpr int kMaxWalkCandidates = 256;

/// The next step of a walk, from where the feet stand: towards the goal in the library's own steps, the
/// last ones as long as each other, onto ground that carries a foot. Everything is decided anew at each
/// step, so that a changed ground or goal counts from the next step on. Never allocates; time is bounded by
/// kMaxWalkCandidates looks at the ground and a few calls of PlanStep.
[[nodiscard]] WalkDecision PlanWalkStep(const MotionLibrary& library, const Terrain* terrain,
                                        const WalkRequest& walk, const WalkStance& stance,
                                        WalkProgress& progress);

}  // namespace stridewire
