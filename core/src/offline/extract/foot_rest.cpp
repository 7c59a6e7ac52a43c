#include "offline/extract/foot_rest.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "offline/base/statistics.h"

namespace stridewire {
namespace {

// A foot that always moves faster than kAtRestM_s counts as resting in its slowest frames: those up
// to this percentile of its speed.
constexpr double kSlowestPercentile = 25.0;
// The ball is the steadiest point unless another point rests at least this many times as long.
constexpr double kBallPreference = 2.0;
// The resting height of a foot is this percentile of its heights in the frames at rest.
constexpr double kRestPercentile = 10.0;
// If the heights of two contacts differ by more than this, they are on different levels.
constexpr double kSameHeightM = 0.04;
// A landing foot rests on its heel for at most this time. Meanwhile, the ball is at most this much
// above its resting height.
constexpr double kLandingMaxS = 0.2;
constexpr double kHeelStrikeM = 0.08;
// Before and after a contact, a slow foot may rest at another height. This counts as a contact if
// it lasts at least this fraction of ContactOptions::contact_min_s.
constexpr double kRestMinShare = 0.5;

using Flags = std::vector<char>;

// Returns the maximal ranges of non-zero flags. Index 0 is frame `first`.
std::vector<FrameRange> Runs(const Flags& flags, int first) {
  std::vector<FrameRange> runs;
  for (int i = 0; i < static_cast<int>(flags.size()); ++i) {
    if (!flags[static_cast<std::size_t>(i)]) continue;
    if (runs.empty() || runs.back().end != first + i) runs.push_back({first + i, first + i});
    runs.back().end = first + i + 1;
  }
  return runs;
}

// Finds the spans during which one foot is slow and near the height at which it rests.
class RestFinder {
 public:
  RestFinder(const FootPaths& foot, double fps, const ContactOptions& options)
      : foot_(foot),
        options_(options),
        gap_min_(options.gap_min_s * fps),
        contact_min_(options.contact_min_s * fps),
        landing_max_(kLandingMaxS * fps) {}

  std::vector<Contact> Find() {
    Flags slow(foot_.slowest_m_s.size());
    for (std::size_t i = 0; i < slow.size(); ++i) {
      slow[i] = foot_.slowest_m_s[i] < options_.speed_max_m_s;
    }
    for (const FrameRange& run : Runs(slow, 0)) Collect(run);
    std::ranges::sort(found_, {}, [](const Contact& c) { return c.frames.begin; });
    Join();
    std::erase_if(found_, [&](const Contact& c) { return c.frames.size() < contact_min_; });
    return std::move(found_);
  }

 private:
  // Returns the speed below which the foot is at rest within a range of frames.
  [[nodiscard]] double RestSpeed(const FrameRange& range) const {
    return std::max(kAtRestM_s, Percentile({foot_.slowest_m_s.begin() + range.begin,
                                            foot_.slowest_m_s.begin() + range.end},
                                           kSlowestPercentile));
  }

  // Returns the point that is at rest in most frames. The ball is preferred, because toe tips are
  // often noisy.
  [[nodiscard]] std::size_t SteadiestPoint(const FrameRange& range, double rest_speed) const {
    std::array<double, FootPaths::kPoints> frames{};
    for (std::size_t p = 0; p < FootPaths::kPoints; ++p) {
      for (int i = range.begin; i < range.end; ++i) frames[p] += foot_.IsSlower(p, i, rest_speed);
    }
    frames[FootPaths::kBall] *= kBallPreference;
    return static_cast<std::size_t>(std::ranges::max_element(frames) - frames.begin());
  }

  // Resting heights of the points of the foot.
  using RestHeights = std::array<double, FootPaths::kPoints>;

