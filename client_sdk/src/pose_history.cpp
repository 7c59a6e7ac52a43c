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

void InterpolatePose(const PoseKeys& keys, double time_s, Vec3& root_position_m,
                     std::span<Quat> rotations) {
  const auto& [before_s, start_s, end_s, beyond_s] = keys.times_s;
  const double length_s = end_s - start_s;
  // The slopes at start and end are those of the secants through their neighbours, scaled to the
  // interval.
  const auto scale_start = static_cast<float>(length_s / (end_s - before_s));
  const auto scale_end = static_cast<float>(length_s / (beyond_s - start_s));
  const Hermite h(static_cast<float>((time_s - start_s) / length_s));

  const Vec3& start_m = keys.start.root_position_m;
  const Vec3& end_m = keys.end.root_position_m;
  root_position_m = start_m + h.value_1 * (end_m - start_m) +
                    h.slope_0 * scale_start * (end_m - keys.before.root_position_m) +
                    h.slope_1 * scale_end * (keys.beyond.root_position_m - start_m);

  for (std::size_t joint = 0; joint < rotations.size(); ++joint) {
    const Quat at_start = keys.start.rotations[joint];
    const Quat at_before = Near(keys.before.rotations[joint], at_start);
    const Quat at_end = Near(keys.end.rotations[joint], at_start);
    const Quat at_beyond = Near(keys.beyond.rotations[joint], at_end);
    rotations[joint] = Normalise(at_start + (at_end - at_start) * h.value_1 +
                                 (at_end - at_before) * (h.slope_0 * scale_start) +
                                 (at_beyond - at_start) * (h.slope_1 * scale_end));
  }
}

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

  // If a neighbour is missing, i or j takes its place, which results in the secant of the interval.
  const std::size_t before = i > 0 && !stamp(i).discontinuity ? i - 1 : i;
  const std::size_t beyond = j + 1 < size_ && !stamp(j + 1).discontinuity ? j + 1 : j;
  const auto pose = [this](std::size_t k) {
    return ConstPoseSpan{this->root_position_m(k), this->rotations(k)};
  };
  InterpolatePose(
      {.times_s = {stamp(before).time_s, stamp(i).time_s, stamp(j).time_s, stamp(beyond).time_s},
       .before = pose(before),
       .start = pose(i),
       .end = pose(j),
       .beyond = pose(beyond)},
      time_s, root_position_m, rotations);
  return Sampled{i, true};
}

}  // namespace stridewire::client
