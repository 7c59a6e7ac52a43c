#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "pose_stamp.h"
#include "stridewire/base/math.h"

namespace stridewire::client {

/// The last poses of one avatar, oldest first: the jitter buffer. A ring that takes its memory when
/// it is made and none later; a full ring forgets its oldest pose.
class PoseHistory {
 public:
  /// `capacity` poses of `joint_count` joints; both > 0.
  PoseHistory(std::size_t capacity, std::size_t joint_count);

  /// Memory such a history takes.
  [[nodiscard]] static std::size_t Bytes(std::size_t capacity, std::size_t joint_count);

  /// False, changing nothing, when tick or time are not after the newest one's.
  bool Push(const PoseStamp& stamp, const Vec3& root_position_m, std::span<const Quat> rotations);

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t joint_count() const { return joint_count_; }
  [[nodiscard]] const PoseStamp& stamp(std::size_t i) const { return stamps_[Slot(i)]; }
  [[nodiscard]] const Vec3& root_position_m(std::size_t i) const { return roots_m_[Slot(i)]; }
  [[nodiscard]] std::span<const Quat> rotations(std::size_t i) const {
    return std::span(rotations_).subspan(Slot(i) * joint_count_, joint_count_);
  }

  /// Index of the oldest pose with a tick above `tick`.
  [[nodiscard]] std::optional<std::size_t> FirstAfterTick(std::uint64_t tick) const;

  /// What Sample found.
  struct Sampled {
    std::size_t index = 0;      ///< The pose at or before the time.
    bool interpolated = false;  ///< Else it is held as it is.
  };

  /// Pose at `time_s`: cubic through the poses around it (C1, and exact at each), rotations in one
  /// hemisphere and then made unit. Never across a discontinuity, not beyond the newest pose: there
  /// the last one is held. Empty before the oldest one.
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
