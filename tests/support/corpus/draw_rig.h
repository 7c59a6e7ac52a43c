#pragma once

#include <string>

#include "corpus/bvh_notation.h"
#include "corpus/corpus_case.h"
#include "corpus/rig.h"
#include "random.h"

namespace stridewire::test {

/// Turns the plain figure into a random rig with random names, axes and unit. Returns a description
/// of the random choices.
[[nodiscard]] std::string DrawRig(Movement movement, Random& random, Rig& rig);

struct DrawnNotation {
  BvhNotation notation;
  std::string description;
};

[[nodiscard]] DrawnNotation DrawNotation(Random& random, int frame_count);

}  // namespace stridewire::test
