// SIMD vectors, quaternions and trigonometry for the kernels. pose_kernels.cpp compiles this file
// once per instruction set, so it has no ordinary include guard. It uses only operations that IEEE
// 754 defines exactly (additions, multiplications, divisions, square roots, comparisons and
// rounding to integers), each rounded separately, so that all instruction sets produce the same
// bytes.
#if defined(STRIDEWIRE_SIMD_MATH_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STRIDEWIRE_SIMD_MATH_INL_H
#undef STRIDEWIRE_SIMD_MATH_INL_H
#else
#define STRIDEWIRE_SIMD_MATH_INL_H
#endif

#include <cstddef>
#include <cstring>

#include "hwy/highway.h"
#include "runtime/pose/wasm_doubles-inl.h"

HWY_BEFORE_NAMESPACE();
namespace stridewire::kernels::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, kBlock>;
using DoubleTag = hn::CappedTag<double, kBlock / 2>;

struct Mask {
  hn::Mask<FloatTag> m;
};

struct Float {
  hn::Vec<FloatTag> v;
  Float() = default;
  HWY_INLINE explicit Float(hn::Vec<FloatTag> value) : v(value) {}
  // Broadcasts the value to all lanes.
  HWY_INLINE Float(float value) : v(hn::Set(FloatTag(), value)) {}  // NOLINT
};

HWY_INLINE Float operator+(Float a, Float b) { return Float(hn::Add(a.v, b.v)); }
HWY_INLINE Float operator-(Float a, Float b) { return Float(hn::Sub(a.v, b.v)); }
HWY_INLINE Float operator*(Float a, Float b) { return Float(hn::Mul(a.v, b.v)); }
HWY_INLINE Float operator/(Float a, Float b) { return Float(hn::Div(a.v, b.v)); }
HWY_INLINE Float operator-(Float a) { return Float(hn::Neg(a.v)); }
HWY_INLINE Mask operator<(Float a, Float b) { return {hn::Lt(a.v, b.v)}; }
HWY_INLINE Mask operator>(Float a, Float b) { return {hn::Gt(a.v, b.v)}; }
HWY_INLINE Mask operator<=(Float a, Float b) { return {hn::Le(a.v, b.v)}; }
HWY_INLINE Mask operator>=(Float a, Float b) { return {hn::Ge(a.v, b.v)}; }
HWY_INLINE Mask operator||(Mask a, Mask b) { return {hn::Or(a.m, b.m)}; }
HWY_INLINE Mask operator&&(Mask a, Mask b) { return {hn::And(a.m, b.m)}; }
HWY_INLINE Float Select(Mask mask, Float yes, Float no) {
  return Float(hn::IfThenElse(mask.m, yes.v, no.v));
}
HWY_INLINE Float Sqrt(Float a) { return Float(hn::Sqrt(a.v)); }
HWY_INLINE Float Abs(Float a) { return Float(hn::Abs(a.v)); }
HWY_INLINE Float Round(Float a) { return Float(hn::Round(a.v)); }
// Neither argument may be NaN.
HWY_INLINE Float Max(Float a, Float b) { return Select(a < b, b, a); }
HWY_INLINE Float Min(Float a, Float b) { return Select(b < a, b, a); }
HWY_INLINE Float Clamp(Float a, Float low, Float high) { return Min(Max(a, low), high); }
HWY_INLINE bool Any(Mask mask) { return !hn::AllFalse(FloatTag(), mask.m); }

