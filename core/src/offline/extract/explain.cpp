#include "offline/extract/explain.h"

#include <algorithm>

#include "offline/base/statistics.h"
#include "offline/base/text.h"
#include "offline/extract/posture.h"
#include "offline/extract/segment_jumps.h"

namespace stridewire {
namespace {

constexpr double kShortS = 0.5;  // Steps and jumps take at least this time.
// A point rests if its path extends over at most this distance.
constexpr double kNothingMovesM = 0.01;
constexpr double kMostlyShare = 0.5;
constexpr double kRunSpeed_m_s = 1.8;

// Returns the longest side of the box around a path.
double Extent(const std::vector<DVec3>& path) {
  DVec3 low = path.front();
  DVec3 high = low;
  for (const DVec3& point : path) {
    low = glm::min(low, point);
    high = glm::max(high, point);
  }
  const DVec3 size = high - low;
  return std::max({size.x, size.y, size.z});
}

bool NothingMoves(const BodyTracks& tracks) {
  return Extent(tracks.pelvis_m) < kNothingMovesM &&
         Extent(tracks.feet[0].ball_m) < kNothingMovesM &&
         Extent(tracks.feet[1].ball_m) < kNothingMovesM &&
         (tracks.trunk_m.empty() || Extent(tracks.trunk_m) < kNothingMovesM);
}

double MedianPelvisHeight(const BodyTracks& tracks) {
  std::vector<double> heights;
  for (int i = 0; i < tracks.size(); ++i) heights.push_back(PelvisHeight(tracks, i));
  return Median(std::move(heights));
}

double LyingShare(const BodyTracks& tracks) {
  int lying = 0;
  for (int i = 0; i < tracks.size(); ++i) lying += LiesOrCrawls(tracks, i) ? 1 : 0;
  return static_cast<double>(lying) / tracks.size();
}

// Returns a sentence if the figure runs. Otherwise, returns an empty string.
std::string DescribeRun(const BodyTracks& tracks, const FootContacts& contacts) {
  std::vector<double> flights_s;
  for (const FrameRange& flight : FlightRanges(tracks, contacts)) {
    if (IsRun(tracks, contacts, flight)) flights_s.push_back(flight.size() / tracks.fps);
  }
  if (!flights_s.empty()) {
    return Text(
        "this is a run (both feet off the ground for about %.2f s in each stride); running "
        "steps are not supported yet",
        Median(std::move(flights_s)));
  }
  const double speed = Median(tracks.pelvis_speed_m_s);
  if (speed > kRunSpeed_m_s && contacts.feet[0].size() + contacts.feet[1].size() < 3) {
    return Text(
        "this is probably a run (%.1f m/s, and the feet hardly stand still); running steps "
        "are not supported yet",
        speed);
  }
  return {};
}

bool NeverLeavesTheGround(const std::vector<Contact>& contacts, int frame_count) {
  return contacts.size() == 1 && contacts[0].frames == FrameRange{0, frame_count};
}

std::string DescribeFeet(const BodyTracks& tracks, const FootContacts& contacts) {
  const bool left_stays = NeverLeavesTheGround(contacts.feet[0], tracks.size());
  const bool right_stays = NeverLeavesTheGround(contacts.feet[1], tracks.size());
  if (left_stays && right_stays) return "the feet never leave the floor, so there is no step";
  if (left_stays || right_stays) {
    return Text(
        "the %s foot never leaves the floor, and the other foot does not step to another "
        "place between two moments with both feet standing",
        left_stays ? "left" : "right");
  }
  if (contacts.feet[0].empty() && contacts.feet[1].empty()) {
    return "the feet never stand still on the ground; check that the file contains the motion of "
           "the root, and that --fps, --unit-m and --up are right";
  }
  if (contacts.feet[0].empty() || contacts.feet[1].empty()) {
    return Text(
        "the %s foot never stands still on the ground; a step needs both feet to stand "
        "before and after it",
        contacts.feet[0].empty() ? "left" : "right");
  }
  return "no foot is lifted, moved and set down again between two moments with both feet standing; "
         "record a little more before and after the steps";
}

}  // namespace

std::string ExplainNoMovement(const BodyTracks& tracks, const FootContacts& contacts,
                              bool has_rejections) {
  const int count = tracks.size();
  const double seconds = count / tracks.fps;
  if (count < 2) return "the capture has only one usable frame; steps and jumps need motion";
  if (LyingShare(tracks) > kMostlyShare) {
    return Text(
        "the figure lies or crawls: its pelvis is only %.2f m above its feet and its trunk "
        "is nearly horizontal. Steps and jumps need a standing figure; if it should "
        "stand, set --up",
        MedianPelvisHeight(tracks));
  }
  if (NothingMoves(tracks)) {
    return "nothing moves: the pelvis and both feet stay within 1 cm; use a capture with steps or "
           "jumps";
  }
  if (seconds < kShortS) {
    return Text(
        "the capture lasts only %.2f s; a step with both feet standing before and after it "
        "takes at least half a second. If the frame rate is wrong, set --fps",
        seconds);
  }
  if (MedianPelvisHeight(tracks) < 0.0) {
    return "the feet are above the pelvis; if the figure should stand, set --up";
  }
  if (std::string run = DescribeRun(tracks, contacts); !run.empty()) return run;
  return has_rejections ? std::string() : DescribeFeet(tracks, contacts);
}

}  // namespace stridewire
