#include "pelvis_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "elementary.h"
#include "leg_ik.h"
#include "stridewire/base/trig.h"

namespace stridewire::builtin {
namespace {

constexpr int kSamples = 161;
constexpr double kLeastKneeRad = 4.0 * kDegree;
constexpr double kYawRad = 5.0 * kDegree;
constexpr double kRollRad = 4.0 * kDegree;
constexpr double kTiltRad = 1.5 * kDegree;

Curve MakeForward(const StepTiming& timing) {
  // Flat ankles: the fixed foot's at -ball_ahead, the others a length and the raised ball's
  // shortfall behind or ahead of it.
  const double fixed_ankle = -kBallAheadOfAnkleM * Cos(kToeOutRad);
  const double rear_at_start =
      fixed_ankle - timing.start.length_m - timing.start.front_ball_back_m();
  return Curve({{0.0, rear_at_start + timing.start.pelvis_ahead_m, timing.start.speed_mps},
                {timing.end_s, fixed_ankle + timing.end.pelvis_ahead_m, timing.end.speed_mps}});
}

Curve MakeSide(Foot moving, const StepTiming& timing) {
  const GaitState& start = timing.start;
  const GaitState& end = timing.end;
  const double toward_fixed = SideSign(OtherFoot(moving));
  double sway = 0.5 * (start.sway_m + end.sway_m);
  if (start.standing() || end.standing())
    sway = 0.036;  // the weight has to come over one foot without any swing
  const double middle_s = timing.toe_off_s + (start.standing() ? 0.3 : 0.5) * timing.swing_s();
  const auto rate = [](const GaitState& state) {
    return state.standing() ? 0.0 : state.sway_m * 0.12 * std::numbers::pi / state.half_support_s;
  };
  return Curve({{0.0, 0.0, toward_fixed * rate(start)},
                {middle_s, toward_fixed * sway, 0.0},
                {timing.end_s, 0.0, -toward_fixed * rate(end)}});
}

// The side whose leg is ahead is ahead: a positive yaw brings the right side forward.
Curve MakeYaw(Foot moving, const StepTiming& timing) {
  const double to_right = SideSign(moving);
  return Curve({{0.0, to_right * kYawRad * timing.start.vigour, 0.0},
                {timing.end_s, -to_right * kYawRad * timing.end.vigour, 0.0}});
}

// The side of the swinging leg drops soon after toe-off.
Curve MakeRoll(Foot moving, const StepTiming& timing) {
  const double drop = -SideSign(moving) * kRollRad;
  const double vigour = std::max(timing.start.vigour, timing.end.vigour);
  const auto rate = [](const GaitState& state) {
    return state.standing() ? 0.0 : 0.3 * state.vigour / state.half_support_s;
  };
  return Curve({{0.0, 0.0, drop * rate(timing.start)},
                {timing.toe_off_s + 0.2 * timing.swing_s(), drop * vigour, 0.0},
                {timing.end_s, 0.0, -drop * rate(timing.end)}});
}

// Forward, twice a stride. The ten degrees by which a pelvis tilts anyway are in its bones.
Curve MakeTilt(const StepTiming& timing) {
  const double start = kTiltRad * timing.start.vigour, end = kTiltRad * timing.end.vigour;
  return Curve({{0.0, start, 0.0},
                {0.5 * timing.end_s, -0.5 * (start + end), 0.0},
                {timing.end_s, end, 0.0}});
}

Curve MakeHeight(const StepTiming& timing) {
  const double vigour = 0.5 * (timing.start.vigour + timing.end.vigour);
  const double top = kStandingHipHeightM - 0.003 - 0.0095 * vigour;
  const double middle_s = 0.42 * timing.end_s;
  std::vector<Curve::Knot> knots = {{0.0, kStandingHipHeightM - timing.start.pelvis_drop_m, 0.0}};
  knots.push_back({middle_s, top, 0.0});
  knots.push_back({timing.end_s, kStandingHipHeightM - timing.end.pelvis_drop_m, 0.0});
  return Curve(knots);
}

}  // namespace

PelvisPath::PelvisPath(Foot moving, const StepTiming& timing, const FootPaths& feet)
    : moving_(moving),
      timing_(timing),
      forward_(MakeForward(timing)),
      side_(MakeSide(moving, timing)),
      yaw_(MakeYaw(moving, timing)),
      roll_(MakeRoll(moving, timing)),
      tilt_(MakeTilt(timing)),
      height_(MakeHeight(timing)),
      lowered_m_(kSamples, 0.0) {
  StayWithinReach(feet);
}

DVec3 PelvisPath::Position(double time_s) const {
  const double at = std::clamp(time_s / timing_.end_s, 0.0, 1.0) * (kSamples - 1);
  const int i = std::clamp(static_cast<int>(at), 1, kSamples - 3);
  // Catmull-Rom through the samples keeps velocities smooth.
  const double s = at - i;
  const auto y = [&](int k) { return lowered_m_[static_cast<std::size_t>(k)]; };
  const double m0 = 0.5 * (y(i + 1) - y(i - 1)), m1 = 0.5 * (y(i + 2) - y(i));
  const double lowered = y(i) + s * (m0 + s * (3.0 * (y(i + 1) - y(i)) - 2.0 * m0 - m1 +
                                               s * (m0 + m1 - 2.0 * (y(i + 1) - y(i)))));
  return {side_.At(time_s), height_.At(time_s) - lowered, forward_.At(time_s)};
}

DQuat PelvisPath::Rotation(double time_s) const {
  return RotateY(yaw_.At(time_s)) * RotateZ(roll_.At(time_s)) * RotateX(tilt_.At(time_s));
}

void PelvisPath::StayWithinReach(const FootPaths& feet) {
  // A few spline knots instead of these filters diverge: the ceiling is sharp where legs change.
  constexpr int kRounds = 3, kMaxHalf = 12, kSmoothHalf = 20;
  const double reach = ReachAtKnee(kLeastKneeRad);
  std::vector<double> excess(kSamples), highest(kSamples);
  for (int round = 0; round < kRounds; ++round) {
    for (int i = 0; i < kSamples; ++i) {
      const double time_s = timing_.end_s * i / (kSamples - 1);
      const DVec3 root = Position(time_s);
      const DQuat rotation = Rotation(time_s);
      double over = 0.0;
      for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
        const DVec3 ankle = (foot == moving_ ? feet.Moving(time_s) : feet.Fixed(time_s)).ankle_m;
        const DVec3 hip = root + rotation * DVec3(SideSign(foot) * kHipHalfWidthM, 0.0, 0.0);
        const double dx = hip.x - ankle.x, dz = hip.z - ankle.z;
        const double ceiling =
            ankle.y + std::sqrt(std::max(0.0, reach * reach - dx * dx - dz * dz));
        over = std::max(over, hip.y - ceiling);
      }
      excess[static_cast<std::size_t>(i)] = over;
    }
    for (int i = 0; i < kSamples; ++i) {
      double most = 0.0;
      for (int k = std::max(0, i - kMaxHalf); k <= std::min(kSamples - 1, i + kMaxHalf); ++k) {
        most = std::max(most, excess[static_cast<std::size_t>(k)]);
      }
      highest[static_cast<std::size_t>(i)] = most;
    }
    for (int i = 0; i < kSamples; ++i) {
      double sum = 0.0, weights = 0.0;
      for (int k = -kSmoothHalf; k <= kSmoothHalf; ++k) {
        const double weight = 1.0 + Cos(std::numbers::pi * k / (kSmoothHalf + 1));
        sum += weight * highest[static_cast<std::size_t>(std::clamp(i + k, 0, kSamples - 1))];
        weights += weight;
      }
      const double from_end = std::min(i, kSamples - 1 - i) / (0.06 * (kSamples - 1));
      lowered_m_[static_cast<std::size_t>(i)] += sum / weights * Ease(from_end);
    }
  }
}

}  // namespace stridewire::builtin
