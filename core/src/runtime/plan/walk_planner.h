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

/// The state of an avatar between two steps of a walk.
struct WalkStance {
  std::array<Footprint, 2> feet;  ///< [foot]: positions and headings of the feet.
  double heading_rad = 0.0;       ///< Heading of the body, unwrapped.
  Foot last_moved = Foot::kRight;
  FootState vector;          ///< Relative position of the feet, for PlanFootprint.
  double last_step_s = 0.0;  ///< Duration of the previous step. 0 if the avatar is not walking.
  /// Group of the previous movement, as in FootprintOrigin::after.
  std::optional<std::size_t> last_group;
  /// True if feet land exactly on their footprints. False without foot planting.
  bool is_exact = true;
  /// [foot]: true if the last step of this foot in the current walk was aimed at its footprint at
  /// the goal.
  std::array<bool, 2> is_aimed{};
};

/// Progress of a walk. A new walk starts with a default-constructed value.
struct WalkProgress {
  std::size_t next_waypoint = 0;
  int steps = 0;
  int steps_without = 0;  ///< Number of successive steps without progress.
  /// Remaining effort when the walk last made progress (WalkSteering::EffortM).
  double least_effort_m = std::numeric_limits<double>::infinity();
  /// True if the terrain has ruled out a footprint of this walk: the ground at it is too steep or
  /// too uneven, or the ground at or before it is too high or too low.
  bool is_detour = false;
  /// [foot]: as in WalkStance.
  std::array<bool, 2> is_aimed{};
};

/// Measures the speed of a walk. A new walk starts with a default-constructed value.
class WalkPace {
 public:
  /// Call it at the start of the walk and after each of its steps, with the position of the base
  /// frame and the time.
  void Add(const DVec3& position_m, double time_s);
  /// Returns the mean speed without the first kStartSteps and the last kStopSteps steps. Returns 0
  /// if no other steps are left.
  [[nodiscard]] double mean_m_s() const;

 private:
  static constexpr std::size_t kStartSteps = 3;
  static constexpr std::size_t kStopSteps = 2;

  struct Mark {
    double path_m = 0.0;  // Length of the walk so far.
    double time_s = 0.0;
  };
  std::array<Mark, kStopSteps + 1> last_;  // The latest marks, oldest first.
  Mark started_;                           // The mark after the first kStartSteps steps.
  DVec3 position_m_ = DVec3(0.0);
  std::size_t marks_ = 0;
};

enum class WalkOutcome : std::uint8_t { kStep, kArrived, kRefused };

struct WalkDecision {
  WalkOutcome outcome = WalkOutcome::kArrived;
  RequestPlan plan;  ///< The planned step. Set for kStep.
  /// Reason why the walk cannot continue, in static storage. Set for kRefused.
  const char* reason = "";
};

/// Limits of a walk. It ends after kMaxStepsWithout successive steps without progress. If the
/// terrain has ruled out a footprint (WalkProgress::is_detour), it ends after kMaxDetourSteps such
/// steps.
inline constexpr int kMaxWalkSteps = 10'000;
inline constexpr int kMaxStepsWithout = 2;
inline constexpr int kMaxDetourSteps = 16;
/// Minimum y component of the ground normal at a footprint (cosine of 20 degrees).
inline constexpr double kLeastWalkNormalY = 0.9396926;
/// Maximum height difference between a footprint and the standing foot.
inline constexpr double kMaxWalkClimbM = 0.26;
/// Maximum number of footprints whose ground is checked per step.
inline constexpr int kMaxWalkCandidates = 256;

/// Plans the next step of a walk towards the goal. Uses only steps that the library contains and
/// ground that supports a foot. The remaining distance is divided into equal steps. If the library
/// lacks the next of these steps, the planner compares shorter, longer and turning steps of either
/// foot by the effort that remains after them.
///
/// Every decision applies to one step only, so a changed terrain or goal takes effect with the next
/// step. Never allocates. A call checks the ground at up to kMaxWalkCandidates footprints. On level
/// ground, it calls PlanFootprint at most 160 times.
[[nodiscard]] WalkDecision PlanWalkStep(const MotionLibrary& library, const Terrain* terrain,
                                        const WalkRequest& walk, const WalkStance& stance,
                                        WalkProgress& progress);

}  // namespace stridewire
