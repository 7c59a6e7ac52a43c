// Arithmetic with vectors of doubles for WebAssembly. Highway 1.0.3 does not provide it. Like
// simd_math-inl.h, which includes it, this file is compiled once per instruction set.
#if defined(STRIDEWIRE_WASM_DOUBLES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef STRIDEWIRE_WASM_DOUBLES_INL_H
#undef STRIDEWIRE_WASM_DOUBLES_INL_H
#else
#define STRIDEWIRE_WASM_DOUBLES_INL_H
#endif

#include "hwy/highway.h"

#if HWY_TARGET == HWY_WASM
HWY_BEFORE_NAMESPACE();
namespace hwy::HWY_NAMESPACE {

template <std::size_t N>
using DoubleVec = Vec128<double, N>;

template <std::size_t N, HWY_IF_LE128(double, N)>
HWY_API DoubleVec<N> Set(Simd<double, N, 0>, const double value) {
  return DoubleVec<N>{wasm_f64x2_splat(value)};
}
template <std::size_t N>
HWY_API DoubleVec<N> operator+(DoubleVec<N> a, DoubleVec<N> b) {
  return DoubleVec<N>{wasm_f64x2_add(a.raw, b.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> operator-(DoubleVec<N> a, DoubleVec<N> b) {
  return DoubleVec<N>{wasm_f64x2_sub(a.raw, b.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> operator*(DoubleVec<N> a, DoubleVec<N> b) {
  return DoubleVec<N>{wasm_f64x2_mul(a.raw, b.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> operator/(DoubleVec<N> a, DoubleVec<N> b) {
  return DoubleVec<N>{wasm_f64x2_div(a.raw, b.raw)};
}
// Min and Max return `b` if both are equal, as on x86.
template <std::size_t N>
HWY_API DoubleVec<N> Min(DoubleVec<N> a, DoubleVec<N> b) {
  return DoubleVec<N>{wasm_f64x2_pmin(b.raw, a.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> Max(DoubleVec<N> a, DoubleVec<N> b) {
  return DoubleVec<N>{wasm_f64x2_pmax(b.raw, a.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> Round(DoubleVec<N> v) {
  return DoubleVec<N>{wasm_f64x2_nearest(v.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> Trunc(DoubleVec<N> v) {
  return DoubleVec<N>{wasm_f64x2_trunc(v.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> Abs(DoubleVec<N> v) {
  return DoubleVec<N>{wasm_f64x2_abs(v.raw)};
}
template <std::size_t N>
HWY_API Mask128<double, N> operator==(DoubleVec<N> a, DoubleVec<N> b) {
  return Mask128<double, N>{wasm_f64x2_eq(a.raw, b.raw)};
}
template <std::size_t N>
HWY_API Mask128<double, N> operator<(DoubleVec<N> a, DoubleVec<N> b) {
  return Mask128<double, N>{wasm_f64x2_lt(a.raw, b.raw)};
}
template <std::size_t N>
HWY_API Mask128<double, N> operator>(DoubleVec<N> a, DoubleVec<N> b) {
  return Mask128<double, N>{wasm_f64x2_gt(a.raw, b.raw)};
}
template <std::size_t N>
HWY_API Mask128<double, N> operator>=(DoubleVec<N> a, DoubleVec<N> b) {
  return Mask128<double, N>{wasm_f64x2_ge(a.raw, b.raw)};
}
template <std::size_t N>
HWY_API DoubleVec<N> PromoteTo(Simd<double, N, 0>, Vec128<float, N> v) {
  return DoubleVec<N>{wasm_f64x2_promote_low_f32x4(v.raw)};
}
template <std::size_t N>
HWY_API Vec128<float, N> DemoteTo(Simd<float, N, 0>, DoubleVec<N> v) {
  return Vec128<float, N>{wasm_f32x4_demote_f64x2_zero(v.raw)};
}

}  // namespace hwy::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // HWY_TARGET == HWY_WASM

#endif  // STRIDEWIRE_WASM_DOUBLES_INL_H
