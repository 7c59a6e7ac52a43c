#include "clock_map.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace stridewire::client {

void ClockMap::AddSample(double local_s, double server_s) {
  STRIDEWIRE_CHECK(!ready_ || local_s >= at_local_s_);
  const double offset_s = local_s - server_s;
  const auto number = static_cast<std::int64_t>(std::floor(local_s / kBucketS));

  if (ready_ && std::abs(offset_s - target_offset_s_) > kSnapS) {
    // A much larger offset may be a single late message, so the window determines the result. A
    // much smaller offset cannot be caused by delays: the server's clock has changed.
    if (offset_s < target_offset_s_) Reset();
  }
  Bucket& bucket = buckets_[static_cast<std::size_t>(number % kBuckets + kBuckets) % kBuckets];
  if (bucket.number != number) bucket = Bucket{number, offset_s};
  bucket.smallest_offset_s = std::min(bucket.smallest_offset_s, offset_s);

  double smallest_s = offset_s;
  for (const Bucket& b : buckets_) {
    if (b.number >= 0 && b.number > number - kBuckets) {
      smallest_s = std::min(smallest_s, b.smallest_offset_s);
    }
  }

  if (!ready_) {
    ready_ = true;
    first_local_s_ = local_s;
    offset_s_ = smallest_s;
  } else {
    offset_s_ = OffsetAt(local_s);
    const bool settling = local_s - first_local_s_ < kSettleS;
    if (std::abs(smallest_s - offset_s_) > kSnapS || (settling && smallest_s < offset_s_)) {
      offset_s_ = smallest_s;
    }
  }
  at_local_s_ = local_s;
  target_offset_s_ = smallest_s;
  lateness_s_ = offset_s - smallest_s;
}

double ClockMap::OffsetAt(double local_s) const {
  const double most_s = kSlew * std::max(0.0, local_s - at_local_s_);
  return offset_s_ + std::clamp(target_offset_s_ - offset_s_, -most_s, most_s);
}

double ClockMap::ServerTime(double local_s) const {
  STRIDEWIRE_CHECK(ready_);
  return local_s - OffsetAt(local_s);
}

}  // namespace stridewire::client
