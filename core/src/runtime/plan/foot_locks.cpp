#include "runtime/plan/foot_locks.h"

#include <cmath>

#include "runtime/pose/plant_feet.h"
#include "runtime/skeleton/foot_plant_constants.h"

namespace stridewire {
namespace {

constexpr double kHalfFootWidthM = 0.04;
// A sole rests on bumps that rise less than kBumpM above the plane fitted to the ground
// (FootSupport). Higher ground is a wall.
constexpr double kBumpM = 0.05;

// If the ground ahead rises by more than this per metre, a foot does not tilt further.
constexpr double kSteepRise = 0.27;

// If the ground ahead rises steeply, changes the landing so that the foot stands on its toes, with
// the heel off the ground. Otherwise, the ankle would bend too far.
void StandOnToes(const LegRig::Side& side, FootTrajectory& trajectory) {
  Vec3& normal = trajectory.normals[1];
  const DVec3 forward = RotateYaw(trajectory.to.heading_rad, DVec3(0.0, 0.0, 1.0));
  const double rise = -(normal.x * forward.x + normal.z * forward.z) / normal.y;
  const double excess = rise - kSteepRise;
  if (excess <= 0.0) return;
  const DVec3 flatter = DVec3(normal / normal.y) + excess * forward;
  normal = Vec3(flatter / std::sqrt(glm::dot(flatter, flatter)));
  trajectory.to.position_m.y += excess * side.toe_m;
}

// Returns the height of the ground under a sole. The sole rests on the highest bump below it. Walls
// are ignored, because steps do not end on walls.
double StandingHeight(const FootSupport& support) {
  return support.plane_height_m + (support.rise_m < kBumpM ? support.rise_m : 0.0);
}

}  // namespace

double SlopeRise(const LegRig::Side& side, const Vec3& normal) {
  return side.ball_height_m * (1.0 / normal.y - 1.0);
}

Sole SoleOf(const LegRig::Side& side) {
  return {side.foot_m + kSoleBehindAnkleM, side.toe_m, kHalfFootWidthM};
}

FootSupport SupportOf(const Terrain& terrain, const LegRig::Side& side, const Footprint& print) {
  return SupportOf(terrain, print.position_m.x, print.position_m.z, print.heading_rad,
                   SoleOf(side));
}

void LandOnGround(const Terrain& terrain, const LegRig::Side& side, FootTrajectory& trajectory) {
  const FootSupport support = SupportOf(terrain, side, trajectory.to);
  trajectory.to.position_m.y = StandingHeight(support);
  trajectory.normals[1] = support.normal;
  StandOnToes(side, trajectory);
}

FootLocks FootLocksOf(const Skeleton& skeleton, const LegRig& rig, ConstPoseSpan pose,
                      double ground_m, const Terrain* terrain) {
  FootLocks locks;
  LegPose leg;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    EvaluateLeg(skeleton, rig, pose, foot, leg);
    const BlendedFoot blended = FootOf(rig, foot, DVec3(pose.root_position_m), leg);
    FootLock& lock = locks[static_cast<std::size_t>(foot)];
    lock.print = {DVec3(blended.ball_m.x, ground_m, blended.ball_m.z), blended.heading_rad};
    if (terrain == nullptr) continue;
    const FootSupport support = SupportOf(*terrain, rig.side(foot), lock.print);
    lock.print.position_m.y = StandingHeight(support);
    lock.normal = support.normal;
    lock.height_m = lock.print.position_m.y - ground_m + SlopeRise(rig.side(foot), support.normal);
  }
  return locks;
}

void StandOn(const FootLocks& locks, Movement& movement) {
  movement.warp = TimeWarp(std::array{0.0, kEaseOutS}, std::array{1});
  movement.start_offset_s = movement.extra_turn_rad = 0.0;
  movement.ease_out_s = kEaseOutS;
  FootPlan& plan = movement.feet;
  plan = {};
  plan.is_active = true;
  for (std::size_t f = 0; f < 2; ++f) {
    const FootLock& lock = locks[f];
    FootTrajectory& trajectory = plan.feet[f];
    trajectory.from = trajectory.to = lock.print;
    trajectory.normals.fill(lock.normal);
    trajectory.height_m.fill(lock.height_m);
    trajectory.turn_rad.fill(lock.turn_rad);
    trajectory.root_weight = lock.root_weight;
  }
}

FootLocks FootLocksAt(const MotionLibrary& library, const Movement& movement, double time_s,
                      ConstPoseSpan pose) {
  FootLocks locks;
  LegPose leg;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    EvaluateLeg(library.skeleton(), library.leg_rig(), pose, foot, leg);
    const FootCorrection correction = CorrectFoot(
        movement, foot, time_s, FootOf(library.leg_rig(), foot, DVec3(pose.root_position_m), leg));
    FootLock& lock = locks[static_cast<std::size_t>(foot)];
    const FootTrajectory& trajectory = movement.feet.foot(foot);
    lock.print = time_s > trajectory.release_s ? trajectory.to : trajectory.from;
    lock.height_m = correction.offset_m.y;
    lock.turn_rad = correction.free_turn_rad;
    lock.normal = correction.normal;
    lock.root_weight = correction.root_weight;
  }
  return locks;
}

}  // namespace stridewire
