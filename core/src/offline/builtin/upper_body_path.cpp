#include "offline/builtin/upper_body_path.h"

#include <algorithm>
#include <cstddef>
#include <numbers>
#include <vector>

#include "base/easing.h"
#include "base/trig.h"

namespace stridewire::builtin {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kArmAbductionRad = 6.0 * kDegree;
constexpr double kStandingElbowRad = 14.0 * kDegree;
constexpr double kStandingArmRad = -1.0 * kDegree;
constexpr double kThoraxYawRad = 4.0 * kDegree;
constexpr double kThoraxRollRad = 2.0 * kDegree;
constexpr double kLeanRangeRad = 1.6 * kDegree;
constexpr double kNodRad = 1.5 * kDegree;
// Values of Oscillation::lag for the swings of arm and elbow.
constexpr double kArmLag = 0.05;
constexpr double kElbowLag = 0.17;

double Mix(double a, double b, double s) { return a + (b - a) * s; }

// The oscillation of an angle about `middle`, for one gait state.
struct Oscillation {
  double middle = 0.0;
  double amplitude = 0.0;
  double lag = 0.0;  // Time from the state to an extreme, as a fraction of a step.
};

// Returns the slope of amplitude * cos(2 pi cycles (u - lag)) at u = 0, per second. u is the time
// as a fraction of a step.
double SlopeOf(const Oscillation& oscillation, double cycles, const GaitState& state) {
  if (state.standing()) return 0.0;
  const double angle = 2.0 * kPi * cycles;
  return oscillation.amplitude * angle * Sin(angle * oscillation.lag) / state.step_s;
}

// Creates a curve with half a period per step, from one extreme to the other.
Curve PerStride(const StepTiming& timing, const Oscillation& start, const Oscillation& end) {
  const double first = start.middle + start.amplitude * Cos(kPi * start.lag);
  const double last = end.middle - end.amplitude * Cos(kPi * end.lag);
  std::vector<Curve::Knot> knots = {{0.0, first, SlopeOf(start, 0.5, timing.start)}};
  if (!timing.start.standing() && start.lag > 0.0) {
    const double u = start.lag;
    knots.push_back({u * timing.end_s,
                     Mix(start.middle + start.amplitude, end.middle + end.amplitude, SmoothStep(u)),
                     0.0});
  }
  knots.push_back({timing.end_s, last, -SlopeOf(end, 0.5, timing.end)});
  return Curve(knots);
}

// Creates a curve with one period per step. It is middle + amplitude at both ends, and middle -
// amplitude in between. `middle_offset` is added to the value in between.
Curve PerStep(const StepTiming& timing, const Oscillation& start, const Oscillation& end,
              double middle_offset = 0.0) {
  const double low = 0.5 * (start.middle + end.middle - start.amplitude - end.amplitude);
  return Curve({{0.0, start.middle + start.amplitude, 0.0},
                {0.4 * timing.end_s, low + middle_offset, 0.0},
                {timing.end_s, end.middle + end.amplitude, 0.0}});
}

// The ranges of shoulder and elbow are close to those of Perry and Burnfield, Gait Analysis: the
// shoulder moves between 24 degrees of extension and 8 of flexion, the elbow from 20 to 45 degrees.
Oscillation Arm(const GaitState& state) {
  const double forward = Mix(kStandingArmRad, 12.0 * kDegree, state.vigour);
  const double back = Mix(kStandingArmRad, -22.0 * kDegree, state.vigour);
  return {0.5 * (forward + back), 0.5 * (forward - back), kArmLag};
}

Oscillation Elbow(const GaitState& state) {
  const double forward = Mix(kStandingElbowRad, 42.0 * kDegree, state.vigour);
  const double back = Mix(kStandingElbowRad, 20.0 * kDegree, state.vigour);
  return {0.5 * (forward + back), 0.5 * (forward - back), kElbowLag};
}

Oscillation Opposite(const Oscillation& oscillation) {
  return {oscillation.middle, -oscillation.amplitude, oscillation.lag};
}

// In slow walking, thorax and pelvis rotate almost together. In faster walking, they rotate more in
// opposite directions (van Emmerik and Wagenaar 1996).
Oscillation ThoraxYaw(Foot moving, const GaitState& state) {
  return {0.0, -SideSign(moving) * kThoraxYawRad * state.vigour, Mix(0.36, 0.18, state.vigour)};
}

// The trunk leans further forward uphill and on stairs. In a step, it leans forward most shortly
// after heel-strikes and least in single support (Krebs et al. 1992).
Oscillation Lean(const GaitState& state) {
  const double slope =
      state.standing() ? 0.0 : std::clamp(state.ascent_m / state.length_m, -1.0, 1.0);
  const double uphill = (slope > 0.0 ? 9.0 : 3.0) * slope;
  return {(4.0 + 3.0 * state.speed_mps + uphill) * kDegree, kLeanRangeRad * state.vigour};
}

// Returns the lean of the trunk due to acceleration. A body with the acceleration a must lean by
// atan(a / g) to stay in balance. Trunk and legs share this lean.
double AccelerationLean(const StepTiming& timing) {
  constexpr double kRad_mps2 = 2.5 * kDegree;
  const double acceleration = (timing.end.speed_mps - timing.start.speed_mps) / timing.end_s;
  return kRad_mps2 * std::clamp(acceleration, -2.0, 2.0);
}

// The trunk bends towards the standing leg.
Curve MakeThoraxRoll(Foot moving, const StepTiming& timing) {
  const double lift = SideSign(moving) * kThoraxRollRad;
  const auto rate = [&](const GaitState& state) {
    return state.standing() ? 0.0 : lift * state.vigour * kPi / state.step_s;
  };
  const double most = lift * std::max(0.5, 0.5 * (timing.start.vigour + timing.end.vigour));
  return Curve({{0.0, 0.0, rate(timing.start)},
                {0.5 * (timing.toe_off_s + timing.heel_strike_s), most, 0.0},
                {timing.end_s, 0.0, -rate(timing.end)}});
}

// The head nods down while the body is high and up while it is low, so that the eyes keep looking
// at their target (Pozzo, Berthoz and Lefort 1990).
Oscillation Nod(const GaitState& state) {
  return {0.3 * Lean(state).middle, -kNodRad * state.vigour};
}

}  // namespace

