#include "offline/extract/support.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "offline/base/horizontal_distance.h"
#include "offline/base/statistics.h"
#include "offline/extract/foot_paths.h"
#include "offline/extract/segment_jumps.h"

namespace stridewire {
namespace {

// Shorter contacts may be slow moments within swings and jumps.
constexpr double kLongContactS = 0.3;
// If the vertical acceleration of the pelvis is below this, the figure is falling.
constexpr double kFreeFallM_s2 = -5.0;
// The pelvis of a standing figure is above the foot by at least this fraction of the leg length.
constexpr double kPelvisAboveShare = 0.3;
// The other foot may be this much lower while it swings past the standing foot.
constexpr double kSwingBelowM = 0.03;
// Minimum time for which a foot must carry the figure alone, or be as low as the other foot.
constexpr double kAloneMinS = 0.05;
// A foot counts as being as low as the other one if it is at most this much higher.
constexpr double kAsLowM = 0.05;
// A higher foot carries weight if it is still for kLoadMinS and if the pelvis is at least
// kLoadShare of the way from the lower to the higher foot.
constexpr double kLoadMinS = 0.1;
constexpr double kLoadShare = 0.35;
constexpr double kStandingStillM_s = 0.15;
// In shorter flights, the acceleration of the pelvis is only noise.
constexpr double kHeldMinS = 0.1;
// If the feet are closer than this, the pelvis does not indicate which one carries the weight.
constexpr double kFeetApartMinM = 0.3;

// Returns the mean vertical acceleration of the pelvis over a range of frames. It is the second
// difference of the mean heights in the three thirds of the range, which reduces noise.
double VerticalAcceleration(const BodyTracks& tracks, const FrameRange& range) {
  const int third = std::max(1, range.size() / 3);
  if (range.size() < 3 * third) return 0.0;
  const auto mean = [&](int begin) {
    double sum = 0.0;
    for (int i = begin; i < begin + third; ++i)
      sum += tracks.pelvis_m[static_cast<std::size_t>(i)].y;
    return sum / third;
  };
  const double dt = third / tracks.fps;
  return (mean(range.begin) - 2.0 * mean(range.begin + third) + mean(range.begin + 2 * third)) /
         (dt * dt);
}

class SupportCheck {
 public:
  SupportCheck(const BodyTracks& tracks, const FootPaths (&feet)[2],
               const std::vector<char> (&standing)[2])
      : tracks_(tracks), feet_(feet), standing_(standing) {}

  [[nodiscard]] bool IsSupported(int foot, const Contact& contact) const {
    return PelvisIsAbove(contact) && !Falls(contact.frames) &&
           (StandsAlone(foot, contact) || IsAsLow(foot, contact) || CarriesWeight(foot, contact));
  }

 private:
  [[nodiscard]] bool PelvisIsAbove(const Contact& contact) const {
    std::vector<double> heights;
    for (int i = contact.frames.begin; i < contact.frames.end; ++i) {
      heights.push_back(tracks_.pelvis_m[static_cast<std::size_t>(i)].y);
    }
    return Median(std::move(heights)) - contact.ball_height_m >
           kPelvisAboveShare * tracks_.leg_length_m;
  }

  [[nodiscard]] bool Falls(const FrameRange& frames) const {
    return frames.size() < kLongContactS * tracks_.fps &&
           VerticalAcceleration(tracks_, frames) < kFreeFallM_s2;
  }

  [[nodiscard]] bool StandsAlone(int foot, const Contact& contact) const {
    const FootPaths& other = feet_[1 - foot];
    int alone = 0;
    for (int i = contact.frames.begin; i < contact.frames.end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (!standing_[1 - foot][k] &&
          other.Height(FootPaths::kBall, i) > contact.ball_height_m - kSwingBelowM) {
        ++alone;
      }
    }
    return alone >= kAloneMinS * tracks_.fps;
  }

  [[nodiscard]] bool IsAsLow(int foot, const Contact& contact) const {
    int as_low = 0;
    for (int i = contact.frames.begin; i < contact.frames.end; ++i) {
      const double other = feet_[1 - foot].Height(FootPaths::kBall, i);
      if (standing_[1 - foot][static_cast<std::size_t>(i)] &&
          contact.ball_height_m - other < kAsLowM) {
        ++as_low;
      }
    }
    return as_low >= kAloneMinS * tracks_.fps;
  }

