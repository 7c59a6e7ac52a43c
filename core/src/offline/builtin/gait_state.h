#pragma once

namespace stridewire::builtin {

/// Frames a second of every generated clip. Keytimes are whole frames, so that a state is a frame.
inline constexpr double kClipFps = 120.0;

[[nodiscard]] double ToWholeFrames(double time_s);

/// Duration of a step of a length in steady walking, seconds: cadence after Grieve and Gear 1966,
/// V = (L / 0.463 H)^(1/0.43) statures a second, 129.6 V^0.57 steps a minute, within 0.42..0.75 s
/// (the walk ratio is constant only at normal speeds; below, people vary).
[[nodiscard]] double SteadyStepTime(double length_m);

/// The middle of double support in steady walking with the feet `length_m` apart: everything a
/// pose or a velocity at the start or the end of a step depends on. Length 0 is standing.
///
///   heel-strike        state          toe-off
///   front  a            0.32 a         0           foot pitch, toes up positive
///   rear  -0.42 b      -0.72 b        -b
struct GaitState {
  double length_m = 0.0;
  double half_support_s = 0.0;     ///< heel-strike to state, and state to toe-off
  double speed_mps = 0.0;          ///< of the pelvis, forward
  double vigour = 0.0;             ///< min(1, speed / 1.4 m/s): scales what the upper body does
  double strike_pitch_rad = 0.0;   ///< a
  double toe_off_pitch_rad = 0.0;  ///< b, positive
  double toe_rock_rad = 0.0;       ///< how far the toes have risen about their tip at toe-off
  double pelvis_drop_m = 0.0;      ///< below standing
  double pelvis_ahead_m = 0.0;     ///< pelvis ahead of the rear ankle's place when flat
  double sway_m = 0.0;  ///< amplitude toward the stance foot in a step between such states

  [[nodiscard]] bool standing() const { return length_m == 0.0; }
  [[nodiscard]] double front_pitch_rad() const { return 0.32 * strike_pitch_rad; }
  [[nodiscard]] double rear_pitch_rad() const { return -0.72 * toe_off_pitch_rad; }
  /// Rates of the foot pitches at the state, rad/s.
  [[nodiscard]] double front_pitch_rate() const;
  [[nodiscard]] double rear_pitch_rate() const;
  /// How much less far ahead the raised ball of the front foot is than when it lies flat.
  [[nodiscard]] double front_ball_back_m() const;
};

/// `rise_m`: how much higher one foot stands than the other; takes time (0.6 s a metre). `flat`: as in
/// StepShape.
[[nodiscard]] GaitState MakeGaitState(double length_m, double rise_m = 0.0, bool flat = false);

inline constexpr double kRiseTime_s_m = 0.6;

}  // namespace stridewire::builtin
