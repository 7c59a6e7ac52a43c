#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "offline/complete/posture_mix.h"
#include "offline/complete/stride_model.h"
#include "runtime/skeleton/leg_rig.h"
#include "stridewire/offline/raw_library.h"

namespace stridewire::complete {

/// The person for whom steps are generated.
struct Person {
  const Skeleton& skeleton;
  LegRig rig;
  PostureSample stand;                 ///< The stand pose; its heading is 0.
  std::array<StrideModel, 2> strides;  ///< [Foot]: mean stride in which this foot moves.

  /// Returns the vector from the fixed to the moving foot in the stand pose.
  [[nodiscard]] DVec3 StandVector(Foot moving) const;
};

/// Position of the feet at both ends of a step, as in the parameters of a general step.
struct StepFeet {
  /// Vector from the fixed to the moving foot at the start, in the heading frame of the start.
  DVec3 start_m = DVec3(0.0);
  DVec3 end_m = DVec3(0.0);  ///< The same vector at the end, in the heading frame of the end.
  double turn_rad = 0.0;     ///< Change of heading; positive is left.
};

/// A step to generate.
struct StepSpec {
  Foot moving = Foot::kLeft;
  StepFeet feet;
  bool is_backward = false;
};

/// Generates a step on level ground. Its posture at generic time g(t) is a blend of the stand pose
/// and the mean captured stride:
///
///   posture(t) = (1 - w(t)) stand + w(t) stride(g(t))
///
/// The weight w changes smoothly from the start to the end of the step. At both ends it depends
/// only on the distance between the feet. Every generated step therefore continues captured steps
/// and the stand pose without a jump, and has the posture and style of the person.
///
/// The feet are placed first. The root then follows a cubic curve, plus w times the deviation of
/// the captured root from such a curve. The height of the root is corrected so that both legs reach
/// the feet and, in steps that neither start nor end in a stand, so that the leg of the fixed foot
/// bends as in the blend. Finally, inverse kinematics sets the legs, and toes bend where they would
/// be in the ground (RaiseToeTip).
///
/// A step backward is a forward step from `feet.end_m` to `feet.start_m`, played more slowly and in
/// reverse. Its moving foot is in front in `feet.start_m` and behind in `feet.end_m`, and it does
/// not turn.
///
/// `cells` [interval] is the grid of the step's group (CellsAtRate). The example has a frame at
/// each grid point, so that LibraryBuilder stores the frames without interpolation. `names` selects
/// the parameters of the example, which are measured in its first and last pose.
[[nodiscard]] RawExample MakeStep(const Person& person, const StepSpec& step,
                                  std::span<const int> cells, std::span<const ParameterName> names,
                                  std::string source);

/// Returns the keytimes of the example that MakeStep generates.
[[nodiscard]] std::vector<double> StepKeytimes(const Person& person, const StepSpec& step);

}  // namespace stridewire::complete
