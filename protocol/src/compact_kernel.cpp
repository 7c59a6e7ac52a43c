#include "compact_kernel.h"

#include "stridewire/base/rotation_quantization.h"
#include "stridewire/protocol/compact_codec.h"
#include "stridewire/protocol/pose_codec.h"

#undef HWY_TARGET_INCLUDE
// NOLINTNEXTLINE(readability-identifier-naming): Highway requires this name.
#define HWY_TARGET_INCLUDE "compact_kernel.cpp"
#include "hwy/foreach_target.h"
// Must follow foreach_target.h, which includes this file once per instruction set.
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace stridewire::protocol::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kBlock = CompactCodec::kBlock;
using D = hn::CappedTag<float, kBlock>;
using DI = hn::RebindToSigned<D>;
using DU = hn::RebindToUnsigned<D>;
using V = hn::Vec<D>;
using VI = hn::Vec<DI>;
using VU = hn::Vec<DU>;

// Adding this constant rounds a float to the nearest integer, ties to even, on every machine. The
// low bits of the sum then contain the integer.
constexpr float kRounder = 12582912.0f;  // 1.5 2^23
constexpr std::int32_t kRounderBits = 0x4b400000;

// Largest deviation from 1 of the squared length of a quaternion that is accepted as unit.
constexpr float kUnitSquared = 2e-5f;

struct Rotation {
  V x, y, z, w;
};

struct Vector {
  V x, y, z;
};

HWY_INLINE V Sum3(V a, V b, V c) { return hn::Add(hn::Add(a, b), c); }

// The vector part of conj(a) b.
HWY_INLINE Vector ConjugateTimes(const Rotation& a, const Rotation& b) {
  const auto along = [&](V au, V av, V aw, V bu, V bv, V bw) HWY_ATTR {
    return hn::Sub(hn::Sub(hn::Mul(a.w, bu), hn::Mul(au, b.w)),
                   hn::Sub(hn::Mul(av, bw), hn::Mul(aw, bv)));
  };
  return {along(a.x, a.y, a.z, b.x, b.y, b.z), along(a.y, a.z, a.x, b.y, b.z, b.x),
          along(a.z, a.x, a.y, b.z, b.x, b.y)};
}

// Concatenates the bits of all numbers of a pose. Each lane holds one pose.
HWY_INLINE void WriteWords(std::span<const CompactPart> parts, const std::uint32_t* numbers,
                           std::uint32_t* words) {
  const DU du;
  for (std::size_t i = 0; i < parts.size(); words += 4 * kBlock) {
    const auto next = [&]() HWY_ATTR {
      VU word = hn::Zero(du);
      for (bool is_more = true; is_more; ++i) {
        const VU number = hn::LoadU(du, numbers + std::size_t{parts[i].row} * kBlock);
        word = hn::Or(word, parts[i].left < 0 ? hn::ShiftRightSame(number, -parts[i].left)
                                              : hn::ShiftLeftSame(number, parts[i].left));
        is_more = !parts[i].ends_word;
      }
      return word;
    };
    const VU first = next();
    const VU second = next();
    const VU third = next();
    const VU fourth = next();
    hn::StoreInterleaved4(first, second, third, fourth, du, words);
  }
}

// A component in steps, as float and as integer. |value| is below 2^22.
struct Steps {
  V number;
  VI integer;
};
HWY_INLINE Steps RoundToSteps(V value) {
  const D d;
  const DI di;
  const V rounded = hn::Add(value, hn::Set(d, kRounder));
  return {hn::Sub(rounded, hn::Set(d, kRounder)),
          hn::Sub(hn::BitCast(di, rounded), hn::Set(di, kRounderBits))};
}

