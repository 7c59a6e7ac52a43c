#pragma once

#include <array>
#include <limits>

#include "stridewire/runtime/movement_request.h"

namespace stridewire {

/// How one foot goes through a movement, as corrections to where the blend has it: b(t), the ball
/// of the blended and eased pose in the world.
///
///   horizontally  t <= release: from - b(t), so that the ball stands still at `from`
///                 then a cubic that goes on with the same offset and velocity and arrives at
///                 t >= land:    to - b(t)
///   heading: held like the ball while the sole is down; with the heel up it turns as the blend
///   height: values to add, eased from one to the next; the ball's height follows the blend
///   (holding it still bends knees by 25 degrees on captures)
struct FootTrajectory {
  static constexpr double kNever = std::numeric_limits<double>::infinity();

  Footprint from;             ///< Where it stands at the start
  Footprint to;               ///< Where it stands at the end
  double release_s = kNever;  ///< Leaves `from`; kNever: stands all through the movement
  double land_s = kNever;     ///< Stands on `to` from here on
  DVec3 release_offset_m = DVec3(0.0);
  double release_turn_rad = 0.0;  ///< What holding the foot's heading adds to its turning there
  DVec3 release_velocity_m_s = DVec3(0.0);  ///< Of the offset
  DVec3 land_offset_m = DVec3(0.0);
  DVec3 land_velocity_m_s = DVec3(0.0);
  // What is added to the blend's height and heading: at t = 0, once the difference pose is eased
  // out, and from landing on.
  std::array<double, 3> height_m{};
  std::array<double, 3> turn_rad{};
  std::array<Vec3, 2> normals{Vec3(0.0f, 1.0f, 0.0f), Vec3(0.0f, 1.0f, 0.0f)};  ///< from, to
  double lift_m = 0.0;         ///< Highest point of what is added in the swing to clear the ground
  DVec3 aside_m = DVec3(0.0);  ///< The same sidewise, to pass the other foot
  double root_weight = 0.0;    ///< How far the root follows this foot; over both feet 1
  DVec3 root_shift_m = DVec3(0.0);  ///< Added to the root by the end

  [[nodiscard]] bool IsPlanted(double time_s) const {
    return time_s <= release_s || time_s >= land_s;
  }
};

/// What a correction differs by from the one that was when the movement was entered, and how fast that
/// changes: eased out.
struct FootResidual {
  DVec3 offset_m = DVec3(0.0);
  DVec3 offset_m_s = DVec3(0.0);
  double turn_rad = 0.0;
  double turn_rad_s = 0.0;
  double over_s = 0.2;  ///< Nothing is left of it then
};

/// A movement's plan as the vectors that plant a crowd read it: four floats at a time, positions from the movement's
/// base. Two tracks and what they share (PackFootPlan).
inline constexpr std::size_t kPackedTrajectoryFloats = 56;
inline constexpr std::size_t kPackedPlanFloats = 2 * kPackedTrajectoryFloats + 12;
using PackedFootPlan = std::array<float, kPackedPlanFloats>;

/// Both feet through a movement: a value of the movement, from which with the blended pose and the
/// time everything about planting follows.
struct FootPlan {
  bool is_active = false;
  /// What was displayed before had no feet planted: soles come out of the ground, and what else planting changes at
  /// once (a root lower so that legs bend) sets in, over this long.
  double plant_fade_s = 0.0;
  PackedFootPlan packed{};  ///< All of it but what was missed, once the plan is made

  std::array<FootTrajectory, 2> feet;     ///< Indexed by Foot.
  std::array<FootResidual, 2> residuals;  ///< Indexed by Foot.
  DVec3 root_residual_m =
      DVec3(0.0);  ///< The same of the root, which may change the foot it follows
  DVec3 root_residual_m_s = DVec3(0.0);
  /// On terrain: soles are lifted out of the ground they leave and land on. Level ground the blend
  /// itself keeps to within what the examples do, and knees move less.
  bool keeps_above_ground = false;
  Vec3 plant_fade_root_m = Vec3(0.0f);  ///< What was displayed less what planting makes of it
  std::array<std::array<Quat, 3>, 2>
      plant_fade_rotations{};   ///< The same of hip, knee and ankle, by Foot
  DVec3 missed_m = DVec3(0.0);  ///< From where a step lands to where it was asked to, horizontally
  double missed_rad = 0.0;      ///< The same for the foot's heading

  [[nodiscard]] const FootTrajectory& foot(Foot f) const {
    return feet[static_cast<std::size_t>(f)];
  }
  [[nodiscard]] FootTrajectory& foot(Foot f) { return feet[static_cast<std::size_t>(f)]; }
};

}  // namespace stridewire
