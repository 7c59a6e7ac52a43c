#include "quantise_kernel.h"

#include <cstdint>
#include <cstring>

#include "stridewire/protocol/pose_codec.h"

#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): Highway requires this name.
#define HWY_TARGET_INCLUDE "quantise_kernel.cpp"
#include "hwy/foreach_target.h"
// Must follow foreach_target.h, which includes this file once per instruction set.
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace stridewire::protocol::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

std::size_t QuantiseRotations(const float* quaternions, std::size_t count, std::byte* out) {
  constexpr std::size_t kMaxLanes = 16;
  constexpr float kSteps = 16383.0f;
  constexpr int kZero = 16384;
  const hn::CappedTag<float, kMaxLanes> d;
  const hn::RebindToSigned<decltype(d)> di;
  const hn::Rebind<std::uint16_t, decltype(d)> dw;
  const std::size_t width = hn::Lanes(d);
  HWY_ALIGN float in[4 * kMaxLanes];
  HWY_ALIGN std::uint16_t words[3 * kMaxLanes];
  for (std::size_t i = 0; i < count; i += width) {
    const std::size_t left = count - i < width ? count - i : width;
    const float* from = quaternions + 4 * i;
    if (left < width) {
      // Fills unused lanes with the unit quaternion (1, 1, 1, 1) / 2, so that they pass the check.
      for (std::size_t k = 4 * left; k < 4 * width; ++k) in[k] = 0.5f;
      std::memcpy(in, from, 4 * left * sizeof(float));
      from = in;
    }
    hn::Vec<decltype(d)> x, y, z, w;
    hn::LoadInterleaved4(d, from, x, y, z, w);
    const auto squared =
        hn::Add(hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z)), hn::Mul(w, w));
    constexpr float kLow = (1.0f - kUnitTolerance) * (1.0f - kUnitTolerance);
    constexpr float kHigh = (1.0f + kUnitTolerance) * (1.0f + kUnitTolerance);
    // Written this way so that NaN is rejected.
    const auto is_unit =
        hn::And(hn::Ge(squared, hn::Set(d, kLow)), hn::Le(squared, hn::Set(d, kHigh)));
    if (!hn::AllTrue(d, is_unit)) {
      return i + static_cast<std::size_t>(hn::FindFirstTrue(d, hn::Not(is_unit)));
    }

    auto largest = x;
    auto index = hn::Zero(di);
    const auto take = [&](hn::Vec<decltype(d)> component, int number) HWY_ATTR {
      const auto is_larger = hn::Gt(hn::Abs(component), hn::Abs(largest));
      largest = hn::IfThenElse(is_larger, component, largest);
      index = hn::IfThenElse(hn::RebindMask(di, is_larger), hn::Set(di, number), index);
    };
    take(y, 1);
    take(z, 2);
    take(w, 3);
    const auto scale = hn::CopySign(
        hn::Div(hn::Set(d, 1.41421356237309505f * kSteps), hn::Sqrt(squared)), largest);
    const auto is_0 = hn::RebindMask(d, hn::Eq(index, hn::Zero(di)));
    const auto is_3 = hn::RebindMask(d, hn::Eq(index, hn::Set(di, 3)));
    const auto is_0_or_1 = hn::RebindMask(d, hn::Lt(index, hn::Set(di, 2)));
    const auto steps = [&](hn::Vec<decltype(d)> component) HWY_ATTR {
      // The value is not negative, so truncation rounds down.
      const auto value = hn::ConvertTo(
          di, hn::Add(hn::Mul(component, scale), hn::Set(d, static_cast<float>(kZero) + 0.5f)));
      return hn::Min(hn::Max(value, hn::Set(di, 1)), hn::Set(di, 2 * kZero - 1));
    };
    auto first = steps(hn::IfThenElse(is_0, y, x));
    auto second = steps(hn::IfThenElse(is_0_or_1, z, y));
    const auto third = steps(hn::IfThenElse(is_3, z, w));
    first = hn::Or(first, hn::ShiftLeft<15>(hn::And(index, hn::Set(di, 1))));
    second = hn::Or(second, hn::ShiftLeft<15>(hn::ShiftRight<1>(index)));
    hn::StoreInterleaved3(hn::DemoteTo(dw, first), hn::DemoteTo(dw, second),
                          hn::DemoteTo(dw, third), dw, words);
    std::memcpy(out + 6 * i, words, 6 * left);
  }
  return count;
}

}  // namespace
}  // namespace stridewire::protocol::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stridewire::protocol {

HWY_EXPORT(QuantiseRotations);

std::size_t QuantiseRotations(const float* quaternions, std::size_t count, std::byte* out) {
  return HWY_DYNAMIC_DISPATCH(QuantiseRotations)(quaternions, count, out);
}

}  // namespace stridewire::protocol

#endif  // HWY_ONCE
