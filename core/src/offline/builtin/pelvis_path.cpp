#include "offline/builtin/pelvis_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/easing.h"
#include "base/trig.h"
#include "offline/base/moving_window.h"
#include "offline/builtin/leg_ik.h"

namespace stridewire::builtin {
namespace {

constexpr int kSamples = 161;
constexpr double kMinKneeRad = 6.0 * kDegree;  // Minimum bend of the knees.
// Amplitudes at 1.4 m/s. Perry and Burnfield, Gait Analysis, give 5 degrees of yaw and 4 of
// obliquity (roll) to each side. The amplitudes are slightly larger, because blended steps lose a
// part of them.
constexpr double kYawRad = 6.5 * kDegree;
constexpr double kRollRad = 4.8 * kDegree;
constexpr double kTiltRad = 1.5 * kDegree;

// Sideways position of the pelvis between the feet: 0 is above the fixed foot, 1 above the moving
// foot.
constexpr double kMiddleShare = 0.5;

// Horizontal positions of the pelvis at both ends of a step. Successive steps join without a jump
// only if both have the same position of the pelvis in the state between them. The position
// therefore depends only on the balls of the feet and on that state. The rear foot is assumed to be
// flat.
struct Ends {
  DVec3 start;
  DVec3 end;
  DVec3 end_velocity;
};

Ends EndsOf(const StepTiming& timing, const FootPaths& feet) {
  const double ankle = -kBallAheadOfAnkleM * Cos(kToeOutRad);
  const DVec3& fixed = feet.fixed_ball_m();
  const DVec3& from = feet.start_ball_m();
  const DQuat turn = RotateY(timing.shape.turn_rad);
  Ends ends;
  ends.start =
      DVec3(kMiddleShare * (fixed.x + from.x), 0.0, from.z + ankle + timing.start.pelvis_ahead_m);
  ends.end = fixed + turn * DVec3(kMiddleShare * timing.shape.end_m.x, 0.0,
                                  ankle + timing.end.pelvis_ahead_m);
  ends.end_velocity = turn * DVec3(0.0, 0.0, timing.end.speed_mps);
  return ends;
}

Curve MakeForward(const StepTiming& timing, const Ends& ends) {
  return Curve({{0.0, ends.start.z, timing.start.speed_mps},
                {timing.end_s, ends.end.z, ends.end_velocity.z}});
}

Curve MakeAcross(const StepTiming& timing, const Ends& ends) {
  return Curve({{0.0, ends.start.x, 0.0}, {timing.end_s, ends.end.x, ends.end_velocity.x}});
}

Curve MakeSway(Foot moving, const StepTiming& timing) {
  const GaitState& start = timing.start;
  const GaitState& end = timing.end;
  const double toward_fixed = SideSign(OtherFoot(moving));
  double sway = 0.5 * (start.sway_m + end.sway_m);
  if (start.standing() || end.standing()) {
    sway = 0.036;  // Without momentum, the weight must move over one foot.
  }
  // Before a foot moves far sideways, the body leans to the other side.
  const double stand_width = 2.0 * StandingBall(Foot::kLeft).x;
  sway += 0.2 * std::max(0.0, std::fabs(timing.shape.end_m.x) - stand_width);
  const double middle_s = timing.toe_off_s + (start.standing() ? 0.3 : 0.5) * timing.swing_s();
  const auto rate = [](const GaitState& state) {
    return state.standing() ? 0.0 : state.sway_m * 0.12 * std::numbers::pi / state.half_support_s;
  };
  return Curve({{0.0, 0.0, toward_fixed * rate(start)},
                {middle_s, toward_fixed * sway, 0.0},
                {timing.end_s, 0.0, -toward_fixed * rate(end)}});
}

// The hip of the leading leg is forward. A positive yaw moves the right side forward.
Curve MakeYaw(Foot moving, const StepTiming& timing) {
  const double to_right = SideSign(moving);
  return Curve({{0.0, to_right * kYawRad * timing.start.vigour, 0.0},
                {timing.end_s, -to_right * kYawRad * timing.end.vigour, 0.0}});
}

// The weight moves to the front leg until toe-off. Then the side of the swinging leg drops. It is
// lowest 15 % of the stride after the heel-strike of the other leg, and level again at its own
// heel-strike (Perry and Burnfield, Gait Analysis).
Curve MakeRoll(Foot moving, const StepTiming& timing) {
  const double drop = -SideSign(moving) * kRollRad;
  // In slow steps, obliquity decreases less than the other rotations.
  const auto share = [](const GaitState& state) {
    return state.standing() ? 0.0 : 0.35 + 0.65 * state.vigour;
  };
  const auto rate = [&](const GaitState& state) {
    return state.standing() ? 0.0 : share(state) * std::numbers::pi / state.step_s;
  };
  return Curve({{0.0, 0.0, drop * rate(timing.start)},
                {timing.toe_off_s + 0.22 * timing.swing_s(),
                 drop * std::max(share(timing.start), share(timing.end)), 0.0},
                {timing.end_s, 0.0, -drop * rate(timing.end)}});
}

// The pelvis tilts forwards twice per stride. Its constant tilt of ten degrees is part of the
// skeleton.
Curve MakeTilt(const StepTiming& timing) {
  const double start = kTiltRad * timing.start.vigour, end = kTiltRad * timing.end.vigour;
  return Curve({{0.0, start, 0.0},
                {0.5 * timing.end_s, -0.5 * (start + end), 0.0},
                {timing.end_s, end, 0.0}});
}

// Returns the height of the pelvis in a state in which the moving foot is at `moved_m` relative to
// the fixed one. It is the walking height above the lower foot, unless legs with knees bent by 12
// degrees cannot reach that far.
double StateHeight(const GaitState& state, const DVec3& moved_m) {
  const double low = std::min(0.0, moved_m.y);
  const double height = low + kStandingHipHeightM - state.pelvis_drop_m;
  const double stand_width = 2.0 * StandingBall(Foot::kLeft).x;
  const bool rolls = state.standing() || state.strike_pitch_rad > 0.0;
  if (moved_m.y == 0.0 && rolls && std::fabs(moved_m.x - stand_width) < 1e-9) return height;
  const bool fixed_is_rear = moved_m.z >= 0.0;
  const DVec3 rear_ball = fixed_is_rear ? DVec3(0.0) : moved_m;
  const DVec3 front_ball = fixed_is_rear ? moved_m : DVec3(0.0);
  // Side of the rear foot. The left foot is the moving foot.
  const double side = fixed_is_rear ? -1.0 : 1.0;
  const Foot rear = fixed_is_rear ? Foot::kRight : Foot::kLeft;
  const DVec3 rear_ankle = FootOnGround(rear, rear_ball, state.rear_pitch_rad(), 0.0).ankle_m;
  const DVec3 front_ankle =
      FootOnGround(OtherFoot(rear), front_ball, state.front_pitch_rad(), 0.0).ankle_m;
  const DVec3 pelvis(kMiddleShare * moved_m.x, 0.0,
                     rear_ball.z - kBallAheadOfAnkleM * Cos(kToeOutRad) + state.pelvis_ahead_m);
  const double reach = ReachAtKnee(12.0 * kDegree);
  const DVec3 to_rear_hip(side * kHipHalfWidthM, 0.0, 0.0);
  return std::min({height, HighestHipM(pelvis + to_rear_hip, rear_ankle, reach),
                   HighestHipM(pelvis - to_rear_hip, front_ankle, reach)});
}

// Converts a vector of a right step to that of the mirrored left step.
DVec3 AsLeft(Foot moving, const DVec3& d) { return {SideSign(moving) * d.x, d.y, d.z}; }

Curve MakeHeight(Foot moving, const StepTiming& timing) {
  // At the highest point, the knee of the standing leg is bent by 5 to 10 degrees.
  const double vigour = 0.5 * (timing.start.vigour + timing.end.vigour);
  const double top = kStandingHipHeightM - 0.003 - 0.002 * vigour;
  const double start = StateHeight(timing.start, AsLeft(moving, timing.shape.start_m));
  const double end = StateHeight(timing.end, AsLeft(moving, timing.shape.end_m));
  const bool level = timing.shape.start_m.y == 0.0 && timing.shape.end_m.y == 0.0;
  if (level) {
    return Curve({{0.0, start, 0.0}, {0.42 * timing.end_s, top, 0.0}, {timing.end_s, end, 0.0}});
  }
  // In steps up, most of the rise is early, when the upper leg takes the weight. In steps down,
  // most of the drop is late.
  const double middle = top - 0.2 * std::max(0.0, top - start) - 0.25 * std::max(0.0, top - end);
  return Curve({{0.0, start, 0.0}, {0.45 * timing.end_s, middle}, {timing.end_s, end, 0.0}});
}

}  // namespace

PelvisPath::PelvisPath(Foot moving, const StepTiming& timing, const FootPaths& feet)
    : moving_(moving),
      timing_(timing),
      across_(MakeAcross(timing, EndsOf(timing, feet))),
      forward_(MakeForward(timing, EndsOf(timing, feet))),
      sway_(MakeSway(moving, timing)),
      yaw_(MakeYaw(moving, timing)),
      roll_(MakeRoll(moving, timing)),
      tilt_(MakeTilt(timing)),
      height_(MakeHeight(moving, timing)),
      lowered_m_(kSamples, 0.0) {
  StayWithinReach(feet);
}

DVec3 PelvisPath::Position(double time_s) const {
  const double at = std::clamp(time_s / timing_.end_s, 0.0, 1.0) * (kSamples - 1);
  const int i = std::clamp(static_cast<int>(at), 1, kSamples - 3);
  // Catmull-Rom interpolation of the samples keeps velocities smooth.
  const double s = at - i;
  const auto y = [&](int k) { return lowered_m_[static_cast<std::size_t>(k)]; };
  const double m0 = 0.5 * (y(i + 1) - y(i - 1)), m1 = 0.5 * (y(i + 2) - y(i));
  const double lowered = y(i) + s * (m0 + s * (3.0 * (y(i + 1) - y(i)) - 2.0 * m0 - m1 +
                                               s * (m0 + m1 - 2.0 * (y(i + 1) - y(i)))));
  return DVec3(across_.At(time_s), height_.At(time_s) - lowered, forward_.At(time_s)) +
         RotateY(Heading(time_s)) * DVec3(sway_.At(time_s), 0.0, 0.0);
}

double PelvisPath::Heading(double time_s) const {
  if (timing_.shape.turn_rad == 0.0) return 0.0;
  // This is turn_rad * SmootherStep(s). The order of the multiplications must not change: it
  // determines rounding, and therefore the bytes of the library.
  const double s = std::clamp(time_s / timing_.end_s, 0.0, 1.0);
  return timing_.shape.turn_rad * s * s * s * (10.0 + s * (6.0 * s - 15.0));
}

DQuat PelvisPath::Rotation(double time_s) const {
  return RotateY(Heading(time_s) + yaw_.At(time_s)) * RotateZ(roll_.At(time_s)) *
         RotateX(tilt_.At(time_s));
}

double PelvisPath::MissingReach(const FootPaths& feet, double time_s) const {
  const double reach = ReachAtKnee(kMinKneeRad);
  const DVec3 root = Position(time_s);
  const DQuat rotation = Rotation(time_s);
  double missing = 0.0;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const DVec3 ankle = (foot == moving_ ? feet.Moving(time_s) : feet.Fixed(time_s)).ankle_m;
    const DVec3 hip = root + rotation * DVec3(SideSign(foot) * kHipHalfWidthM, 0.0, 0.0);
    missing = std::max(missing, hip.y - HighestHipM(hip, ankle, reach));
  }
  return missing;
}

