#include "offline/builtin/gait_state.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/trig.h"
#include "offline/builtin/curve.h"
#include "offline/builtin/elementary.h"
#include "offline/builtin/figure.h"

namespace stridewire::builtin {
namespace {

// Additional pitch of the foot at toe-off, in degrees, per metre of height difference between the
// feet.
constexpr double kRiseHeel_deg_m = 60.0;
constexpr double kMinStairsStepS = 0.72;
// Additional duration of a step in seconds per metre of height difference.
constexpr double kRiseTime_s_m = 0.6;

// In straight walking, the heel rises late and fast. On stairs it rises early, because the rear leg
// pushes the body up.
constexpr RollOff kStraightRollOff = {.heel_rise_swing = 0.52,
                                      .strike = 0.15,
                                      .strike_rate = 0.16,
                                      .state = 0.40,
                                      .state_rate = 0.42,
                                      .toe_off_rate = 0.50,
                                      .toe_rock = 0.19,
                                      .swing = 0.60};
constexpr RollOff kGeneralRollOff = {.heel_rise_swing = 0.48,
                                     .strike = 0.24,
                                     .strike_rate = 0.22,
                                     .state = 0.55,
                                     .state_rate = 0.42,
                                     .toe_off_rate = 0.42,
                                     .toe_rock = 0.30,
                                     .swing = 0.60};
constexpr RollOff kStairsRollOff = {.heel_rise_swing = 0.42,
                                    .strike = 0.42,
                                    .strike_rate = 0.22,
                                    .state = 0.72,
                                    .state_rate = 0.37,
                                    .toe_off_rate = 0.32,
                                    .toe_rock = 0.65,
                                    .swing = 0.45};

RollOff RollOffOf(double length_m, StepStyle style) {
  switch (style) {
    case StepStyle::kGeneral: return kGeneralRollOff;
    case StepStyle::kStairs: return kStairsRollOff;
    case StepStyle::kStraight: break;
  }
  // In long steps, the heel is higher when the other foot lands, because a flat foot cannot stay as
  // far behind the body.
  RollOff roll_off = kStraightRollOff;
  const double long_step = std::clamp((length_m - 0.55) / 0.2, 0.0, 1.0);
  roll_off.strike += 0.15 * long_step;
  roll_off.state += 0.28 * long_step;
  roll_off.state_rate -= 0.10 * long_step;
  roll_off.toe_off_rate -= 0.16 * long_step;
  roll_off.toe_rock += 0.20 * long_step;
  roll_off.strike_rate += 0.10 * long_step;
  return roll_off;
}

}  // namespace

double ToWholeFrames(double time_s) { return std::floor(time_s * kClipFps + 0.5) / kClipFps; }

double SteadyStepTime(double length_m) {
  const Curve steps_per_minute(
      {{0.0, 92.0}, {0.35, 99.0}, {0.6, 107.0}, {0.78, 118.0}, {0.9, 126.0}});
  return 60.0 / steps_per_minute.At(length_m);
}

double GaitState::front_pitch_rate() const {
  return standing() ? 0.0 : -0.66 * strike_pitch_rad / half_support_s;
}

double GaitState::rear_pitch_rate() const {
  return standing() ? 0.0 : -roll_off.state_rate * toe_off_pitch_rad / half_support_s;
}

double GaitState::front_ball_back_m() const {
  const double foot = kHeelBehindAnkleM + kBallAheadOfAnkleM;
  return foot * (1.0 - Cos(front_pitch_rad())) * Cos(kToeOutRad);
}

double StepTime(double length_m, double rise_m, StepStyle style) {
  const double level_s = SteadyStepTime(length_m);
  return style == StepStyle::kStairs ? std::max(level_s, kMinStairsStepS) + kRiseTime_s_m * rise_m
                                     : level_s;
}

GaitState MakeGaitState(double length_m, double rise_m, StepStyle style) {
  STRIDEWIRE_CHECK(length_m >= 0.0 && rise_m >= 0.0);
  const bool on_stairs = style == StepStyle::kStairs;
  GaitState state;
  state.length_m = length_m;
  state.pelvis_ahead_m = 0.02;
  state.roll_off = RollOffOf(length_m, style);
  if (state.standing()) return state;
  state.step_s = StepTime(length_m, rise_m, style);
  const double mean_speed = length_m / state.step_s;
  // The pelvis is lowest and fastest while both feet are on the ground. As in a pendulum, height is
  // exchanged for speed (Cavagna and Margaria 1966).
  state.speed_mps = (on_stairs ? 0.95 : 1.08) * mean_speed;
  state.vigour = std::min(1.0, mean_speed / 1.4);
  // At free speed, double support takes 20 to 24 % of the stride (Perry and Burnfield, Gait
  // Analysis), and more in slow walking. Here it is 23 % at 1.4 m/s and 35 % at 0.57 m/s.
  const double share = on_stairs ? 0.12 : 0.220 - 0.105 * state.vigour;
  state.half_support_s = ToWholeFrames(share * state.step_s);
  STRIDEWIRE_CHECK(state.half_support_s > 0.0);
  state.strike_pitch_rad = on_stairs ? 0.0 : 24.0 * kDegree * Tanh(length_m / 0.5);
  const Curve toe_off_deg({{0.0, 0.0}, {0.35, 37.0}, {0.55, 58.0}, {0.75, 62.0}, {0.9, 65.0}});
  state.toe_off_pitch_rad = (toe_off_deg.At(length_m) + kRiseHeel_deg_m * rise_m) * kDegree;
  // The pelvis descends by half of what it would descend on stiff legs: 27 mm at 0.7 m/s and 48 mm
  // at 1.6 m/s (Orendurff et al. 2004, centre of the body). The front knee bends by 15 to 20
  // degrees. The pelvis is as far back as the front leg can reach at heel-strike.
  const Curve drop =
      on_stairs ? Curve({{0.0, 0.0}, {0.35, 0.003}, {0.55, 0.021}, {0.75, 0.0415}, {0.9, 0.075}})
                : Curve({{0.0, 0.0}, {0.35, 0.0145}, {0.55, 0.0280}, {0.75, 0.052}, {0.9, 0.088}});
  state.pelvis_drop_m = drop.At(length_m);
  const Curve ahead =
      on_stairs ? Curve({{0.0, 0.02}, {0.35, 0.240}, {0.55, 0.405}, {0.75, 0.4955}, {0.9, 0.59}})
                : Curve({{0.0, 0.02}, {0.35, 0.255}, {0.55, 0.355}, {0.75, 0.474}, {0.9, 0.54}});
  state.pelvis_ahead_m = ahead.At(length_m);
  // The pelvis sways by 7.0 cm peak to peak at 0.7 m/s and by 3.9 cm at 1.6 m/s (Orendurff et al.
  // 2004).
  state.sway_m = 0.5 * (0.070 - (mean_speed - 0.7) / 0.9 * 0.031);
  return state;
}

}  // namespace stridewire::builtin