// One Vec3 per lane.
struct SoaVec3 {
  Float x, y, z;
};
HWY_INLINE SoaVec3 operator+(SoaVec3 a, SoaVec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
HWY_INLINE SoaVec3 operator-(SoaVec3 a, SoaVec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
HWY_INLINE SoaVec3 operator*(SoaVec3 a, Float s) { return {a.x * s, a.y * s, a.z * s}; }
HWY_INLINE Float Dot(SoaVec3 a, SoaVec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
HWY_INLINE SoaVec3 Cross(SoaVec3 a, SoaVec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
HWY_INLINE SoaVec3 Select(Mask mask, SoaVec3 yes, SoaVec3 no) {
  return {Select(mask, yes.x, no.x), Select(mask, yes.y, no.y), Select(mask, yes.z, no.z)};
}

// One Quat per lane.
struct SoaQuat {
  Float x, y, z, w;
};
HWY_INLINE SoaQuat operator+(SoaQuat a, SoaQuat b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w};
}
HWY_INLINE SoaQuat operator*(SoaQuat a, Float s) { return {a.x * s, a.y * s, a.z * s, a.w * s}; }
HWY_INLINE SoaQuat Select(Mask mask, SoaQuat yes, SoaQuat no) {
  return {Select(mask, yes.x, no.x), Select(mask, yes.y, no.y), Select(mask, yes.z, no.z),
          Select(mask, yes.w, no.w)};
}
HWY_INLINE Float Dot(SoaQuat a, SoaQuat b) { return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w; }
HWY_INLINE SoaQuat Conjugate(SoaQuat q) { return {-q.x, -q.y, -q.z, q.w}; }
HWY_INLINE SoaQuat Multiply(SoaQuat a, SoaQuat b) {
  return {
      a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y + a.y * b.w + a.z * b.x - a.x * b.z,
      a.w * b.z + a.z * b.w + a.x * b.y - a.y * b.x, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}
HWY_INLINE SoaVec3 Rotate(SoaQuat q, SoaVec3 v) {
  const SoaVec3 u = {q.x, q.y, q.z};
  const SoaVec3 t = Cross(u, v);
  return v + (t * q.w + Cross(u, t)) * Float(2.0f);
}
// Normalizes `q`; `square` is Dot(q, q).
HWY_INLINE SoaQuat UnitOf(SoaQuat q, Float square) {
  const Float norm = Sqrt(square);
  const Mask is_sound = norm > Float(1e-12f);
  const Float scale = Select(is_sound, Float(1.0f) / norm, Float(0.0f));
  return {q.x * scale, q.y * scale, q.z * scale, Select(is_sound, q.w * scale, Float(1.0f))};
}
HWY_INLINE SoaQuat Normalise(SoaQuat q) { return UnitOf(q, Dot(q, q)); }

// Polynomials interpolated at Chebyshev nodes. Their errors are below 2e-8, about the precision of
// a float.
HWY_INLINE Float AtanOverX(Float square) {  // |x| <= 1
  Float p = 2.834064299e-03f;
  p = p * square - Float(1.600503050e-02f);
  p = p * square + Float(4.258760747e-02f);
  p = p * square - Float(7.495445443e-02f);
  p = p * square + Float(1.063675410e-01f);
  p = p * square - Float(1.420257051e-01f);
  p = p * square + Float(1.999248358e-01f);
  p = p * square - Float(3.333306678e-01f);
  return p * square + Float(1.0f);
}
HWY_INLINE Float SinOverX(Float square) {  // |x| <= pi / 2
  Float p = 2.605019618e-06f;
  p = p * square - Float(1.980898300e-04f);
  p = p * square + Float(8.333049779e-03f);
  p = p * square - Float(1.666665794e-01f);
  return p * square + Float(1.0f);
}
HWY_INLINE Float CosNearZero(Float square) {  // |x| <= pi / 2
  Float p = -2.604960852e-07f;
  p = p * square + Float(2.476005399e-05f);
  p = p * square - Float(1.388835928e-03f);
  p = p * square + Float(4.166663609e-02f);
  p = p * square - Float(4.999999935e-01f);
  return p * square + Float(1.0f);
}

// The parts of slerp(1, q, fraction), along the short arc, that do not depend on the fraction. With
// m = |xyz| / (1 + |w|), the tangent of a quarter of the angle, half the angle is 2 atan m. This
// avoids a division by a small sine.
struct SlerpParts {
  SoaVec3 half;  // Rotation vector of half the angle.
  Float square;  // |half|^2
};
HWY_INLINE SlerpParts SlerpPartsOf(SoaQuat q) {
  const Mask is_long = q.w < Float(0.0f);
  const Float sign = Select(is_long, Float(-1.0f), Float(1.0f));
  const Float beside = Float(1.0f) / (Float(1.0f) + Abs(q.w));
  const Float xx = q.x * q.x + q.y * q.y + q.z * q.z;
  // Half the angle divided by its sine. Negative if q is negated to follow the short arc.
  const Float per_sine =
      sign * Float(2.0f) * beside * AtanOverX(Min(xx * beside * beside, Float(1.0f)));
  return {SoaVec3{q.x, q.y, q.z} * per_sine, xx * per_sine * per_sine};
}
// Returns the slerp as a quaternion of length 1 to kLongestSlerp. The caller normalizes the final
// rotation, so only the ratio of xyz to w must be accurate. A quotient of two short polynomials
// approximates that ratio better than separate polynomials of the same degree for sine and cosine.
// They are interpolated at Chebyshev nodes in the square of half the angle; the error of the angle
// is below 2e-8.
constexpr float kLongestSlerp = 1.12f;
HWY_INLINE SoaQuat SlerpOf(SlerpParts parts, Float fraction) {
  const Float square = parts.square * (fraction * fraction);
  Float sine = 2.061795443e-03f;  // Sine divided by half the angle
  sine = sine * square - Float(1.216445714e-01f);
  sine = sine * square + Float(1.0f);
  Float cosine = -1.004631922e-04f;
  cosine = cosine * square + Float(2.038776688e-02f);
  cosine = cosine * square - Float(4.549778998e-01f);
  cosine = cosine * square + Float(1.0f);
  const SoaVec3 xyz = parts.half * (fraction * sine);
  return {xyz.x, xyz.y, xyz.z, cosine};
}

// Returns the angle of the vector (x, y) in [-pi, pi]. Returns 0 for (0, 0).
HWY_INLINE Float Atan2(Float y, Float x) {
  const Float ax = Abs(x);
  const Float ay = Abs(y);
  const Mask is_steep = ay > ax;
  const Float longer = Select(is_steep, ay, ax);
  const Float slope = Select(longer > Float(0.0f), Select(is_steep, ax, ay) / longer, Float(0.0f));
  Float angle = slope * AtanOverX(slope * slope);
  angle = Select(is_steep, Float(1.57079632679f) - angle, angle);
  angle = Select(x < Float(0.0f), Float(3.14159265359f) - angle, angle);
  return Select(y < Float(0.0f), -angle, angle);
}

// Maps an angle to [-pi, pi].
HWY_INLINE Float WrapAngle(Float angle) {
  return angle - Float(6.28318530718f) * Round(angle * Float(0.159154943092f));
}

// Returns the rotation about +Y by an angle in [-pi, pi].
HWY_INLINE SoaQuat YawRotation(Float yaw) {
  const Float half = Float(0.5f) * yaw;
  const Float square = half * half;
  return {Float(0.0f), half * SinOverX(square), Float(0.0f), CosNearZero(square)};
}

// Loads consecutive quaternions x y z w. If only `left` of them remain, fewer than a full vector,
// the other lanes are zero.
HWY_INLINE SoaQuat LoadQuats(const float* at, std::size_t left) {
  const FloatTag d;
  HWY_ALIGN float buffer[4 * kBlock];
  if (left < hn::Lanes(d)) {
    std::memset(buffer + 4 * left, 0, 4 * (hn::Lanes(d) - left) * sizeof(float));
    std::memcpy(buffer, at, left * 4 * sizeof(float));
    at = buffer;
  }
  SoaQuat q;
  hn::LoadInterleaved4(d, at, q.x.v, q.y.v, q.z.v, q.w.v);
  return q;
}
HWY_INLINE void StoreQuats(SoaQuat q, float* at, std::size_t left) {
  const FloatTag d;
  if (left >= hn::Lanes(d)) {
    hn::StoreInterleaved4(q.x.v, q.y.v, q.z.v, q.w.v, d, at);
    return;
  }
  HWY_ALIGN float buffer[4 * kBlock];
  hn::StoreInterleaved4(q.x.v, q.y.v, q.z.v, q.w.v, d, buffer);
  std::memcpy(at, buffer, left * 4 * sizeof(float));
}

// GatherQuats loads four floats from address(lane) for each lane and transposes them into four
// vectors. The transposition happens in registers, because loading a vector from memory that was
// just written in smaller parts would stall the processor.
#if HWY_TARGET != HWY_SCALAR && !HWY_HAVE_SCALABLE
// Transposes the 4 x 4 floats in each block of four lanes.
HWY_INLINE void TransposeBlocks(hn::Vec<FloatTag>& a, hn::Vec<FloatTag>& b, hn::Vec<FloatTag>& c,
                                hn::Vec<FloatTag>& e) {
  const FloatTag d;
  const hn::RepartitionToWide<FloatTag> pairs;
  const auto ab_low = hn::BitCast(pairs, hn::InterleaveLower(d, a, b));
  const auto ab_high = hn::BitCast(pairs, hn::InterleaveUpper(d, a, b));
  const auto ce_low = hn::BitCast(pairs, hn::InterleaveLower(d, c, e));
  const auto ce_high = hn::BitCast(pairs, hn::InterleaveUpper(d, c, e));
  a = hn::BitCast(d, hn::InterleaveLower(pairs, ab_low, ce_low));
  b = hn::BitCast(d, hn::InterleaveUpper(pairs, ab_low, ce_low));
  c = hn::BitCast(d, hn::InterleaveLower(pairs, ab_high, ce_high));
  e = hn::BitCast(d, hn::InterleaveUpper(pairs, ab_high, ce_high));
}
template <typename Tag, typename Address>
HWY_INLINE hn::Vec<Tag> LoadBlocks(Tag d, std::size_t first, Address address) {
  if constexpr (hn::MaxLanes(d) == 4) {
    return hn::LoadU(d, address(first));
  } else {
    const hn::Half<Tag> half;
    return hn::Combine(d, LoadBlocks(half, first + hn::MaxLanes(half), address),
                       LoadBlocks(half, first, address));
  }
}
template <typename Tag, typename Address>
HWY_INLINE void StoreBlocks(Tag d, hn::Vec<Tag> v, std::size_t first, std::size_t lanes,
                            Address address) {
  if constexpr (hn::MaxLanes(d) == 4) {
    if (first < lanes) hn::StoreU(v, d, address(first));
  } else {
    const hn::Half<Tag> half;
    StoreBlocks(half, hn::LowerHalf(half, v), first, lanes, address);
    StoreBlocks(half, hn::UpperHalf(half, v), first + hn::MaxLanes(half), lanes, address);
  }
}
template <typename Address>
HWY_INLINE SoaQuat GatherQuats(Address address) {
  const FloatTag d;
  SoaQuat q = {Float(LoadBlocks(d, 0, address)), Float(LoadBlocks(d, 1, address)),
               Float(LoadBlocks(d, 2, address)), Float(LoadBlocks(d, 3, address))};
  TransposeBlocks(q.x.v, q.y.v, q.z.v, q.w.v);
  return q;
}
// The inverse of GatherQuats for the first `lanes` lanes.
template <typename Address>
HWY_INLINE void ScatterQuats(SoaQuat q, std::size_t lanes, Address address) {
  const FloatTag d;
  TransposeBlocks(q.x.v, q.y.v, q.z.v, q.w.v);
  StoreBlocks(d, q.x.v, 0, lanes, address);
  StoreBlocks(d, q.y.v, 1, lanes, address);
  StoreBlocks(d, q.z.v, 2, lanes, address);
  StoreBlocks(d, q.w.v, 3, lanes, address);
}
#else
template <typename Address>
HWY_INLINE SoaQuat GatherQuats(Address address) {
  const FloatTag d;
  HWY_ALIGN float buffer[4 * kBlock];
  for (std::size_t i = 0; i < hn::Lanes(d); ++i) {
    std::memcpy(buffer + 4 * i, address(i), 4 * sizeof(float));
  }
  return LoadQuats(buffer, kBlock);
}
template <typename Address>
HWY_INLINE void ScatterQuats(SoaQuat q, std::size_t lanes, Address address) {
  HWY_ALIGN float buffer[4 * kBlock];
  StoreQuats(q, buffer, kBlock);
  for (std::size_t i = 0; i < lanes; ++i) {
    std::memcpy(address(i), buffer + 4 * i, 4 * sizeof(float));
  }
}
#endif
HWY_INLINE SoaVec3 LoadVectors(const float* at, std::size_t left) {
  const FloatTag d;
  HWY_ALIGN float buffer[3 * kBlock];
  if (left < hn::Lanes(d)) {
    std::memset(buffer + 3 * left, 0, 3 * (hn::Lanes(d) - left) * sizeof(float));
    std::memcpy(buffer, at, left * 3 * sizeof(float));
    at = buffer;
  }
  SoaVec3 v;
  hn::LoadInterleaved3(d, at, v.x.v, v.y.v, v.z.v);
  return v;
}

// LoadLanes and StoreLanes access one float per lane, starting at `at`.
HWY_INLINE Float LoadLanes(const float* at) { return Float(hn::LoadU(FloatTag(), at)); }
HWY_INLINE void StoreLanes(Float value, float* at) { hn::StoreU(value.v, FloatTag(), at); }
HWY_INLINE SoaVec3 LoadVec3(const float* at) {
  return {LoadLanes(at), LoadLanes(at + kBlock), LoadLanes(at + 2 * kBlock)};
}
HWY_INLINE SoaQuat LoadQuat(const float* at) {
  return {LoadLanes(at), LoadLanes(at + kBlock), LoadLanes(at + 2 * kBlock),
          LoadLanes(at + 3 * kBlock)};
}
HWY_INLINE void StoreQuat(SoaQuat q, float* at) {
  StoreLanes(q.x, at);
  StoreLanes(q.y, at + kBlock);
  StoreLanes(q.z, at + 2 * kBlock);
  StoreLanes(q.w, at + 3 * kBlock);
}

HWY_INLINE SoaVec3 XyzOf(SoaQuat q) { return {q.x, q.y, q.z}; }

// Sine and cosine with the same operations as in base/trig.cpp, in the same order.
HWY_INLINE void SinCosOf(DoubleTag d, const double* x, double* sine, double* cosine) {
  const auto number = [d](double value) HWY_ATTR { return hn::Set(d, value); };
  const auto angle = hn::Load(d, x);
  const auto k = hn::Round(hn::Mul(angle, number(2.0 / 3.14159265358979323846)));
  auto r = hn::Sub(angle, hn::Mul(k, number(1.57079632673412561417e+00)));
  r = hn::Sub(r, hn::Mul(k, number(6.07710050630396597660e-11)));
  r = hn::Sub(r, hn::Mul(k, number(2.02226624879595063154e-21)));
  const auto s = hn::Mul(r, r);
  auto p = number(1.0 / 355687428096000.0);
  p = hn::Sub(hn::Mul(p, s), number(1.0 / 1307674368000.0));
  p = hn::Add(hn::Mul(p, s), number(1.0 / 6227020800.0));
  p = hn::Sub(hn::Mul(p, s), number(1.0 / 39916800.0));
  p = hn::Add(hn::Mul(p, s), number(1.0 / 362880.0));
  p = hn::Sub(hn::Mul(p, s), number(1.0 / 5040.0));
  p = hn::Add(hn::Mul(p, s), number(1.0 / 120.0));
  p = hn::Sub(hn::Mul(p, s), number(1.0 / 6.0));
  const auto sin = hn::Add(r, hn::Mul(hn::Mul(r, s), p));
  p = number(1.0 / 20922789888000.0);
  p = hn::Sub(hn::Mul(p, s), number(1.0 / 87178291200.0));
  p = hn::Add(hn::Mul(p, s), number(1.0 / 479001600.0));
  p = hn::Sub(hn::Mul(p, s), number(1.0 / 3628800.0));
  p = hn::Add(hn::Mul(p, s), number(1.0 / 40320.0));
  p = hn::Sub(hn::Mul(p, s), number(1.0 / 720.0));
  p = hn::Add(hn::Mul(p, s), number(1.0 / 24.0));
  const auto cos =
      hn::Add(hn::Sub(number(1.0), hn::Mul(number(0.5), s)), hn::Mul(hn::Mul(s, s), p));
  // The quadrant, k - 4 round(k / 4), is -2, -1, 0, 1 or 2.
  const auto quadrant = hn::Sub(k, hn::Mul(number(4.0), hn::Round(hn::Mul(k, number(0.25)))));
  const auto is_odd = hn::Eq(hn::Abs(quadrant), number(1.0));
  const auto is_far = hn::Eq(hn::Abs(quadrant), number(2.0));
  const auto sin_part = hn::IfThenElse(is_odd, cos, sin);
  const auto cos_part = hn::IfThenElse(is_odd, sin, cos);
  const auto sin_flips = hn::Or(is_far, hn::Eq(quadrant, number(-1.0)));
  const auto cos_flips = hn::Or(is_far, hn::Eq(quadrant, number(1.0)));
  hn::Store(hn::IfThenElse(sin_flips, hn::Neg(sin_part), sin_part), d, sine);
  hn::Store(hn::IfThenElse(cos_flips, hn::Neg(cos_part), cos_part), d, cosine);
}

}  // namespace
}  // namespace stridewire::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // STRIDEWIRE_SIMD_MATH_INL_H
