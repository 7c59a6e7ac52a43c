#include "step_timing.h"

#include <algorithm>

namespace stridewire::builtin {

StepTiming MakeStepTiming(double start_length_m, double end_length_m) {
  StepTiming timing;
  timing.start = MakeGaitState(start_length_m);
  timing.end = MakeGaitState(end_length_m);
  const bool partial = timing.start.standing() || timing.end.standing();
  const double step_s = SteadyStepTime(partial ? std::max(start_length_m, end_length_m)
                                               : 0.5 * (start_length_m + end_length_m));
  // From standing the weight first moves over the foot that stays; to standing the body settles.
  const double weight_shift_s = 0.30, settle_s = 0.12 * step_s + 0.15;
  timing.toe_off_s = timing.start.standing() ? weight_shift_s : timing.start.half_support_s;
  timing.heel_strike_s = timing.toe_off_s + ToWholeFrames(0.76 * step_s);
  timing.end_s = timing.heel_strike_s +
                 (timing.end.standing() ? ToWholeFrames(settle_s) : timing.end.half_support_s);
  timing.toe_off_s = ToWholeFrames(timing.toe_off_s);
  timing.heel_strike_s = ToWholeFrames(timing.heel_strike_s);
  timing.end_s = ToWholeFrames(timing.end_s);
  return timing;
}

}  // namespace stridewire::builtin
