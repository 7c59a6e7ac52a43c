#pragma once

// Fields of movement records. The same functions describe reading and writing, so that the two
// cannot differ. A stream has the members F64, F32, Index and Bool for single values, and
// CheckUnit, which validates unit vectors when reading. Values are little-endian, without padding.

#include <array>
#include <cstddef>
#include <cstdint>

#include "runtime/avatar/avatar_body.h"
#include "runtime/pose/evaluate_poses.h"

namespace stridewire::record {

enum Flag : std::uint16_t {
  kIsState = 1 << 0,
  kMoves = 1 << 1,   // In a change: a movement began. In a state: a movement is in progress.
  kIsIdle = 1 << 2,  // AvatarSimulation::idle().
  kPlants = 1 << 3,  // Value of AvatarBody::plants_feet.
  kLayers = 1 << 4,  // The record contains layers. A state without this flag has no layers.
  // Changes only:
  kLeft = 1 << 5,       // The previous movement ended or was interrupted.
  kLeftAtEnd = 1 << 6,  // The previous movement was completed, so its end time is omitted.
  // The previous movement was redirected in mid-swing. The foot locks remain unchanged.
  kIsRedirected = 1 << 7,
  // Argument `keeps_speed` of AvatarBody::CaptureBlendSource for the previous movement.
  kLeftKeepsSpeed = 1 << 8,
  // Argument `keeps_speed` of AvatarBody::BlendIn for the new movement. In the state of a standing
  // avatar: the next movement keeps the speed of the previous one.
  kKeepsSpeed = 1 << 9,
  // Flags for a movement that began:
  kIsEntered = 1 << 10,  // The record contains Movement::start_offset_s, which is not 0.
  kIsSteered = 1 << 11,  // The record contains LandingDecision::extra_turn_rad.
  kOnTerrain = 1 << 12,  // LandingDecision::is_on_terrain; the record contains lift_m and normal.
  kMidSwingOffset = 1 << 13,  // The record contains LandingDecision::mid_swing_offset_m.
  kRootShift = 1 << 14,       // The record contains LandingDecision::root_shift_m.
  // In a change: the movement that began has a Movement::rate other than 1, which the record
  // contains.
  kHasRate = 1 << 15,
  // In the state of a standing avatar: the value of AvatarBody::begins_planting.
  kBeginsPlanting = 1 << 15,
};

template <typename Stream, typename V>
void Vector(Stream& stream, V& v) {
  if constexpr (sizeof(v.x) == sizeof(double)) {
    stream.F64(v.x), stream.F64(v.y), stream.F64(v.z);
  } else {
    stream.F32(v.x), stream.F32(v.y), stream.F32(v.z);
  }
}

template <typename Stream, typename Q>
void Rotation(Stream& stream, Q& q) {
  stream.F32(q.x), stream.F32(q.y), stream.F32(q.z), stream.F32(q.w);
  stream.CheckUnit(q);
}

template <typename Stream, typename P>
void PoseFields(Stream& stream, P& pose) {
  Vector(stream, pose.root_position_m);
  for (auto& rotation : pose.rotations) Rotation(stream, rotation);
}

template <typename Stream, typename P>
void FootprintFields(Stream& stream, P& print) {
  Vector(stream, print.position_m);
  stream.F64(print.heading_rad);
}

template <typename Stream, typename L>
void DecisionFields(Stream& stream, unsigned flags, MovementKind kind, L& decision) {
  if (kind == MovementKind::kStand) return;
  if ((flags & kIsSteered) != 0) stream.F64(decision.extra_turn_rad);
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    if (IsStep(kind) && foot != MovingFoot(kind)) continue;
    Vector(stream, decision.to_m[static_cast<std::size_t>(foot)]);
  }
  if (!IsStep(kind)) return;
  stream.F64(decision.turn_rad);
  stream.F64(decision.height_m);
  if ((flags & kOnTerrain) != 0) {
    for (auto& lift : decision.lift_m) stream.F64(lift);
    Vector(stream, decision.normal);
    stream.CheckUnit(decision.normal);
  }
  if ((flags & kMidSwingOffset) != 0)
    stream.F64(decision.mid_swing_offset_m.x), stream.F64(decision.mid_swing_offset_m.z);
  if ((flags & kRootShift) != 0) Vector(stream, decision.root_shift_m);
}

