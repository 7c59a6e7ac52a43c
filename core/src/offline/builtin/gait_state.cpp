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

// On stairs the heel rises further, so that the ankle below a bent knee can stay lower.
constexpr double kRiseHeel_deg_m = 60.0;

}  // namespace

double ToWholeFrames(double time_s) { return std::floor(time_s * kClipFps + 0.5) / kClipFps; }

double SteadyStepTime(double length_m) {
  const double speed = Power(length_m / (0.463 * kStatureM), 1.0 / 0.43);  // Statures per second.
  // Steps per minute in steady walking.
  const double cadence = 129.6 * Power(speed, 0.57);
  return std::clamp(60.0 / cadence, 0.42, 0.75);
}

double GaitState::front_pitch_rate() const {
  return standing() ? 0.0 : -0.66 * strike_pitch_rad / half_support_s;
}

double GaitState::rear_pitch_rate() const {
  return standing() ? 0.0 : -0.37 * toe_off_pitch_rad / half_support_s;
}

double GaitState::front_ball_back_m() const {
  const double foot = kHeelBehindAnkleM + kBallAheadOfAnkleM;
  return foot * (1.0 - Cos(front_pitch_rad())) * Cos(kToeOutRad);
}

GaitState MakeGaitState(double length_m, double rise_m, bool flat) {
  STRIDEWIRE_CHECK(length_m >= 0.0 && rise_m >= 0.0);
  GaitState state;
  state.length_m = length_m;
  state.pelvis_ahead_m = 0.02;
  if (state.standing()) return state;
  const double step_s = SteadyStepTime(length_m) + kRiseTime_s_m * rise_m;
  const double mean_speed = length_m / step_s;
  state.half_support_s = ToWholeFrames(0.12 * step_s);
  STRIDEWIRE_CHECK(state.half_support_s > 0.0);
  state.speed_mps = 0.95 * mean_speed;
  state.vigour = std::min(1.0, mean_speed / 1.4);
  state.strike_pitch_rad = flat ? 0.0 : 22.0 * kDegree * Tanh(length_m / 0.5);
  // Compromise between 68 tanh(L / 0.5) and the pitch that gives blended step lengths the smallest
  // errors.
  const Curve toe_off_deg({{0.0, 0.0}, {0.35, 30.0}, {0.55, 54.0}, {0.75, 61.5}, {0.9, 64.5}});
  state.toe_off_pitch_rad = (toe_off_deg.At(length_m) + kRiseHeel_deg_m * rise_m) * kDegree;
  state.toe_rock_rad = 0.65 * state.toe_off_pitch_rad;
  // The pelvis is lower when the feet are apart, with knees slightly more bent than necessary.
  const Curve drop({{0.0, 0.0}, {0.35, 0.003}, {0.55, 0.021}, {0.75, 0.0415}, {0.9, 0.075}});
  state.pelvis_drop_m = drop.At(length_m);
  const Curve ahead({{0.0, 0.02}, {0.35, 0.240}, {0.55, 0.405}, {0.75, 0.4955}, {0.9, 0.59}});
  state.pelvis_ahead_m = ahead.At(length_m);
  // The pelvis moves by 7.0 cm peak to peak at 0.7 m/s and by 3.9 cm at 1.6 m/s (Orendurff et al.
  // 2004).
  state.sway_m = 0.5 * (0.070 - (mean_speed - 0.7) / 0.9 * 0.031);
  return state;
}

}  // namespace stridewire::builtin
