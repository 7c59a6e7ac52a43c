#pragma once

#include "offline/builtin/curve.h"
#include "offline/builtin/figure.h"
#include "offline/builtin/step_timing.h"

namespace stridewire::builtin {

/// The pose of a foot: position of the ankle, and pitch of foot and toes. Pitches are in radians in
/// the frame of the example; positive raises the toes. At `yaw_rad` 0 the foot points outwards by
/// kToeOutRad.
struct FootPose {
  DVec3 ankle_m = DVec3(0.0);
  double pitch_rad = 0.0;
  double toe_pitch_rad = 0.0;
  double yaw_rad = 0.0;
};

/// Returns the rotation of a foot, or of its toes, with this pitch.
[[nodiscard]] DQuat FootRotation(Foot foot, double pitch_rad, double yaw_rad = 0.0);

/// Returns the pose of a foot on the ground. Its ball would be at `flat_ball_m` if the foot were
/// flat. The foot is rotated about the heel for pitch > 0 and about the ball for pitch < 0. If
/// `toe_rock_rad` > 0, the ball is lifted about the toe tip. The contact point (heel, ball or toe
/// tip) stays exactly fixed.
[[nodiscard]] FootPose FootOnGround(Foot foot, const DVec3& flat_ball_m, double pitch_rad,
                                    double toe_rock_rad, double yaw_rad = 0.0);

/// Returns the position of the ball of a flat foot in the stand, with the ankle at z = 0 and
/// kAnkleHalfWidthM to the left or right of x = 0.
[[nodiscard]] DVec3 StandingBall(Foot foot);

/// The motion of both feet in a step. The ball of the fixed foot, when flat, is at y = z = 0.
///
///   fixed   heel pivot | flat ........ | ball pivot .............
///   moving  toe pivot  | swing ..................... | heel pivot
///           start    toe-off                    heel-strike    end
///
/// "Heel pivot" means that the foot turns about its heel, which stays on the ground. In steep steps
/// down, the moving foot lands on its ball and turns about it instead. In the toe pivot, the foot
/// turns about its ball first and about the tip of its toes last.
class FootPaths {
 public:
  FootPaths(Foot moving, const StepTiming& timing);

  [[nodiscard]] FootPose Fixed(double time_s) const;
  [[nodiscard]] FootPose Moving(double time_s) const;

  /// Positions that the balls of the fixed foot, and of the moving foot before its swing, have when
  /// these feet are flat.
  [[nodiscard]] const DVec3& fixed_ball_m() const { return fixed_ball_m_; }
  [[nodiscard]] const DVec3& start_ball_m() const { return start_ball_m_; }

 private:
  [[nodiscard]] FootPose MovingBeforeToeOff(double time_s) const;
  [[nodiscard]] FootPose MovingInSwing(double time_s) const;
  [[nodiscard]] double GroundAt(double z_m) const;
  [[nodiscard]] double NearestApproach() const;
  void LeadSwingAroundFixedFoot();
  void RaiseSwingUntilClear();

  Foot moving_;
  StepTiming timing_;
  DVec3 fixed_ball_m_, start_ball_m_, end_ball_m_;
  Curve fixed_pitch_, moving_pitch_, toe_rock_, toe_bend_;
  DVec3 toe_off_m_, strike_m_, toe_off_velocity_, strike_velocity_;
  double lift_m_ = 0.0;
  double detour_m_ = 0.0;  // Sideways detour of the swinging foot around the fixed foot.
};

}  // namespace stridewire::builtin
