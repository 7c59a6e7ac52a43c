#pragma once

#include <array>
#include <limits>

#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// The path of one foot through a movement, as corrections that planting adds to the blended pose.
/// b(t) is the ball of the foot in the blended pose with the difference pose, in world space.
///
///   horizontal: t <= release: from - b(t), so that the ball stands still at `from`;
///               then a cubic that continues with the same offset and velocity and ends at
///               t >= land: to - b(t)
///   heading:    locked while the sole is on the ground; with the heel up it follows the blend
///   height:     follows the blend, plus corrections that ease from one value to the next, plus
///               `level_m`. It is locked only if `locks_height`, because in captured libraries a
///               lock would bend knees by 25 degrees
struct FootTrajectory {
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  Footprint from;  ///< Footprint at the start.
  Footprint to;    ///< Footprint at the end.
  /// Time at which the foot leaves `from`. kNever: it stands throughout the movement.
  double release_s = kNever;
  double land_s = kNever;               ///< Time at which the foot comes to rest on `to`.
  DVec3 release_offset_m = DVec3(0.0);  ///< Offset of the ball from b(t) at release.
  /// Turn that the heading lock adds to the heading of the foot at release.
  double release_turn_rad = 0.0;
  DVec3 release_velocity_m_s = DVec3(0.0);  ///< Velocity of the offset at release.
  DVec3 land_offset_m = DVec3(0.0);         ///< Offset of the ball from b(t) at landing.
  DVec3 land_velocity_m_s = DVec3(0.0);     ///< Velocity of the offset at landing.
  // Corrections of the height and heading of the blended foot: at Movement::start_offset_s, after
  // the difference pose has faded out, and from landing on. If `locks_height`, `height_m` contains
  // heights of the ball above the footprint.
  std::array<double, 3> height_m{};
  std::array<double, 3> turn_rad{};
  /// An additional height that keeps the sole of a step's supporting foot on the ground:
  /// coefficients of u, u^2, u^3 and u^4, where u is the elapsed fraction of the movement.
  std::array<double, 4> level_m{};
  /// Peak of an additional height while the difference pose fades out; negative if the foot has to
  /// be lowered. Without it, the foot would sink or hover, because the rotations of the legs and
  /// the height of the root fade differently.
  double settle_lift_m = 0.0;
  /// True if the height of the ball is locked to the footprint as well. A standing avatar needs
  /// this, because its legs straighten while its feet must stay on the ground.
  bool locks_height = false;
  /// Ground normals at `from` and `to`.
  std::array<Vec3, 2> normals{Vec3(0.0f, 1.0f, 0.0f), Vec3(0.0f, 1.0f, 0.0f)};
  /// Additional heights early, in the middle and late in the swing, so that the foot clears the
  /// ground. Each is the peak of a curve that fades in and out (LiftShare). The middle one may be
  /// negative.
  std::array<double, 3> lift_m{};
  /// Horizontal offset in the middle of the swing, for passing the other foot and the edges of
  /// treads.
  DVec3 mid_swing_offset_m = DVec3(0.0);
  /// Fraction of the foot's correction that also moves the root. The fractions of both feet sum to
  /// 1.
  double root_weight = 0.0;
  /// Additional shift of the root. It increases over the movement and is complete at its end.
  DVec3 root_shift_m = DVec3(0.0);

  [[nodiscard]] bool IsPlanted(double time_s) const {
    return time_s <= release_s || time_s >= land_s;
  }
};

/// Difference between the foot corrections of the previous movement and of a new plan, at the start
/// of the new movement, and its velocity. It fades to zero, so that feet do not jump.
struct FootResidual {
  DVec3 offset_m = DVec3(0.0);
  DVec3 offset_m_s = DVec3(0.0);
  double turn_rad = 0.0;
  double turn_rad_s = 0.0;
  double over_s = 0.2;  ///< Time from Movement::start_offset_s until the residual is zero.
};

/// Additional motion with which the root approaches its planned place above the standing feet over
/// `over_s`. Without this motion, the rotations of the legs would move the root there while the
/// difference pose fades out. That would be too abrupt if the place is far away or if the root
/// moves at another speed. The motion is horizontal, except where the root rises on terrain.
struct RootApproach {
  /// Displacement of the root relative to the standing feet at the start of the movement, caused by
  /// the difference pose.
  DVec3 offset_m = DVec3(0.0);
  DVec3 offset_m_s = DVec3(0.0);  ///< Velocity of this displacement at the start of the movement.
  /// Duration. If it is at most Movement::ease_out_s, there is no additional motion.
  double over_s = 0.0;
};

/// A temporary descent of the root in a step on terrain. It begins at Movement::start_offset_s,
/// reaches `depth_m` when the moving foot is released, and ends `over_s` later. Without it, a leg
/// that is fully extended before its foot is released would pull the root down, and the root would
/// spring up after the release.
struct RootDip {
  double depth_m = 0.0;    ///< Depth at the release; >= 0. 0: no dip.
  double speed_m_s = 0.0;  ///< Downward speed at the release; >= 0. The root then sinks further.
  double over_s = 0.0;     ///< Time from the release until the dip is 0 again.
};

/// A foot plan in the layout that the planting kernels read: groups of four floats, with positions
/// relative to the base of the movement. PackFootPlan writes the trajectories of both feet and then
/// the data that both have in common.
inline constexpr std::size_t kPackedTrajectoryFloats = 60;
inline constexpr std::size_t kPackedPlanFloats = 2 * kPackedTrajectoryFloats + 24;
using PackedFootPlan = std::array<float, kPackedPlanFloats>;

/// The plan for both feet of a movement. Together with the blended pose and the time, it determines
/// the planted pose.
struct FootPlan {
  bool is_active = false;
  /// If the feet were not planted before, or if an earlier fade was interrupted, the changes due to
  /// planting fade in over this time: soles are lifted out of the ground, and the root is lowered
  /// so that legs reach their targets. Otherwise 0.
  double plant_fade_s = 0.0;
  /// The plan in the layout of the planting kernels. Set when the plan is complete.
  PackedFootPlan packed{};

  std::array<FootTrajectory, 2> feet;     ///< [foot]
  std::array<FootResidual, 2> residuals;  ///< [foot]
  /// Residual of the root, as in FootResidual. It is separate from those of the feet, because the
  /// root may have followed the other foot before.
  DVec3 root_residual_m = DVec3(0.0);
  DVec3 root_residual_m_s = DVec3(0.0);
  RootApproach root_approach;
  RootDip root_dip;
  /// True on terrain: planting lifts soles out of the ground that they leave and land on. False on
  /// level ground: the blend already keeps soles close to the ground, and a lift would only move
  /// the knees.
  bool keeps_above_ground = false;
  /// Root of the displayed pose minus that of the planted pose when the plant fade began.
  Vec3 plant_fade_root_m = Vec3(0.0f);
  /// [foot]: rotations of hip, knee and ankle from the planted to the displayed pose when the plant
  /// fade began.
  std::array<std::array<Quat, 3>, 2> plant_fade_rotations{};
  DVec3 missed_m = DVec3(0.0);  ///< Horizontal vector from the planned to the requested footprint.
  /// Heading of the requested footprint minus that of the planned one.
  double missed_rad = 0.0;

  [[nodiscard]] const FootTrajectory& foot(Foot f) const {
    return feet[static_cast<std::size_t>(f)];
  }
  [[nodiscard]] FootTrajectory& foot(Foot f) { return feet[static_cast<std::size_t>(f)]; }
};

}  // namespace stridewire
