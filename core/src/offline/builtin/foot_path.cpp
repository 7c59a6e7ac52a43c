#include "foot_path.h"

#include <algorithm>

#include "elementary.h"
#include "stridewire/base/trig.h"

namespace stridewire::builtin {
namespace {

constexpr double kClearanceM = 0.017;  // 15 mm, and what blending takes off it
constexpr double kLiftStepM = 0.004;
constexpr double kLeastLiftM = -0.08;
constexpr double kMostLiftM = 0.30;

DVec3 Forward(Foot foot) {
  const double yaw = SideSign(foot) * kToeOutRad;
  return {Sin(yaw), 0.0, Cos(yaw)};
}

// From standing only half the push: the body is not yet moving.
double ToeOffPitch(const StepTiming& timing) {
  if (!timing.start.standing()) return timing.start.toe_off_pitch_rad;
  return 0.5 * 68.0 * kDegree * Tanh(0.5 * timing.end.length_m / 0.5);
}

Curve MakeFixedPitch(const StepTiming& timing) {
  const GaitState& start = timing.start;
  const GaitState& end = timing.end;
  // Heels rise from the middle of single support on.
  const double heel_off_s = timing.toe_off_s + 0.42 * timing.swing_s();
  return Curve({{0.0, start.front_pitch_rad(), start.front_pitch_rate()},
                {timing.toe_off_s, 0.0, 0.0},
                {heel_off_s, 0.0, 0.0},
                {timing.heel_strike_s, -0.42 * end.toe_off_pitch_rad,
                 end.standing() ? 0.0 : -0.22 * end.toe_off_pitch_rad / end.half_support_s},
                {timing.end_s, end.rear_pitch_rad(), end.rear_pitch_rate()}});
}

Curve MakeMovingPitch(const StepTiming& timing) {
  const GaitState& start = timing.start;
  const double b = ToeOffPitch(timing);
  const double a = timing.end.strike_pitch_rad;
  const double swing = timing.swing_s();
  std::vector<Curve::Knot> knots;
  if (start.standing()) {
    knots = {{0.0, 0.0, 0.0}, {0.4 * timing.toe_off_s, 0.0, 0.0}};
  } else {
    knots = {{0.0, start.rear_pitch_rad(), start.rear_pitch_rate()}};
  }
  knots.push_back({timing.toe_off_s, -b, -0.32 * b / timing.toe_off_s});
  knots.push_back({timing.toe_off_s + 0.13 * swing, -1.09 * b});
  knots.push_back({timing.toe_off_s + 0.47 * swing, -0.45 * b});
  knots.push_back({timing.toe_off_s + 0.74 * swing, 0.05 * a});
  knots.push_back({timing.toe_off_s + 0.94 * swing, a, 0.0});
  knots.push_back(
      {timing.heel_strike_s, 0.97 * a, -0.9 * a / std::max(timing.end.half_support_s, 0.06)});
  knots.push_back({timing.end_s, timing.end.front_pitch_rad(), timing.end.front_pitch_rate()});
  return Curve(knots);
}

Curve MakeToeRock(const StepTiming& timing) {
  const double rock = timing.start.toe_rock_rad;
  if (rock == 0.0) return Curve({{0.0, 0.0}});
  return Curve({{0.0, 0.0, 0.0}, {timing.toe_off_s, rock, 1.9 * rock / timing.toe_off_s}});
}

// Angle of the toe joint in swing: what it has at toe-off fades to straight.
Curve MakeToeBend(const StepTiming& timing) {
  const double bend = ToeOffPitch(timing) - timing.start.toe_rock_rad;
  return Curve(
      {{timing.toe_off_s, bend, 0.0}, {timing.toe_off_s + 0.45 * timing.swing_s(), 0.0, 0.0}});
}

}  // namespace

DQuat FootRotation(Foot foot, double pitch_rad) {
  return RotateY(SideSign(foot) * kToeOutRad) * RotateX(-pitch_rad);
}

FootPlace FootOnGround(Foot foot, const DVec3& flat_ball_m, double pitch_rad, double toe_rock_rad) {
  FootPlace place;
  place.pitch_rad = pitch_rad;
  const DQuat rotation = FootRotation(foot, pitch_rad);
  if (pitch_rad > 0.0) {
    const DVec3 heel = flat_ball_m - (kHeelBehindAnkleM + kBallAheadOfAnkleM) * Forward(foot);
    place.toe_pitch_rad = pitch_rad;
    place.ankle_m = heel + rotation * DVec3(0.0, kAnkleHeightM, kHeelBehindAnkleM);
    return place;
  }
  place.toe_pitch_rad = -toe_rock_rad;
  const DVec3 tip = flat_ball_m + kToeM * Forward(foot);
  const DVec3 ball = tip - FootRotation(foot, -toe_rock_rad) * DVec3(0.0, 0.0, kToeM);
  place.ankle_m = ball + rotation * DVec3(0.0, kAnkleHeightM, -kBallAheadOfAnkleM);
  return place;
}

DVec3 StandingBall(Foot foot) {
  return DVec3(SideSign(foot) * kAnkleHalfWidthM, 0.0, 0.0) + kBallAheadOfAnkleM * Forward(foot);
}

FootPaths::FootPaths(Foot moving, const StepTiming& timing)
    : moving_(moving),
      timing_(timing),
      fixed_pitch_(MakeFixedPitch(timing)),
      moving_pitch_(MakeMovingPitch(timing)),
      toe_rock_(MakeToeRock(timing)),
      toe_bend_(MakeToeBend(timing)) {
  fixed_ball_m_ = DVec3(StandingBall(OtherFoot(moving)).x, 0.0, 0.0);
  // Lengths are measured at the balls as they are in the states, the front one raised.
  const double x = StandingBall(moving).x;
  start_ball_m_ = DVec3(x, 0.0, -timing.start.length_m - timing.start.front_ball_back_m());
  end_ball_m_ = DVec3(x, 0.0, timing.end.length_m + timing.end.front_ball_back_m());

  const double h = 1e-5;
  const FootPlace toe_off = MovingBeforeToeOff(timing.toe_off_s);
  toe_off_m_ = toe_off.ankle_m;
  toe_off_velocity_ = (toe_off_m_ - MovingBeforeToeOff(timing.toe_off_s - h).ankle_m) / h;
  const auto striking = [&](double time_s) {
    return FootOnGround(moving_, end_ball_m_, moving_pitch_.At(time_s), 0.0).ankle_m;
  };
  strike_m_ = striking(timing.heel_strike_s);
  strike_velocity_ = (striking(timing.heel_strike_s + h) - strike_m_) / h;
  RaiseSwingUntilClear();
}

FootPlace FootPaths::Fixed(double time_s) const {
  return FootOnGround(OtherFoot(moving_), fixed_ball_m_, fixed_pitch_.At(time_s), 0.0);
}

FootPlace FootPaths::MovingBeforeToeOff(double time_s) const {
  return FootOnGround(moving_, start_ball_m_, moving_pitch_.At(time_s), toe_rock_.At(time_s));
}

FootPlace FootPaths::MovingInSwing(double time_s) const {
  const double swing = timing_.swing_s();
  const double u = (time_s - timing_.toe_off_s) / swing;
  const double u2 = u * u, u3 = u2 * u;
  FootPlace place;
  place.pitch_rad = moving_pitch_.At(time_s);
  place.toe_pitch_rad = place.pitch_rad + toe_bend_.At(time_s);
  place.ankle_m = (2.0 * u3 - 3.0 * u2 + 1.0) * toe_off_m_ +
                  (u3 - 2.0 * u2 + u) * swing * toe_off_velocity_ +
                  (3.0 * u2 - 2.0 * u3) * strike_m_ + (u3 - u2) * swing * strike_velocity_;
  place.ankle_m.y += lift_m_ * 16.0 * u2 * (1.0 - u) * (1.0 - u);
  return place;
}

FootPlace FootPaths::Moving(double time_s) const {
  if (time_s <= timing_.toe_off_s) return MovingBeforeToeOff(time_s);
  if (time_s < timing_.heel_strike_s) return MovingInSwing(time_s);
  return FootOnGround(moving_, end_ball_m_, moving_pitch_.At(time_s), 0.0);
}

void FootPaths::RaiseSwingUntilClear() {
  const auto clear = [&] {
    for (int i = 5; i <= 85; ++i) {
      const FootPlace place = MovingInSwing(timing_.toe_off_s + 0.01 * i * timing_.swing_s());
      const DQuat foot = FootRotation(moving_, place.pitch_rad);
      const DQuat toes = FootRotation(moving_, place.toe_pitch_rad);
      const double heel = (place.ankle_m + foot * DVec3(0.0, -kAnkleHeightM, -kHeelBehindAnkleM)).y;
      const DVec3 ball = place.ankle_m + foot * DVec3(0.0, -kAnkleHeightM, kBallAheadOfAnkleM);
      const double tip = (ball + toes * DVec3(0.0, 0.0, kToeM)).y;
      if (i >= 30 && (heel < kClearanceM || ball.y < kClearanceM)) return false;
      if (tip < (i >= 50 ? kClearanceM : i >= 30 ? 0.012 : 0.0)) return false;
    }
    return true;
  };
  lift_m_ = kLeastLiftM;
  while (!clear() && lift_m_ < kMostLiftM) lift_m_ += kLiftStepM;
}

}  // namespace stridewire::builtin
