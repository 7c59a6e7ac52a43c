#include "pose_kernels.h"

#include <cstring>

#include "foot_plant_constants.h"
#include "stridewire/runtime/foot_plan.h"

#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): Highway's
#define HWY_TARGET_INCLUDE "pose_kernels.cpp"
#include "hwy/foreach_target.h"
// Behind foreach_target.h, which includes this file once for each instruction set.
#include "foot_plant-inl.h"
#include "hwy/highway.h"
#include "lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stridewire::kernels::HWY_NAMESPACE {
namespace {

constexpr float kSmallestNorm = 0.1f;

void SumRows(const float* HWY_RESTRICT examples, const float* HWY_RESTRICT weights,
             std::size_t count, std::size_t row_floats, float* HWY_RESTRICT row) {
  const FloatTag d;
  const std::size_t width = hn::Lanes(d);
  std::size_t i = 0;
  // Four sums at a time: additions wait for the one before.
  for (; i + 4 * width <= row_floats; i += 4 * width) {
    auto s0 = hn::Zero(d), s1 = s0, s2 = s0, s3 = s0;
    const float* source = examples + i;
    for (std::size_t e = 0; e < count; ++e, source += row_floats) {
      const auto w = hn::Set(d, weights[e]);
      s0 = hn::Add(s0, hn::Mul(w, hn::LoadU(d, source)));
      s1 = hn::Add(s1, hn::Mul(w, hn::LoadU(d, source + width)));
      s2 = hn::Add(s2, hn::Mul(w, hn::LoadU(d, source + 2 * width)));
      s3 = hn::Add(s3, hn::Mul(w, hn::LoadU(d, source + 3 * width)));
    }
    hn::StoreU(s0, d, row + i);
    hn::StoreU(s1, d, row + i + width);
    hn::StoreU(s2, d, row + i + 2 * width);
    hn::StoreU(s3, d, row + i + 3 * width);
  }
  for (; i < row_floats; i += width) {
    auto sum = hn::Zero(d);
    const float* source = examples + i;
    for (std::size_t e = 0; e < count; ++e, source += row_floats) {
      sum = hn::Add(sum, hn::Mul(hn::Set(d, weights[e]), hn::LoadU(d, source)));
    }
    hn::StoreU(sum, d, row + i);
  }
}

std::uint32_t BlendRow(const float* HWY_RESTRICT examples, const float* HWY_RESTRICT weights,
                       std::size_t count, std::size_t row_floats, std::size_t padded,
                       std::size_t joint_count, float* HWY_RESTRICT row) {
  const FloatTag d;
  const std::size_t width = hn::Lanes(d);
  std::uint32_t degenerate = 0;
  std::size_t next = 0;
  while (next < padded) {
    // The last ones go with some before them, as in BlendRotations.
    const std::size_t j = next + width > padded && padded >= width ? padded - width : next;
    Quat4 q = {Float(0.0f), Float(0.0f), Float(0.0f), Float(0.0f)};
    const float* source = examples + j;
    for (std::size_t e = 0; e < count; ++e, source += row_floats) {
      q = q + LoadParts(source, padded) * Float(weights[e]);
    }
    // Behind the joints comes the root, which is no rotation.
    const auto is_joint = hn::FirstN(d, joint_count > j ? joint_count - j : 0);
    const Float norm = Sqrt(Dot(q, q));
    const hn::Mask<FloatTag> is_sound = hn::Ge(norm.v, hn::Set(d, kSmallestNorm));
    const Float scale = Select({hn::And(is_joint, is_sound)}, Float(1.0f) / norm, Float(1.0f));
    StoreParts(q * scale, row + j, padded, hn::FirstN(d, padded - j));
    const auto is_new = hn::Not(hn::FirstN(d, next - j));
    degenerate += static_cast<std::uint32_t>(
        hn::CountTrue(d, hn::And(hn::AndNot(is_sound, is_joint), is_new)));
    next = j + width;
  }
  return degenerate;
}

void BlendRotations(const RotationBlend& blend, float* HWY_RESTRICT out) {
  const FloatTag d;
  const std::size_t width = hn::Lanes(d);
  const std::size_t padded = blend.padded;
  std::size_t next = 0;
  while (next < blend.joint_count) {
    // The last ones go with some before them, which come out the same again: no vector is part empty.
    const std::size_t j = next + width > blend.joint_count && blend.joint_count >= width
                              ? blend.joint_count - width
                              : next;
    next = j + width;
    const Quat4 first = LoadParts(blend.rows[1] + j, padded);
    Quat4 q = {Float(0.0f), Float(0.0f), Float(0.0f), Float(0.0f)};
    for (std::size_t k = 0; k < 4; ++k) {
      const Quat4 at = LoadParts(blend.rows[k] + j, padded);
      // Alignment is per grid point, so a track far from the reference may flip between two.
      const Float weight =
          Select(Dot(first, at) < Float(0.0f), Float(-blend.weights[k]), Float(blend.weights[k]));
      q = q + at * weight;
    }
    // Lengths multiply: one division at the end serves all.
    const std::size_t left = blend.joint_count - j;
    if (blend.difference != nullptr) {
      const Quat4 difference = LoadQuats(blend.difference + 4 * j, left);
      q = Multiply(q, SlerpFromIdentity(difference, Float(blend.fraction)));
    }
    if (blend.velocity != nullptr) {
      const Vec3x along = LoadVectors(blend.velocity + 3 * j, left) * Float(0.5f * blend.seconds);
      q = Multiply(q, {along.x, along.y, along.z, Float(1.0f)});
    }
    StoreQuats(Normalise(q), out + 4 * j, left);
  }
}

void SinCos(const double* angles_rad, std::size_t count, double* sines, double* cosines) {
  const DoubleTag d;
  const std::size_t width = hn::Lanes(d);
  HWY_ALIGN double x[kBlock] = {};
  HWY_ALIGN double s[kBlock];
  HWY_ALIGN double c[kBlock];
  for (std::size_t begin = 0; begin < count; begin += kBlock) {
    const std::size_t n = count - begin < kBlock ? count - begin : kBlock;
    std::memcpy(x, angles_rad + begin, n * sizeof(double));
    for (std::size_t i = 0; i < n; i += width) SinCosOf(d, x + i, s + i, c + i);
    std::memcpy(sines + begin, s, n * sizeof(double));
    std::memcpy(cosines + begin, c, n * sizeof(double));
  }
}

}  // namespace
}  // namespace stridewire::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stridewire::kernels {

