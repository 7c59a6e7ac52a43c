#pragma once

#include <vector>

#include "offline/builtin/curve.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/foot_path.h"
#include "offline/builtin/step_timing.h"

namespace stridewire::builtin {

/// The motion of the pelvis in a step. The gait states at both ends of the step determine its
/// height there. In a walk on level ground, it is higher between the ends. Where a leg could not
/// reach the ground with a slightly bent knee, the pelvis is lowered smoothly.
class PelvisPath {
 public:
  PelvisPath(Foot moving, const StepTiming& timing, const FootPaths& feet);

  [[nodiscard]] DVec3 Position(double time_s) const;
  [[nodiscard]] DQuat Rotation(double time_s) const;
  /// Heading of the body, which turns over the whole step. Yaw is relative to this heading.
  [[nodiscard]] double Heading(double time_s) const;
  [[nodiscard]] double Yaw(double time_s) const { return yaw_.At(time_s); }
  [[nodiscard]] double Roll(double time_s) const { return roll_.At(time_s); }
  [[nodiscard]] double Tilt(double time_s) const { return tilt_.At(time_s); }

 private:
  // Returns by how much the pelvis must be lowered for the legs to reach the feet.
  [[nodiscard]] double MissingReach(const FootPaths& feet, double time_s) const;
  void StayWithinReach(const FootPaths& feet);

  Foot moving_;
  StepTiming timing_;
  Curve across_, forward_, sway_, yaw_, roll_, tilt_, height_;
  // Amount by which the pelvis is lowered, at equal time intervals over the step.
  std::vector<double> lowered_m_;
};

}  // namespace stridewire::builtin
