#include "runtime/plan/terrain_swing.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/plan/swing_path.h"
#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/foot_plant_constants.h"
#include "runtime/skeleton/leg_rig.h"

namespace stridewire {
namespace {

// Fractions of the swing at which the reach of the legs is checked.
constexpr std::array<double, 4> kSinkSamples{0.55, 0.7, 0.85, 1.0};
constexpr double kMaxRootSinkM = 0.3;
// A leg whose foot descends by kFullDescentM or more is extended to at most kDescentExtension of
// its length when it lands, so that its knee is bent. For smaller descents, the limit is between
// kDescentExtension and kLongestExtension. Without this limit, the knee would be nearly straight
// and would then bend abruptly. The limit applies from the fraction kBentLanding of the swing on.
constexpr double kDescentExtension = 0.97;
constexpr double kFullDescentM = 0.15;
constexpr double kBentLanding = 0.85;
constexpr double kLeastShare = 0.8;

// Evaluates the blended pose, before planting, into `job.pose`.
void EvaluateAt(const FootPlanJob& job, double time_s) {
  EvaluateMovement(job.library.group(job.movement.group), job.library.layout(), job.movement,
                   time_s, job.scratch.cache(), job.pose);
}

// Returns by how much planting would lower the root at this time, so that both legs reach their
// targets. The leg of `moving` may extend to `extension` of its length.
double MissingReach(const FootPlanJob& job, double time_s, Foot moving, double extension) {
  const LegRig& rig = job.library.leg_rig();
  EvaluateAt(job, time_s);
  std::array<LegPose, 2> legs;
  FeetAt blended;
  for (std::size_t f = 0; f < 2; ++f) {
    EvaluateLeg(job.library.skeleton(), rig, job.pose, static_cast<Foot>(f), legs[f]);
    blended[f] = FootOf(rig, static_cast<Foot>(f), DVec3(job.pose.root_position_m), legs[f]);
  }
  const FeetCorrection corrections = CorrectFeet(job.movement, time_s, blended);
  double missing_m = 0.0;
  for (std::size_t f = 0; f < 2; ++f) {
    const LegRig::Side& side = rig.sides[f];
    const Vec3& hip = legs[f].positions_m[static_cast<std::size_t>(side.hip)];
    const Vec3& ankle = legs[f].positions_m[static_cast<std::size_t>(side.ankle)];
    const double length_m = static_cast<double>(side.thigh_m) + side.shank_m;
    double allowed_m = std::clamp(static_cast<double>(glm::length(ankle - hip)),
                                  kEasyExtension * length_m, kLongestExtension * length_m);
    if (f == static_cast<std::size_t>(moving)) {
      allowed_m = std::min(allowed_m, extension * length_m);
    }
    const DVec3 at = blended[f].ball_m + corrections.feet[f].offset_m +
                     DVec3(TurnOf(corrections.feet[f]) * (ankle - legs[f].ball_m));
    const DVec3 reach = at - (DVec3(job.pose.root_position_m) + corrections.root_m + DVec3(hip));
    const double drop_squared = allowed_m * allowed_m - reach.x * reach.x - reach.z * reach.z;
    const double drop_m = std::sqrt(std::max(drop_squared, 0.25 * length_m * length_m));
    missing_m = std::max(missing_m, -reach.y - drop_m);
  }
  return missing_m;
}

// Samples the sole of the moving foot during its swing.
SwingSoles SampleSoles(const FootPlanJob& job, Foot moving) {
  const LegRig& rig = job.library.leg_rig();
  const FootTrajectory& trajectory = job.movement.feet.foot(moving);
  const LegRig::Side& side = rig.side(moving);
  SwingSoles soles;
  LegPose leg;
  for (std::size_t i = 0; i < kClearanceSamples.size(); ++i) {
    const double time_s =
        trajectory.release_s + kClearanceSamples[i] * (trajectory.land_s - trajectory.release_s);
    EvaluateAt(job, time_s);
    EvaluateLeg(job.library.skeleton(), rig, job.pose, moving, leg);
    const BlendedFoot blended = FootOf(rig, moving, DVec3(job.pose.root_position_m), leg);
    const FootCorrection correction = CorrectFoot(job.movement, moving, time_s, blended);
    const DVec3 ball = blended.ball_m + correction.offset_m;
    const Quat turn = TurnOf(correction);
    const auto sole = [&](const Vec3& point, double rest_m) {
      return ball + DVec3(turn * (point - leg.ball_m)) - DVec3(0.0, rest_m, 0.0);
    };
    soles.points_m[i] = {sole(leg.ball_m, side.ball_height_m), sole(leg.heel_m, side.ball_height_m),
                         sole(leg.toe_tip_m, side.toe_height_m)};
    soles.balls_m[i] = soles.points_m[i][0].y;
  }
  return soles;
}

}  // namespace

void ClearGround(const FootPlanJob& job, Foot moving, const Terrain& terrain) {
  FootTrajectory& trajectory = job.movement.feet.foot(moving);
  const SwingPath path = ChooseSwing(SampleSoles(job, moving), trajectory, terrain);
  trajectory.lift_m = path.lift_m;
  trajectory.mid_swing_offset_m = path.mid_swing_offset_m;
}

double RootSink(const FootPlanJob& job, Foot moving) {
  const FootTrajectory& trajectory = job.movement.feet.foot(moving);
  const double descent_m = trajectory.from.position_m.y - trajectory.to.position_m.y;
  const double descent = std::clamp(descent_m / kFullDescentM, 0.0, 1.0);
  const double bent = kLongestExtension + descent * (kDescentExtension - kLongestExtension);
  double sink_m = 0.0;
  for (const double part : kSinkSamples) {
    const double time_s = trajectory.release_s + part * (trajectory.land_s - trajectory.release_s);
    const double share = RootSinkShare(time_s / job.movement.duration_s());
    sink_m = std::max(sink_m, MissingReach(job, time_s, moving, kLongestExtension) / share);
    // If the foot lands long before the end of the movement, `share` is small, so the root would
    // descend much further after the landing. For a bent knee, which is only a preference, the
    // share counts as at least kLeastShare.
    if (part < kBentLanding) continue;
    sink_m =
        std::max(sink_m, MissingReach(job, time_s, moving, bent) / std::max(share, kLeastShare));
  }
  return std::min(sink_m, kMaxRootSinkM);
}

}  // namespace stridewire
