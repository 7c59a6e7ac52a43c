#include "offline/extract/segment_jumps.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "offline/base/horizontal_distance.h"
#include "offline/base/text.h"

// pelvis height      ____                 .-.
//                        \               /   \              ____
//                         \             /     \            /
//                          `--.      __/       \__      .-'
//                              `----'             `----'
//                    start   crouch  toe-off landing absorb end

namespace stridewire {
namespace {

// Range of the vertical acceleration of the pelvis in free fall. In captured jumps, the
// acceleration is -11.8 to -9.5 m/s^2, because arms and legs swing. For a figure that hangs on a
// bar, it is near 0.
constexpr double kFallMin_m_s2 = -15.0;
constexpr double kFallMax_m_s2 = -5.0;
constexpr double kGravity_m_s2 = -9.81;
// If the pelvis follows a parabola, but not with the acceleration of a free fall, the frame rate is
// probably wrong. The parabola must be at least kArchMinM high. Deviations must be below
// kArchResidualShare of its height.
constexpr double kArchMinM = 0.02;
constexpr double kArchResidualShare = 0.05;
// A figure that hangs by its arms swings at most this fast and has raised its feet at least this
// far.
constexpr double kHangMax_m_s = 1.5;
constexpr double kHangRiseM = 0.03;
// A runner moves at least this fast and is in the air for at least this time.
constexpr double kRunMin_m_s = 1.0;
constexpr double kRunFlightMinS = 0.04;
// The other foot of a runner leaves the ground at least this time before the flight.
constexpr double kRunFeetApartS = 0.1;
// If the pelvis has risen by this much, it has passed its lowest point.
constexpr double kPastLowestM = 0.03;
// If the pelvis then descends by this much, the next crouch begins.
constexpr double kNextCrouchM = 0.05;
// A standing figure has risen from the crouch by at least this fraction of its depth.
constexpr double kUprightShare = 0.6;
// A standing figure may move at up to this many times still_m_s.
constexpr double kNearlyStill = 2.5;
constexpr double kUnsettledMinS = 0.1;  // Minimum duration of a usable support after landing.

// A parabola through the heights of the pelvis.
struct Fall {
  double acceleration_m_s2 = 0.0;
  double residual_m = 0.0;  // Root mean square deviation from the parabola.
};

Fall FitFall(const BodyTracks& tracks, const FrameRange& flight) {
  const int n = flight.size();
  if (n < 4) return {};
  Eigen::MatrixXd a(n, 3);
  Eigen::VectorXd y(n);
  for (int i = 0; i < n; ++i) {
    const double t = i / tracks.fps;
    a.row(i) << 1.0, t, t * t;
    y(i) = tracks.pelvis_m[static_cast<std::size_t>(flight.begin + i)].y;
  }
  const Eigen::VectorXd fit = a.colPivHouseholderQr().solve(y);
  return {2.0 * fit(2), (a * fit - y).norm() / std::sqrt(static_cast<double>(n))};
}

// Returns a common frame rate if one is within 3 % of the measured rate. Otherwise, returns the
// rounded rate.
double PlausibleRate(double fps) {
  for (const double usual : {24.0, 25.0, 30.0, 50.0, 60.0, 90.0, 100.0, 120.0, 200.0, 240.0}) {
    if (std::fabs(fps - usual) < 0.03 * usual) return usual;
  }
  return std::round(fps);
}

// Returns the mean horizontal speed of the pelvis.
double TravelSpeed(const BodyTracks& tracks, const FrameRange& flight) {
  const DVec3& from = tracks.pelvis_m[static_cast<std::size_t>(flight.begin)];
  const DVec3& to = tracks.pelvis_m[static_cast<std::size_t>(flight.end)];
  return HorizontalDistance(from, to) * tracks.fps / flight.size();
}

bool IsFreeFall(double acceleration_m_s2) {
  return acceleration_m_s2 >= kFallMin_m_s2 && acceleration_m_s2 <= kFallMax_m_s2;
}

struct Standing {
  int lowest = 0;
  int still = 0;
  double speed_m_s = 0.0;  // Speed of the pelvis in frame `still`.
};

// Searches from an edge of the flight away from it (direction -1: before, +1: after), up to `last`.
// First finds the lowest point of the pelvis, and then the first frame in which it is still and
// upright.
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
  // Stops where the pelvis descends again, because another jump begins there.
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

// Returns true if both feet are higher during a flight than before and after it.
bool FeetRise(const BodyTracks& tracks, const FrameRange& flight) {
  const auto lower_foot = [&](int frame) {
    const auto i = static_cast<std::size_t>(frame);
    return std::min(tracks.feet[0].ball_m[i].y, tracks.feet[1].ball_m[i].y);
  };
  const double ground = std::max(lower_foot(flight.begin), lower_foot(flight.end));
  for (int i = flight.begin; i < flight.end; ++i) {
    if (lower_foot(i) > ground + kHangRiseM) return true;
  }
  return false;
}

// Describes a flight in which the acceleration of the pelvis is not that of gravity.
JumpFinding WrongFall(const Fall& fall, const FrameRange& flight, const BodyTracks& tracks) {
  const double seconds = flight.size() / tracks.fps;
  const double fall_m_s2 = -fall.acceleration_m_s2;
  const double arch_m = fall_m_s2 * seconds * seconds / 8.0;
  if (arch_m > kArchMinM && fall.residual_m < kArchResidualShare * arch_m) {
    const double rate = PlausibleRate(tracks.fps * std::sqrt(-kGravity_m_s2 / fall_m_s2));
    return {{},
            Text("falls at about %.*f m/s^2 instead of 9.81, as if recorded at about %.0f frames "
                 "per second (the file says %.0f): set --fps %.0f",
                 fall_m_s2 < 3.0 ? 1 : 0, fall_m_s2, rate, tracks.fps, rate)};
  }
  if (TravelSpeed(tracks, flight) > kHangMax_m_s || !FeetRise(tracks, flight)) {
    return {{},
            Text("no foot stands still for %.2f s, but the figure does not fall either "
                 "(%.1f m/s^2): the feet slide",
                 seconds, fall.acceleration_m_s2)};
  }
  return {{},
          Text("both feet off the ground but not falling (%.1f m/s^2): something holds the figure",
               fall.acceleration_m_s2),
          true};
}

}  // namespace

std::vector<FrameRange> FlightRanges(const BodyTracks& tracks, const FootContacts& contacts) {
  const std::vector<char> left = StandingFrames(contacts.feet[0], tracks.size());
  const std::vector<char> right = StandingFrames(contacts.feet[1], tracks.size());
  const auto stands = [&](int i) {
    return left[static_cast<std::size_t>(i)] != 0 || right[static_cast<std::size_t>(i)] != 0;
  };
  std::vector<FrameRange> flights;
  int begin = -1;
  for (int i = 1; i < tracks.size(); ++i) {
    if (stands(i - 1) && !stands(i)) begin = i;
    if (!stands(i - 1) && stands(i) && begin > 0) flights.push_back({begin, i});
  }
  return flights;
}

bool FallsFreely(const BodyTracks& tracks, const FrameRange& flight) {
  return IsFreeFall(FitFall(tracks, flight).acceleration_m_s2);
}

bool IsRun(const BodyTracks& tracks, const FootContacts& contacts, const FrameRange& flight) {
  // The true duration of a flight of n frames may be half a frame longer.
  if (flight.size() + 0.5 < kRunFlightMinS * tracks.fps) return false;
  if (TravelSpeed(tracks, flight) < kRunMin_m_s) return false;
  // A foot takes part in the take-off if it stands shortly before the flight.
  const double apart = kRunFeetApartS * tracks.fps;
  bool takes_off[2] = {false, false};
  bool lands[2] = {false, false};
  for (int f = 0; f < 2; ++f) {
    for (const Contact& contact : contacts.feet[f]) {
      const FrameRange& frames = contact.frames;
      if (frames.end <= flight.begin && flight.begin - frames.end < apart) takes_off[f] = true;
      if (frames.begin >= flight.end && frames.begin - flight.end < apart) lands[f] = true;
    }
  }
  return takes_off[0] != takes_off[1] && lands[0] != lands[1] && takes_off[0] != lands[0];
}

JumpFinding FindJump(const BodyTracks& tracks, const FootContacts& contacts,
                     const FrameRange& flight, const SegmentOptions& options) {
  STRIDEWIRE_CHECK(flight.begin > 0 && flight.size() > 0 && flight.end < tracks.size());
  const double seconds = flight.size() / tracks.fps;
  if (IsRun(tracks, contacts, flight)) {
    return {{}, Text("this is a run: both feet off the ground for %.2f s", seconds)};
  }
  if (seconds < options.flight_min_s) {
    return {{}, Text("both feet off the ground for %.2f s", seconds)};
  }
  const Fall fall = FitFall(tracks, flight);
  if (!IsFreeFall(fall.acceleration_m_s2)) return WrongFall(fall, flight, tracks);
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
      return {{}, "a leap from one foot: the feet do not leave the ground together"};
    }
    if (after == nullptr || after->frames.begin - flight.end > apart) {
      return {{}, "a leap to one foot: the feet do not land together"};
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
    return {{}, Text("the jump does not start from standing (%.2f m/s)", from.speed_m_s)};
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
    return {{}, "the jump has no crouch before or after it"};
  }
  return {jump, {}};
}

}  // namespace stridewire
