#include "offline/extract/contacts.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "offline/base/statistics.h"
#include "offline/extract/foot_paths.h"
#include "offline/extract/foot_rest.h"
#include "offline/extract/support.h"

namespace stridewire {
namespace {

// The resting height of a ball is measured only if the ball rests for at least this time.
constexpr double kBallStillMinS = 0.03;
// If both feet are off the ground for less than this, the figure is not jumping.
constexpr double kFlightMinS = 0.15;
// A contact that is shorter than this may be a moment at which a foot stops while it rolls off.
constexpr double kRollOffMaxS = 0.2;

// Returns the height of the resting ball: the lower quartile over the frames in which the ball
// hardly moves. If there are too few such frames, for example because a recording ends while only
// the heel is on the ground, returns an estimate. The estimate is the lower of two quartiles: that
// of the ball's height over all frames, and that of the height that the ball would have if the foot
// below the ankle were flat.
double RestingBallHeight(const FootPaths& foot, const FrameRange& frames, double fps) {
  std::vector<double> still;
  std::vector<double> ball;
  std::vector<double> below_ankle;
  for (int i = frames.begin; i < frames.end; ++i) {
    const double height = foot.Height(FootPaths::kBall, i);
    ball.push_back(height);
    below_ankle.push_back(foot.Height(FootPaths::kAnkle, i) -
                          foot.flat_height_m[FootPaths::kAnkle]);
    if (foot.IsSlower(FootPaths::kBall, i, kAtRestM_s)) still.push_back(height);
  }
  if (!still.empty() && static_cast<double>(still.size()) >= kBallStillMinS * fps) {
    return Percentile(std::move(still), 25.0);
  }
  return std::min(Percentile(std::move(ball), 25.0), Percentile(std::move(below_ankle), 25.0));
}

// Closes gaps in the contacts of a foot while the other foot swings, because the figure must then
// stand on this foot.
class ContactBridge {
 public:
  ContactBridge(const FootPaths& foot, double fps, const ContactOptions& options)
      : foot_(foot), fps_(fps), speed_max_m_s_(options.speed_max_m_s) {}

  // Extends each contact while the foot stays slow and in place and the other foot swings.
  void Extend(const std::vector<char>& other_swings, std::vector<Contact>& contacts) const {
    const int count = static_cast<int>(other_swings.size());
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      FrameRange& frames = contacts[k].frames;
      const int last = k + 1 < contacts.size() ? contacts[k + 1].frames.begin - 1 : count;
      const int first = k > 0 ? contacts[k - 1].frames.end + 1 : 0;
      const int end = frames.end - 1;
      while (frames.end < last && Carries(frames.end, end, other_swings)) ++frames.end;
      const int begin = frames.begin;
      while (frames.begin > first && Carries(frames.begin - 1, begin, other_swings)) {
        --frames.begin;
      }
    }
  }

  // Merges successive contacts at one place if the foot stays slow between them. In addition,
  // either the other foot must swing, or one of the contacts must be so short that the foot was
  // rolling off.
  void Join(const std::vector<char>& other_swings, std::vector<Contact>& contacts) const {
    std::vector<Contact> joined;
    for (const Contact& contact : contacts) {
      if (!joined.empty() && AreOne(joined.back().frames, contact.frames, other_swings)) {
        joined.back().frames.end = contact.frames.end;
      } else {
        joined.push_back(contact);
      }
    }
    contacts = std::move(joined);
  }

 private:
  [[nodiscard]] bool IsSlow(int frame) const {
    return foot_.slowest_m_s[static_cast<std::size_t>(frame)] < speed_max_m_s_;
  }

  [[nodiscard]] bool Carries(int frame, int edge, const std::vector<char>& other_swings) const {
    return other_swings[static_cast<std::size_t>(frame)] != 0 && IsSlow(frame) &&
           foot_.OnOnePlace(frame, edge);
  }