HWY_EXPORT(SumRows);
HWY_EXPORT(BlendRow);
HWY_EXPORT(BlendRotations);
HWY_EXPORT(SinCos);
HWY_EXPORT(PlantPoses);

void SumRows(const float* examples, const float* weights, std::size_t count, std::size_t row_floats,
             float* row) {
  HWY_DYNAMIC_DISPATCH(SumRows)(examples, weights, count, row_floats, row);
}

std::uint32_t BlendRow(const float* examples, const float* weights, std::size_t count,
                       std::size_t row_floats, std::size_t padded, std::size_t joint_count,
                       float* row) {
  return HWY_DYNAMIC_DISPATCH(BlendRow)(examples, weights, count, row_floats, padded, joint_count,
                                        row);
}

void BlendRotations(const RotationBlend& blend, float* out) {
  HWY_DYNAMIC_DISPATCH(BlendRotations)(blend, out);
}

void SinCos(const double* angles_rad, std::size_t count, double* sines, double* cosines) {
  HWY_DYNAMIC_DISPATCH(SinCos)(angles_rad, count, sines, cosines);
}

void PlantPoses(const LegRig& rig, const PlantJob* jobs, std::size_t count) {
  HWY_DYNAMIC_DISPATCH(PlantPoses)(rig, jobs, count);
}

}  // namespace stridewire::kernels

#endif  // HWY_ONCE