void PelvisPath::StayWithinReach(const FootPaths& feet) {
  // A fit with a few spline knots would diverge, because the limit has a kink where the other leg
  // becomes the limiting one. The lowering is therefore filtered.
  constexpr int kRounds = 3, kMaximumHalf = 12, kMeanHalf = 20;
  std::vector<double> weights;
  for (int k = -kMeanHalf; k <= kMeanHalf; ++k) {
    weights.push_back(1.0 + Cos(std::numbers::pi * k / (kMeanHalf + 1)));
  }
  std::vector<double> missing(kSamples);
  for (int round = 0; round < kRounds; ++round) {
    for (int i = 0; i < kSamples; ++i) {
      missing[static_cast<std::size_t>(i)] = MissingReach(feet, timing_.end_s * i / (kSamples - 1));
    }
    const std::vector<double> smooth = MovingMean(MovingMaximum(missing, kMaximumHalf), weights);
    for (int i = 0; i < kSamples; ++i) {
      // The pelvis is lowered at neither end of a step, because successive steps have the same pose
      // there. A step that turns may lower the pelvis at its end: its last pose differs from the
      // first pose of the next step anyway, because the rear foot points in another direction.
      const int to_state = timing_.shape.turn_rad == 0.0 ? std::min(i, kSamples - 1 - i) : i;
      const auto k = static_cast<std::size_t>(i);
      lowered_m_[k] += smooth[k] * SmoothStep(to_state / (0.06 * (kSamples - 1)));
    }
  }
}

}  // namespace stridewire::builtin
