#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "pose_stamp.h"
#include "stridewire/base/math.h"
#include "stridewire/runtime/pose.h"

namespace stridewire::client {

/// Four poses for cubic interpolation in an interval: before it, at its start, at its end, and
/// after it. If there is no pose before or after the interval, use the start or the end again.
struct PoseKeys {
  std::array<double, 4> times_s;
  ConstPoseSpan before;
  ConstPoseSpan start;
  ConstPoseSpan end;
  ConstPoseSpan beyond;
};

/// Computes the pose at `time_s` inside the interval by cubic Hermite interpolation, which is
/// continuous in its first derivative and exact at the keys. Rotations are interpolated in one
/// hemisphere and normalized.
void InterpolatePose(const PoseKeys& keys, double time_s, Vec3& root_position_m,
                     std::span<Quat> rotations);

/// Jitter buffer: the last poses of one avatar, the oldest first. It allocates in its constructor
/// only. A full buffer drops its oldest pose.
class PoseHistory {
 public:
  /// `capacity` (in poses) and `joint_count` must be above 0.
  PoseHistory(std::size_t capacity, std::size_t joint_count);

  /// Returns the memory of a history in bytes.
  [[nodiscard]] static std::size_t Bytes(std::size_t capacity, std::size_t joint_count);

  /// Adds a pose. Returns false and does nothing unless tick and time exceed those of the newest
  /// pose.
  bool Push(const PoseStamp& stamp, const Vec3& root_position_m, std::span<const Quat> rotations);

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t joint_count() const { return joint_count_; }
  [[nodiscard]] const PoseStamp& stamp(std::size_t i) const { return stamps_[Slot(i)]; }
  [[nodiscard]] const Vec3& root_position_m(std::size_t i) const { return roots_m_[Slot(i)]; }
  [[nodiscard]] std::span<const Quat> rotations(std::size_t i) const {
    return std::span(rotations_).subspan(Slot(i) * joint_count_, joint_count_);
  }

  /// Returns the index of the oldest pose with a tick above `tick`, if any.
  [[nodiscard]] std::optional<std::size_t> FirstAfterTick(std::uint64_t tick) const;

  /// Describes how Sample computed a pose.
  struct Sampled {
    std::size_t index = 0;  ///< Index of the newest pose at or before the sampled time.
    /// True if the pose was interpolated, false if pose `index` is returned unchanged.
    bool interpolated = false;
  };

  /// Computes the pose at `time_s` by cubic Hermite interpolation, which is continuous in its first
  /// derivative and exact at received poses. Rotations are interpolated in one hemisphere and
  /// normalized. After the newest pose, or before a discontinuity, the last pose is returned
  /// unchanged. Returns an empty optional before the oldest pose.
  [[nodiscard]] std::optional<Sampled> Sample(double time_s, Vec3& root_position_m,
                                              std::span<Quat> rotations) const;

 private:
  [[nodiscard]] std::size_t Slot(std::size_t i) const { return (first_ + i) % stamps_.size(); }

  std::size_t joint_count_;
  std::size_t first_ = 0;
  std::size_t size_ = 0;
  std::vector<PoseStamp> stamps_;
  std::vector<Vec3> roots_m_;
  std::vector<Quat> rotations_;
};

}  // namespace stridewire::client
