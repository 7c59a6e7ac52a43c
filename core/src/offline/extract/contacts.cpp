#include "offline/extract/contacts.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "offline/base/statistics.h"

namespace stridewire {
namespace {

// Shorter contacts may be slow moments within swings and jumps.
constexpr double kLongContactS = 0.3;
constexpr double kFreeFallM_s2 = -5.0;  // A figure whose pelvis accelerates like this is falling.
// A ball that moves slower than this belongs to a flat foot.
constexpr double kBallAtRestM_s = 0.3;

using Flags = std::vector<char>;

std::vector<FrameRange> Runs(const Flags& flags) {
  std::vector<FrameRange> runs;
  for (int i = 0; i < static_cast<int>(flags.size()); ++i) {
    if (!flags[static_cast<std::size_t>(i)]) continue;
    if (runs.empty() || runs.back().end != i) runs.push_back({i, i});
    runs.back().end = i + 1;
  }
  return runs;
}

std::vector<double> Heights(const std::vector<DVec3>& path) {
  std::vector<double> heights;
  heights.reserve(path.size());
  for (const DVec3& point : path) heights.push_back(point.y);
  return heights;
}

// Returns the frames at which any of the three points is slow and, if `use_height`, low. Fills
// short gaps and drops short contacts.
std::vector<FrameRange> StandingRuns(const BodyTracks::FootTrajectory& track, double fps,
                                     bool use_height, const ContactOptions& options) {
  Flags standing(track.ball_m.size(), 0);
  const int window = static_cast<int>(std::lround(options.smooth_s * fps));
  for (const auto* points : {&track.ankle_m, &track.ball_m, &track.toe_tip_m}) {
    const std::vector<DVec3> path = SmoothPath(*points, window);
    const std::vector<double> speed = PathSpeed(path, fps);
    const double low = Percentile(Heights(path), options.resting_percentile) + options.height_max_m;
    for (std::size_t i = 0; i < path.size(); ++i) {
      if (speed[i] < options.speed_max_m_s && (!use_height || path[i].y < low)) standing[i] = 1;
    }
  }
  std::vector<FrameRange> merged;
  for (const FrameRange& run : Runs(standing)) {
    if (!merged.empty() && (run.begin - merged.back().end) < options.gap_min_s * fps) {
      merged.back().end = run.end;
    } else {
      merged.push_back(run);
    }
  }
  std::erase_if(merged,
                [&](const FrameRange& r) { return r.size() < options.contact_min_s * fps; });
  return merged;
}

// Returns the mean vertical acceleration of the pelvis over some frames, from the second difference
// of the mean heights of thirds.
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

// Returns the lower quartile of the height of the ball while it rests, or over all frames if it
// never rests.
double RestingBallHeight(const BodyTracks::FootTrajectory& track,
                         const std::vector<double>& ball_speed, const FrameRange& frames) {
  std::vector<double> still;
  std::vector<double> all;
  for (int i = frames.begin; i < frames.end; ++i) {
    const auto k = static_cast<std::size_t>(i);
    all.push_back(track.ball_m[k].y);
    if (ball_speed[k] < kBallAtRestM_s) still.push_back(track.ball_m[k].y);
  }
  return Percentile(still.empty() ? std::move(all) : std::move(still), 25.0);
}

std::vector<double> BallSpeed(const BodyTracks::FootTrajectory& track, double fps,
                              const ContactOptions& options) {
  const int window = static_cast<int>(std::lround(options.smooth_s * fps));
  return PathSpeed(SmoothPath(track.ball_m, window), fps);
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
    const std::vector<double> speed = BallSpeed(tracks.feet[f], tracks.fps, options);
    for (Contact& contact : contacts.feet[f]) {
      STRIDEWIRE_CHECK(contact.frames.size() > 0 && contact.frames.end <= tracks.size());
      contact.ball_height_m = RestingBallHeight(tracks.feet[f], speed, contact.frames);
    }
  }
}

FootContacts FindContacts(const BodyTracks& tracks, const ContactOptions& options) {
  STRIDEWIRE_CHECK(tracks.fps > 0.0);
  FootContacts contacts;
  std::vector<FrameRange> by_speed[2];
  for (int f = 0; f < 2; ++f) {
    const BodyTracks::FootTrajectory& track = tracks.feet[f];
    const std::vector<double> ball_speed = BallSpeed(track, tracks.fps, options);
    by_speed[f] = StandingRuns(track, tracks.fps, false, options);
    double lowest = 1e9;
    double highest = -1e9;
    for (const FrameRange& run : by_speed[f]) {
      if (run.size() < kLongContactS * tracks.fps) continue;
      const double height = RestingBallHeight(track, ball_speed, run);
      lowest = std::min(lowest, height);
      highest = std::max(highest, height);
    }
    if (highest - lowest > options.raised_floor_m) contacts.single_floor = false;
  }
  for (int f = 0; f < 2; ++f) {
    const BodyTracks::FootTrajectory& track = tracks.feet[f];
    std::vector<FrameRange> runs = contacts.single_floor
                                       ? StandingRuns(track, tracks.fps, true, options)
                                       : std::move(by_speed[f]);
    for (const FrameRange& run : runs) {
      if (!contacts.single_floor && run.size() < kLongContactS * tracks.fps &&
          VerticalAcceleration(tracks, run) < kFreeFallM_s2) {
        continue;
      }
      contacts.feet[f].push_back({run, 0.0});
    }
  }
  MeasureBallHeights(tracks, options, contacts);
  return contacts;
}

}  // namespace stridewire
