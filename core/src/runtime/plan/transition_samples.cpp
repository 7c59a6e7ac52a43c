#include "runtime/plan/transition_samples.h"

#include <algorithm>
#include <span>

namespace stridewire {

void TransitionSamples::Sample(const Movement& movement, const SwingTimes& swing, bool settles) {
  const double start_s = movement.start_offset_s;
  start_step_s_ = std::min(kBlendStepS, 0.5 * movement.ease_out_s);
  std::size_t count = 0;
  const auto add = [&](double time_s) { times_s_[count++] = time_s; };
  for (const double part : kReleaseSamples) {
    add(start_s + part * std::max(0.0, swing.release_s - start_s));
  }
  for (const double part : kLandingSamples) {
    add(swing.release_s + part * (swing.land_s - swing.release_s));
  }
  const auto add_start = [&] {
    add(start_s);
    add(start_s + start_step_s_);
  };
  add_start();
  if (settles) {
    for (const double part : kSettleSamples) add(start_s + part * movement.ease_out_s);
  }
  blended_start_ = count;
  add_start();
  feet_.Sample(movement, std::span(times_s_).first(count), blended_start_);
}

}  // namespace stridewire
