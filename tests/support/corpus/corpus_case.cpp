#include "corpus/corpus_case.h"

#include <cmath>
#include <cstdio>

#include "corpus/draw_movement.h"
#include "corpus/draw_rig.h"

namespace stridewire::test {

std::string_view MovementName(Movement movement) {
  switch (movement) {
    case Movement::kWalk: return "walk";
    case Movement::kJump: return "jump";
    case Movement::kRun: return "run";
    case Movement::kStand: return "stand";
    case Movement::kDance: return "dance";
    case Movement::kSit: return "sit";
    case Movement::kLie: return "lie";
    case Movement::kCrawl: return "crawl";
    case Movement::kHang: return "hang";
    case Movement::kMarch: return "march";
    case Movement::kWalkInPlace: return "walk_in_place";
    case Movement::kSlowWalk: return "slow_walk";
    case Movement::kFastJump: return "fast_jump";
    case Movement::kOneFrame: return "one_frame";
    case Movement::kFrozen: return "frozen";
  }
  return "";
}

CorpusCase DrawCase(Movement movement, unsigned seed) {
  Random random(seed * 131u + static_cast<unsigned>(movement));
  CorpusCase result;
  result.movement = movement;
  result.seed = seed;
  const Figure figure(random.Draw(0.9, 1.1));
  result.leg_m = figure.LegLength();
  const DrawnMovement drawn = DrawMovement(movement, figure, random);
  result.steps = drawn.steps;
  result.jumps = drawn.jumps;
  result.mean_move_m = drawn.mean_move_m;
  result.move_tolerance_m = drawn.move_tolerance_m;
  Rig rig = MakeRig(figure, drawn.motion);
  result.description = drawn.description + DrawRig(movement, random, rig);
  const DrawnNotation notation = DrawNotation(random, rig.frame_count());
  result.description += notation.description;
  rig.fps = drawn.declared_fps;
  result.bvh = WriteRig(rig, notation.notation);
  return result;
}

}  // namespace stridewire::test