  [[nodiscard]] bool AreOne(const FrameRange& before, const FrameRange& after,
                            const std::vector<char>& other_swings) const {
    if (!foot_.OnOnePlace(before.end - 1, after.begin)) return false;
    bool alone = true;
    for (int i = before.end; i < after.begin; ++i) {
      if (!IsSlow(i)) return false;
      if (!other_swings[static_cast<std::size_t>(i)]) alone = false;
    }
    return alone || std::min(before.size(), after.size()) < kRollOffMaxS * fps_;
  }

  const FootPaths& foot_;
  double fps_;
  double speed_max_m_s_;
};

// Returns one flag per frame. It is non-zero if the foot `other` is fast and does not stand, or if
// no foot stands for a time that is too short for a jump.
std::vector<char> OtherSwings(const FootPaths& other_foot, int other, double fps,
                              const FootContacts& contacts, const ContactOptions& options) {
  const int count = static_cast<int>(other_foot.slowest_m_s.size());
  const std::vector<char> stands = StandingFrames(contacts.feet[other], count);
  const std::vector<char> self_stands = StandingFrames(contacts.feet[1 - other], count);
  std::vector<char> swings(stands.size());
  int flight = 0;  // Number of frames, up to the current one, without a standing foot.
  for (int i = 0; i < count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    swings[k] = !stands[k] && other_foot.slowest_m_s[k] >= options.speed_max_m_s;
    flight = stands[k] || self_stands[k] ? 0 : flight + 1;
    const bool lands = i + 1 < count && (stands[k + 1] || self_stands[k + 1]);
    if (flight > 0 && lands && flight < kFlightMinS * fps) {
      std::fill_n(swings.begin() + i - flight + 1, flight, 1);
    }
  }
  return swings;
}

}  // namespace

std::vector<char> StandingFrames(const std::vector<Contact>& contacts, int frame_count) {
  std::vector<char> standing(static_cast<std::size_t>(frame_count), 0);
  for (const Contact& contact : contacts) {
    STRIDEWIRE_CHECK(contact.frames.begin >= 0 && contact.frames.end <= frame_count);
    std::fill(standing.begin() + contact.frames.begin, standing.begin() + contact.frames.end, 1);
  }
  return standing;
}

void MeasureBallHeights(const BodyTracks& tracks, const ContactOptions& options,
                        FootContacts& contacts) {
  for (int f = 0; f < 2; ++f) {
    const FootPaths foot = MakeFootPaths(tracks.feet[f], tracks.fps, options.smooth_s);
    for (Contact& contact : contacts.feet[f]) {
      STRIDEWIRE_CHECK(contact.frames.size() > 0 && contact.frames.end <= tracks.size());
      contact.ball_height_m = RestingBallHeight(foot, contact.frames, tracks.fps);
    }
  }
}

FootContacts FindContacts(const BodyTracks& tracks, const ContactOptions& options) {
  STRIDEWIRE_CHECK(tracks.fps > 0.0);
  const FootPaths feet[2] = {MakeFootPaths(tracks.feet[0], tracks.fps, options.smooth_s),
                             MakeFootPaths(tracks.feet[1], tracks.fps, options.smooth_s)};
  FootContacts contacts;
  for (int f = 0; f < 2; ++f) contacts.feet[f] = FindRests(feet[f], tracks.fps, options);
  MeasureBallHeights(tracks, options, contacts);
  RemoveUnsupported(tracks, options, contacts);
  // An extended contact may leave only a short gap to a contact of the other foot. The second round
  // closes that gap.
  for (int round = 0; round < 2; ++round) {
    const std::vector<char> others_swing[2] = {
        OtherSwings(feet[1], 1, tracks.fps, contacts, options),
        OtherSwings(feet[0], 0, tracks.fps, contacts, options)};
    for (int f = 0; f < 2; ++f) {
      const ContactBridge bridge(feet[f], tracks.fps, options);
      bridge.Join(others_swing[f], contacts.feet[f]);
      bridge.Extend(others_swing[f], contacts.feet[f]);
    }
  }
  MeasureBallHeights(tracks, options, contacts);
  return contacts;
}

}  // namespace stridewire
