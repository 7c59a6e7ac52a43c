// Kernels that process the poses of several movements side by side, one movement per lane.
// pose_kernels.cpp compiles this file once per instruction set.
#if defined(STRIDEWIRE_SOA_POSE_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STRIDEWIRE_SOA_POSE_INL_H
#undef STRIDEWIRE_SOA_POSE_INL_H
#else
#define STRIDEWIRE_SOA_POSE_INL_H
#endif

#include "runtime/pose/simd_math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stridewire::kernels::HWY_NAMESPACE {
namespace {

// Returns the address of four consecutive floats in the row of a lane.
struct RowAddress {
  const float* const* rows;
  std::size_t at;
  HWY_INLINE const float* operator()(std::size_t i) const { return rows[i] + at; }
};

void Transpose(const float* const* from, std::size_t count, std::size_t lanes, float* to) {
  if (count < 4) {
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t lane = 0; lane < lanes; ++lane) to[i * kBlock + lane] = from[lane][i];
    }
    return;
  }
  for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(FloatTag())) {
    for (std::size_t next = 0; next < count;) {
      // The last group of four may overlap the previous one.
      const std::size_t i = next + 4 <= count ? next : count - 4;
      StoreQuat(GatherQuats(RowAddress{from + lane, i}), to + i * kBlock + lane);
      next = i + 4;
    }
  }
}

void ScatterRotations(const float* rotations, std::size_t joint_count, std::size_t lanes,
                      float* const* to) {
  const std::size_t width = hn::Lanes(FloatTag());
  for (std::size_t lane = 0; lane < lanes; lane += width) {
    const std::size_t left = lanes - lane;
    for (std::size_t j = 0; j < joint_count; ++j) {
      ScatterQuats(LoadQuat(rotations + j * 4 * kBlock + lane), left,
                   [&](std::size_t i) HWY_ATTR { return to[lane + i] + 4 * j; });
    }
  }
}

void PrepareDifferences(const float* difference, std::size_t joint_count, std::size_t lanes,
                        float* ease) {
  for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(FloatTag())) {
    for (std::size_t j = 0; j < joint_count; ++j) {
      const SoaQuat q = LoadQuat(difference + j * 4 * kBlock + lane);
      const SlerpParts parts = SlerpPartsOf(q);
      StoreQuat({parts.half.x, parts.half.y, parts.half.z, parts.square},
                ease + j * kDifferenceFloats * kBlock + lane);
    }
  }
}

void FindLargestVelocities(const float* velocity, std::size_t joint_count, std::size_t lanes,
                           float* fastest) {
  for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(FloatTag())) {
    Float most = 0.0f;
    for (std::size_t j = 0; j < joint_count; ++j) {
      const SoaVec3 v = LoadVec3(velocity + j * 3 * kBlock + lane);
      most = Max(most, Dot(v, v));
    }
    StoreLanes(most, fastest + lane);
  }
}

// Describes which lanes of one vector still have a difference pose ("eased") and which of them also
// add its velocity ("inertial"). `fraction` and `half_s` determine how much of both is added.
struct DifferenceState {
  bool is_any = false;
  bool is_any_inertial = false;
  // True if every lane is eased and inertial. In this case, no result needs a mask.
  bool are_all = false;
  Mask is_eased, is_inertial;
  Float fraction, half_s;
};

HWY_INLINE SoaQuat AddDifference(SoaQuat q, const DifferenceState& state,
                                 const FinishPosesJob& blend, std::size_t joint, std::size_t lane) {
  const SoaQuat ease = LoadQuat(blend.ease + joint * kDifferenceFloats * kBlock + lane);
  SoaQuat eased = Multiply(q, SlerpOf({.half = XyzOf(ease), .square = ease.w}, state.fraction));
  if (state.is_any_inertial) {
    const SoaVec3 along = LoadVec3(blend.velocity + joint * 3 * kBlock + lane) * state.half_s;
    const SoaQuat along_it = Multiply(eased, {along.x, along.y, along.z, Float(1.0f)});
    if (state.are_all) return along_it;
    eased = Select(state.is_inertial, along_it, eased);
  }
  return Select(state.is_eased, eased, q);
}

// Transforms the roots of blended poses into world space. Writes the sine and cosine of half the
// heading of each root to `sines` and `cosines`.
void TransformRoots(const FinishPosesJob& blend, const float* local, std::size_t lane,
                    float* root_m, float* sines, float* cosines) {
  const DoubleTag d;
  const hn::Rebind<float, DoubleTag> floats;
  HWY_ALIGN double half_rad[kBlock];
  HWY_ALIGN double sine[kBlock];
  HWY_ALIGN double cosine[kBlock];
  for (std::size_t i = 0; i < hn::Lanes(FloatTag()); i += hn::Lanes(d)) {
    const auto of = [&](const double* numbers)
                        HWY_ATTR { return hn::LoadU(d, numbers + lane + i); };
    const auto part = [&](std::size_t c) HWY_ATTR {
      return hn::PromoteTo(d, hn::LoadU(floats, local + c * kBlock + i));
    };
    const auto put = [&](std::size_t c, hn::Vec<DoubleTag> value) HWY_ATTR {
      const auto base = hn::LoadU(d, blend.base_m + c * kBlock + lane + i);
      hn::StoreU(hn::DemoteTo(floats, hn::Add(base, value)), floats,
                 root_m + c * kBlock + lane + i);
    };
    const auto s = of(blend.sine);
    const auto c = of(blend.cosine);
    put(0, hn::Add(hn::Mul(c, part(0)), hn::Mul(s, part(2))));
    put(1, part(1));
    put(2, hn::Sub(hn::Mul(c, part(2)), hn::Mul(s, part(0))));
    const auto yaw = hn::Add(part(3), hn::Mul(of(blend.extra_turn_rad),
                                              hn::Sub(hn::Set(d, 1.0), of(blend.remaining_turn))));
    hn::Store(hn::Mul(hn::Set(d, 0.5), hn::Add(of(blend.heading_rad), yaw)), d, half_rad + i);
    SinCosOf(d, half_rad + i, sine + i, cosine + i);
    hn::StoreU(hn::DemoteTo(floats, hn::Load(d, sine + i)), floats, sines + i);
    hn::StoreU(hn::DemoteTo(floats, hn::Load(d, cosine + i)), floats, cosines + i);
  }
}

