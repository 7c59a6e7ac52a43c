#include "offline/builtin/step_timing.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace stridewire::builtin {

StepTiming MakeStepTiming(const StepShape& shape) {
  STRIDEWIRE_CHECK(shape.start_m.z <= 0.0 && shape.end_m.z >= 0.0);
  const double start_length_m = -shape.start_m.z, end_length_m = shape.end_m.z;
  const double start_rise_m = std::fabs(shape.start_m.y), end_rise_m = std::fabs(shape.end_m.y);
  StepTiming timing;
  timing.shape = shape;
  timing.start = MakeGaitState(start_length_m, start_rise_m, shape.style);
  timing.end = MakeGaitState(end_length_m, end_rise_m, shape.style);
  timing.start.ascent_m = -shape.start_m.y;
  timing.end.ascent_m = shape.end_m.y;
  const bool partial = timing.start.standing() || timing.end.standing();
  // Sideways steps and steps on the spot have their own duration, because the leg does not swing
  // past the other leg.
  const bool in_place = timing.start.standing() && timing.end.standing();
  const double length_m =
      partial ? std::max(start_length_m, end_length_m) : 0.5 * (start_length_m + end_length_m);
  const double step_s =
      in_place ? 0.54 : StepTime(length_m, 0.5 * (start_rise_m + end_rise_m), shape.style);
  // A step from a stand starts with a shift of the weight over the fixed foot. A step to a stand
  // ends when the body is at rest.
  const double weight_shift_s = in_place ? 0.20 : 0.27;
  const double settling_s = 0.12 * step_s + (in_place ? 0.10 : 0.15);
  timing.toe_off_s = timing.start.standing() ? weight_shift_s : timing.start.half_support_s;
  // At the standing end of a step, the part that corresponds to half of double support is the same
  // fraction of the step as in walking at 1.3 m/s.
  const auto half_support_s = [&](const GaitState& state) {
    return state.standing() ? 0.12 * step_s : state.half_support_s;
  };
  timing.heel_strike_s = timing.toe_off_s + ToWholeFrames(step_s - half_support_s(timing.start) -
                                                          half_support_s(timing.end));
  timing.end_s = timing.heel_strike_s +
                 (timing.end.standing() ? ToWholeFrames(settling_s) : timing.end.half_support_s);
  timing.toe_off_s = ToWholeFrames(timing.toe_off_s);
  timing.heel_strike_s = ToWholeFrames(timing.heel_strike_s);
  timing.end_s = ToWholeFrames(timing.end_s);
  STRIDEWIRE_CHECK(timing.toe_off_s > 0.0 && timing.toe_off_s < timing.heel_strike_s);
  STRIDEWIRE_CHECK(timing.heel_strike_s < timing.end_s);
  return timing;
}

}  // namespace stridewire::builtin
