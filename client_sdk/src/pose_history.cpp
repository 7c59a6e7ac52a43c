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

std::optional<std::size_t> PoseHistory::PushStamp(const PoseStamp& stamp) {
  if (size_ > 0) {
    const PoseStamp& newest = this->stamp(size_ - 1);
    if (stamp.tick <= newest.tick || stamp.time_s <= newest.time_s) return std::nullopt;
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
  if (size_ == entries_.size()) DropOldest();
  STRIDEWIRE_CHECK(size_ < entries_.size());
  const std::size_t slot = Slot(size_++);
  entries_[slot] = {.stamp = stamp};
  return slot;
}

bool PoseHistory::Push(const PoseStamp& stamp, const Vec3& root_position_m,
                       std::span<const Quat> rotations) {
  const auto slot = PushStamp(stamp);
  if (!slot) return false;
  STRIDEWIRE_CHECK(rotations.size() == joint_count_);
  entries_[*slot].root_position_m = root_position_m;
  std::ranges::copy(rotations, RotationsAt(*slot).begin());
  return true;
}

bool PoseHistory::Push(const PoseStamp& stamp,
                       const std::shared_ptr<const PlayedMovement>& movement, double time_s,
                       MovementEvaluator& evaluator) {
  STRIDEWIRE_CHECK(movement != nullptr && (evaluator_ == nullptr || evaluator_ == &evaluator));
  const auto slot = PushStamp(stamp);
  if (!slot) return false;
  evaluator_ = &evaluator;
  if (movements_.empty() || movements_.back() != movement) AddMovement(movement);
  entries_[*slot].movement = movement.get();
  entries_[*slot].movement_time_s = time_s;
  return true;
}

void PoseHistory::DropOldest() {
  first_ = (first_ + 1) % entries_.size();
  --size_;
}

// Adds the movement of the newest pose, and removes movements that no pose needs any more.
void PoseHistory::AddMovement(const std::shared_ptr<const PlayedMovement>& movement) {
  // If movements are interrupted very often, the oldest poses are dropped to limit memory.
  const std::size_t most = 4 + entries_.size() / 4;
  const auto oldest = [this] {
    std::size_t i = 0;
    while (i + 1 < size_ && entries_[Slot(i)].movement == nullptr) ++i;
    return std::ranges::find(movements_, entries_[Slot(i)].movement,
                             [](const auto& kept) { return kept.get(); });
  };
  movements_.erase(movements_.begin(), oldest());
  while (movements_.size() >= most) {
    DropOldest();
    movements_.erase(movements_.begin(), oldest());
  }
  movements_.push_back(movement);
}

PoseHistory::MovementTime PoseHistory::NewestMovement() const {
  if (size_ == 0) return {};
  const Entry& newest = entries_[Slot(size_ - 1)];
  return {newest.movement, newest.movement_time_s};
}

void PoseHistory::EvaluateAll() {
  for (std::size_t i = 0; i < size_; ++i) PreparePose(i);
  if (evaluator_ != nullptr) evaluator_->Evaluate();
  for (Entry& entry : entries_) entry.movement = nullptr;
  movements_.clear();
  evaluator_ = nullptr;
}

ConstPoseSpan PoseHistory::pose(std::size_t i) const {
  const std::size_t slot = Slot(i);
  Entry& entry = entries_[slot];
  if (entry.movement != nullptr && !entry.is_evaluated) {
    EvaluateMovement({entry.movement, entry.movement_time_s}, entry.root_position_m,
                     RotationsAt(slot));
    entry.is_evaluated = true;
  }
  return {entry.root_position_m, RotationsAt(slot)};
}

// Returns the first pose after a time. Poses are usually sampled shortly before the newest one and
// arrive at equal intervals, so a search that starts there reads less memory than a binary search.
std::size_t PoseHistory::FirstAfterTime(double time_s) const {
  // This form of the comparison treats NaN like a time after the newest pose.
  if (size_ == 0 || !(time_s < stamp(size_ - 1).time_s)) return size_;
  std::size_t low = 0;           // All poses before this index are at or before the time.
  std::size_t high = size_ - 1;  // The pose with this index is after the time.
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
    if (entries_[Slot(i)].movement != nullptr) continue;
    PrefetchBytes(RotationsAt(Slot(i)).data(), joint_count_ * sizeof(Quat));
  }
}

