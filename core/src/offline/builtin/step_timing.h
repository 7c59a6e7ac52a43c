#pragma once

#include <vector>

#include "offline/builtin/gait_state.h"
#include "offline/builtin/step_shape.h"

namespace stridewire::builtin {

/// The timing of a step between two GaitStates, with keytimes start, toe-off, heel-strike and end.
/// While walking, double support around a GaitState is symmetric and does not depend on the step,
/// so two successive steps have the same velocities in the state that they share.
struct StepTiming {
  StepShape shape;
  GaitState start;
  GaitState end;
  double toe_off_s = 0.0;
  double heel_strike_s = 0.0;
  double end_s = 0.0;

  [[nodiscard]] double swing_s() const { return heel_strike_s - toe_off_s; }
  [[nodiscard]] std::vector<double> keytimes_s() const {
    return {0.0, toe_off_s, heel_strike_s, end_s};
  }
};

[[nodiscard]] StepTiming MakeStepTiming(const StepShape& shape);

}  // namespace stridewire::builtin
