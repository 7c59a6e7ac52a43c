#include "offline/extract/segment_jumps.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "offline/base/text.h"

// pelvis height      ____                 .-.
//                        \               /   \              ____
//                         \             /     \            /
//                          `--.      __/       \__      .-'
//                              `----'             `----'
//                    start   crouch  toe-off landing absorb end

namespace stridewire {
namespace {

// Acceleration of a falling pelvis. In captured jumps it is -9.5 to -11.8 m/s^2, since arms and
// legs swing. For a figure that hangs on a bar it is near 0.
constexpr double kFallMin_m_s2 = -15.0;
constexpr double kFallMax_m_s2 = -5.0;
constexpr double kGravity_m_s2 = -9.81;
constexpr double kGravityDoubt_m_s2 = 1.5;
constexpr double kPastLowestM = 0.03;   // The lowest point is past if the pelvis rose this much.
constexpr double kNextCrouchM = 0.05;   // The next crouch has begun if it sank this much again.
constexpr double kUprightShare = 0.6;   // The figure stands if this share of the crouch is undone.
constexpr double kNearlyStill = 2.5;    // Largest speed of a standing figure, times still_m_s.
constexpr double kUnsettledMinS = 0.1;  // Shortest usable support after landing.

double FlightAcceleration(const BodyTracks& tracks, const FrameRange& flight) {
  const int n = flight.size();
  if (n < 4) return 0.0;
  Eigen::MatrixXd a(n, 3);
  Eigen::VectorXd y(n);
  for (int i = 0; i < n; ++i) {
    const double t = i / tracks.fps;
    a.row(i) << 1.0, t, t * t;
    y(i) = tracks.pelvis_m[static_cast<std::size_t>(flight.begin + i)].y;
  }
  return 2.0 * a.colPivHouseholderQr().solve(y)(2);
}

struct Standing {
  int lowest = 0;
  int still = 0;
  double speed_m_s = 0.0;  // Speed at `still`.
};

// Searches from an edge of the flight away from it (direction -1: before, +1: after) up to `last`
// for the lowest point of the pelvis, and then for the first moment when it is still and upright.
Standing FindStanding(const BodyTracks& tracks, int edge, int direction, int last,
                      double still_m_s) {
  const auto height = [&](int i) { return tracks.pelvis_m[static_cast<std::size_t>(i)].y; };
  Standing standing;
  standing.lowest = edge;
  int i = edge;
  for (; i != last + direction; i += direction) {
    if (height(i) < height(standing.lowest)) standing.lowest = i;
    if (height(i) > height(standing.lowest) + kPastLowestM && i != edge &&
        standing.lowest != edge) {
      break;
    }
  }
  // Stops where the pelvis sinks again, which is the crouch of another jump.
  double highest = height(standing.lowest);
  for (int k = standing.lowest; k != last + direction; k += direction) {
    highest = std::max(highest, height(k));
    if (height(k) < highest - kNextCrouchM) {
      last = k;
      break;
    }
  }
  const double upright =
      height(standing.lowest) + kUprightShare * (highest - height(standing.lowest));
  standing.still = last;
  standing.speed_m_s = 1e9;
  for (int k = standing.lowest; k != last + direction; k += direction) {
    const double speed = tracks.pelvis_speed_m_s[static_cast<std::size_t>(k)];
    if (height(k) < upright) continue;
    if (speed < standing.speed_m_s) {
      standing.speed_m_s = speed;
      standing.still = k;
    }
    if (speed < still_m_s) break;
  }
  return standing;
}

}  // namespace

std::vector<FrameRange> FlightRanges(const BodyTracks& tracks, const FootContacts& contacts) {
  std::vector<char> standing(static_cast<std::size_t>(tracks.size()), 0);
  for (const auto& foot : contacts.feet) {
    for (const Contact& contact : foot) {
      std::fill(standing.begin() + contact.frames.begin, standing.begin() + contact.frames.end, 1);
    }
  }
  std::vector<FrameRange> flights;
  int begin = -1;
  for (int i = 1; i < tracks.size(); ++i) {
    const bool now = standing[static_cast<std::size_t>(i)] != 0;
    const bool before = standing[static_cast<std::size_t>(i) - 1] != 0;
    if (before && !now) begin = i;
    if (!before && now && begin > 0) flights.push_back({begin, i});
  }
  return flights;
}

JumpFinding FindJump(const BodyTracks& tracks, const FootContacts& contacts,
                     const FrameRange& flight, const SegmentOptions& options) {
  const double seconds = flight.size() / tracks.fps;
  if (seconds < options.flight_min_s) {
    return {{}, Text("both feet off the ground for %.2f s", seconds)};
  }
  const double acceleration = FlightAcceleration(tracks, flight);
  if (acceleration < kFallMin_m_s2 || acceleration > kFallMax_m_s2) {
    for (const double factor : {2.0, 4.0}) {
      const double true_acceleration = acceleration * factor * factor;
      if (std::fabs(true_acceleration - kGravity_m_s2) < kGravityDoubt_m_s2) {
        return {{},
                Text("both feet off the ground, falling as if recorded at %.0f frames/s",
                     factor * tracks.fps)};
      }
    }
    return {
        {},
        Text("both feet off the ground but not falling (%.1f m/s^2): something holds the figure",
             acceleration),
        true};
  }
  if (seconds > options.flight_max_s) return {{}, Text("in the air for %.1f s", seconds)};
  // Both feet must leave the ground together and land together.
  JumpSegment jump;
  int support_begin = 0;
  int support_end = tracks.size();
  for (int f = 0; f < 2; ++f) {
    const std::vector<Contact>& own = contacts.feet[f];
    const Contact* before = nullptr;
    const Contact* after = nullptr;
    for (const Contact& contact : own) {
      if (contact.frames.end <= flight.begin) before = &contact;
      if (contact.frames.begin >= flight.end && after == nullptr) after = &contact;
    }
    const double apart = options.feet_apart_max_s * tracks.fps;
    if (before == nullptr || flight.begin - before->frames.end > apart) {
      return {{}, "the feet do not leave the ground together"};
    }
    if (after == nullptr || after->frames.begin - flight.end > apart) {
      return {{}, "the feet do not land together"};
    }
    support_begin = std::max(support_begin, before->frames.begin);
    support_end = std::min(support_end, after->frames.end);
    jump.before_contact[f] = static_cast<int>(before - own.data());
    jump.after_contact[f] = static_cast<int>(after - own.data());
  }
  jump.toe_off = flight.begin;
  jump.landing = flight.end;
  const Standing from = FindStanding(tracks, flight.begin, -1, support_begin, options.still_m_s);
  const Standing to = FindStanding(tracks, flight.end, +1, support_end - 1, options.still_m_s);
  if (from.speed_m_s > kNearlyStill * options.still_m_s) {
    return {{}, Text("a leap without standing before it (%.2f m/s)", from.speed_m_s)};
  }
  if (support_end - flight.end < kUnsettledMinS * tracks.fps || to.lowest >= support_end - 1) {
    return {{}, "the recording or the landing ends too early"};
  }
  jump.settled = to.speed_m_s <= kNearlyStill * options.still_m_s;
  jump.start = from.still;
  jump.crouch = from.lowest;
  jump.absorb = to.lowest;
  jump.end = jump.settled ? to.still : support_end - 1;
  if (!(jump.start < jump.crouch && jump.crouch < jump.toe_off && jump.landing < jump.absorb &&
        jump.absorb < jump.end)) {
    return {{}, "a jump without a crouch before or after it"};
  }
  return {jump, {}};
}

}  // namespace stridewire
