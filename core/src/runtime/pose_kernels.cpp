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

void BlendPoints(const float* const* HWY_RESTRICT points, const float* HWY_RESTRICT weights,
                 std::size_t row_floats, float* HWY_RESTRICT row) {
  const FloatTag d;
  for (std::size_t i = 0; i < row_floats; i += hn::Lanes(d)) {
    auto sum = hn::Mul(hn::Set(d, weights[0]), hn::LoadU(d, points[0] + i));
    for (std::size_t k = 1; k < 4; ++k) {
      sum = hn::Add(sum, hn::Mul(hn::Set(d, weights[k]), hn::LoadU(d, points[k] + i)));
    }
    hn::StoreU(sum, d, row + i);
  }
}

bool BlendRotations(const RotationBlend& blend, float* HWY_RESTRICT out) {
  const FloatTag d;
  const std::size_t width = hn::Lanes(d);
  Mask is_short = {hn::FirstN(d, 0)};
  std::size_t next = 0;
  while (next < blend.joint_count) {
    // The last ones go with some before them, which come out the same again: no vector is part empty.
    const std::size_t j = next + width > blend.joint_count && blend.joint_count >= width
                              ? blend.joint_count - width
                              : next;
    next = j + width;
    const std::size_t left = blend.joint_count - j;
    Quat4 q = LoadParts(blend.row + j, blend.padded);
    // Behind the joints comes the root, which is no rotation.
    const Mask is_small = Dot(q, q) < Float(kSmallestNorm * kSmallestNorm);
    is_short = is_short || (is_small && Mask{hn::FirstN(d, left)});
    // Lengths multiply: one division at the end serves all.
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
  return !Any(is_short);
}

void FindInGrids(std::size_t count, GridTimes& times) {
  const DoubleTag d;
  const hn::Rebind<float, DoubleTag> floats;
  const std::size_t width = hn::Lanes(d);
  const auto number = [d](double value) HWY_ATTR { return hn::Set(d, value); };
  const auto zero = number(0.0);
  const auto one = number(1.0);
  const auto ease_out = [&](auto s) HWY_ATTR {
    const auto r = hn::Sub(one, hn::Min(hn::Max(s, zero), one));
    return hn::Mul(hn::Mul(r, r), hn::Sub(number(3.0), hn::Mul(number(2.0), r)));
  };
  for (std::size_t i = 0; i < count; i += width) {
    const auto time = hn::Load(d, times.time_s + i);
    const auto begin_s = hn::Load(d, times.begin_s + i);
    const auto end_s = hn::Load(d, times.end_s + i);
    const auto begin = hn::Load(d, times.begin + i);
    const auto end = hn::Load(d, times.end + i);
    // Hermite's cubic, as TimeWarp::GridPosition has it.
    const auto h = hn::Sub(end_s, begin_s);
    const auto s = hn::Div(hn::Sub(time, begin_s), h);
    const auto rise = hn::Sub(end, begin);
    const auto m0 = hn::Mul(hn::Load(d, times.begin_slope + i), h);
    const auto m1 = hn::Mul(hn::Load(d, times.end_slope + i), h);
    const auto two_rise = hn::Mul(number(2.0), rise);
    const auto cubic = hn::Sub(hn::Add(m0, m1), two_rise);
    const auto square = hn::Sub(hn::Sub(hn::Mul(number(3.0), rise), hn::Mul(number(2.0), m0)), m1);
    auto u =
        hn::Add(begin, hn::Mul(s, hn::Add(m0, hn::Mul(s, hn::Add(square, hn::Mul(s, cubic))))));
    u = hn::Min(hn::Max(u, begin), end);
    u = hn::IfThenElse(hn::Ge(time, end_s), end, u);
    u = hn::IfThenElse(hn::Gt(time, begin_s), u, begin);

    // As CellWeightsAt.
    const auto last = hn::Load(d, times.last_cell + i);
    const auto cell = hn::Min(hn::Max(hn::Trunc(u), zero), last);
    const auto f = hn::Min(hn::Max(hn::Sub(u, cell), zero), one);
    const auto half = number(0.5);
    const auto ff = hn::Mul(f, f);
    const auto before =
        hn::Mul(f, hn::Add(number(-0.5), hn::Mul(f, hn::Sub(one, hn::Mul(half, f)))));
    const auto left = hn::Add(one, hn::Mul(ff, hn::Add(number(-2.5), hn::Mul(number(1.5), f))));
    const auto right =
        hn::Mul(f, hn::Add(half, hn::Mul(f, hn::Sub(number(2.0), hn::Mul(number(1.5), f)))));
    const auto after = hn::Mul(ff, hn::Add(number(-0.5), hn::Mul(half, f)));
    const auto is_pair = hn::Eq(last, zero);
    const auto is_first = hn::Eq(cell, zero);
    const auto is_last = hn::Eq(cell, last);
    const auto three_before = hn::Mul(number(3.0), before);
    const auto three_after = hn::Mul(number(3.0), after);
    const auto weight = [&](std::size_t k, auto pair, auto at_first, auto at_last, auto within)
                            HWY_ATTR {
                              auto w = hn::IfThenElse(is_last, at_last, within);
                              w = hn::IfThenElse(is_first, at_first, w);
                              w = hn::IfThenElse(is_pair, pair, w);
                              hn::Store(hn::DemoteTo(floats, w), floats, times.weights[k] + i);
                            };
    weight(0, hn::Sub(one, f), hn::Add(left, three_before), hn::Add(before, after), before);
    weight(1, f, hn::Sub(right, three_before), hn::Sub(left, three_after), left);
    weight(2, zero, hn::Add(after, before), hn::Add(right, three_after), right);
    weight(3, zero, zero, zero, after);
    hn::Store(hn::IfThenElse(is_first, zero, hn::Sub(cell, one)), d, times.first_point + i);

    hn::Store(ease_out(hn::Div(time, hn::Load(d, times.duration_s + i))), d, times.steered + i);
    const auto over = hn::Load(d, times.ease_out_s + i);
    const auto eased = hn::Div(hn::Sub(time, hn::Load(d, times.entered_s + i)), over);
    const auto part = hn::Min(hn::Max(eased, zero), one);
    const auto rest = hn::Sub(one, part);
    hn::Store(eased, d, times.eased + i);
    hn::Store(hn::DemoteTo(floats, ease_out(eased)), floats, times.fraction + i);
    hn::Store(hn::DemoteTo(floats, hn::Mul(over, hn::Mul(hn::Mul(part, rest), rest))), floats,
              times.slope_s + i);
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
HWY_EXPORT(BlendPoints);
HWY_EXPORT(BlendRotations);
HWY_EXPORT(FindInGrids);
HWY_EXPORT(SinCos);
HWY_EXPORT(PlantPoses);

void SumRows(const float* examples, const float* weights, std::size_t count, std::size_t row_floats,
             float* row) {
  HWY_DYNAMIC_DISPATCH(SumRows)(examples, weights, count, row_floats, row);
}

void BlendPoints(const float* const points[4], const float weights[4], std::size_t row_floats,
                 float* row) {
  HWY_DYNAMIC_DISPATCH(BlendPoints)(points, weights, row_floats, row);
}

bool BlendRotations(const RotationBlend& blend, float* out) {
  return HWY_DYNAMIC_DISPATCH(BlendRotations)(blend, out);
}

void FindInGrids(std::size_t count, GridTimes& times) {
  HWY_DYNAMIC_DISPATCH(FindInGrids)(count, times);
}

void SinCos(const double* angles_rad, std::size_t count, double* sines, double* cosines) {
  HWY_DYNAMIC_DISPATCH(SinCos)(angles_rad, count, sines, cosines);
}

void PlantPoses(const LegRig& rig, const PlantJob* jobs, std::size_t count) {
  HWY_DYNAMIC_DISPATCH(PlantPoses)(rig, jobs, count);
}

}  // namespace stridewire::kernels

#endif  // HWY_ONCE
