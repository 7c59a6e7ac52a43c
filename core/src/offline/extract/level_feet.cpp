#include "offline/extract/level_feet.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/easing.h"

namespace stridewire {
namespace {

// In a stand pose, a foot farther from the ground than this does not stand on it.
constexpr double kMaxStandErrorM = 0.04;

// Increases smoothly from 0 at the time `from_s` to 1 at `to_s`.
double Ramp(double time_s, double from_s, double to_s) {
  return SmoothStep((time_s - from_s) / std::max(to_s - from_s, 1e-6));
}

// Times in seconds between which the moving feet are in the air.
struct Flight {
  double toe_off_s = 0.0;
  double landing_s = 0.0;
};

Flight FlightOf(const ExtractedExample& example) {
  const std::vector<double>& keytimes_s = example.example.keytimes_s;
  // Steps: start, toe-off, heel-strike, end. Jumps: start, crouch, toe-off, landing, absorb, end.
  STRIDEWIRE_CHECK(keytimes_s.size() == (IsStep(example.kind) ? 4u : 6u));
  const std::size_t off = IsStep(example.kind) ? 1 : 2;
  return {keytimes_s[off], keytimes_s[off + 1]};
}

}  // namespace

FeetLeveller::FeetLeveller(const Skeleton& skeleton, ConstPoseSpan any_pose,
                           const std::array<Vec3, 2>& hinges,
                           const std::array<double, 2>& ball_height_m)
    : skeleton_(skeleton),
      ball_height_m_(ball_height_m),
      rig_(MakeLegRig(skeleton, any_pose, hinges)) {}

void FeetLeveller::Level(ExtractedExample& example, std::span<const ParameterName> names) const {
  const auto& ground_m = example.ground_m;
  Clip& clip = example.example.clip;
  const Flight flight = FlightOf(example);
  const double end_s = example.example.keytimes_s.back();
  const bool is_step = IsStep(example.kind);
  for (int i = 0; i < clip.frame_count(); ++i) {
    const double t = i / clip.fps;
    const double flown = Ramp(t, flight.toe_off_s, flight.landing_s);
    std::array<double, 2> raise_m{};
    for (std::size_t f = 0; f < 2; ++f) {
      raise_m[f] = -(ground_m[f][0] + flown * (ground_m[f][1] - ground_m[f][0]));
    }
    double root_m = 0.5 * (raise_m[0] + raise_m[1]);
    if (is_step) {
      // In the middle of double support, the moving foot carries half of the weight. While the
      // foot is in the air, it carries none.
      const double share =
          0.5 * (1.0 - Ramp(t, 0.0, flight.toe_off_s) + Ramp(t, flight.landing_s, end_s));
      const auto m = static_cast<std::size_t>(MovingFoot(example.kind));
      root_m = share * raise_m[m] + (1.0 - share) * raise_m[1 - m];
    }
    Raise(raise_m, root_m, clip.frame(i));
  }
  if (is_step) {
    MeasureStepParameters(skeleton_, names, MovingFoot(example.kind), example.example);
  }
}

void FeetLeveller::Level(PoseSpan stand) const {
  if (!rig_.is_usable) return;
  std::array<double, 2> raise_m{};
  LegPose leg;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const auto f = static_cast<std::size_t>(foot);
    EvaluateLeg(skeleton_, rig_, stand, foot, leg);
    raise_m[f] = ball_height_m_[f] - (stand.root_position_m.y + leg.ball_m.y);
    if (std::fabs(raise_m[f]) > kMaxStandErrorM) return;
  }
  Raise(raise_m, 0.5 * (raise_m[0] + raise_m[1]), stand);
}

void FeetLeveller::Raise(const std::array<double, 2>& feet_m, double root_m, PoseSpan pose) const {
  constexpr double kNegligibleM = 1e-5;
  pose.root_position_m.y += static_cast<float>(root_m);
  if (!rig_.is_usable) return;
  LegPose leg;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const double bend_m = feet_m[static_cast<std::size_t>(foot)] - root_m;
    if (std::fabs(bend_m) < kNegligibleM) continue;
    EvaluateLeg(skeleton_, rig_, pose, foot, leg);
    const auto ankle = static_cast<std::size_t>(rig_.side(foot).ankle);
    SolveLeg(rig_, foot, leg, leg.positions_m[ankle] + Vec3(0.0f, static_cast<float>(bend_m), 0.0f),
             leg.world_rotations[ankle], pose);
  }
}

}  // namespace stridewire
