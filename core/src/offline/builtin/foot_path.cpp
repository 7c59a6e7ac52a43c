#include "offline/builtin/foot_path.h"

#include <algorithm>

#include "base/easing.h"
#include "base/trig.h"
#include "offline/builtin/elementary.h"
#include "offline/builtin/swing_detour.h"

namespace stridewire::builtin {
namespace {

// Minimum height of a swinging foot above level ground: 15 mm, plus 2 mm that blending may lose.
constexpr double kClearanceM = 0.017;
constexpr double kLiftStepM = 0.004;
constexpr double kMinLiftM = -0.08;
constexpr double kMaxLiftM = 0.30;

// If the foot steps down by more than this, its toes land first, at this pitch.
constexpr double kToesFirstDropM = 0.1;
constexpr double kToesFirstRad = -18.0 * kDegree;
// Assumed edges of stair treads. When a foot steps up, the edge of the upper tread is this far
// behind the ball of the foot after landing. When it steps down, the edge is this far ahead of the
// ball before toe-off.
constexpr double kEdgeBehindBallM = 0.15;
constexpr double kEdgeAheadOfBallM = 0.03;
constexpr double kEdgeClearanceM = 0.02;

constexpr DetourRange kDetours = {.max_m = 0.40, .step_m = 0.005, .clearance_m = 0.085};

DVec3 Forward(Foot foot, double yaw_rad = 0.0) {
  const double yaw = yaw_rad + SideSign(foot) * kToeOutRad;
  return {Sin(yaw), 0.0, Cos(yaw)};
}

// In a step from standing, the foot pushes off less, because the body is not moving yet.
double ToeOffPitch(const StepTiming& timing) {
  if (!timing.start.standing()) return timing.start.toe_off_pitch_rad;
  return 0.5 * 68.0 * kDegree * Tanh(0.5 * timing.end.length_m / 0.5);
}

Curve MakeFixedPitch(const StepTiming& timing) {
  const GaitState& start = timing.start;
  const GaitState& end = timing.end;
  // The heel rises slowly from the second half of single support on, and fast from the heel-strike
  // of the other foot on.
  const RollOff& roll_off = end.roll_off;
  const double heel_off_s = timing.toe_off_s + roll_off.heel_rise_swing * timing.swing_s();
  const double at_strike = roll_off.strike * end.toe_off_pitch_rad;
  double strike_rate = 0.0;
  if (!end.standing()) {
    // A steeper cubic curve would first raise the toes.
    const double steepest = 3.0 * at_strike / (timing.heel_strike_s - heel_off_s);
    strike_rate =
        std::min(roll_off.strike_rate * end.toe_off_pitch_rad / end.half_support_s, steepest);
  }
  return Curve({{0.0, start.front_pitch_rad(), start.front_pitch_rate()},
                {timing.toe_off_s, 0.0, 0.0},
                {heel_off_s, 0.0, 0.0},
                {timing.heel_strike_s, -at_strike, -strike_rate},
                {timing.end_s, end.rear_pitch_rad(), end.rear_pitch_rate()}});
}

double StrikePitch(const StepTiming& timing) {
  return timing.shape.end_m.y < -kToesFirstDropM ? kToesFirstRad : timing.end.strike_pitch_rad;
}

Curve MakeMovingPitch(const StepTiming& timing) {
  const GaitState& start = timing.start;
  const double b = ToeOffPitch(timing);
  const double a = StrikePitch(timing);
  const double swing = timing.swing_s();
  const RollOff& roll_off = start.roll_off;
  std::vector<Curve::Knot> knots;
  if (start.standing()) {
    knots = {{0.0, 0.0, 0.0}, {0.4 * timing.toe_off_s, 0.0, 0.0}};
  } else {
    knots = {{0.0, start.rear_pitch_rad(), start.rear_pitch_rate()}};
  }
  knots.push_back({timing.toe_off_s, -b, -roll_off.toe_off_rate * b / timing.toe_off_s});
  knots.push_back({timing.toe_off_s + 0.15 * swing, -1.09 * b});
  knots.push_back({timing.toe_off_s + 0.47 * swing, -roll_off.swing * b});
  knots.push_back({timing.toe_off_s + 0.74 * swing, 0.0});
  knots.push_back({timing.toe_off_s + 0.94 * swing, a, 0.0});
  knots.push_back(
      {timing.heel_strike_s, 0.97 * a, -0.9 * a / std::max(timing.end.half_support_s, 0.06)});
  knots.push_back({timing.end_s, timing.end.front_pitch_rad(), timing.end.front_pitch_rate()});
  return Curve(knots);
}

Curve MakeToeRock(const StepTiming& timing) {
  const double rock = timing.start.toe_rock_rad();
  if (rock == 0.0) return Curve({{0.0, 0.0}});
  return Curve({{0.0, 0.0, 0.0}, {timing.toe_off_s, rock, 1.9 * rock / timing.toe_off_s}});
}

// Returns the angle of the toe joint in swing. The toes first keep their pitch while the foot
// rotates further, so that the toe tip stays above the ground. Then they straighten.
Curve MakeToeBend(const StepTiming& timing) {
  const double bend = ToeOffPitch(timing) - timing.start.toe_rock_rad();
  const double kept_s = timing.toe_off_s + 0.15 * timing.swing_s();
  const double kept = bend + 0.12 * ToeOffPitch(timing);
  const double straight_s = timing.toe_off_s + 0.5 * timing.swing_s();
  const double strike = StrikePitch(timing);
  if (strike >= 0.0) {
    return Curve({{timing.toe_off_s, bend}, {kept_s, kept, 0.0}, {straight_s, 0.0, 0.0}});
  }
  // If the toes land first, they are flat on the ground from then on.
  return Curve({{timing.toe_off_s, bend},
                {kept_s, kept, 0.0},
                {straight_s, 0.0, 0.0},
                {timing.toe_off_s + 0.7 * timing.swing_s(), 0.0, 0.0},
                {timing.heel_strike_s, -0.97 * strike, 0.0}});
}

// Position of a swinging foot along one axis at one end of its swing.
struct SwingEnd {
  double position_m;
  double velocity;  // Metres per swing.
};

// Returns the position of a swinging foot along one axis, at the fraction `u` of its swing. As in
// captured walks, the foot is fastest at about 70 % of the swing and slows down just before it
// lands.
double SwingAlong(double u, const SwingEnd& from, const SwingEnd& to) {
  const double path_m = to.position_m - from.position_m;
  return Curve({{0.0, from.position_m, from.velocity},
                {0.35, from.position_m + 0.30 * path_m, 1.02 * path_m},
                {0.72, from.position_m + 0.755 * path_m, 1.32 * path_m},
                {1.0, to.position_m, to.velocity}})
      .At(u);
}

}  // namespace

DQuat FootRotation(Foot foot, double pitch_rad, double yaw_rad) {
  return RotateY(yaw_rad + SideSign(foot) * kToeOutRad) * RotateX(-pitch_rad);
}

FootPose FootOnGround(Foot foot, const DVec3& flat_ball_m, double pitch_rad, double toe_rock_rad,
                      double yaw_rad) {
  FootPose foot_pose;
  foot_pose.pitch_rad = pitch_rad;
  foot_pose.yaw_rad = yaw_rad;
  const DQuat rotation = FootRotation(foot, pitch_rad, yaw_rad);
  if (pitch_rad > 0.0) {
    const DVec3 heel =
        flat_ball_m - (kHeelBehindAnkleM + kBallAheadOfAnkleM) * Forward(foot, yaw_rad);
    foot_pose.toe_pitch_rad = pitch_rad;
    foot_pose.ankle_m = heel + rotation * DVec3(0.0, kAnkleHeightM, kHeelBehindAnkleM);
    return foot_pose;
  }
  foot_pose.toe_pitch_rad = -toe_rock_rad;
  const DVec3 tip = flat_ball_m + kToeM * Forward(foot, yaw_rad);
  const DVec3 ball = tip - FootRotation(foot, -toe_rock_rad, yaw_rad) * DVec3(0.0, 0.0, kToeM);
  foot_pose.ankle_m = ball + rotation * DVec3(0.0, kAnkleHeightM, -kBallAheadOfAnkleM);
  return foot_pose;
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
  // The lengths of the shape are distances between the balls at both ends of the step. There, the
  // ball of the front foot is raised, and is thus further back than if the foot were flat.
  const StepShape& shape = timing.shape;
  start_ball_m_ = fixed_ball_m_ + shape.start_m - DVec3(0.0, 0.0, timing.start.front_ball_back_m());
  end_ball_m_ = fixed_ball_m_ + RotateY(shape.turn_rad) *
                                    (shape.end_m + DVec3(0.0, 0.0, timing.end.front_ball_back_m()));

  const double h = 1e-5;
  const FootPose toe_off = MovingBeforeToeOff(timing.toe_off_s);
  toe_off_m_ = toe_off.ankle_m;
  toe_off_velocity_ = (toe_off_m_ - MovingBeforeToeOff(timing.toe_off_s - h).ankle_m) / h;
  const auto striking = [&](double time_s) {
    return FootOnGround(moving_, end_ball_m_, moving_pitch_.At(time_s), 0.0, shape.turn_rad)
        .ankle_m;
  };
  strike_m_ = striking(timing.heel_strike_s);
  strike_velocity_ = (striking(timing.heel_strike_s + h) - strike_m_) / h;
  if (shape.turn_rad != 0.0) LeadSwingAroundFixedFoot();
  RaiseSwingUntilClear();
}

FootPose FootPaths::Fixed(double time_s) const {
  return FootOnGround(OtherFoot(moving_), fixed_ball_m_, fixed_pitch_.At(time_s), 0.0);
}

FootPose FootPaths::MovingBeforeToeOff(double time_s) const {
  return FootOnGround(moving_, start_ball_m_, moving_pitch_.At(time_s), toe_rock_.At(time_s));
}

FootPose FootPaths::MovingInSwing(double time_s) const {
  const double swing = timing_.swing_s();
  const double u = (time_s - timing_.toe_off_s) / swing;
  const double y0 = start_ball_m_.y, y1 = end_ball_m_.y, climb = y1 - y0;
  // When stepping down, the foot first moves forward past the edge of the tread. When stepping up,
  // it rises first.
  const double w = climb < 0.0   ? u + 0.6 * u * u * (1.0 - u)
                   : climb > 0.0 ? u - 0.6 * u * (1.0 - u) * (1.0 - u)
                                 : u;
  const double climbed = climb < 0.0 ? SmoothStep((u - 0.45) / 0.55) : SmoothStep(u / 0.6);
  const double u2 = w * w, u3 = u2 * w;
  FootPose foot_pose;
  foot_pose.pitch_rad = moving_pitch_.At(time_s);
  foot_pose.yaw_rad = timing_.shape.turn_rad * SmoothStep((u - 0.1) / 0.8);
  foot_pose.toe_pitch_rad = foot_pose.pitch_rad + toe_bend_.At(time_s);
  const DVec3 from = toe_off_m_ - DVec3(0.0, y0, 0.0), to = strike_m_ - DVec3(0.0, y1, 0.0);
  foot_pose.ankle_m = (2.0 * u3 - 3.0 * u2 + 1.0) * from +
                      (u3 - 2.0 * u2 + w) * swing * toe_off_velocity_ + (3.0 * u2 - 2.0 * u3) * to +
                      (u3 - u2) * swing * strike_velocity_;
  if (timing_.shape.style != StepStyle::kStairs) {
    foot_pose.ankle_m.x =
        SwingAlong(u, {from.x, toe_off_velocity_.x * swing}, {to.x, strike_velocity_.x * swing});
    foot_pose.ankle_m.z =
        SwingAlong(u, {from.z, toe_off_velocity_.z * swing}, {to.z, strike_velocity_.z * swing});
    // The ankle is highest early in the swing. It then descends to slightly above its height at
    // heel-strike.
    foot_pose.ankle_m.y = Curve({{0.0, from.y, toe_off_velocity_.y * swing},
                                 {0.72, to.y + 0.018, -0.06},
                                 {1.0, to.y, strike_velocity_.y * swing}})
                              .At(u);
  }
  foot_pose.ankle_m.y += y0 + climb * climbed + lift_m_ * Bump(u);
  foot_pose.ankle_m += detour_m_ * Bump(u) * SideSign(moving_) *
                       (RotateY(0.5 * timing_.shape.turn_rad) * DVec3(1, 0, 0));
  return foot_pose;
}

FootPose FootPaths::Moving(double time_s) const {
  if (time_s <= timing_.toe_off_s) return MovingBeforeToeOff(time_s);
  if (time_s < timing_.heel_strike_s) return MovingInSwing(time_s);
  return FootOnGround(moving_, end_ball_m_, moving_pitch_.At(time_s), 0.0, timing_.shape.turn_rad);
}

// Returns the height of the ground at z. The ground has three levels: where the moving foot starts,
// under the fixed foot, and where the moving foot lands.
double FootPaths::GroundAt(double z_m) const {
  const auto edge = [](const DVec3& behind, const DVec3& ahead) {
    return behind.y < ahead.y ? ahead.z - kEdgeBehindBallM : behind.z + kEdgeAheadOfBallM;
  };
  if (end_ball_m_.y != 0.0 && z_m > edge(fixed_ball_m_, end_ball_m_)) return end_ball_m_.y;
  if (start_ball_m_.y != 0.0 && z_m < edge(start_ball_m_, fixed_ball_m_)) return start_ball_m_.y;
  return 0.0;
}

// Returns the smallest horizontal distance between the feet during the swing. Each foot is a line
// from its heel to its toe tip.
double FootPaths::NearestApproach() const {
  const Foot fixed = OtherFoot(moving_);
  const auto points = [](Foot foot, const FootPose& foot_pose, DVec3(&out)[5]) {
    const DVec3 ahead = Forward(foot, foot_pose.yaw_rad);
    for (int k = 0; k < 5; ++k) {
      out[k] = foot_pose.ankle_m + (-kHeelBehindAnkleM + 0.065 * k) * ahead;
      out[k].y = 0.0;
    }
  };
  DVec3 still[5], swinging[5];
  points(fixed, FootOnGround(fixed, fixed_ball_m_, 0.0, 0.0), still);
  double nearest = kDetours.max_m;
  for (int i = 1; i < 20; ++i) {
    points(moving_, MovingInSwing(timing_.toe_off_s + 0.05 * i * timing_.swing_s()), swinging);
    for (const DVec3& a : still) {
      for (const DVec3& b : swinging) nearest = std::min(nearest, glm::length(a - b));
    }
  }
  return nearest;
}

void FootPaths::LeadSwingAroundFixedFoot() {
  detour_m_ = FindDetour(kDetours, [&](double detour_m) {
    detour_m_ = detour_m;
    return NearestApproach();
  });
}

void FootPaths::RaiseSwingUntilClear() {
  const bool level = start_ball_m_.y == 0.0 && end_ball_m_.y == 0.0;
  const double clearance = level ? kClearanceM : kEdgeClearanceM;
  const auto clear = [&] {
    for (int i = 5; i <= 85; ++i) {
      const FootPose foot_pose = MovingInSwing(timing_.toe_off_s + 0.01 * i * timing_.swing_s());
      const DQuat foot = FootRotation(moving_, foot_pose.pitch_rad, foot_pose.yaw_rad);
      const DQuat toes = FootRotation(moving_, foot_pose.toe_pitch_rad, foot_pose.yaw_rad);
      const DVec3 heel = foot_pose.ankle_m + foot * DVec3(0.0, -kAnkleHeightM, -kHeelBehindAnkleM);
      const DVec3 ball = foot_pose.ankle_m + foot * DVec3(0.0, -kAnkleHeightM, kBallAheadOfAnkleM);
      const DVec3 tip = ball + toes * DVec3(0.0, 0.0, kToeM);
      const auto above = [&](const DVec3& point) { return point.y - GroundAt(point.z); };
      if (i >= 30 && (above(heel) < clearance || above(ball) < clearance)) return false;
      if (above(tip) < (i >= 50 ? clearance : i >= 30 ? 0.012 : i >= 15 ? 0.004 : 0.0))
        return false;
    }
    return true;
  };
  lift_m_ = kMinLiftM;
  while (!clear() && lift_m_ < kMaxLiftM) lift_m_ += kLiftStepM;
}

}  // namespace stridewire::builtin