  // Returns the resting height of each point of the foot within a range of frames. A point that
  // never rests while the steadiest point is at its resting height gets its usual height relative
  // to the steadiest point (flat_height_m).
  [[nodiscard]] RestHeights MeasureRest(const FrameRange& range, double rest_speed) const {
    const std::size_t steadiest = SteadiestPoint(range, rest_speed);
    std::vector<double> heights;
    for (int i = range.begin; i < range.end; ++i) {
      if (foot_.IsSlower(steadiest, i, rest_speed)) heights.push_back(foot_.Height(steadiest, i));
    }
    RestHeights rest{};
    rest[steadiest] = Percentile(std::move(heights), kRestPercentile);
    for (std::size_t p = 0; p < FootPaths::kPoints; ++p) {
      if (p == steadiest) continue;
      std::vector<double> own;
      for (int i = range.begin; i < range.end; ++i) {
        if (foot_.IsSlower(p, i, rest_speed) &&
            foot_.Height(steadiest, i) < rest[steadiest] + options_.height_max_m) {
          own.push_back(foot_.Height(p, i));
        }
      }
      rest[p] = own.empty()
                    ? rest[steadiest] - foot_.flat_height_m[steadiest] + foot_.flat_height_m[p]
                    : Percentile(std::move(own), kRestPercentile);
    }
    return rest;
  }

  [[nodiscard]] bool StandsAt(int frame, const RestHeights& rest) const {
    for (std::size_t p = 0; p < FootPaths::kPoints; ++p) {
      if (foot_.IsSlower(p, frame, options_.speed_max_m_s) &&
          foot_.Height(p, frame) < rest[p] + options_.height_max_m) {
        return true;
      }
    }
    return false;
  }

  // Returns false if the foot only slows down for a moment, for example while it steps down.
  [[nodiscard]] bool ComesToRest(const FrameRange& range) const {
    const auto at_rest = std::count_if(foot_.slowest_m_s.begin() + range.begin,
                                       foot_.slowest_m_s.begin() + range.end,
                                       [](double speed) { return speed < kAtRestM_s; });
    return static_cast<double>(at_rest) >= kRestMinShare * contact_min_;
  }

  // Adds the contacts within a range of slow frames, from the lowest height to the highest.
  void Collect(const FrameRange& range) {
    if (range.size() < 1) return;
    const RestHeights rest = MeasureRest(range, RestSpeed(range));
    Flags stands(static_cast<std::size_t>(range.size()));
    for (int i = range.begin; i < range.end; ++i) {
      stands[static_cast<std::size_t>(i - range.begin)] = StandsAt(i, rest);
    }
    const std::vector<FrameRange> runs = Runs(stands, range.begin);
    if (runs.empty()) return;
    int end = range.begin;
    for (const FrameRange& run : runs) {
      found_.push_back({run, rest[FootPaths::kBall]});
      if (ComesToRest({end, run.begin})) Collect({end, run.begin});
      end = run.end;
    }
    if (ComesToRest({end, range.end})) Collect({end, range.end});
  }

  // Merges contacts at one height or place that are separated by short gaps. Inserts a gap between
  // contacts that follow each other without one.
  void Join() {
    std::vector<Contact> joined;
    for (Contact& contact : found_) {
      if (!joined.empty() && contact.frames.begin - joined.back().frames.end < gap_min_) {
        Contact& last = joined.back();
        const double rise = std::fabs(contact.ball_height_m - last.ball_height_m);
        const bool lands = std::min(last.frames.size(), contact.frames.size()) < landing_max_ &&
                           rise < kHeelStrikeM &&
                           foot_.OnOnePlace(last.frames.end - 1, contact.frames.begin);
        if (rise < kSameHeightM || lands) {
          last.frames.end = contact.frames.end;
          continue;
        }
        Separate(last.frames, contact.frames);
      }
      if (contact.frames.size() > 0) joined.push_back(contact);
    }
    found_ = std::move(joined);
  }

  // Moves the ends of two contacts at different heights to the moments at which the foot leaves its
  // rest and comes to rest again.
  void Separate(FrameRange& before, FrameRange& after) const {
    const double fast_before = RestSpeed(before);
    const double fast_after = RestSpeed(after);
    while (before.size() > 1 &&
           foot_.slowest_m_s[static_cast<std::size_t>(before.end - 1)] > fast_before) {
      --before.end;
    }
    while (after.size() > 1 &&
           foot_.slowest_m_s[static_cast<std::size_t>(after.begin)] > fast_after) {
      ++after.begin;
    }
    if (before.end == after.begin) ++after.begin;
  }

  const FootPaths& foot_;
  const ContactOptions& options_;
  double gap_min_;
  double contact_min_;
  double landing_max_;
  std::vector<Contact> found_;
};

}  // namespace

std::vector<Contact> FindRests(const FootPaths& foot, double fps, const ContactOptions& options) {
  return RestFinder(foot, fps, options).Find();
}

}  // namespace stridewire
