#include "runtime/pose/pose_kernels.h"

#include <cstring>

#include "runtime/movement/foot_plan.h"
#include "runtime/skeleton/foot_plant_constants.h"

#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): Highway's
#define HWY_TARGET_INCLUDE "runtime/pose/pose_kernels.cpp"
#include "hwy/foreach_target.h"
// These headers must follow foreach_target.h, which includes this file once per instruction set.
#include "hwy/highway.h"
#include "runtime/pose/foot_plant-inl.h"
#include "runtime/pose/simd_math-inl.h"
#include "runtime/pose/soa_pose-inl.h"
#include "runtime/skeleton/leg_rig.h"

HWY_BEFORE_NAMESPACE();
namespace stridewire::kernels::HWY_NAMESPACE {
namespace {

// Keeps a value in a register. Otherwise, g++ reads it from memory again for every multiplication,
// and memory reads limit the speed of the kernel.
HWY_INLINE void StayInRegister([[maybe_unused]] hn::Vec<FloatTag>& x) {
#if HWY_ARCH_X86 && HWY_COMPILER_GCC_ACTUAL
  asm("" : "+v"(x.raw));
#endif
}

// Computes a part of the blended rows of `Rows` movements: the `Vectors` SIMD vectors of each row
// that start at offset `at`. The sums are independent, so the processor executes their additions in
// parallel. Each value that is read from the library is used for all movements.
template <std::size_t Rows, std::size_t Vectors>
HWY_INLINE void SumVectors(const float* HWY_RESTRICT source, const float* const* weights,
                           std::size_t count, std::size_t row_floats, float* const* rows,
                           std::size_t at) {
  const FloatTag d;
  const std::size_t width = hn::Lanes(d);
  hn::Vec<FloatTag> sums[Rows][Vectors];
  for (std::size_t r = 0; r < Rows; ++r) {
    for (std::size_t v = 0; v < Vectors; ++v) sums[r][v] = hn::Zero(d);
  }
  source += at;
  for (std::size_t e = 0; e < count; ++e, source += row_floats) {
    hn::Vec<FloatTag> w[Rows];
    for (std::size_t r = 0; r < Rows; ++r) w[r] = hn::Set(d, weights[r][e]);
    for (std::size_t v = 0; v < Vectors; ++v) {
      auto x = hn::LoadU(d, source + v * width);
      StayInRegister(x);
      for (std::size_t r = 0; r < Rows; ++r) sums[r][v] = hn::Add(sums[r][v], hn::Mul(w[r], x));
    }
  }
  for (std::size_t r = 0; r < Rows; ++r) {
    for (std::size_t v = 0; v < Vectors; ++v) hn::StoreU(sums[r][v], d, rows[r] + at + v * width);
  }
}

// Computes the blended rows of several movements (`Rows`) at the same grid point. Each example is
// read once for all of them.
template <std::size_t Rows>
HWY_INLINE void SumRowsOf(const float* examples, const float* const* weights, std::size_t count,
                          std::size_t row_floats, float* const* rows) {
  const std::size_t width = hn::Lanes(FloatTag());
  std::size_t i = 0;
  const auto take = [&]<std::size_t Vectors>() HWY_ATTR {
    for (; i + Vectors * width <= row_floats; i += Vectors * width) {
      SumVectors<Rows, Vectors>(examples, weights, count, row_floats, rows, i);
    }
  };
  // Computes as many sums at a time as fit into the registers.
  if constexpr (Rows == 1 || HWY_TARGET <= HWY_AVX3) take.template operator()<8>();
  if constexpr (Rows == 1 || HWY_TARGET <= HWY_AVX3) take.template operator()<6>();
  take.template operator()<4>();
  take.template operator()<2>();
  take.template operator()<1>();
}

void SumRows(const float* examples, const float* weights, std::size_t count, std::size_t row_floats,
             float* row) {
  SumRowsOf<1>(examples, &weights, count, row_floats, &row);
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

void BlendRows(const BlendRowsJob& run) {
  const auto last = static_cast<std::size_t>(run.point_count) - 1;
  std::size_t next[kBlock] = {};  // Index of the next pose of each lane.
  const auto first_of = [&](std::size_t i) HWY_ATTR {
    return static_cast<std::size_t>(run.samples[next[i]].first_point[run.lane + i]);
  };
  const auto ring_of = [&](std::size_t i, std::size_t point)
                           HWY_ATTR { return run.ring + (i * 4 + (point & 3)) * run.row_floats; };
  // Visits grid points in ascending order. At each point, computes the rows of all lanes that need
  // it, and then blends the poses for which this is the last of their four points.
  std::size_t point = last;
  for (std::size_t i = 0; i < run.lanes; ++i) point = point < first_of(i) ? point : first_of(i);
  for (std::size_t left = run.lanes; left > 0; ++point) {
    const float* examples = run.grid + point * run.examples * run.row_floats;
    const float* weights[kBlock];
    float* sums[kBlock];
    std::size_t passing[kBlock];  // Lanes that need the current point.
    std::size_t count = 0;
    for (std::size_t i = 0; i < run.lanes; ++i) {
      if (next[i] == run.poses || point < first_of(i)) continue;
      weights[count] = run.weights[run.lane + i];
      sums[count] = ring_of(i, point);
      passing[count++] = i;
    }
    std::size_t i = 0;
    for (; i + 2 <= count; i += 2) {
      SumRowsOf<2>(examples, weights + i, run.examples, run.row_floats, sums + i);
    }
    if (i < count) SumRows(examples, weights[i], run.examples, run.row_floats, sums[i]);
    for (std::size_t p = 0; p < count; ++p) {
      const std::size_t lane = passing[p];
      for (; next[lane] < run.poses; ++next[lane]) {
        const std::size_t first = first_of(lane);
        if ((first + 3 < last ? first + 3 : last) != point) break;
        // Points beyond the last one have weight zero, but a row is read for them nevertheless.
        const float* points[4];
        float part[4];
        const GridSamples& place = run.samples[next[lane]];
        for (std::size_t k = 0; k < 4; ++k) {
          points[k] = ring_of(lane, first + k < last ? first + k : last);
          part[k] = place.weights[k][run.lane + lane];
        }
        BlendPoints(points, part, run.row_floats,
                    run.rows + (next[lane] * kBlock + run.lane + lane) * run.row_floats);
      }
      left -= next[lane] == run.poses;
    }
  }
}

bool BlendRotations(const RotationBlend& blend, float* HWY_RESTRICT out) {
  const FloatTag d;
  const std::size_t width = hn::Lanes(d);
  Mask is_short = {hn::FirstN(d, 0)};
  std::size_t next = 0;
  while (next < blend.joint_count) {
    // If fewer joints remain than a vector holds, the last vector also covers some joints of the
    // previous one, with the same results. Only skeletons with fewer joints than a vector holds
    // leave lanes empty.
    const std::size_t j = next + width > blend.joint_count && blend.joint_count >= width
                              ? blend.joint_count - width
                              : next;
    next = j + width;
    const std::size_t left = blend.joint_count - j;
    SoaQuat q = LoadQuats(blend.row + 4 * j, left);
    const Mask is_small = Dot(q, q) < Float(kSmallestNorm * kSmallestNorm);
    is_short = is_short || (is_small && Mask{hn::FirstN(d, left)});
    // The length of a product of quaternions is the product of their lengths, so it is enough to
    // normalize the result.
    if (blend.difference != nullptr) {
      const SoaQuat difference = LoadQuats(blend.difference + 4 * j, left);
      q = Multiply(q, SlerpOf(SlerpPartsOf(difference), Float(blend.fraction)));
    }
    if (blend.velocity != nullptr) {
      const SoaVec3 along = LoadVectors(blend.velocity + 3 * j, left) * Float(0.5f * blend.seconds);
      q = Multiply(q, {along.x, along.y, along.z, Float(1.0f)});
    }
    StoreQuats(Normalise(q), out + 4 * j, left);
  }
  return !Any(is_short);
}

// q and -q are the same rotation. Returns the one that is closer to `reference`.
HWY_INLINE SoaQuat Closer(SoaQuat q, SoaQuat reference) {
  return q * Select(Dot(q, reference) < Float(0.0f), Float(-1.0f), Float(1.0f));
}

void BlendLayer(const LayerBlend& layer, float* rotations) {
  const std::size_t width = hn::Lanes(FloatTag());
  for (std::size_t i = 0; i < layer.joint_count; i += width) {
    const std::size_t left = layer.joint_count - i;
    const std::size_t lanes = left < width ? left : width;
    float weights[kBlock] = {};
    std::memcpy(weights, layer.joint_weights + i, lanes * sizeof(float));
    const auto key = [&](std::size_t k) HWY_ATTR { return LoadQuats(layer.keys[k] + 4 * i, left); };
    const SoaQuat second = key(1);
    const SoaQuat third = Closer(key(2), second);
    const SoaQuat played =
        Normalise(Closer(key(0), second) * Float(layer.key_weights[0]) +
                  second * Float(layer.key_weights[1]) + third * Float(layer.key_weights[2]) +
                  Closer(key(3), third) * Float(layer.key_weights[3]));
    // Lanes beyond the last joint read that joint again and are not stored.
    const auto rotation_of = [&](std::size_t lane) HWY_ATTR {
      const std::size_t joint = i + lane < layer.joint_count ? i + lane : layer.joint_count - 1;
      return rotations + 4 * static_cast<std::size_t>(layer.joints[joint]);
    };
    const SoaQuat from = GatherQuats(rotation_of);
    const Float share = LoadLanes(weights) * Float(layer.weight);
    const SoaQuat towards = SlerpOf(SlerpPartsOf(Multiply(Conjugate(from), played)), share);
    const SoaQuat blended =
        Select(share >= Float(1.0f), played, Normalise(Multiply(from, towards)));
    ScatterQuats(blended, lanes, rotation_of);
  }
}

void ComputeGridSamples(std::size_t count, const GridTimes& times, GridSamples& samples) {
  const DoubleTag d;
  const hn::Rebind<float, DoubleTag> floats;
  const hn::Rebind<std::int32_t, DoubleTag> integers;
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
    // Cubic Hermite interpolation with the operations of TimeWarp::GridPosition.
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

    // Catmull-Rom weights. Beyond an end, a missing neighbour is extrapolated as p_-1 = 3 p_0 - 3
    // p_1 + p_2. The tangent at the end is then the one-sided second-order difference.
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
                              hn::Store(hn::DemoteTo(floats, w), floats, samples.weights[k] + i);
                            };
    weight(0, hn::Sub(one, f), hn::Add(left, three_before), hn::Add(before, after), before);
    weight(1, f, hn::Sub(right, three_before), hn::Sub(left, three_after), left);
    weight(2, zero, hn::Add(after, before), hn::Add(right, three_after), right);
    weight(3, zero, zero, zero, after);
    hn::Store(hn::DemoteTo(integers, hn::IfThenElse(is_first, zero, hn::Sub(cell, one))), integers,
              samples.first_point + i);

    hn::Store(ease_out(hn::Div(time, hn::Load(d, times.duration_s + i))), d,
              samples.remaining_turn + i);
    const auto over = hn::Load(d, times.ease_out_s + i);
    const auto eased = hn::Div(hn::Sub(time, hn::Load(d, times.start_offset_s + i)), over);
    const auto part = hn::Min(hn::Max(eased, zero), one);
    const auto rest = hn::Sub(one, part);
    hn::Store(hn::DemoteTo(floats, hn::IfThenElseZero(hn::Lt(eased, one), one)), floats,
              samples.is_eased + i);
    hn::Store(hn::DemoteTo(floats, ease_out(eased)), floats, samples.fraction + i);
    hn::Store(hn::DemoteTo(floats, hn::Mul(over, hn::Mul(hn::Mul(part, rest), rest))), floats,
              samples.slope_s + i);
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
HWY_EXPORT(BlendRows);
HWY_EXPORT(BlendRotations);
HWY_EXPORT(BlendLayer);
HWY_EXPORT(ComputeGridSamples);
HWY_EXPORT(SinCos);
HWY_EXPORT(Transpose);
HWY_EXPORT(ScatterRotations);
HWY_EXPORT(PrepareDifferences);
HWY_EXPORT(FindLargestVelocities);
HWY_EXPORT(FinishPoses);
HWY_EXPORT(ComputeFeet);
HWY_EXPORT(PlantPoses);
HWY_EXPORT(PlantPose);

void SumRows(const float* examples, const float* weights, std::size_t count, std::size_t row_floats,
             float* row) {
  HWY_DYNAMIC_DISPATCH(SumRows)(examples, weights, count, row_floats, row);
}

void BlendPoints(const float* const points[4], const float weights[4], std::size_t row_floats,
                 float* row) {
  HWY_DYNAMIC_DISPATCH(BlendPoints)(points, weights, row_floats, row);
}

void BlendRows(const BlendRowsJob& run) { HWY_DYNAMIC_DISPATCH(BlendRows)(run); }

bool BlendRotations(const RotationBlend& blend, float* out) {
  return HWY_DYNAMIC_DISPATCH(BlendRotations)(blend, out);
}

void BlendLayer(const LayerBlend& layer, float* rotations) {
  HWY_DYNAMIC_DISPATCH(BlendLayer)(layer, rotations);
}

void ComputeGridSamples(std::size_t count, const GridTimes& times, GridSamples& samples) {
  HWY_DYNAMIC_DISPATCH(ComputeGridSamples)(count, times, samples);
}

void SinCos(const double* angles_rad, std::size_t count, double* sines, double* cosines) {
  HWY_DYNAMIC_DISPATCH(SinCos)(angles_rad, count, sines, cosines);
}

void Transpose(const float* const from[kBlock], std::size_t count, std::size_t lanes, float* to) {
  HWY_DYNAMIC_DISPATCH(Transpose)(from, count, lanes, to);
}

void ScatterRotations(const float* rotations, std::size_t joint_count, std::size_t lanes,
                      float* const* to) {
  HWY_DYNAMIC_DISPATCH(ScatterRotations)(rotations, joint_count, lanes, to);
}

void PrepareDifferences(const float* difference, std::size_t joint_count, std::size_t lanes,
                        float* ease) {
  HWY_DYNAMIC_DISPATCH(PrepareDifferences)(difference, joint_count, lanes, ease);
}

void FindLargestVelocities(const float* velocity, std::size_t joint_count, std::size_t lanes,
                           float* fastest) {
  HWY_DYNAMIC_DISPATCH(FindLargestVelocities)(velocity, joint_count, lanes, fastest);
}

bool FinishPoses(const FinishPosesJob& blend, float* root_m, float* rotations) {
  return HWY_DYNAMIC_DISPATCH(FinishPoses)(blend, root_m, rotations);
}

void ComputeFeet(const LegRig& rig, const float* rotations, std::size_t lanes,
                 const FeetPositions& feet) {
  HWY_DYNAMIC_DISPATCH(ComputeFeet)(rig, rotations, lanes, feet);
}

void PlantPoses(const LegRig& rig, const PlantPosesJob& block, std::size_t count) {
  HWY_DYNAMIC_DISPATCH(PlantPoses)(rig, block, count);
}

void PlantPose(const LegRig& rig, const PlantPoseJob& job) {
  HWY_DYNAMIC_DISPATCH(PlantPose)(rig, job);
}

}  // namespace stridewire::kernels

#endif  // HWY_ONCE
