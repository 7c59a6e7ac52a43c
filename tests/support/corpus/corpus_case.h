#pragma once

#include <array>
#include <string>
#include <string_view>

#include "corpus/bvh_notation.h"
#include "corpus/gait.h"
#include "corpus/rig.h"

namespace stridewire::test {

/// The movement of the figure in a case.
enum class Movement {
  kWalk,   ///< Steps in any direction on any floor.
  kJump,   ///< A standing jump.
  kRun,    ///< Both feet are off the ground between steps.
  kStand,  ///< Stands still.
  kDance,  ///< Stands on one leg; the other foot hovers.
  kSit,
  kLie,
  kCrawl,
  kHang,
  kMarch,        ///< Lifts the feet and puts them down in the same places.
  kWalkInPlace,  ///< A walk whose root does not travel.
  kSlowWalk,     ///< A walk whose Frame Time is four times too long.
  kFastJump,     ///< A jump whose Frame Time is too short: it falls at about 17 m/s^2.
  kOneFrame,
  kFrozen  ///< The same pose in every frame.
};

[[nodiscard]] std::string_view MovementName(Movement movement);

/// A generated BVH file and the true values of what importers measure in it.
struct CorpusCase {
  Movement movement = Movement::kWalk;
  unsigned seed = 0;
  std::string description;  ///< The random choices, for messages.
  std::string bvh;
  std::array<int, 2> steps{};  ///< Steps of the left and the right foot.
  int jumps = 0;
  double leg_m = 0.0;  ///< True length of a leg.
  /// Mean displacement of the moving foot over a step: x to the left, z forward, in the heading of
  /// the walk. Walks only.
  DVec3 mean_move_m = DVec3(0.0);
  /// Distance by which measurements of `mean_move_m` may differ, for example if a step at the edge
  /// of the recording is lost.
  double move_tolerance_m = 0.0;
};

/// Generates a random BVH file of a movement. Body proportions, details of the movement, rig, axes,
/// unit, frame rate and notation are random. The same seed always gives the same bytes.
[[nodiscard]] CorpusCase DrawCase(Movement movement, unsigned seed);

}  // namespace stridewire::test
