#include "playout_clock.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace stridewire::client {

void PlayoutClock::Start(double local_s, double offset_s) {
  first_ = count_ = 0;
  ready_ = true;
  stalled_ = false;
  first_local_s_ = last_on_time_s_ = last_short_s_ = local_s;
  first_offset_s_ = smallest_s_ = offset_s;
  offset_s_ = target_s_ = offset_s + std::max(kFirstDelayS, (1.0 + kMargin) * interval_s_);
}

void PlayoutClock::OnStall(double local_s) {
  if (stalled_) return;
  stalled_ = true;
  stalled_since_s_ = local_s;
}

void PlayoutClock::Store(const Offset& offset) {
  while (count_ > 0 && offsets_[first_].local_s < offset.local_s - kWindowS) {
    first_ = (first_ + 1) % kMaxOffsets;
    --count_;
  }
  if (count_ > 0) {
    Offset& last = offsets_[(first_ + count_ - 1) % kMaxOffsets];
    if (last.server_s == offset.server_s) {
      last = offset;  // Of two messages with the same server time, the later one counts.
      return;
    }
  }
  if (count_ == kMaxOffsets) {
    first_ = (first_ + 1) % kMaxOffsets;
    --count_;
  }
  offsets_[(first_ + count_++) % kMaxOffsets] = offset;
}

bool PlayoutClock::AddSample(double local_s, double server_s, double interval_s) {
  STRIDEWIRE_CHECK(!ready_ || local_s >= at_local_s_);
  const double offset_s = local_s - server_s;
  const bool is_stall = ready_ && local_s - last_local_s_ > std::max(kStallS, 3.0 * interval_s);
  interval_s_ = interval_s;
  last_local_s_ = local_s;
  bool jumped = false;
  if (!ready_ || offset_s < smallest_s_ - kSnapS) {
    jumped = ready_;
    Start(local_s, offset_s);
  }
  offset_s_ = OffsetAt(local_s);
  at_local_s_ = local_s;
  if (is_stall) OnStall(local_s);
  if (offset_s <= offset_s_) {
    stalled_ = false;
    last_on_time_s_ = local_s;
  } else if (stalled_ && local_s - stalled_since_s_ <= kResyncS) {
    last_on_time_s_ = local_s;
    return jumped;
  }
  stalled_ = false;

  Store({local_s, server_s, offset_s});
  std::array<double, kMaxOffsets> sorted_s;
  smallest_s_ = offset_s;
  for (std::size_t i = 0; i < count_; ++i) {
    sorted_s[i] = offsets_[(first_ + i) % kMaxOffsets].offset_s;
    smallest_s_ = std::min(smallest_s_, sorted_s[i]);
  }
  const auto rank = static_cast<std::size_t>(kQuantile * static_cast<double>(count_ - 1));
  const auto at = sorted_s.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(sorted_s.begin(), at, sorted_s.begin() + static_cast<std::ptrdiff_t>(count_));
  target_s_ = *at + (1.0 + kMargin) * interval_s;
  if (local_s - first_local_s_ < kWindowS) {
    target_s_ = std::max(target_s_, first_offset_s_ + kFirstDelayS);
  }
  if (offset_s_ - target_s_ <= kMaxExcessS) last_short_s_ = local_s;
  if (local_s - last_short_s_ > kResyncS) {
    Start(local_s, offset_s);
    jumped = true;
  } else if (local_s - last_on_time_s_ > kResyncS && target_s_ - offset_s_ > kSnapS) {
    offset_s_ = target_s_;
    last_on_time_s_ = local_s;
    jumped = true;
  }
  return jumped;
}

double PlayoutClock::OffsetAt(double local_s) const {
  const double missing_s = target_s_ - offset_s_;
  const double rate = std::clamp(missing_s / kDecayS, -kMaxRate, kMaxRate);
  const double change_s = rate * std::max(0.0, local_s - at_local_s_);
  return offset_s_ + (std::abs(change_s) < std::abs(missing_s) ? change_s : missing_s);
}

}  // namespace stridewire::client
