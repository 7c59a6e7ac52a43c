#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"

namespace stridewire::protocol {

/// How poses travel.
enum class PoseMode : std::uint8_t {
  kFull = 0,       ///< float32 root position (x, y, z) and float32 quaternions (x, y, z, w).
  kQuantised = 1,  ///< Root in fixed point, 3 x int32; 48 bits a joint ("smallest three").
  kMovement = 2,   ///< What a movement was decided to be, once a step (Movements). No pose is sent.
  /// What who agreed on kFeatureCompact gets in place of kQuantised (compact_codec.h); nobody asks for it.
  kCompact = 3,
  /// What who asked for PoseDetail::kFewer or kRoot gets: compact poses that tell some of the joints.
  kCompactFewer = 4,
  kCompactRoot = 5,
};

/// How much of a pose is told. The joints that are not are decoded to the references of the world's codes.
enum class PoseDetail : std::uint8_t {
  kAll = 0,
  kFewer = 1,  ///< WorldInfo::fewer_joints: what is left out moves little.
  kRoot = 2,   ///< Where the figure is and how it is turned.
};

/// Whether poses are told by a CompactCodec.
[[nodiscard]] constexpr bool IsCompact(PoseMode mode) {
  return mode == PoseMode::kCompact || mode == PoseMode::kCompactFewer ||
         mode == PoseMode::kCompactRoot;
}
[[nodiscard]] constexpr PoseMode CompactMode(PoseDetail detail) {
  return detail == PoseDetail::kAll     ? PoseMode::kCompact
         : detail == PoseDetail::kFewer ? PoseMode::kCompactFewer
                                        : PoseMode::kCompactRoot;
}
[[nodiscard]] constexpr PoseDetail DetailOf(PoseMode mode) {
  return mode == PoseMode::kCompactFewer  ? PoseDetail::kFewer
         : mode == PoseMode::kCompactRoot ? PoseDetail::kRoot
                                          : PoseDetail::kAll;
}

/// Quantised root: multiples of 2^-14 m (0.061 mm), so the error is at most 2^-15 m = 0.031 mm as
/// long as float32 itself is that fine (|x| < 256 m), over +-131,071 m from the world's origin.
inline constexpr float kRootStepsPerM = 16384.0f;
inline constexpr float kMaxRootM = 131'071.0f;

/// Quantised joint: the largest component is left out (the lowest index of equals), the quaternion
/// negated first if that component is negative; the others, in order, are floor(c sqrt(2) 16383 +
/// 16384.5) in 15 bits, so that 0 is exact. Three little-endian u16: component in bits 0-14; bit 15 of
/// the first and second is bit 0 and 1 of the index left out, bit 15 of the third is zero.
/// The rotation is off by at most this angle (a component by 2.2e-5; worst where all are 0.5).
inline constexpr double kMaxQuantisedAngleRad = 1.6e-4;

/// How far a quaternion's length may be from 1.
inline constexpr float kUnitTolerance = 1e-3f;

/// Bytes of one pose: full 12 + 16 n, quantised 12 + 6 n; 0 for kMovement and compact modes, whose poses differ by world.
[[nodiscard]] constexpr std::size_t PoseBytes(PoseMode mode, std::size_t joint_count) {
  switch (mode) {
    case PoseMode::kFull: return 12 + 16 * joint_count;
    case PoseMode::kQuantised: return 12 + 6 * joint_count;
    case PoseMode::kMovement:
    case PoseMode::kCompact:
    case PoseMode::kCompactFewer:
    case PoseMode::kCompactRoot: return 0;
  }
  return 0;
}

/// Writes one pose. `out` is PoseBytes(mode, rotations.size()) long, of any alignment.
/// kShapeMismatch: `out` has another size; kOutOfRange: a number is not finite, a quaternion not
/// unit within kUnitTolerance, or the root beyond kMaxRootM (quantised); `index` is the joint;
/// kUnsupported: another mode. On error the content of `out` is unspecified. Never allocates.
[[nodiscard]] Status EncodePose(PoseMode mode, const Vec3& root_position_m,
                                std::span<const Quat> rotations, std::span<std::byte> out);

/// Reads one pose; `in` is PoseBytes(mode, rotations.size()) long, of any alignment. Errors as
/// above, and kMalformed for quantised bits that no encoder writes. Quantised quaternions come back
/// unit to float32; full ones exactly as they were sent. Never allocates.
[[nodiscard]] Status DecodePose(PoseMode mode, std::span<const std::byte> in, Vec3& root_position_m,
                                std::span<Quat> rotations);

/// The root of a quantised or compact pose, the first 12 bytes of it. kOutOfRange: beyond kMaxRootM.
[[nodiscard]] Status DecodeRoot(std::span<const std::byte, 12> in, Vec3& root_position_m);

}  // namespace stridewire::protocol
