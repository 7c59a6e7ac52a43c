#include "pose_history.h"

#include <algorithm>

#include "base/check.h"
#include "base/prefetch.h"
#include "interpolate_kernel.h"

namespace stridewire::client {

PoseHistory::PoseHistory(std::size_t capacity, std::size_t joint_count)
    : joint_count_(joint_count),
      entries_(capacity),
      rotations_(capacity * joint_count, kIdentityQuat) {
  correction_.rotations.resize(joint_count, kIdentityQuat);
  displayed_.resize(joint_count, kIdentityQuat);
  STRIDEWIRE_CHECK(capacity > 0 && joint_count > 0);
}

std::size_t PoseHistory::Bytes(std::size_t capacity, std::size_t joint_count) {
  return sizeof(PoseHistory) + 2 * joint_count * sizeof(Quat) +
         capacity * (sizeof(Entry) + joint_count * sizeof(Quat));
}

bool PoseHistory::Push(const PoseStamp& stamp, const Vec3& root_position_m,
                       std::span<const Quat> rotations) {
  if (size_ > 0) {
    const PoseStamp& newest = this->stamp(size_ - 1);
    if (stamp.tick <= newest.tick || stamp.time_s <= newest.time_s) return false;
    if (stamp.discontinuity || IsInterrupted()) {
      correction_.state = Correction::State::kNone;
      if (displayed_s_ < this->stamp(0).time_s) displayed_s_ = kNever;
    } else if (displayed_s_ > newest.time_s && correction_.state != Correction::State::kPending) {
      // The pose that is displayed now was extrapolated beyond the newest received pose. It may
      // differ from the new pose, so it is stored, and the motion continues from it.
      Vec3 root_m;
      if (Sample(displayed_s_, root_m, displayed_)) {
        correction_.state = Correction::State::kPending;
        correction_.start_s = displayed_s_;
        correction_.root_m = root_m;
        correction_.rotations.swap(displayed_);
      }
    }
    const bool has_begun = size_ > 1 && displayed_s_ > this->stamp(size_ - 2).time_s;
    entries_[Slot(size_ - 1)].slope_is_before = has_begun;
  }
  if (size_ == entries_.size()) {
    first_ = (first_ + 1) % entries_.size();
    --size_;
  }
  STRIDEWIRE_CHECK(size_ < entries_.size() && rotations.size() == joint_count_);
  const std::size_t slot = Slot(size_++);
  entries_[slot] = {.stamp = stamp, .root_position_m = root_position_m};
  std::ranges::copy(rotations,
                    rotations_.begin() + static_cast<std::ptrdiff_t>(slot * joint_count_));
  return true;
}

// Returns the first pose after a time. Poses are usually sampled shortly before the newest one and
// arrive at equal intervals, so a search that starts there reads less memory than a binary search.
std::size_t PoseHistory::FirstAfterTime(double time_s) const {
  // Written this way so that NaN yields the newest pose.
  if (size_ == 0 || !(time_s < stamp(size_ - 1).time_s)) return size_;
  std::size_t low = 0;           // All poses before it are at or before the time.
  std::size_t high = size_ - 1;  // This pose is after the time.
  if (size_ >= 2) {
    const double newest_s = stamp(size_ - 1).time_s;
    const double interval_s = newest_s - stamp(size_ - 2).time_s;
    const double back = (newest_s - time_s) / interval_s;
    const std::size_t guess =
        back < static_cast<double>(size_ - 1) ? size_ - 1 - static_cast<std::size_t>(back) : 0;
    if (stamp(guess).time_s > time_s) {
      high = guess;
      if (high > 0 && stamp(high - 1).time_s <= time_s) return high;
    } else {
      low = guess + 1;
      if (stamp(low).time_s > time_s) return low;
    }
  }
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    if (stamp(middle).time_s > time_s) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return low;
}

void PoseHistory::Prefetch(double time_s, bool is_near) const {
  if (size_ == 0) return;
  if (!is_near) {
    PrefetchBytes(&entries_[Slot(size_ - 1)], sizeof(Entry));
    return;
  }
  const std::size_t after = FirstAfterTime(time_s);
  const std::size_t begin = after >= 2 ? after - 2 : 0;
  const std::size_t end = std::min(after + 2, size_);
  for (std::size_t i = begin; i < end; ++i) {
    PrefetchBytes(rotations(i).data(), rotations(i).size_bytes());
  }
}

void PoseHistory::PrefetchPush() const {
  if (size_ == 0) return;
  const std::size_t slot = Slot(size_ == entries_.size() ? 0 : size_);
  PrefetchBytes(&entries_[Slot(size_ - 1)], sizeof(Entry));
  PrefetchBytes(&entries_[slot], sizeof(Entry));
  PrefetchBytes(&rotations_[slot * joint_count_], joint_count_ * sizeof(Quat));
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

/// Weights of cubic Hermite interpolation at `u`, from 0 to 1.
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
  const bool is_before = keys.start_slope_is_before && before_s < start_s;
  const Vec3& slope_end_m = is_before ? keys.start.root_position_m : keys.end.root_position_m;
  const auto scale_start =
      static_cast<float>(length_s / ((is_before ? start_s : end_s) - before_s));
  const auto scale_end = static_cast<float>(length_s / (beyond_s - start_s));
  const Hermite h(static_cast<float>((time_s - start_s) / length_s));

  const Vec3& start_m = keys.start.root_position_m;
  const Vec3& end_m = keys.end.root_position_m;
  root_position_m = start_m + h.value_1 * (end_m - start_m) +
                    h.slope_0 * scale_start * (slope_end_m - keys.before.root_position_m) +
                    h.slope_1 * scale_end * (keys.beyond.root_position_m - start_m);

  InterpolateRotations({.before = &keys.before.rotations[0].x,
                        .start = &keys.start.rotations[0].x,
                        .end = &keys.end.rotations[0].x,
                        .beyond = &keys.beyond.rotations[0].x,
                        .start_slope_is_before = is_before,
                        .value = h.value_1,
                        .start_slope = h.slope_0 * scale_start,
                        .end_slope = h.slope_1 * scale_end},
                       rotations.size(), &rotations[0].x);
}

bool PoseHistory::IsInterrupted() const {
  if (size_ == 0 || displayed_s_ == kNever) return false;
  const double newest_s = stamp(size_ - 1).time_s;
  // The server may send poses of distant avatars at intervals longer than kMaxExtrapolationS.
  const double interval_s = size_ > 1 ? newest_s - stamp(size_ - 2).time_s : 0.0;
  return displayed_s_ < stamp(0).time_s ||
         displayed_s_ - newest_s > std::max(kMaxExtrapolationS, 2.0 * interval_s);
}

void PoseHistory::Extrapolate(std::size_t j, double time_s, Vec3& root_position_m,
                              std::span<Quat> rotations) const {
  root_position_m = this->root_position_m(j);
  std::ranges::copy(this->rotations(j), rotations.begin());
  if (j == 0 || stamp(j).discontinuity) return;
  // The speed decreases as (1 - s)^2.
  const double s = std::min(1.0, (time_s - stamp(j).time_s) / kMaxExtrapolationS);
  const double passed_s = kMaxExtrapolationS * s * (1.0 - s + s * s / 3.0);
  const auto scale = static_cast<float>(passed_s / (stamp(j).time_s - stamp(j - 1).time_s));
  root_position_m += scale * (root_position_m - this->root_position_m(j - 1));
  for (std::size_t joint = 0; joint < rotations.size(); ++joint) {
    const Quat newest = rotations[joint];
    rotations[joint] =
        Normalise(newest + (newest - Near(this->rotations(j - 1)[joint], newest)) * scale);
  }
}

void PoseHistory::ResolveCorrection() {
  if (correction_.state != Correction::State::kPending) return;
  Vec3 root_m;
  correction_.state = Correction::State::kNone;
  const auto sampled = SampleCurve(correction_.start_s, root_m, displayed_);
  if (!sampled) return;
  correction_.state = Correction::State::kActive;
  correction_.root_m -= root_m;
  for (std::size_t joint = 0; joint < joint_count_; ++joint) {
    correction_.rotations[joint] =
        Normalise(correction_.rotations[joint] * glm::conjugate(displayed_[joint]));
  }
}

std::optional<PoseHistory::Sampled> PoseHistory::Display(double time_s, Vec3& root_position_m,
                                                         std::span<Quat> rotations) {
  ResolveCorrection();
  const auto sampled = Sample(time_s, root_position_m, rotations);
  if (sampled) displayed_s_ = time_s;
  return sampled;
}

std::optional<PoseHistory::Sampled> PoseHistory::Sample(double time_s, Vec3& root_position_m,
                                                        std::span<Quat> rotations) const {
  const auto sampled = SampleCurve(time_s, root_position_m, rotations);
  const double passed_s = time_s - correction_.start_s;
  if (!sampled || correction_.state != Correction::State::kActive || passed_s < 0.0 ||
      passed_s >= kCorrectionS) {
    return sampled;
  }
  const auto s = static_cast<float>(1.0 - passed_s / kCorrectionS);
  const float rest = s * s * (3.0f - 2.0f * s);
  root_position_m += rest * correction_.root_m;
  for (std::size_t joint = 0; joint < joint_count_; ++joint) {
    const Quat difference = Near(correction_.rotations[joint], kIdentityQuat);
    rotations[joint] =
        Normalise((kIdentityQuat + (difference - kIdentityQuat) * rest) * rotations[joint]);
  }
  return sampled;
}

std::optional<PoseHistory::Sampled> PoseHistory::SampleCurve(double time_s, Vec3& root_position_m,
                                                             std::span<Quat> rotations) const {
  const std::size_t after = FirstAfterTime(time_s);
  if (after == 0) return std::nullopt;
  const std::size_t i = after - 1;
  const std::size_t j = after;

  const bool exact = stamp(i).time_s == time_s;
  // If a gap precedes the discontinuity, the connection was interrupted. The motion before the gap
  // is then extrapolated instead of ending at once.
  const double before_s = i > 0 ? stamp(i).time_s - stamp(i - 1).time_s : 0.0;
  const bool is_last =
      j == size_ || (stamp(j).discontinuity && stamp(j).time_s - stamp(i).time_s > 1.5 * before_s);
  if (is_last && !exact) {
    Extrapolate(i, time_s, root_position_m, rotations);
    const bool moves = i > 0 && !stamp(i).discontinuity;
    return Sampled{i, false, moves && time_s - stamp(i).time_s < kMaxExtrapolationS};
  }
  if (exact || stamp(j).discontinuity) {
    root_position_m = this->root_position_m(i);
    std::ranges::copy(this->rotations(i), rotations.begin());
    return Sampled{i, exact};
  }

  // If a neighbour is missing, i or j replaces it, which results in the secant of the interval.
  const std::size_t before = i > 0 && !stamp(i).discontinuity ? i - 1 : i;
  const bool has_beyond =
      j + 1 < size_ && !stamp(j + 1).discontinuity && !entries_[Slot(j)].slope_is_before;
  const std::size_t beyond = has_beyond ? j + 1 : j;
  const auto pose = [this](std::size_t k) {
    return ConstPoseSpan{this->root_position_m(k), this->rotations(k)};
  };
  InterpolatePose(
      {.times_s = {stamp(before).time_s, stamp(i).time_s, stamp(j).time_s, stamp(beyond).time_s},
       .before = pose(before),
       .start = pose(i),
       .end = pose(j),
       .beyond = pose(beyond),
       .start_slope_is_before = entries_[Slot(i)].slope_is_before},
      time_s, root_position_m, rotations);
  return Sampled{i, true};
}

}  // namespace stridewire::client
