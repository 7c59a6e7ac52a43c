#include "interpolate_kernel.h"

#include <cstring>

#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): Highway's
#define HWY_TARGET_INCLUDE "interpolate_kernel.cpp"
#include "hwy/foreach_target.h"
// Must follow foreach_target.h, which includes this file once per instruction set.
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace stridewire::client::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kMaxLanes = 8;
using Tag = hn::CappedTag<float, kMaxLanes>;
using Vec = hn::Vec<Tag>;

struct Rotations {
  Vec x, y, z, w;
};

HWY_INLINE Rotations Load(Tag d, const float* from, std::size_t count) {
  Rotations q;
  HWY_ALIGN float padded[4 * kMaxLanes];
  if (count < hn::Lanes(d)) {
    for (std::size_t i = 4 * count; i < 4 * hn::Lanes(d); ++i) padded[i] = 0.5f;
    std::memcpy(padded, from, 4 * count * sizeof(float));
    from = padded;
  }
  hn::LoadInterleaved4(d, from, q.x, q.y, q.z, q.w);
  return q;
}

// Adds in the same order as Dot in base/math.h, so that both round in the same way.
HWY_INLINE Vec Dot(const Rotations& a, const Rotations& b) {
  return hn::Add(hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z)),
                 hn::Mul(a.w, b.w));
}

// Returns q or -q, whichever is in the hemisphere of `reference`.
HWY_INLINE Rotations Near(Tag d, const Rotations& q, const Rotations& reference) {
  const auto is_far = hn::Lt(Dot(q, reference), hn::Zero(d));
  const auto near = [&](Vec v) HWY_ATTR { return hn::IfThenElse(is_far, hn::Neg(v), v); };
  return {near(q.x), near(q.y), near(q.z), near(q.w)};
}

void InterpolateRotations(const RotationKeys& keys, std::size_t count, float* out) {
  const Tag d;
  const std::size_t width = hn::Lanes(d);
  const auto value = hn::Set(d, keys.value);
  const auto start_slope = hn::Set(d, keys.start_slope);
  const auto end_slope = hn::Set(d, keys.end_slope);
  HWY_ALIGN float last[4 * kMaxLanes];
  for (std::size_t i = 0; i < count; i += width) {
    const std::size_t left = count - i < width ? count - i : width;
    const Rotations start = Load(d, keys.start + 4 * i, left);
    const Rotations before = Near(d, Load(d, keys.before + 4 * i, left), start);
    const Rotations end = Near(d, Load(d, keys.end + 4 * i, left), start);
    const Rotations beyond = Near(d, Load(d, keys.beyond + 4 * i, left), end);
    const auto blend = [&](Vec of_before, Vec of_start, Vec of_end, Vec of_beyond) HWY_ATTR {
      const auto at_end = hn::Add(of_start, hn::Mul(hn::Sub(of_end, of_start), value));
      const Vec slope_end = keys.start_slope_is_before ? of_start : of_end;
      const auto sloped = hn::Add(at_end, hn::Mul(hn::Sub(slope_end, of_before), start_slope));
      return hn::Add(sloped, hn::Mul(hn::Sub(of_beyond, of_start), end_slope));
    };
    Rotations q = {
        blend(before.x, start.x, end.x, beyond.x), blend(before.y, start.y, end.y, beyond.y),
        blend(before.z, start.z, end.z, beyond.z), blend(before.w, start.w, end.w, beyond.w)};
    // As in Normalise in base/math.h, the result is the identity if the sum has no direction.
    const auto norm = hn::Sqrt(Dot(q, q));
    const auto is_usable = hn::Gt(norm, hn::Set(d, 1e-12f));
    q.x = hn::IfThenElseZero(is_usable, hn::Div(q.x, norm));
    q.y = hn::IfThenElseZero(is_usable, hn::Div(q.y, norm));
    q.z = hn::IfThenElseZero(is_usable, hn::Div(q.z, norm));
    q.w = hn::IfThenElse(is_usable, hn::Div(q.w, norm), hn::Set(d, 1.0f));
    float* to = left < width ? last : out + 4 * i;
    hn::StoreInterleaved4(q.x, q.y, q.z, q.w, d, to);
    if (left < width) std::memcpy(out + 4 * i, last, 4 * left * sizeof(float));
  }
}

}  // namespace
}  // namespace stridewire::client::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stridewire::client {

HWY_EXPORT(InterpolateRotations);

void InterpolateRotations(const RotationKeys& keys, std::size_t count, float* out) {
  HWY_DYNAMIC_DISPATCH(InterpolateRotations)(keys, count, out);
}

}  // namespace stridewire::client

#endif  // HWY_ONCE
