#pragma once

#include "offline/builtin/curve.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/step_timing.h"

namespace stridewire::builtin {

/// Where a foot is: its ankle, and how foot and toes are pitched (radians, toes up positive, in the
/// example's frame). `yaw_rad` turns the foot, which else points `toe-out` away from straight ahead.
struct FootPlace {
  DVec3 ankle_m = DVec3(0.0);
  double pitch_rad = 0.0;
  double toe_pitch_rad = 0.0;
  double yaw_rad = 0.0;
};

/// Rotation of a foot (or of its toes) with that pitch.
[[nodiscard]] DQuat FootRotation(Foot foot, double pitch_rad, double yaw_rad = 0.0);

/// A foot on the ground, lying flat with its ball at `flat_ball_m`, then turned about what touches:
/// the heel for pitch > 0, the ball for pitch < 0; `toe_rock_rad` > 0 lifts the ball about the tip
/// of the toes. What touches stays where it is, exactly.
[[nodiscard]] FootPlace FootOnGround(Foot foot, const DVec3& flat_ball_m, double pitch_rad,
                                     double toe_rock_rad, double yaw_rad = 0.0);

/// Where the ball lies when the foot is flat below a hip that stands at x = 0, z = 0.
[[nodiscard]] DVec3 StandingBall(Foot foot);

/// Both feet of a step. The fixed foot's flat ball is at y = z = 0.
///
///   fixed   heel pivot | flat ........ | ball pivot .............
///   moving  ball, tip  | swing ..................... | heel pivot
///           start    toe-off                    heel-strike    end
class FootPaths {
 public:
  FootPaths(Foot moving, const StepTiming& timing);

  [[nodiscard]] FootPlace Fixed(double time_s) const;
  [[nodiscard]] FootPlace Moving(double time_s) const;

  /// Flat balls: of the fixed foot, and of the moving one before and after the swing.
  [[nodiscard]] const DVec3& fixed_ball_m() const { return fixed_ball_m_; }
  [[nodiscard]] const DVec3& start_ball_m() const { return start_ball_m_; }
  [[nodiscard]] const DVec3& end_ball_m() const { return end_ball_m_; }

 private:
  [[nodiscard]] FootPlace MovingBeforeToeOff(double time_s) const;
  [[nodiscard]] FootPlace MovingInSwing(double time_s) const;
  [[nodiscard]] double GroundAt(double z_m) const;
  [[nodiscard]] double NearestApproach() const;
  void BowSwingAroundFixedFoot();
  void RaiseSwingUntilClear();

  Foot moving_;
  StepTiming timing_;
  DVec3 fixed_ball_m_, start_ball_m_, end_ball_m_;
  Curve fixed_pitch_, moving_pitch_, toe_rock_, toe_bend_;
  DVec3 toe_off_m_, strike_m_, toe_off_velocity_, strike_velocity_;
  double lift_m_ = 0.0;
  double bow_m_ = 0.0;  // how far the swing is led around the fixed foot
};

}  // namespace stridewire::builtin
