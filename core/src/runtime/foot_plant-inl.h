// The planting of several avatars' feet at once. The same as PlantFeetByReference of foot_plan.cpp, which says why what
// is done is done; a test holds the two together. Positions are relative to each movement's base, so that floats do.
#if defined(STRIDEWIRE_FOOT_PLANT_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STRIDEWIRE_FOOT_PLANT_INL_H
#undef STRIDEWIRE_FOOT_PLANT_INL_H
#else
#define STRIDEWIRE_FOOT_PLANT_INL_H
#endif

#include "foot_plant_constants.h"
#include "lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stridewire::kernels::HWY_NAMESPACE {
namespace {

HWY_INLINE Float EaseOut(Float s) {
  const Float r = Float(1.0f) - Clamp(s, Float(0.0f), Float(1.0f));
  return r * r * (Float(3.0f) - Float(2.0f) * r);
}
HWY_INLINE Float EaseOutSlope(Float s) {
  const Float in = Clamp(s, Float(0.0f), Float(1.0f));
  const Float r = Float(1.0f) - in;
  return in * r * r;
}
HWY_INLINE Float SmoothMax(Float a, Float b, float soft_m) {
  const Float d = a - b;
  return Float(0.5f) * (a + b + Sqrt(d * d + Float(soft_m * soft_m)));
}

// A FootTrack and its FootRest, as PackFootPlan lays them out.
struct Track {
  Vec3x from, to, release_offset, release_velocity, land_offset, land_velocity, aside, height, turn;
  Vec3x normals[2];
  Vec3x rest_offset, rest_velocity, root_shift;
  Float from_heading, to_heading, release_turn, root_weight, lift, rest_turn, rest_turn_s;
  Float rest_over_s, release_s, land_s;
};

HWY_INLINE Track LoadTrack(const float* plan) {
  Track t;
  const auto next = [&]() HWY_ATTR {
    const Quat4 four = LoadQuat(plan);
    plan += 4 * kBlock;
    return four;
  };
  Quat4 q = next();
  t.from = XyzOf(q), t.from_heading = q.w;
  q = next();
  t.to = XyzOf(q), t.to_heading = q.w;
  q = next();
  t.release_offset = XyzOf(q), t.release_turn = q.w;
  q = next();
  t.release_velocity = XyzOf(q), t.root_weight = q.w;
  q = next();
  t.land_offset = XyzOf(q), t.lift = q.w;
  q = next();
  t.land_velocity = XyzOf(q), t.rest_turn = q.w;
  q = next();
  t.aside = XyzOf(q), t.rest_turn_s = q.w;
  q = next();
  t.height = XyzOf(q), t.rest_over_s = q.w;
  q = next();
  t.turn = XyzOf(q), t.release_s = q.w;
  q = next();
  t.normals[0] = XyzOf(q), t.land_s = q.w;
  t.normals[1] = XyzOf(next());
  t.rest_offset = XyzOf(next());
  t.rest_velocity = XyzOf(next());
  t.root_shift = XyzOf(next());
  return t;
}

// What all of a movement's plan shares.
struct Common {
  Vec3x root_rest, root_rest_velocity;
  Float steer, duration_s, entered_s, ease_out_s, keeps_above_ground, settle_s;
  Float time_s;
};

// A leg by forward kinematics, relative to the root and in world axes.
struct LegLanes {
  Vec3x positions[kMaxLegChain];
  Quat4 rotations[kMaxLegChain];
  Vec3x ball;
};

HWY_INLINE Vec3x Same(const float* v) { return {Float(v[0]), Float(v[1]), Float(v[2])}; }

HWY_INLINE void EvaluateLeg(const LegRig::Bones& bones, const float* rotations, Quat4 root,
                            LegLanes& out) {
  out.positions[0] = {Float(0.0f), Float(0.0f), Float(0.0f)};
  out.rotations[0] = root;
  for (std::size_t i = 1; i < bones.count; ++i) {
    out.positions[i] =
        out.positions[i - 1] + Rotate(out.rotations[i - 1], Same(bones.offsets_m[i]));
    out.rotations[i] =
        Multiply(out.rotations[i - 1], LoadQuat(rotations + bones.joints[i] * 4 * kBlock));
  }
  const std::size_t last = bones.count - 1;
  out.ball = out.positions[last] + Rotate(out.rotations[last], Same(bones.ball_m));
}

struct Correction {
  Vec3x offset;
  Float swing;
  Quat4 turn;  // of the foot
  Vec3x root;  // what the root goes along with it
};

HWY_INLINE Float Steered(const Common& common, Float at_s) {
  return common.steer * (Float(1.0f) - EaseOut(at_s / common.duration_s));
}

HWY_INLINE Correction CorrectFoot(const Common& common, const Track& track, Vec3x ball,
                                  Float heading, Float flatness) {
  const Float one = 1.0f;
  const Float zero = 0.0f;
  const Float t = common.time_s;
  const Mask has_landed = t >= track.land_s;
  const Mask is_planted = (t <= track.release_s) || has_landed;
  const Float length = Select(is_planted, one, track.land_s - track.release_s);
  const Float s = Select(has_landed, one, Select(is_planted, zero, (t - track.release_s) / length));
  const Float r = one - s;

  Correction c;
  c.swing = s;
  const Vec3x print = Select(has_landed, track.to, track.from);
  const Float print_heading = Select(has_landed, track.to_heading, track.from_heading);
  const Float across = Float(4.0f) * s * r;
  const Vec3x flying = track.release_offset * ((one + s + s) * r * r) +
                       track.land_offset * (s * s * (one + r + r)) +
                       (track.release_velocity * r - track.land_velocity * s) * (length * s * r) +
                       track.aside * (across * across);
  c.offset = Select(is_planted, print - ball, flying);
  const Float since_s = t - common.entered_s;
  const Float settled = one - EaseOut(since_s / common.ease_out_s);
  const Float rise = track.height.z - track.height.y;
  const Float rise_from = Select(rise > zero, zero, Float(static_cast<float>(kSinkFrom)));
  const Float risen = one - EaseOut((s - rise_from) / Float(static_cast<float>(1.0 - kSinkFrom)));
  const Float ends = static_cast<float>(kLiftEnds);
  const Float lifted = (one - EaseOut(s / ends)) * EaseOut((s - (one - ends)) / ends);
  c.offset.y = track.height.x + settled * (track.height.y - track.height.x) + rise * risen +
               track.lift * lifted;

  const Float turned = one - EaseOut(s);
  Float free = track.turn.x + settled * (track.turn.y - track.turn.x) +
               turned * (track.turn.z - track.turn.y);
  free =
      free + (Steered(common, Min(track.land_s, common.duration_s)) * turned - Steered(common, t));
  const Float rested = since_s / track.rest_over_s;
  const Float value = EaseOut(rested);
  const Float slope = track.rest_over_s * EaseOutSlope(rested);
  c.offset = c.offset + track.rest_offset * value + track.rest_velocity * slope;
  free = free + value * track.rest_turn + slope * track.rest_turn_s;
  const Float held = WrapAngle(print_heading - heading - free);
  const Float hold = one - EaseOut((flatness - Float(static_cast<float>(kHeelUp))) /
                                   Float(static_cast<float>(kSoleDown - kHeelUp)));
  const Float turn =
      Select(is_planted, free + hold * held, free + (one - turned) * track.release_turn);

  const Vec3x tilt = track.normals[0] * (one - turned) + track.normals[1] * turned;
  const Vec3x normal = tilt * (one / Sqrt(Dot(tilt, tilt)));
  c.turn = Multiply(Normalise({normal.z, zero, -normal.x, one + normal.y}),
                    YawRotation(WrapAngle(turn)));
  c.root = c.offset * track.root_weight + track.root_shift * (one - EaseOut(t / common.duration_s));
  return c;
}

// How deep a sole is below the ground a print lies on, taken for a plane; less the further it is away.
HWY_INLINE Float DepthBelow(Vec3x print, Vec3x normal, const LegRig::Bones& bones,
                            const LegLanes& leg, Vec3x ball, Quat4 turn) {
  const Float dx = ball.x - print.x;
  const Float dz = ball.z - print.z;
  const Float away = Sqrt(dx * dx + dz * dz);
  const Float near = EaseOut((away - Float(static_cast<float>(kNearPrintM))) /
                             Float(static_cast<float>(kFarFromPrintM - kNearPrintM)));
  const auto depth_of = [&](Vec3x point, float rest_m) HWY_ATTR {
    const Vec3x at = ball + Rotate(turn, point - leg.ball);
    const Float ground =
        print.y - (normal.x * (at.x - print.x) + normal.z * (at.z - print.z)) / normal.y;
    return ground + Float(rest_m) / normal.y - at.y;
  };
  const std::size_t last = bones.count - 1;
  const Vec3x toe_tip = leg.positions[last] + Rotate(leg.rotations[last], Same(bones.toe_tip_m));
  const Vec3x heel =
      leg.positions[bones.ankle] + Rotate(leg.rotations[bones.ankle], Same(bones.heel_m));
  const Float depth =
      Max(Max(depth_of(leg.ball, bones.ball_height_m), depth_of(heel, bones.ball_height_m)),
          depth_of(toe_tip, bones.toe_height_m));
  return near * SmoothMax(Float(0.0f), depth, static_cast<float>(kSoftGroundM));
}

HWY_INLINE Quat4 ShortestArc(Vec3x from, Vec3x to) {
  const Float scale = Sqrt(Dot(from, from) * Dot(to, to));
  const Vec3x axis = Cross(from, to);
  return Normalise({axis.x, axis.y, axis.z, scale + Dot(from, to)});
}

HWY_INLINE Vec3x KneeAxis(Vec3x thigh, Vec3x shank, Quat4 hip_rotation) {
  const Float scale = Sqrt(Dot(thigh, thigh) * Dot(shank, shank));
  const Vec3x plane = Cross(thigh, shank) * (Float(1.0f) / scale);
  const Float sine = Sqrt(Dot(plane, plane));
  const Float s =
      Clamp((Float(kBentSine) - sine) / Float(kBentSine - kStraightSine), Float(0.0f), Float(1.0f));
  const Vec3x reference = Rotate(hip_rotation, {Float(1.0f), Float(0.0f), Float(0.0f)});
  const Mask is_backward = Dot(plane, reference) < Float(0.0f);
  const Float forward = Select(is_backward, Float(0.0f), Float(1.0f));
  const Float weight = Select(is_backward, Float(1.0f), s * s * (Float(3.0f) - Float(2.0f) * s));
  return plane * forward + reference * (Float(kReferenceWeight) * weight);
}

struct LegRotations {
  Quat4 hip, knee, ankle;
};

HWY_INLINE LegRotations SolveLeg(const LegRig::Bones& bones, const LegLanes& leg, Vec3x ankle_m,
                                 Quat4 ankle_rotation) {
  const std::size_t hip = bones.hip;
  const std::size_t knee = bones.knee;
  const std::size_t ankle = bones.ankle;
  const Vec3x thigh = leg.positions[knee] - leg.positions[hip];
  const Vec3x shank = leg.positions[ankle] - leg.positions[knee];
  const float l1 = bones.thigh_m;
  const float l2 = bones.shank_m;

  const Vec3x reach = ankle_m - leg.positions[hip];
  const Float distance = Sqrt(Dot(reach, reach));
  const Mask is_away = distance > Float(1e-6f);
  const Float per_distance = Float(1.0f) / Max(distance, Float(1e-6f));
  const Vec3x u = Select(is_away, reach * per_distance, {Float(0.0f), Float(-1.0f), Float(0.0f)});
  const float shortest = (l1 > l2 ? l1 - l2 : l2 - l1) + 1e-3f * (l1 + l2);
  const Float d = Clamp(distance, Float(shortest), Float(kMaxLegExtension * (l1 + l2)));

  const Float a = (Float(l1 * l1 - l2 * l2) + d * d) / (d + d);
  const Float h = Sqrt(Max(Float(0.0f), Float(l1 * l1) - a * a));
  Vec3x pole = Cross(u, KneeAxis(thigh, shank, leg.rotations[hip]));
  const Float pole_length = Sqrt(Dot(pole, pole));
  const Mask has_pole = pole_length > Float(1e-6f);
  pole = Select(has_pole, pole * (Float(1.0f) / Max(pole_length, Float(1e-6f))),
                {Float(0.0f), Float(0.0f), Float(1.0f)});
  const Vec3x new_thigh = u * a + pole * h;
  const Vec3x new_shank = u * d - new_thigh;

  const Quat4 turn_thigh = ShortestArc(thigh, new_thigh);
  const Quat4 turn_shank = Multiply(ShortestArc(Rotate(turn_thigh, shank), new_shank), turn_thigh);
  const Quat4 before_hip = leg.rotations[hip - 1];
  const Quat4 before_knee = Multiply(turn_thigh, leg.rotations[knee - 1]);
  const Quat4 before_ankle = Multiply(turn_shank, leg.rotations[ankle - 1]);
  return {Normalise(Multiply(Conjugate(before_hip), Multiply(turn_thigh, leg.rotations[hip]))),
          Normalise(Multiply(Conjugate(before_knee), Multiply(turn_shank, leg.rotations[knee]))),
          Normalise(Multiply(Conjugate(before_ankle), ankle_rotation))};
}

// As many as a vector has lanes, from `lane` on.
void PlantSome(const LegRig& rig, const PlantBlock& block, std::size_t lane) {
  const DoubleTag d;
  const hn::Rebind<float, DoubleTag> floats;
  const std::size_t doubles = hn::Lanes(d);
  const std::size_t width = hn::Lanes(FloatTag());
  const float* plan = block.plan + lane;
  float* rotations = block.rotations + lane;
  Common common;
  {
    const float* at = plan + 2 * kPackedTrackFloats * kBlock;
    Quat4 q = LoadQuat(at);
    common.root_rest = XyzOf(q), common.steer = q.w;
    q = LoadQuat(at + 4 * kBlock);
    common.root_rest_velocity = XyzOf(q), common.duration_s = q.w;
    q = LoadQuat(at + 8 * kBlock);
    common.entered_s = q.x, common.ease_out_s = q.y, common.keeps_above_ground = q.z;
    common.settle_s = q.w;
  }
  HWY_ALIGN float local_m[3 * kBlock];
  HWY_ALIGN float times_s[kBlock];
  for (std::size_t i = 0; i < width; i += doubles) {
    for (std::size_t c = 0; c < 3; ++c) {
      const auto world = hn::PromoteTo(d, hn::LoadU(floats, block.root_m + c * kBlock + lane + i));
      const auto base = hn::LoadU(d, block.base_m + c * kBlock + lane + i);
      hn::StoreU(hn::DemoteTo(floats, hn::Sub(world, base)), floats, local_m + c * kBlock + i);
    }
    hn::StoreU(hn::DemoteTo(floats, hn::LoadU(d, block.time_s + lane + i)), floats, times_s + i);
  }
  const Vec3x root = LoadVec3(local_m);
  common.time_s = LoadLanes(times_s);

  const Quat4 root_rotation = LoadQuat(rotations);
  LegLanes legs[2];
  Correction corrections[2];
  Vec3x ankles[2];
  Vec3x shift = {Float(0.0f), Float(0.0f), Float(0.0f)};
  for (std::size_t f = 0; f < 2; ++f) {
    const LegRig::Bones& bones = rig.bones[f];
    LegLanes& leg = legs[f];
    EvaluateLeg(bones, rotations, root_rotation, leg);
    const Vec3x ankle = leg.positions[bones.ankle];
    const Vec3x sole = leg.ball - ankle;
    const Float heading = Atan2(sole.x, sole.z) - Float(bones.toe_out_rad);
    const Float flatness = bones.foot_m < kSmallestBoneM
                               ? Float(0.0f)
                               : Sqrt(sole.x * sole.x + sole.z * sole.z) / Float(bones.foot_m);
    const Track track = LoadTrack(plan + f * kPackedTrackFloats * kBlock);
    const Vec3x ball = root + leg.ball;
    Correction& c = corrections[f];
    c = CorrectFoot(common, track, ball, heading, flatness);
    const Mask keeps_above = common.keeps_above_ground > Float(0.0f);
    if (Any(keeps_above)) {
      const Float second =
          Float(1.0f) - EaseOut((c.swing - Float(static_cast<float>(kGroundFrom))) /
                                Float(static_cast<float>(kGroundOver)));
      const Vec3x at = ball + c.offset;
      const Float lift = (Float(1.0f) - second) *
                             DepthBelow(track.from, track.normals[0], bones, leg, at, c.turn) +
                         second * DepthBelow(track.to, track.normals[1], bones, leg, at, c.turn);
      // The root goes with what it goes with on level ground too, and with this.
      const Mask is_settling = common.settle_s > Float(0.0f);
      const Float settled =
          Float(1.0f) - EaseOut((common.time_s - common.entered_s) /
                                Select(is_settling, common.settle_s, Float(1.0f)));
      const Float lifted =
          Select(keeps_above, Select(is_settling, lift * settled, lift), Float(0.0f));
      c.offset.y = c.offset.y + lifted;
      c.root.y = c.root.y + lifted * track.root_weight;
    }
    ankles[f] = ball + c.offset + Rotate(c.turn, ankle - leg.ball);
    shift = shift + c.root;
  }
  const Float since_s = common.time_s - common.entered_s;
  const Float flat = EaseOut(since_s / Float(static_cast<float>(kRootShiftS)));
  const Float rise =
      EaseOut(since_s / Max(Float(static_cast<float>(kRootShiftS)),
                            Float(static_cast<float>(kRootRisePart)) * common.duration_s));
  const Float speed = common.ease_out_s * EaseOutSlope(since_s / common.ease_out_s);
  shift = shift +
          Vec3x{flat * common.root_rest.x, rise * common.root_rest.y, flat * common.root_rest.z} +
          common.root_rest_velocity * speed;

  Float lower = 0.0f;
  for (std::size_t f = 0; f < 2; ++f) {
    const LegRig::Bones& bones = rig.bones[f];
    const Vec3x hip = legs[f].positions[bones.hip];
    const Vec3x blended = legs[f].positions[bones.ankle] - hip;
    const float length = bones.thigh_m + bones.shank_m;
    const Float allowed = Min(
        SmoothMax(Sqrt(Dot(blended, blended)), Float(static_cast<float>(kEasyExtension) * length),
                  static_cast<float>(kSoftM)),
        Float(static_cast<float>(kLongestExtension) * length));
    const Vec3x reach = ankles[f] - (root + shift + hip);
    const Float drop_squared = allowed * allowed - (reach.x * reach.x + reach.z * reach.z);
    const float deepest = 0.5f * length;
    const Float drop = Sqrt(Max(drop_squared, Float(deepest * deepest)));
    lower = SmoothMax(lower, -reach.y - drop, static_cast<float>(kSoftLowerM));
  }
  shift.y = shift.y - lower;

  // The root is shown in floats of the world: the legs reach from where that is.
  HWY_ALIGN float shifts_m[3 * kBlock];
  StoreLanes(shift.x, shifts_m);
  StoreLanes(shift.y, shifts_m + kBlock);
  StoreLanes(shift.z, shifts_m + 2 * kBlock);
  for (std::size_t i = 0; i < width; i += doubles) {
    for (std::size_t c = 0; c < 3; ++c) {
      float* root_m = block.root_m + c * kBlock + lane + i;
      const auto by = hn::PromoteTo(d, hn::LoadU(floats, shifts_m + c * kBlock + i));
      const auto shown =
          hn::DemoteTo(floats, hn::Add(hn::PromoteTo(d, hn::LoadU(floats, root_m)), by));
      hn::StoreU(shown, floats, root_m);
      const auto base = hn::LoadU(d, block.base_m + c * kBlock + lane + i);
      hn::StoreU(hn::DemoteTo(floats, hn::Sub(hn::PromoteTo(d, shown), base)), floats,
                 local_m + c * kBlock + i);
    }
  }
  const Vec3x moved = LoadVec3(local_m);
  for (std::size_t f = 0; f < 2; ++f) {
    const LegRig::Bones& bones = rig.bones[f];
    const LegLanes& leg = legs[f];
    const Quat4 ankle_rotation = Multiply(corrections[f].turn, leg.rotations[bones.ankle]);
    const LegRotations solved = SolveLeg(bones, leg, ankles[f] - moved, ankle_rotation);
    StoreQuat(solved.hip, rotations + bones.joints[bones.hip] * 4 * kBlock);
    StoreQuat(solved.knee, rotations + bones.joints[bones.knee] * 4 * kBlock);
    StoreQuat(solved.ankle, rotations + bones.joints[bones.ankle] * 4 * kBlock);
  }
}

void PlantLanes(const LegRig& rig, const PlantBlock& block, std::size_t count) {
  for (std::size_t lane = 0; lane < count; lane += hn::Lanes(FloatTag())) {
    PlantSome(rig, block, lane);
  }
}

// The same number in the lanes of one vector.
HWY_INLINE void Spread(const float* from, std::size_t count, float* to) {
  const FloatTag d;
  for (std::size_t i = 0; i < count; ++i) hn::Store(hn::Set(d, from[i]), d, to + i * kBlock);
}

// One pose in all lanes of a vector, of which the first is kept.
void PlantOne(const LegRig& rig, const PlantJob& job) {
  HWY_ALIGN float plan[kPackedPlanFloats * kBlock];
  HWY_ALIGN float rotations[kMaxJoints * 4 * kBlock];  // of which those of the legs are used
  HWY_ALIGN double time_s[kBlock];
  HWY_ALIGN double base_m[3 * kBlock];
  HWY_ALIGN float root_m[3 * kBlock];
  Spread(job.plan, kPackedPlanFloats, plan);
  Spread(job.root_m, 3, root_m);
  for (const LegRig::Bones& bones : rig.bones) {
    for (std::size_t i = 0; i < bones.count; ++i) {
      const std::size_t joint = bones.joints[i];
      Spread(job.rotations + 4 * joint, 4, rotations + joint * 4 * kBlock);
    }
  }
  for (std::size_t i = 0; i < hn::Lanes(FloatTag()); ++i) {
    time_s[i] = job.time_s;
    for (std::size_t c = 0; c < 3; ++c) base_m[c * kBlock + i] = job.base_m[c];
  }
  PlantSome(rig, {plan, time_s, base_m, root_m, rotations}, 0);
  for (std::size_t c = 0; c < 3; ++c) job.root_m[c] = root_m[c * kBlock];
  for (const LegRig::Bones& bones : rig.bones) {
    for (const std::size_t place : {bones.hip, bones.knee, bones.ankle}) {
      const std::size_t joint = bones.joints[place];
      for (std::size_t c = 0; c < 4; ++c) {
        job.rotations[4 * joint + c] = rotations[(joint * 4 + c) * kBlock];
      }
    }
  }
}

}  // namespace
}  // namespace stridewire::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // STRIDEWIRE_FOOT_PLANT_INL_H
