#pragma once

#include <array>
#include <string>

#include "corpus/corpus_case.h"
#include "corpus/figure.h"
#include "random.h"

namespace stridewire::test {

/// A random motion and the true values of its measurements.
struct DrawnMovement {
  FigureMotion motion;
  double declared_fps = 30.0;  ///< Differs from motion.fps if the file declares a wrong rate.
  std::array<int, 2> steps{};
  int jumps = 0;
  DVec3 mean_move_m = DVec3(0.0);  ///< As in CorpusCase.
  double move_tolerance_m = 0.0;
  std::string description;
};

[[nodiscard]] DrawnMovement DrawMovement(Movement movement, const Figure& figure, Random& random);

}  // namespace stridewire::test