template <typename Stream, typename C>
void CorrectionFields(Stream& stream, C& feet) {
  for (auto& foot : feet.feet) {
    Vector(stream, foot.offset_m);
    stream.F64(foot.turn_rad);
    stream.F64(foot.free_turn_rad);
    Vector(stream, foot.normal);
    stream.F64(foot.root_weight);
    Vector(stream, foot.root_shift_m);
  }
  Vector(stream, feet.root_m);
}

template <typename Stream, typename H>
void FootLockFields(Stream& stream, H& locks) {
  for (auto& lock : locks) {
    FootprintFields(stream, lock.print);
    stream.F64(lock.height_m);
    stream.F64(lock.turn_rad);
    Vector(stream, lock.normal);
    stream.CheckUnit(lock.normal);
    stream.F64(lock.root_weight);
  }
}

// A foot plan, except for the parts that follow from the kind and the keytimes of its movement.
template <typename Stream, typename P>
void PlanFields(Stream& stream, P& plan) {
  stream.Bool(plan.keeps_above_ground);
  for (std::size_t f = 0; f < 2; ++f) {
    auto& trajectory = plan.feet[f];
    FootprintFields(stream, trajectory.from);
    FootprintFields(stream, trajectory.to);
    Vector(stream, trajectory.release_offset_m);
    stream.F64(trajectory.release_turn_rad);
    Vector(stream, trajectory.release_velocity_m_s);
    Vector(stream, trajectory.land_offset_m);
    Vector(stream, trajectory.land_velocity_m_s);
    for (auto& height : trajectory.height_m) stream.F64(height);
    for (auto& turn : trajectory.turn_rad) stream.F64(turn);
    for (auto& coefficient : trajectory.level_m) stream.F64(coefficient);
    stream.F64(trajectory.settle_lift_m);
    for (auto& normal : trajectory.normals) {
      Vector(stream, normal);
      stream.CheckUnit(normal);
    }
    for (auto& lift : trajectory.lift_m) stream.F64(lift);
    Vector(stream, trajectory.mid_swing_offset_m);
    Vector(stream, trajectory.root_shift_m);
    auto& residual = plan.residuals[f];
    Vector(stream, residual.offset_m);
    Vector(stream, residual.offset_m_s);
    stream.F64(residual.turn_rad);
    stream.F64(residual.turn_rad_s);
    stream.F64(residual.over_s);
  }
  Vector(stream, plan.root_residual_m);
  Vector(stream, plan.root_residual_m_s);
  Vector(stream, plan.root_approach.offset_m);
  Vector(stream, plan.root_approach.offset_m_s);
  stream.F64(plan.root_approach.over_s);
  if (plan.keeps_above_ground) {
    auto& dip = plan.root_dip;
    for (auto* value : {&dip.depth_m, &dip.speed_m_s, &dip.over_s}) stream.F64(*value);
  }
  bool settles = plan.plant_fade_s > 0.0;
  stream.Bool(settles);
  if (!settles) return;
  stream.F64(plan.plant_fade_s);
  Vector(stream, plan.plant_fade_root_m);
  for (auto& leg : plan.plant_fade_rotations) {
    for (auto& rotation : leg) Rotation(stream, rotation);
  }
}

// Returns true if a part of the difference pose may still be needed.
inline bool NeedsDifference(const Movement& movement, double movement_time_s) {
  // A blend uses the pose kBlendStepS earlier. The margin is twice as large, so that rounding has
  // no effect.
  return movement_time_s - 2.0 * kBlendStepS < movement.start_offset_s + movement.ease_out_s;
}

template <typename Stream, typename M>
void DifferenceFields(Stream& stream, M& movement) {
  PoseFields(stream, movement.difference);
  stream.Bool(movement.is_inertial);
  if (!movement.is_inertial) return;
  Vector(stream, movement.difference_velocity.root_m_s);
  for (auto& velocity : movement.difference_velocity.joints_rad_s) Vector(stream, velocity);
}

template <typename Stream, typename P>
void LayerFields(Stream& stream, P& playing) {
  stream.Index(playing.layer);
  stream.Bool(playing.is_ending);
  for (auto* value : {&playing.time_s, &playing.weight, &playing.speed, &playing.from_weight,
                      &playing.to_weight, &playing.from_speed, &playing.to_speed, &playing.slope,
                      &playing.slope_s, &playing.elapsed_s, &playing.ease_s, &playing.blend_s}) {
    stream.F64(*value);
  }
}

}  // namespace stridewire::record