// Rounds half away from zero, like std::round. The product is exact because the factor is a power
// of two.
HWY_INLINE VI RootSteps(V metres) {
  const D d;
  const V scaled = hn::Mul(metres, hn::Set(d, kRootStepsPerM));
  const V size = hn::Abs(scaled);
  const V whole = hn::Trunc(size);
  const V up = hn::IfThenElseZero(hn::Ge(hn::Sub(size, whole), hn::Set(d, 0.5f)), hn::Set(d, 1.0f));
  return hn::ConvertTo(DI(), hn::CopySign(hn::Add(whole, up), scaled));
}

// Computes the numbers of all joints first and concatenates their bits afterwards. A joint needs
// the error of its parent, whose computation has a long latency. `plan.order` therefore puts joints
// of equal depth next to each other, so that the processor overlaps their computation.
void EncodeCompact(const CompactPlan& plan, const CompactWork& work) {
  const D d;
  const DI di;
  const std::size_t width = hn::Lanes(d);
  const V one = hn::Set(d, 1.0f);
  for (std::size_t lane = 0; lane < work.count; lane += width) {
    auto fits = hn::Eq(one, one);
    for (std::size_t c = 0; c < 3; ++c) {
      const V metres = hn::LoadU(d, work.roots_m + c * kBlock + lane);
      // Written this way so that NaN does not fit.
      fits = hn::And(fits, hn::Le(hn::Abs(metres), hn::Set(d, kMaxRootM)));
      hn::StoreU(hn::BitCast(DU(), RootSteps(hn::IfThenElseZero(fits, metres))), DU(),
                 work.numbers + c * kBlock + lane);
    }
    // Becomes nonzero in lanes where a number needs more bits than its quantization has.
    VI excess = hn::Zero(di);
    for (const std::size_t j : plan.order) {
      const CompactJoint& joint = plan.joints[j];
      std::uint32_t* numbers = work.numbers + (kJointRows + 4 * j) * kBlock + lane;
      const auto keep = [&](std::size_t c, VI value) HWY_ATTR {
        hn::StoreU(hn::BitCast(DU(), value), DU(), numbers + c * kBlock);
      };
      const float* rotation = work.rotations + 4 * j * kBlock + lane;
      Rotation q = {hn::LoadU(d, rotation), hn::LoadU(d, rotation + kBlock),
                    hn::LoadU(d, rotation + 2 * kBlock), hn::LoadU(d, rotation + 3 * kBlock)};
      // Poses with are_unit may contain NaN. Without "smallest three", the comparison of w with
      // least_w below rejects it, so this check is not needed.
      if (!work.are_unit || joint.smallest_three_bits > 0) {
        const V squared = hn::Add(Sum3(hn::Mul(q.x, q.x), hn::Mul(q.y, q.y), hn::Mul(q.z, q.z)),
                                  hn::Mul(q.w, q.w));
        fits = hn::And(fits, hn::Le(hn::Abs(hn::Sub(squared, one)), hn::Set(d, kUnitSquared)));
      }
      if (joint.is_omitted) continue;
      if (joint.parent >= 0) {
        // Computes q = e q, where e = (ex, ey, ez, 1) is the error of the parent, a rotation by a
        // small angle.
        const float* error =
            work.errors + static_cast<std::size_t>(joint.parent) * 3 * kBlock + lane;
        const V ex = hn::LoadU(d, error);
        const V ey = hn::LoadU(d, error + kBlock);
        const V ez = hn::LoadU(d, error + 2 * kBlock);
        const Rotation p = q;
        q.x = hn::Add(p.x, hn::Sub(hn::Add(hn::Mul(ex, p.w), hn::Mul(ey, p.z)), hn::Mul(ez, p.y)));
        q.y = hn::Add(p.y, hn::Sub(hn::Add(hn::Mul(ey, p.w), hn::Mul(ez, p.x)), hn::Mul(ex, p.z)));
        q.z = hn::Add(p.z, hn::Sub(hn::Add(hn::Mul(ez, p.w), hn::Mul(ex, p.y)), hn::Mul(ey, p.x)));
        // Without "smallest three", w is not encoded. Without a reference as well, the approximate
        // w of `p` suffices.
        if (joint.smallest_three_bits > 0 || joint.has_reference) {
          q.w = hn::Sub(p.w, Sum3(hn::Mul(ex, p.x), hn::Mul(ey, p.y), hn::Mul(ez, p.z)));
        }
      }
      float* error = work.errors + j * 3 * kBlock + lane;
      // The error is the vector part of conj(decoded) q.
      const auto keep_error = [&](Vector e) HWY_ATTR {
        hn::StoreU(e.x, d, error);
        hn::StoreU(e.y, d, error + kBlock);
        hn::StoreU(e.z, d, error + 2 * kBlock);
      };
      if (joint.smallest_three_bits > 0) {
        // Encodes with "smallest three" as quantise_kernel.cpp does, but the number of bits per
        // component depends on the joint.
        V largest = q.x;
        VI index = hn::Zero(di);
        const auto take = [&](V component, int number) HWY_ATTR {
          const auto is_larger = hn::Gt(hn::Abs(component), hn::Abs(largest));
          largest = hn::IfThenElse(is_larger, component, largest);
          index = hn::IfThenElse(hn::RebindMask(di, is_larger), hn::Set(di, number), index);
        };
        take(q.y, 1);
        take(q.z, 2);
        take(q.w, 3);
        const V sign = hn::And(largest, hn::SignBit(d));
        q.x = hn::Xor(q.x, sign);
        q.y = hn::Xor(q.y, sign);
        q.z = hn::Xor(q.z, sign);
        q.w = hn::Xor(q.w, sign);
        const auto is_0 = hn::RebindMask(d, hn::Eq(index, hn::Zero(di)));
        const auto is_1 = hn::RebindMask(d, hn::Eq(index, hn::Set(di, 1)));
        const auto is_2 = hn::RebindMask(d, hn::Eq(index, hn::Set(di, 2)));
        const auto is_3 = hn::RebindMask(d, hn::Eq(index, hn::Set(di, 3)));
        const auto is_0_or_1 = hn::RebindMask(d, hn::Lt(index, hn::Set(di, 2)));
        const int most = (1 << (joint.smallest_three_bits - 1)) - 1;
        const V to_steps = hn::Set(d, joint.inverse_step[0]);
        const V to_number = hn::Set(d, joint.step[0]);
        keep(3, index);
        const auto encode = [&](V component, std::size_t c) HWY_ATTR {
          Steps steps = RoundToSteps(hn::Mul(component, to_steps));
          const V limit = hn::Set(d, static_cast<float>(most));
          steps.number = hn::Max(hn::Min(steps.number, limit), hn::Neg(limit));
          steps.integer = hn::Max(hn::Min(steps.integer, hn::Set(di, most)), hn::Set(di, -most));
          keep(c, hn::Add(steps.integer, hn::Set(di, most + 1)));
          return hn::Mul(steps.number, to_number);
        };
        const V a = encode(hn::IfThenElse(is_0, q.y, q.x), 0);
        const V b = encode(hn::IfThenElse(is_0_or_1, q.z, q.y), 1);
        const V c = encode(hn::IfThenElse(is_3, q.z, q.w), 2);
        const V left = hn::Sqrt(
            hn::Max(hn::Zero(d), hn::Sub(one, Sum3(hn::Mul(a, a), hn::Mul(b, b), hn::Mul(c, c)))));
        if (!joint.has_children) continue;
        const Rotation decoded = {
            hn::IfThenElse(is_0, left, a), hn::IfThenElse(is_1, left, hn::IfThenElse(is_0, a, b)),
            hn::IfThenElse(is_2, left, hn::IfThenElse(is_3, c, b)), hn::IfThenElse(is_3, left, c)};
        keep_error(ConjugateTimes(decoded, q));
      } else {
        if (joint.has_reference) {
          const Rotation r = {hn::Set(d, joint.reference[0]), hn::Set(d, joint.reference[1]),
                              hn::Set(d, joint.reference[2]), hn::Set(d, joint.reference[3])};
          const Vector v = ConjugateTimes(r, q);
          const V w = hn::Add(hn::Mul(r.w, q.w),
                              Sum3(hn::Mul(r.x, q.x), hn::Mul(r.y, q.y), hn::Mul(r.z, q.z)));
          q = {v.x, v.y, v.z, w};
        }
        const V sign = hn::And(q.w, hn::SignBit(d));
        q.x = hn::Xor(sign, q.x);
        q.y = hn::Xor(sign, q.y);
        q.z = hn::Xor(sign, q.z);
        q.w = hn::Abs(q.w);
        fits = hn::And(fits, hn::Ge(q.w, hn::Set(d, joint.least_w)));
        // Stores the encoded component and returns its error.
        const auto encode = [&](V value, std::size_t c) HWY_ATTR {
          const V steps =
              hn::Mul(hn::Sub(value, hn::Set(d, joint.low[c])), hn::Set(d, joint.inverse_step[c]));
          const Steps rounded = RoundToSteps(steps);
          excess = hn::Or(excess, hn::ShiftRightSame(rounded.integer, joint.bits[c]));
          keep(c, rounded.integer);
          return hn::Mul(hn::Sub(steps, rounded.number), hn::Set(d, joint.step[c]));
        };
        const V dx = encode(q.x, 0);
        const V dy = encode(q.y, 1);
        const V dz = encode(q.z, 2);
        if (!joint.has_children) continue;
        // The decoded vector part is v - d, with v = (x, y, z), so the decoded w is w + v.d / w. Up
        // to terms of second order in d, the error is w d + v (v.d) / w - v x d.
        const V per_w = hn::Div(one, q.w);
        const V along = Sum3(hn::Mul(q.x, dx), hn::Mul(q.y, dy), hn::Mul(q.z, dz));
        const auto component = [&](V u, V v, V w, V du, V dv, V dw) HWY_ATTR {
          return hn::Add(hn::Sub(hn::Add(hn::Mul(q.w, du), hn::Mul(w, dv)), hn::Mul(v, dw)),
                         hn::Mul(hn::Mul(u, per_w), along));
        };
        keep_error({component(q.x, q.y, q.z, dx, dy, dz), component(q.y, q.z, q.x, dy, dz, dx),
                    component(q.z, q.x, q.y, dz, dx, dy)});
      }
    }
    WriteWords(plan.parts, work.numbers + lane, work.words + 4 * lane);
    const auto is_exact = hn::RebindMask(d, hn::Eq(excess, hn::Zero(di)));
    const VI fit = hn::IfThenElseZero(hn::RebindMask(di, hn::And(fits, is_exact)), hn::Set(di, 1));
    hn::StoreU(hn::BitCast(DU(), fit), DU(), work.fits + lane);
  }
}

void StreamWords(const std::uint32_t* words, std::size_t fours, std::byte* to) {
  const hn::CappedTag<std::uint32_t, 4> d;
  auto* out = reinterpret_cast<std::uint32_t*>(to);
  for (std::size_t i = 0; i < fours; ++i, words += 4 * kBlock, out += 4) {
    for (std::size_t k = 0; k < 4; k += hn::Lanes(d)) {
      hn::Stream(hn::LoadU(d, words + k), d, out + k);
    }
  }
}

}  // namespace
}  // namespace stridewire::protocol::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace stridewire::protocol {

HWY_EXPORT(EncodeCompact);
HWY_EXPORT(StreamWords);

void EncodeCompact(const CompactPlan& plan, const CompactWork& work) {
  HWY_DYNAMIC_DISPATCH(EncodeCompact)(plan, work);
}

void StreamWords(const std::uint32_t* words, std::size_t fours, std::byte* to) {
  HWY_DYNAMIC_DISPATCH(StreamWords)(words, fours, to);
}

}  // namespace stridewire::protocol

#endif  // HWY_ONCE
