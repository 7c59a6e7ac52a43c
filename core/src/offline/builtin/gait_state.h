#pragma once

#include "offline/builtin/step_shape.h"

namespace stridewire::builtin {

/// Frame rate of generated steps and jumps. Keytimes are rounded to whole frames, so the GaitStates
/// at the start and the end of a step coincide with frames.
inline constexpr double kClipFps = 120.0;

/// Rounds a time to whole frames.
[[nodiscard]] double ToWholeFrames(double time_s);

/// Returns the duration of a step in steady walking, in seconds. It decreases with length, because
/// people who walk faster take longer steps and more of them (Grieve and Gear 1966). The cadence is
/// 107 steps per minute at 0.6 m and 118 at 0.78 m. Murray, Drought and Kory 1964 measured 117 at
/// 0.78 m in men who walked at their free speed.
[[nodiscard]] double SteadyStepTime(double length_m);

/// Returns the duration of a step in seconds. In the style kStairs, it is at least 0.72 s and
/// increases with `rise_m`, the height difference of the feet, because people step more slowly on
/// stairs and uneven ground.
[[nodiscard]] double StepTime(double length_m, double rise_m, StepStyle style);

/// Pitch of a foot while it rolls over its ball, as fractions of its pitch at toe-off. Rates are
/// changes per half of double support. The other foot lands at the start of double support.
struct RollOff {
  double heel_rise_swing;  ///< Fraction of the other foot's swing at which the heel starts to rise.
  double strike;           ///< Pitch when the other foot lands.
  double strike_rate;      ///< Rate when the other foot lands.
  double state;            ///< Pitch in the middle of double support.
  double state_rate;       ///< Rate in the middle of double support.
  double toe_off_rate;     ///< Rate at toe-off.
  double toe_rock;         ///< Angle of the toes about their tip at toe-off.
  double swing;            ///< Pitch in the middle of the swing.
};

/// State in the middle of double support, in steady walking with the feet `length_m` apart. It
/// determines pose and velocity at the start and the end of a step. Length 0 is standing.
///
/// Each foot rolls over three rockers (Perry and Burnfield, Gait Analysis): over the heel from
/// heel-strike until the sole is flat, then the shank over the ankle, then the foot over the ball
/// from the middle of single support until toe-off. Pitches of the feet around the state:
///
///        heel-strike   state      toe-off
///   front      a        0.32 a       0       foot pitch; positive raises the toes
///   rear   -0.15 b     -0.40 b      -b      `RollOff`, in straight steps up to 0.55 m
struct GaitState {
  double length_m = 0.0;
  /// Time from heel-strike to the state, and from the state to toe-off.
  double half_support_s = 0.0;
  double step_s = 0.0;     ///< Duration of a steady step between two such states.
  double speed_mps = 0.0;  ///< Forward speed of the pelvis.
  /// min(1, mean speed of the step / 1.4 m/s). Scales the motion of the pelvis and the upper body.
  double vigour = 0.0;
  double strike_pitch_rad = 0.0;   ///< a.
  double toe_off_pitch_rad = 0.0;  ///< b, positive.
  RollOff roll_off{};
  double pelvis_drop_m = 0.0;  ///< Distance by which the pelvis is lower than when standing.
  /// Distance of the pelvis in front of the ankle of the rear foot, assuming that this foot is
  /// flat.
  double pelvis_ahead_m = 0.0;
  double sway_m = 0.0;  ///< Amplitude of the sideways sway in a step between two such states.
  /// Height of the front foot above the rear foot.
  double ascent_m = 0.0;

  [[nodiscard]] bool standing() const { return length_m == 0.0; }
  [[nodiscard]] double front_pitch_rad() const { return 0.32 * strike_pitch_rad; }
  [[nodiscard]] double rear_pitch_rad() const { return -roll_off.state * toe_off_pitch_rad; }
  /// Rates of the foot pitches in the state, in rad/s.
  [[nodiscard]] double front_pitch_rate() const;
  [[nodiscard]] double rear_pitch_rate() const;
  /// Angle of the toes about their tip at toe-off.
  [[nodiscard]] double toe_rock_rad() const { return roll_off.toe_rock * toe_off_pitch_rad; }
  /// Returns the distance by which the raised ball of the front foot is further back than if the
  /// foot were flat.
  [[nodiscard]] double front_ball_back_m() const;
};

/// `rise_m` is the height difference of the feet.
[[nodiscard]] GaitState MakeGaitState(double length_m, double rise_m = 0.0,
                                      StepStyle style = StepStyle::kStraight);

}  // namespace stridewire::builtin