bool FinishPoses(const FinishPosesJob& blend, float* root_m, float* rotations) {
  const std::size_t width = hn::Lanes(FloatTag());
  bool is_any_short = false;
  for (std::size_t lane = 0; lane < blend.lanes; lane += width) {
    const Float half = 0.5f;
    DifferenceState state;
    state.is_eased = state.is_inertial = {hn::FirstN(FloatTag(), 0)};
    state.fraction = state.half_s = Float(0.0f);
    if (blend.ease != nullptr) {
      state.is_eased = LoadLanes(blend.is_eased + lane) > half;
      state.is_any = Any(state.is_eased);
      state.fraction = LoadLanes(blend.fraction + lane);
      if (blend.velocity != nullptr) {
        state.is_inertial = state.is_eased && LoadLanes(blend.is_inertial + lane) > half;
        state.is_any_inertial = Any(state.is_inertial);
        state.half_s = half * LoadLanes(blend.slope_s + lane);
        state.are_all = !Any(LoadLanes(blend.is_eased + lane) < half ||
                             LoadLanes(blend.is_inertial + lane) < half);
      }
    }
    // Blended quaternions shorter than kSmallestNorm must be detected, but lengths are measured
    // only after the difference poses are added, which can lengthen quaternions. `shortest` is an
    // upper bound of the squared length to which a quaternion of length kSmallestNorm can grow.
    Float shortest = kSmallestNorm * kSmallestNorm;
    if (state.is_any) shortest = shortest * Float(1.01f * kLongestSlerp * kLongestSlerp);
    if (state.is_any_inertial) {
      const Float along = state.half_s * state.half_s * LoadLanes(blend.fastest + lane);
      shortest = shortest * (Float(1.0f) + along);
    }
    Float least = shortest;
    const auto make_unit = [&](SoaQuat q, float* unit) HWY_ATTR {
      const Float square = Dot(q, q);
      least = Float(hn::Min(square.v, least.v));
      StoreQuat(UnitOf(q, square), unit);
    };
    // Each rotation is normalized while the next one is blended, because both have long latencies.
    SoaQuat last = {half, half, half, half};
    float* to = rotations + lane;
    for (std::size_t joint = 0; joint < blend.joint_count; ++joint) {
      SoaQuat q = GatherQuats(RowAddress{blend.rows + lane, 4 * joint});
      // The length of a product of quaternions is the product of their lengths, so it is enough to
      // normalize the result.
      if (state.is_any) q = AddDifference(q, state, blend, joint, lane);
      if (joint > 0) {
        make_unit(last, to);
        to += 4 * kBlock;
      }
      last = q;
    }
    make_unit(last, to);
    HWY_ALIGN float local[4 * kBlock];  // Root x, y, z and yaw.
    StoreQuat(GatherQuats(RowAddress{blend.rows + lane, 4 * blend.joint_count}), local);
    const Mask is_there = {hn::FirstN(FloatTag(), blend.lanes - lane)};
    is_any_short |= Any(least < shortest && is_there);
    HWY_ALIGN float sines[kBlock];
    HWY_ALIGN float cosines[kBlock];
    TransformRoots(blend, local, lane, root_m, sines, cosines);
    const SoaQuat turn = {Float(0.0f), LoadLanes(sines), Float(0.0f), LoadLanes(cosines)};
    StoreQuat(Multiply(turn, LoadQuat(rotations + lane)), rotations + lane);
    if (!state.is_any) continue;
    const SoaVec3 root = LoadVec3(root_m + lane);
    SoaVec3 eased = root + LoadVec3(blend.root_ease_m + lane) * state.fraction;
    if (state.is_any_inertial) {
      eased = Select(state.is_inertial,
                     eased + LoadVec3(blend.root_ease_m_s + lane) * LoadLanes(blend.slope_s + lane),
                     eased);
    }
    eased = Select(state.is_eased, eased, root);
    StoreLanes(eased.x, root_m + lane);
    StoreLanes(eased.y, root_m + kBlock + lane);
    StoreLanes(eased.z, root_m + 2 * kBlock + lane);
  }
  return !is_any_short;
}

}  // namespace
}  // namespace stridewire::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // STRIDEWIRE_SOA_POSE_INL_H
