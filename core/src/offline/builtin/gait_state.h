#pragma once

namespace stridewire::builtin {

/// Frame rate of generated clips. Keytimes are whole frames, so that every state is a frame.
inline constexpr double kClipFps = 120.0;

/// Rounds a time to whole frames.
[[nodiscard]] double ToWholeFrames(double time_s);

/// Returns the duration of a step in steady walking, in seconds. The cadence follows Grieve and
/// Gear 1966: V = (L / 0.463 H)^(1/0.43) statures per second, 129.6 V^0.57 steps per minute. The
/// result is limited to 0.42..0.75 s, since the walk ratio is constant only at normal speeds.
[[nodiscard]] double SteadyStepTime(double length_m);

/// The middle of double support in steady walking with the feet `length_m` apart. It determines
/// pose and velocity at the start and the end of a step. Length 0 is standing.
///
///        heel-strike   state      toe-off
///   front      a        0.32 a       0       foot pitch, toes up is positive
///   rear   -0.42 b     -0.72 b      -b
struct GaitState {
  double length_m = 0.0;
  /// Time from heel-strike to the state, and from the state to toe-off.
  double half_support_s = 0.0;
  double speed_mps = 0.0;          ///< Forward speed of the pelvis.
  double vigour = 0.0;             ///< min(1, speed / 1.4 m/s); scales motion of the upper body.
  double strike_pitch_rad = 0.0;   ///< a.
  double toe_off_pitch_rad = 0.0;  ///< b, positive.
  double toe_rock_rad = 0.0;       ///< Angle of the toes about their tip at toe-off.
  double pelvis_drop_m = 0.0;      ///< Height of the pelvis below standing.
  /// Distance of the pelvis in front of the rear ankle, if that foot is flat.
  double pelvis_ahead_m = 0.0;
  double sway_m = 0.0;  ///< Sideways amplitude of a step between two such states.

  [[nodiscard]] bool standing() const { return length_m == 0.0; }
  [[nodiscard]] double front_pitch_rad() const { return 0.32 * strike_pitch_rad; }
  [[nodiscard]] double rear_pitch_rad() const { return -0.72 * toe_off_pitch_rad; }
  /// Rates of the foot pitches in the state, in rad/s.
  [[nodiscard]] double front_pitch_rate() const;
  [[nodiscard]] double rear_pitch_rate() const;
  /// Returns the distance by which raising the ball of the front foot moves it back.
  [[nodiscard]] double front_ball_back_m() const;
};

/// `rise_m`: height difference of the feet, which takes additional time (kRiseTime_s_m). `flat` is
/// StepShape::flat.
[[nodiscard]] GaitState MakeGaitState(double length_m, double rise_m = 0.0, bool flat = false);

/// Additional time per height difference, in seconds per metre.
inline constexpr double kRiseTime_s_m = 0.6;

}  // namespace stridewire::builtin
