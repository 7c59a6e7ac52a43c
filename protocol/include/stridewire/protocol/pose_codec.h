#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "stridewire/base/error.h"
#include "stridewire/base/math.h"

namespace stridewire::protocol {

/// Layouts of poses on the wire.
enum class PoseMode : std::uint8_t {
  kFull = 0,  ///< Root position (x, y, z) and quaternions (x, y, z, w) as float32.
  /// Root position as 3 x int32 in fixed point; 48 bits per rotation ("smallest three").
  kQuantised = 1,
  kMovement = 2,  ///< Movement records instead of poses (Movements).
  /// The number of bits per joint depends on the library (compact_codec.h). The server sends this
  /// mode, kCompactReduced and kCompactRoot to subscriptions of kQuantised. A client cannot request
  /// these three modes.
  kCompact = 3,
  kCompactReduced = 4,  ///< Compact poses of PoseDetail::kReduced.
  kCompactRoot = 5,     ///< Compact poses of PoseDetail::kRoot.
};

/// Selects the joints that a compact pose contains. Omitted joints are decoded to their reference
/// rotations.
enum class PoseDetail : std::uint8_t {
  kAll = 0,
  kReduced = 1,  ///< The joints that WorldInfo::reduced_joints lists.
  kRoot = 2,     ///< The root joint only.
};

/// Returns whether CompactCodec decodes poses of this mode.
[[nodiscard]] constexpr bool IsCompact(PoseMode mode) {
  return mode == PoseMode::kCompact || mode == PoseMode::kCompactReduced ||
         mode == PoseMode::kCompactRoot;
}
/// Returns the compact mode of a detail.
[[nodiscard]] constexpr PoseMode CompactMode(PoseDetail detail) {
  return detail == PoseDetail::kAll       ? PoseMode::kCompact
         : detail == PoseDetail::kReduced ? PoseMode::kCompactReduced
                                          : PoseMode::kCompactRoot;
}
/// Returns the detail of a mode; modes that are not compact contain all joints.
[[nodiscard]] constexpr PoseDetail DetailOf(PoseMode mode) {
  return mode == PoseMode::kCompactReduced ? PoseDetail::kReduced
         : mode == PoseMode::kCompactRoot  ? PoseDetail::kRoot
                                           : PoseDetail::kAll;
}

/// Steps per metre of a quantised root position. A step is 2^-14 m (0.061 mm), so a coordinate
/// changes by at most 2^-15 m (0.031 mm). From 512 m on, every float32 is a multiple of a step, so
/// it does not change.
inline constexpr float kRootStepsPerM = 16384.0f;
/// Maximum magnitude of a coordinate of a quantised root position, in metres.
inline constexpr float kMaxRootM = 131'071.0f;

/// Largest error of a quantised rotation in radians. The error of a component is at most 2.2e-5.
///
/// Each joint is encoded as three little-endian u16. The component with the largest magnitude is
/// dropped; if several are equal, the first. If it is negative, the quaternion is negated first.
/// Each other component c becomes floor(c sqrt(2) 16383 + 16384.5) in bits 0 to 14, so that 0 is
/// exact. Bit 15 of the first word is bit 0 of the dropped index, bit 15 of the second word is bit
/// 1, and bit 15 of the third word is 0.
inline constexpr double kMaxQuantisedAngleRad = 1.6e-4;

/// Largest deviation of a quaternion's length from 1.
inline constexpr float kUnitTolerance = 1e-3f;

/// Returns the size of a pose in bytes: 12 + 16 n if full, 12 + 6 n if quantised, for n joints.
/// Returns 0 for kMovement, and for compact modes, whose size depends on the world.
[[nodiscard]] constexpr std::size_t PoseBytes(PoseMode mode, std::size_t joint_count) {
  switch (mode) {
    case PoseMode::kFull: return 12 + 16 * joint_count;
    case PoseMode::kQuantised: return 12 + 6 * joint_count;
    case PoseMode::kMovement:
    case PoseMode::kCompact:
    case PoseMode::kCompactReduced:
    case PoseMode::kCompactRoot: return 0;
  }
  return 0;
}

/// Encodes a full or quantised pose. `out` needs no alignment. Never allocates. On failure the
/// content of `out` is unspecified. Error codes:
///   kShapeMismatch  the size of `out` is not PoseBytes(mode, rotations.size())
///   kOutOfRange     a number is not finite, a length deviates from 1 by more than kUnitTolerance,
///                   or the magnitude of a quantised root coordinate exceeds kMaxRootM; `index` is
///                   the joint of a rotation, or the axis (0 to 2) of that coordinate
///   kUnsupported    another mode
[[nodiscard]] Status EncodePose(PoseMode mode, const Vec3& root_position_m,
                                std::span<const Quat> rotations, std::span<std::byte> out);

/// Decodes a full or quantised pose. `in` needs no alignment. Never allocates. Quantised
/// quaternions have unit length to float32 precision; full ones are returned unchanged. Fails with
/// the errors of EncodePose, and with kMalformed for quantised bits that no encoder writes.
[[nodiscard]] Status DecodePose(PoseMode mode, std::span<const std::byte> in, Vec3& root_position_m,
                                std::span<Quat> rotations);

/// Decodes the root position from the first 12 bytes of a quantised or compact pose. Fails with
/// kOutOfRange if the magnitude of a coordinate exceeds kMaxRootM.
[[nodiscard]] Status DecodeRoot(std::span<const std::byte, 12> in, Vec3& root_position_m);

}  // namespace stridewire::protocol
