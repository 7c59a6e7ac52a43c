#pragma once

#include <optional>
#include <span>
#include <vector>

#include "offline/build/grid_example.h"
#include "runtime/library/cardinal_basis.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

// How far a set of examples is from one that is not in it, when asked for its parameters.
struct LeftOutError {
  double pose_m = 0.0;      // mean distance of joints at equal generic times
  double miss_m = 0.0;      // of its parameters by the hull of the set, grown by 10 %
  double outside_m = 0.0;   // the same of the hull itself
  double duration_s = 0.0;  // made less its own
  [[nodiscard]] double worst_m() const { return pose_m > miss_m ? pose_m : miss_m; }
};

// Examples to blend, with their weights' basis as a library of them would have it. Borrows them.
struct BlendSet {
  std::vector<const GridExample*> examples;
  CardinalBasis basis;
  std::vector<double> sites;  // [example][parameter]
};

// Nothing if their weights cannot be solved, or without any example.
[[nodiscard]] std::optional<BlendSet> MakeBlendSet(std::vector<const GridExample*> examples);

// Joint positions of an example at every other grid point.
[[nodiscard]] std::vector<Vec3> JointPositions(const GridExample& example, const GridLayout& layout,
                                               const Skeleton& skeleton);

// Compares what sets make with the truth. One thread's: it keeps scratch.
class LeftOutProbe {
 public:
  // `units`: metres a unit of each parameter.
  LeftOutProbe(const GridLayout& layout, const Skeleton& skeleton, std::span<const double> units)
      : layout_(layout), skeleton_(skeleton), units_(units.begin(), units.end()) {}

  // `truth`: JointPositions of the target.
  [[nodiscard]] LeftOutError Measure(const BlendSet& set, const GridExample& target,
                                     std::span<const Vec3> truth);

 private:
  const GridLayout& layout_;
  const Skeleton& skeleton_;
  std::vector<double> units_;
  GridExample blend_;
  std::vector<double> weights_;
  std::vector<double> applied_;
};

}  // namespace stridewire