UpperBodyPath::UpperBodyPath(Foot moving, const StepTiming& timing)
    : thorax_yaw_(
          PerStride(timing, ThoraxYaw(moving, timing.start), ThoraxYaw(moving, timing.end))),
      thorax_roll_(MakeThoraxRoll(moving, timing)),
      lean_(PerStep(timing, Lean(timing.start), Lean(timing.end), AccelerationLean(timing))),
      nod_(PerStep(timing, Nod(timing.start), Nod(timing.end))) {
  // The moving foot is behind at the start, so the arm on its side is in front.
  const auto m = static_cast<std::size_t>(moving), f = static_cast<std::size_t>(OtherFoot(moving));
  arms_[m] = PerStride(timing, Arm(timing.start), Arm(timing.end));
  arms_[f] = PerStride(timing, Opposite(Arm(timing.start)), Opposite(Arm(timing.end)));
  elbows_[m] = PerStride(timing, Elbow(timing.start), Elbow(timing.end));
  elbows_[f] = PerStride(timing, Opposite(Elbow(timing.start)), Opposite(Elbow(timing.end)));
}

UpperBody UpperBodyPath::At(double time_s) const {
  UpperBody body;
  body.thorax_yaw = thorax_yaw_.At(time_s);
  body.thorax_roll = thorax_roll_.At(time_s);
  body.thorax_lean = lean_.At(time_s);
  body.head_nod = nod_.At(time_s);
  body.arm_abduction = kArmAbductionRad;
  for (const std::size_t side : {0u, 1u}) {
    body.arm_flexion[side] = arms_[side].At(time_s);
    body.elbow_flexion[side] = elbows_[side].At(time_s);
  }
  return body;
}

UpperBody StandingUpperBody() {
  const GaitState still = MakeGaitState(0.0);
  UpperBody body;
  body.thorax_lean = Lean(still).middle;
  body.head_nod = Nod(still).middle;
  body.arm_abduction = kArmAbductionRad;
  for (const std::size_t side : {0u, 1u}) {
    body.arm_flexion[side] = kStandingArmRad;
    body.elbow_flexion[side] = kStandingElbowRad;
  }
  return body;
}

}  // namespace stridewire::builtin
