#include "pose_history.h"

#include <algorithm>

#include "base/check.h"

namespace stridewire::client {

PoseHistory::PoseHistory(std::size_t capacity, std::size_t joint_count)
    : joint_count_(joint_count),
      stamps_(capacity),
      roots_m_(capacity),
      rotations_(capacity * joint_count, kIdentityQuat) {
  STRIDEWIRE_CHECK(capacity > 0 && joint_count > 0);
}

std::size_t PoseHistory::Bytes(std::size_t capacity, std::size_t joint_count) {
  return sizeof(PoseHistory) +
         capacity * (sizeof(PoseStamp) + sizeof(Vec3) + joint_count * sizeof(Quat));
}

bool PoseHistory::Push(const PoseStamp& stamp, const Vec3& root_position_m,
                       std::span<const Quat> rotations) {
  if (size_ > 0) {
    const PoseStamp& newest = this->stamp(size_ - 1);
    if (stamp.tick <= newest.tick || stamp.time_s <= newest.time_s) return false;
  }
  if (size_ == stamps_.size()) {
    first_ = (first_ + 1) % stamps_.size();
    --size_;
  }
  STRIDEWIRE_CHECK(size_ < stamps_.size() && rotations.size() == joint_count_);
  const std::size_t slot = Slot(size_++);
  stamps_[slot] = stamp;
  roots_m_[slot] = root_position_m;
  std::ranges::copy(rotations,
                    rotations_.begin() + static_cast<std::ptrdiff_t>(slot * joint_count_));
  return true;
}

std::optional<std::size_t> PoseHistory::FirstAfterTick(std::uint64_t tick) const {
  std::size_t low = 0;
  std::size_t high = size_;
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    if (stamp(middle).tick > tick) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  if (low == size_) return std::nullopt;
  return low;
}

namespace {

/// Weights of cubic Hermite interpolation at u, which is 0 to 1.
struct Hermite {
  explicit Hermite(float u)
      : slope_0(u * (1.0f - u) * (1.0f - u)),
        value_1(u * u * (3.0f - 2.0f * u)),
        slope_1(u * u * (u - 1.0f)) {}
  float slope_0;
  float value_1;  ///< Weight of the value at u = 1. That of the value at u = 0 is 1 - value_1.
  float slope_1;
};

Quat Near(const Quat& q, const Quat& reference) { return Dot(q, reference) < 0.0f ? -q : q; }

}  // namespace

std::optional<PoseHistory::Sampled> PoseHistory::Sample(double time_s, Vec3& root_position_m,
                                                        std::span<Quat> rotations) const {
  std::size_t after = 0;
  std::size_t high = size_;
  while (after < high) {
    const std::size_t middle = (after + high) / 2;
    if (stamp(middle).time_s > time_s) {
      high = middle;
    } else {
      after = middle + 1;
    }
  }
  if (after == 0) return std::nullopt;
  const std::size_t i = after - 1;
  const std::size_t j = after;

  const bool exact = stamp(i).time_s == time_s;
  if (exact || j == size_ || stamp(j).discontinuity) {
    root_position_m = this->root_position_m(i);
    std::ranges::copy(this->rotations(i), rotations.begin());
    return Sampled{i, exact};
  }

  // The slopes at i and j are those of the secants before -> j and i -> after next, scaled to the
  // interval. If a neighbour is missing, i or j takes its place, which results in the secant of the
  // interval.
  const std::size_t before = i > 0 && !stamp(i).discontinuity ? i - 1 : i;
  const std::size_t beyond = j + 1 < size_ && !stamp(j + 1).discontinuity ? j + 1 : j;
  const double length_s = stamp(j).time_s - stamp(i).time_s;
  const auto ratio = [&](std::size_t from, std::size_t to) {
    return static_cast<float>(length_s / (stamp(to).time_s - stamp(from).time_s));
  };
  const float scale_i = ratio(before, j);
  const float scale_j = ratio(i, beyond);
  const Hermite h(static_cast<float>((time_s - stamp(i).time_s) / length_s));

  root_position_m =
      this->root_position_m(i) + h.value_1 * (this->root_position_m(j) - this->root_position_m(i)) +
      h.slope_0 * scale_i * (this->root_position_m(j) - this->root_position_m(before)) +
      h.slope_1 * scale_j * (this->root_position_m(beyond) - this->root_position_m(i));

  const auto q_before = this->rotations(before);
  const auto q_i = this->rotations(i);
  const auto q_j = this->rotations(j);
  const auto q_beyond = this->rotations(beyond);
  for (std::size_t joint = 0; joint < joint_count_; ++joint) {
    const Quat at_i = q_i[joint];
    const Quat at_before = Near(q_before[joint], at_i);
    const Quat at_j = Near(q_j[joint], at_i);
    const Quat at_beyond = Near(q_beyond[joint], at_j);
    rotations[joint] =
        Normalise(at_i + (at_j - at_i) * h.value_1 + (at_j - at_before) * (h.slope_0 * scale_i) +
                  (at_beyond - at_i) * (h.slope_1 * scale_j));
  }
  return Sampled{i, true};
}

}  // namespace stridewire::client
