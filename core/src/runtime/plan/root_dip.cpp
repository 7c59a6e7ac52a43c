#include "runtime/plan/root_dip.h"

#include <algorithm>

#include "runtime/pose/evaluate_poses.h"
#include "runtime/pose/plant_feet.h"

namespace stridewire {
namespace {

// Minimum depth of a dip. If planting lowers the root by less, the root does not rise abruptly.
constexpr double kLeastDepthM = 0.015;
constexpr double kMaxDepthM = 0.2;
constexpr double kMaxSpeedMPerS = 0.6;
// The speed at the release is the mean speed during this time before it. If the movement starts
// later, there is no dip.
constexpr double kSpeedStepS = 1.0 / 60.0;
// Maximum time from the release until the root has risen again.
constexpr double kMaxRiseS = 0.35;

// Returns how far below its planned height planting puts the root at a time, in metres. Planting
// lowers the root so that both legs reach their targets. Overwrites `job.pose`.
double LoweringAt(const FootPlanJob& job, double time_s) {
  const Skeleton& skeleton = job.library.skeleton();
  const LegRig& rig = job.library.leg_rig();
  EvaluateMovement(job.library.group(job.movement.group), job.library.layout(), job.movement,
                   time_s, job.scratch.cache(), job.pose);
  const double planned_m = double{job.pose.root_position_m.y} +
                           CorrectFeet(skeleton, rig, job.movement, time_s, job.pose).root_m.y;
  PlantFeet(rig, job.movement, time_s, job.pose);
  return planned_m - double{job.pose.root_position_m.y};
}

}  // namespace

void PlanRootDip(const FootPlanJob& job) {
  FootPlan& plan = job.movement.feet;
  plan.root_dip = {};
  const MovementKind kind = job.library.group(job.movement.group).kind;
  if (!plan.is_active || !plan.keeps_above_ground || !IsStep(kind)) return;
  const FootTrajectory& moving = plan.foot(MovingFoot(kind));
  if (!(moving.release_s - job.movement.start_offset_s > kSpeedStepS)) return;
  const double depth_m = LoweringAt(job, moving.release_s);
  if (!(depth_m > kLeastDepthM)) return;
  const double earlier_m = LoweringAt(job, moving.release_s - kSpeedStepS);
  plan.root_dip = {
      .depth_m = std::min(depth_m, kMaxDepthM),
      .speed_m_s = std::clamp((depth_m - earlier_m) / kSpeedStepS, 0.0, kMaxSpeedMPerS),
      .over_s = std::min(kMaxRiseS,
                         std::min(moving.land_s, job.movement.duration_s()) - moving.release_s)};
}

}  // namespace stridewire