  [[nodiscard]] bool CarriesWeight(int foot, const Contact& contact) const {
    int loaded = 0;
    for (int i = contact.frames.begin; i < contact.frames.end; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (feet_[foot].slowest_m_s[k] > kStandingStillM_s) continue;
      const DVec3& own = tracks_.feet[foot].ball_m[k];
      const DVec3& other = tracks_.feet[1 - foot].ball_m[k];
      const double apart = HorizontalDistance(own, other);
      if (apart < kFeetApartMinM) continue;
      const DVec3 to_pelvis = tracks_.pelvis_m[k] - other;
      const double along =
          (to_pelvis.x * (own.x - other.x) + to_pelvis.z * (own.z - other.z)) / apart;
      if (along > kLoadShare * apart) ++loaded;
    }
    return loaded >= kLoadMinS * tracks_.fps;
  }

  const BodyTracks& tracks_;
  const FootPaths (&feet_)[2];
  const std::vector<char> (&standing_)[2];
};

// A span of time in which at least one foot stands.
struct StandingSpan {
  FrameRange frames;
  double first_m = 0.0;   // Ball height of the first contact.
  double last_m = 0.0;    // Ball height of the contact that ends last.
  double lowest_m = 0.0;  // Minimum ball height of all contacts.
};

std::vector<StandingSpan> StandingSpans(const FootContacts& contacts) {
  std::vector<Contact> all = contacts.feet[0];
  all.insert(all.end(), contacts.feet[1].begin(), contacts.feet[1].end());
  std::ranges::sort(all, {}, [](const Contact& c) { return c.frames.begin; });
  std::vector<StandingSpan> spans;
  for (const Contact& contact : all) {
    const double height = contact.ball_height_m;
    if (spans.empty() || contact.frames.begin > spans.back().frames.end) {
      spans.push_back({contact.frames, height, height, height});
      continue;
    }
    StandingSpan& span = spans.back();
    span.lowest_m = std::min(span.lowest_m, height);
    if (contact.frames.end > span.frames.end) {
      span.frames.end = contact.frames.end;
      span.last_m = height;
    }
  }
  return spans;
}

// Returns true if the figure is in the air between two spans but does not fall freely, because
// something that was not captured carries it.
bool IsHeldBetween(const BodyTracks& tracks, const StandingSpan& from, const StandingSpan& to) {
  const FrameRange flight{from.frames.end, to.frames.begin};
  return flight.size() >= kHeldMinS * tracks.fps && !FallsFreely(tracks, flight);
}

// Removes contacts of feet that hang in the air. They are higher than the contacts before and after
// them, and the figure does not fall freely on the way there and back.
void RemoveHanging(const BodyTracks& tracks, FootContacts& contacts) {
  const std::vector<StandingSpan> spans = StandingSpans(contacts);
  for (std::size_t k = 1; k + 1 < spans.size(); ++k) {
    const StandingSpan& span = spans[k];
    const double ground = std::max(spans[k - 1].last_m, spans[k + 1].first_m);
    if (span.lowest_m < ground + kAsLowM || !IsHeldBetween(tracks, spans[k - 1], span) ||
        !IsHeldBetween(tracks, span, spans[k + 1])) {
      continue;
    }
    for (std::vector<Contact>& own : contacts.feet) {
      std::erase_if(own, [&](const Contact& c) { return span.frames.Contains(c.frames); });
    }
  }
}

}  // namespace

void RemoveUnsupported(const BodyTracks& tracks, const ContactOptions& options,
                       FootContacts& contacts) {
  const FootPaths feet[2] = {MakeFootPaths(tracks.feet[0], tracks.fps, options.smooth_s),
                             MakeFootPaths(tracks.feet[1], tracks.fps, options.smooth_s)};
  const std::vector<char> standing[2] = {StandingFrames(contacts.feet[0], tracks.size()),
                                         StandingFrames(contacts.feet[1], tracks.size())};
  const SupportCheck check(tracks, feet, standing);
  for (int f = 0; f < 2; ++f) {
    std::erase_if(contacts.feet[f],
                  [&](const Contact& contact) { return !check.IsSupported(f, contact); });
  }
  RemoveHanging(tracks, contacts);
}

}  // namespace stridewire
