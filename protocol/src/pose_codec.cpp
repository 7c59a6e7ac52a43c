#include "stridewire/protocol/pose_codec.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "quantise_kernel.h"
#include "smallest_three.h"

namespace stridewire::protocol {
namespace {

static_assert(std::endian::native == std::endian::little);
static_assert(offsetof(Quat, x) == 0 && offsetof(Quat, w) == 12, "x, y, z, w in memory");

constexpr float kComponentSteps = 16383.0f;
constexpr int kZero = 16384;
constexpr std::uint16_t kComponentMask = 0x7fff;
constexpr std::uint16_t kHighBit = 0x8000;

// The squares of the three smaller components sum to at most 3/4, plus a margin for rounding.
constexpr float kMaxThreeSquared = 0.7502f;

bool IsFinite(const Vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// Checks that |q|^2 is within (1 - t)^2 to (1 + t)^2. Rejects NaN.
bool IsUnit(const Quat& q) {
  const float squared = Dot(q, q);
  return squared >= (1.0f - kUnitTolerance) * (1.0f - kUnitTolerance) &&
         squared <= (1.0f + kUnitTolerance) * (1.0f + kUnitTolerance);
}

// Returns false for bits that no encoder writes.
bool DecodeSmallestThree(const std::byte* in, Quat& q) {
  std::array<std::uint16_t, 3> words;
  std::memcpy(words.data(), in, 6);
  if (words[2] & kHighBit) return false;
  const auto largest = static_cast<std::size_t>((words[0] >> 15) | ((words[1] >> 15) << 1));
  std::array<float, 4> c{};
  float squared = 0.0f;
  bool zero = false;
  for (std::size_t k = 0; k < 3; ++k) {
    const int bits = words[k] & kComponentMask;
    zero |= bits == 0;
    const float value = static_cast<float>(bits - kZero) / (kSqrt2 * kComponentSteps);
    c[kKept[largest][k]] = value;
    squared += value * value;
  }
  if (zero || squared > kMaxThreeSquared) return false;
  c[largest] = std::sqrt(1.0f - squared);
  q = Quat(c[3], c[0], c[1], c[2]);
  return true;
}

}  // namespace

Status EncodePose(PoseMode mode, const Vec3& root_position_m, std::span<const Quat> rotations,
                  std::span<std::byte> out) {
  if (mode != PoseMode::kFull && mode != PoseMode::kQuantised) {
    return Fail(ErrorCode::kUnsupported, "poses of this mode have no fixed layout");
  }
  if (out.size() != PoseBytes(mode, rotations.size())) {
    return Fail(ErrorCode::kShapeMismatch, "the output has the wrong size for a pose",
                static_cast<std::int64_t>(out.size()));
  }
  if (!IsFinite(root_position_m)) {
    return Fail(ErrorCode::kOutOfRange, "root position is not finite");
  }
  const auto not_unit = [](std::size_t joint) {
    return Fail(ErrorCode::kOutOfRange, "rotation is not a unit quaternion",
                static_cast<std::int64_t>(joint));
  };
  if (mode == PoseMode::kFull) {
    for (std::size_t j = 0; j < rotations.size(); ++j) {
      if (!IsUnit(rotations[j])) return not_unit(j);
    }
    std::memcpy(out.data(), &root_position_m, 12);
    if (!rotations.empty()) {
      std::memcpy(out.data() + 12, rotations.data(), rotations.size_bytes());
    }
    return {};
  }
  std::array<std::int32_t, 3> root;
  for (int i = 0; i < 3; ++i) {
    if (std::abs(root_position_m[i]) > kMaxRootM) {
      return Fail(ErrorCode::kOutOfRange, "root is too far from the world's origin", i);
    }
    // The product is exact in double because the factor is a power of two.
    root[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(
        std::round(static_cast<double>(root_position_m[i]) * kRootStepsPerM));
  }
  std::memcpy(out.data(), root.data(), 12);
  if (rotations.empty()) return {};
  const std::size_t valid = QuantiseRotations(&rotations[0].x, rotations.size(), out.data() + 12);
  if (valid < rotations.size()) return not_unit(valid);
  return {};
}

Status DecodeRoot(std::span<const std::byte, 12> in, Vec3& root_position_m) {
  std::array<std::int32_t, 3> root;
  std::memcpy(root.data(), in.data(), 12);
  for (int i = 0; i < 3; ++i) {
    const double metres = static_cast<double>(root[static_cast<std::size_t>(i)]) /
                          static_cast<double>(kRootStepsPerM);
    if (std::abs(metres) > static_cast<double>(kMaxRootM)) {
      return Fail(ErrorCode::kOutOfRange, "root is too far from the world's origin", i);
    }
    root_position_m[i] = static_cast<float>(metres);
  }
  return {};
}

Status DecodePose(PoseMode mode, std::span<const std::byte> in, Vec3& root_position_m,
                  std::span<Quat> rotations) {
  if (mode != PoseMode::kFull && mode != PoseMode::kQuantised) {
    return Fail(ErrorCode::kUnsupported, "poses of this mode have no fixed layout");
  }
  if (in.size() != PoseBytes(mode, rotations.size())) {
    return Fail(ErrorCode::kShapeMismatch, "the input has the wrong size for a pose",
                static_cast<std::int64_t>(in.size()));
  }
  if (mode == PoseMode::kFull) {
    std::memcpy(&root_position_m, in.data(), 12);
    if (!IsFinite(root_position_m)) {
      return Fail(ErrorCode::kOutOfRange, "root position is not finite");
    }
    if (!rotations.empty()) {
      std::memcpy(rotations.data(), in.data() + 12, rotations.size_bytes());
    }
    for (std::size_t j = 0; j < rotations.size(); ++j) {
      if (!IsUnit(rotations[j])) {
        return Fail(ErrorCode::kOutOfRange, "rotation is not a unit quaternion",
                    static_cast<std::int64_t>(j));
      }
    }
    return {};
  }
  if (const Status status = DecodeRoot(in.first<12>(), root_position_m); !status) return status;
  for (std::size_t j = 0; j < rotations.size(); ++j) {
    if (!DecodeSmallestThree(in.data() + 12 + 6 * j, rotations[j])) {
      return Fail(ErrorCode::kMalformed, "rotation has bits that no encoder writes",
                  static_cast<std::int64_t>(j));
    }
  }
  return {};
}

}  // namespace stridewire::protocol