void PoseHistory::PrefetchPush() const {
  if (size_ == 0) return;
  const std::size_t slot = Slot(size_ == entries_.size() ? 0 : size_);
  PrefetchBytes(&entries_[Slot(size_ - 1)], sizeof(Entry));
  PrefetchBytes(&entries_[slot], sizeof(Entry));
  if (evaluator_ != nullptr) return;  // The next pose probably has a movement instead of rotations.
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
  correction_.state = Correction::State::kNone;
  const auto sampled = SampleCurve(correction_.start_s, correction_.curve_root_m, displayed_);
  if (!sampled) return;
  correction_.state = Correction::State::kActive;
  correction_.root_m -= correction_.curve_root_m;
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
  prepared_count_ = 0;
  return sampled;
}

bool PoseHistory::Prepare(double time_s, Vec3& root_position_m, std::span<Quat> rotations) {
  const Curve curve = FindCurve(time_s);
  prepared_count_ = 0;
  if (curve.kind == Curve::Kind::kNone) return false;
  if (evaluator_ == nullptr) return true;
  if (correction_.state == Correction::State::kPending) {
    PrepareCurve(FindCurve(correction_.start_s), correction_.curve_root_m, displayed_);
  }
  PrepareCurve(curve, root_position_m, rotations);
  return true;
}

void PoseHistory::PrepareCurve(const Curve& curve, Vec3& root_position_m,
                               std::span<Quat> rotations) {
  switch (curve.kind) {
    case Curve::Kind::kNone: return;
    case Curve::Kind::kPose: return PreparePose(curve.i);
    case Curve::Kind::kInterpolated: {
      const auto [before, beyond] = NeighboursOf(curve.i);
      for (std::size_t i = before; i <= beyond; ++i) PreparePose(i);
      return;
    }
    case Curve::Kind::kMovement:
      evaluator_->Add(curve.movement.movement->movement, curve.movement.time_s, root_position_m,
                      rotations);
      prepared_[prepared_count_++] = {curve.movement, &root_position_m, rotations.data()};
      return;
    case Curve::Kind::kExtrapolated:
      if (curve.i > 0) PreparePose(curve.i - 1);
      return PreparePose(curve.i);
  }
}

void PoseHistory::PreparePose(std::size_t i) {
  Entry& entry = entries_[Slot(i)];
  if (entry.movement == nullptr || entry.is_evaluated) return;
  evaluator_->Add(entry.movement->movement, entry.movement_time_s, entry.root_position_m,
                  RotationsAt(Slot(i)));
  entry.is_evaluated = true;
}

void PoseHistory::EvaluateMovement(const MovementTime& at, Vec3& root_position_m,
                                   std::span<Quat> rotations) const {
  for (const Prepared& prepared : std::span(prepared_).first(prepared_count_)) {
    if (prepared.rotations == rotations.data() && prepared.at.movement == at.movement &&
        prepared.at.time_s == at.time_s) {
      return;
    }
  }
  evaluator_->Add(at.movement->movement, at.time_s, root_position_m, rotations);
  evaluator_->Evaluate();
}

