#pragma once

#include "offline/builtin/curve.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/step_timing.h"
#include "offline/builtin/upper_body.h"

namespace stridewire::builtin {

/// The motion of trunk, head and arms over a step, except for the yaw of the head, which depends on
/// the heading of the pelvis.
///
///   thorax yaw   opposite to the pelvis, later by 18 to 36 % of a step
///   lean         grows with speed, ascent and acceleration; largest in double support
///   roll         towards the standing leg
///   arms         opposite to the legs; the elbows are later than the shoulders
///   nod          keeps the line of sight level while the body rises and falls
class UpperBodyPath {
 public:
  UpperBodyPath(Foot moving, const StepTiming& timing);

  [[nodiscard]] UpperBody At(double time_s) const;

 private:
  Curve thorax_yaw_, thorax_roll_, lean_, nod_;
  // Indexed by Foot.
  Curve arms_[2], elbows_[2];
};

/// Returns the angles of arms, trunk and head of a standing figure.
[[nodiscard]] UpperBody StandingUpperBody();

}  // namespace stridewire::builtin
