#pragma once

#include <optional>
#include <span>
#include <vector>

#include "offline/build/grid_example.h"
#include "runtime/library/cardinal_basis.h"
#include "stridewire/runtime/skeleton.h"

namespace stridewire {

// The error with which a set of examples reproduces an example outside the set.
struct LeftOutError {
  double pose_m = 0.0;  // Mean distance of joints at equal generic times.
  // Distance of the example's parameters from the hull of the set, enlarged by 10 %.
  double miss_m = 0.0;
  double outside_m = 0.0;   // Distance of the example's parameters from the hull, not enlarged.
  double duration_s = 0.0;  // Synthesized duration minus original duration.
  [[nodiscard]] double worst_m() const { return pose_m > miss_m ? pose_m : miss_m; }
};

// A set of examples to blend, with the same weight functions as in a library. Borrows the examples.
struct BlendSet {
  std::vector<const GridExample*> examples;
  CardinalBasis basis;
  std::vector<double> sites;  // [example][parameter]
};

// Returns nullopt if there are no examples, or if the weights cannot be solved.
[[nodiscard]] std::optional<BlendSet> MakeBlendSet(std::vector<const GridExample*> examples);

// Returns the joint positions of an example at every other grid point.
[[nodiscard]] std::vector<Vec3> JointPositions(const GridExample& example, const GridLayout& layout,
                                               const Skeleton& skeleton);

// Measures how well a BlendSet reproduces an example that it does not contain. Not thread-safe,
// because it contains scratch memory.
class LeftOutProbe {
 public:
  // `units` contains the metres per unit of each parameter.
  LeftOutProbe(const GridLayout& layout, const Skeleton& skeleton, std::span<const double> units)
      : layout_(layout), skeleton_(skeleton), units_(units.begin(), units.end()) {}

  // `truth` must be the result of JointPositions for the target.
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