PoseHistory::MovementTime PoseHistory::MovementAt(std::size_t i, double time_s) const {
  const Entry& start = entries_[Slot(i)];
  const Entry& end = entries_[Slot(i + 1)];
  if (start.movement == nullptr || end.movement == nullptr) return {};
  if (start.movement == end.movement) {
    const double share = (time_s - start.stamp.time_s) / (end.stamp.time_s - start.stamp.time_s);
    return {start.movement,
            start.movement_time_s + share * (end.movement_time_s - start.movement_time_s)};
  }
  if (end.movement->previous_end_s < 0.0 || end.movement->number != start.movement->number + 1) {
    return {};
  }
  // The movement at the end of the interval began where the other one ended.
  const double end_time_s = end.movement_time_s - (end.stamp.time_s - time_s);
  if (end_time_s >= end.movement->movement.start_offset_s) return {end.movement, end_time_s};
  return {start.movement, std::min(start.movement_time_s + (time_s - start.stamp.time_s),
                                   end.movement->previous_end_s)};
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

PoseHistory::Curve PoseHistory::FindCurve(double time_s) const {
  const std::size_t after = FirstAfterTime(time_s);
  if (after == 0) return {};
  const std::size_t i = after - 1;
  const std::size_t j = after;

  const bool is_exact = stamp(i).time_s == time_s;
  // If a gap precedes the discontinuity, the connection was interrupted. The motion before the gap
  // is then extrapolated instead of ending at once.
  const double before_s = i > 0 ? stamp(i).time_s - stamp(i - 1).time_s : 0.0;
  const bool is_last =
      j == size_ || (stamp(j).discontinuity && stamp(j).time_s - stamp(i).time_s > 1.5 * before_s);
  if (is_last && !is_exact) return {Curve::Kind::kExtrapolated, i};
  if (is_exact || stamp(j).discontinuity) return {Curve::Kind::kPose, i, is_exact};
  const MovementTime movement = MovementAt(i, time_s);
  if (movement.movement != nullptr) return {Curve::Kind::kMovement, i, false, movement};
  return {Curve::Kind::kInterpolated, i};
}

std::pair<std::size_t, std::size_t> PoseHistory::NeighboursOf(std::size_t i) const {
  // If a neighbour is missing, i or j replaces it, which results in the secant of the interval.
  const std::size_t j = i + 1;
  const std::size_t before = i > 0 && !stamp(i).discontinuity ? i - 1 : i;
  const bool has_beyond =
      j + 1 < size_ && !stamp(j + 1).discontinuity && !entries_[Slot(j)].slope_is_before;
  return {before, has_beyond ? j + 1 : j};
}

std::optional<PoseHistory::Sampled> PoseHistory::SampleCurve(double time_s, Vec3& root_position_m,
                                                             std::span<Quat> rotations) const {
  const Curve curve = FindCurve(time_s);
  const std::size_t i = curve.i;
  switch (curve.kind) {
    case Curve::Kind::kNone: return std::nullopt;
    case Curve::Kind::kPose:
      root_position_m = this->root_position_m(i);
      std::ranges::copy(this->rotations(i), rotations.begin());
      return Sampled{i, curve.is_exact};
    case Curve::Kind::kExtrapolated: {
      Extrapolate(i, time_s, root_position_m, rotations);
      const bool moves = i > 0 && !stamp(i).discontinuity;
      return Sampled{i, false, moves && time_s - stamp(i).time_s < kMaxExtrapolationS};
    }
    case Curve::Kind::kMovement:
      EvaluateMovement(curve.movement, root_position_m, rotations);
      return Sampled{i, true};
    case Curve::Kind::kInterpolated: break;
  }
  const auto [before, beyond] = NeighboursOf(i);
  InterpolatePose({.times_s = {stamp(before).time_s, stamp(i).time_s, stamp(i + 1).time_s,
                               stamp(beyond).time_s},
                   .before = pose(before),
                   .start = pose(i),
                   .end = pose(i + 1),
                   .beyond = pose(beyond),
                   .start_slope_is_before = entries_[Slot(i)].slope_is_before},
                  time_s, root_position_m, rotations);
  return Sampled{i, true};
}

}  // namespace stridewire::client
