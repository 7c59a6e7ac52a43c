#include "offline/extract/segment.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "offline/base/horizontal_distance.h"
#include "offline/base/statistics.h"
#include "offline/base/text.h"
#include "offline/extract/posture.h"
#include "offline/extract/segment_jumps.h"

namespace stridewire {
namespace {

constexpr double kHalfSupportDefaultS = 0.08;
// Minimum duration of half a double support. If it is shorter, the keytimes of toe-off and
// heel-strike are moved into the swing. Between keytimes that are closer, the grid of a library
// would be much finer than elsewhere, and blends would jerk there.
constexpr double kHalfSupportMinS = 0.02;
// If a recording begins or ends during a double support, at least this fraction of the usual half
// of a double support must be recorded.
constexpr double kHalfSupportMinShare = 0.5;

// A swing of a foot, with the contacts before and after it.
struct Swing {
  Foot moving = Foot::kLeft;
  const Contact* before = nullptr;  // Contacts of the moving foot.
  const Contact* after = nullptr;
  const Contact* fixed = nullptr;  // Contact of the other foot that contains the swing, or null.
  int before_index = 0;
  int fixed_index = -1;
  FrameRange frames;  // Frames in which the foot is off the ground.

  [[nodiscard]] int SupportBegin() const {
    return std::max(before->frames.begin, fixed->frames.begin);
  }
  [[nodiscard]] int SupportEnd() const { return std::min(after->frames.end, fixed->frames.end); }
};

std::vector<Swing> FindSwings(const FootContacts& contacts) {
  std::vector<Swing> swings;
  for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
    const std::vector<Contact>& own = contacts.foot(foot);
    for (std::size_t k = 0; k + 1 < own.size(); ++k) {
      Swing swing;
      swing.moving = foot;
      swing.before = &own[k];
      swing.after = &own[k + 1];
      swing.frames = {own[k].frames.end, own[k + 1].frames.begin};
      STRIDEWIRE_CHECK(swing.frames.size() > 0);
      swing.before_index = static_cast<int>(k);
      const std::vector<Contact>& others = contacts.foot(OtherFoot(foot));
      for (std::size_t o = 0; o < others.size(); ++o) {
        if (!others[o].frames.Contains(swing.frames)) continue;
        swing.fixed = &others[o];
        swing.fixed_index = static_cast<int>(o);
      }
      swings.push_back(swing);
    }
  }
  std::ranges::sort(swings, {}, [](const Swing& s) { return s.frames.begin; });
  return swings;
}

// Returns half the median duration of double support, in frames. Ignores double supports that the
// recording cuts off, and those that are so long that the figure stands.
double UsualHalfSupport(const std::vector<Swing>& swings, int frame_count, double fps,
                        double standing_max_s) {
  std::vector<double> halves;
  for (const Swing& swing : swings) {
    if (swing.fixed == nullptr) continue;
    const double before = 0.5 * (swing.frames.begin - swing.SupportBegin());
    const double after = 0.5 * (swing.SupportEnd() - swing.frames.end);
    if (swing.SupportBegin() > 0 && before < standing_max_s * fps) halves.push_back(before);
    if (swing.SupportEnd() < frame_count && after < standing_max_s * fps) halves.push_back(after);
  }
  return halves.empty() ? kHalfSupportDefaultS * fps : Median(std::move(halves));
}

double FootYaw(const BodyTracks::FootTrajectory& track, int frame) {
  const DVec3 d = track.toe_tip_m[static_cast<std::size_t>(frame)] -
                  track.ankle_m[static_cast<std::size_t>(frame)];
  return std::atan2(d.x, d.z);
}

class StepFinder {
 public:
  StepFinder(const BodyTracks& tracks, const SegmentOptions& options, double usual_half)
      : tracks_(tracks), options_(options), usual_half_(usual_half) {}

  // Fills `step` and returns an empty string, or returns the reason why the swing is not a step.
  std::string Find(const Swing& swing, StepSegment& step) const {
    if (swing.fixed == nullptr) return "the other foot does not stand during the whole swing";
    const double seconds = swing.frames.size() / tracks_.fps;
    if (seconds < options_.swing_min_s) return Text("the foot is lifted for only %.2f s", seconds);
    if (seconds > options_.swing_max_s) {
      return Text(
          "the foot is lifted for %.1f s, which is too long for a step; if this is slow "
          "motion, set --fps",
          seconds);
    }
    const BodyTracks::FootTrajectory& moving = tracks_.foot(swing.moving);
    const BodyTracks::FootTrajectory& fixed = tracks_.foot(OtherFoot(swing.moving));
    step.moving = swing.moving;
    step.toe_off = swing.frames.begin;
    step.heel_strike = swing.frames.end;
    const int half_before =
        Half(swing.frames.begin - swing.SupportBegin(), swing.SupportBegin() == 0);
    const int half_after =
        Half(swing.SupportEnd() - swing.frames.end, swing.SupportEnd() == tracks_.size());
    if (half_before < 1) return "the recording begins in mid-stride, without both feet standing";
    if (half_after < 1) return "the recording ends in mid-stride, without both feet standing";
    step.start = std::max(0, step.toe_off - half_before);
    step.end = std::min(step.heel_strike + half_after, tracks_.size() - 1);
    if (step.end <= step.heel_strike) return "the recording ends when the foot lands";
    const auto at = [](const std::vector<DVec3>& path, int i) {
      return path[static_cast<std::size_t>(i)];
    };
    const double moved = glm::length(at(moving.ball_m, step.end) - at(moving.ball_m, step.start));
    const double turned =
        std::fabs(WrapAngle(FootYaw(moving, step.end) - FootYaw(moving, step.start)));
    if (moved < options_.moved_min_m && turned < options_.turned_min_rad) {
      return Text("the foot lands only %.2f m from its start", moved);
    }
    if (LiesOrCrawls(tracks_, (step.toe_off + step.heel_strike) / 2)) {
      return "the figure lies or crawls";
    }
    double slide = 0.0;
    for (int i = step.toe_off; i < step.heel_strike; ++i) {
      slide =
          std::max(slide, HorizontalDistance(at(fixed.ball_m, i), at(fixed.ball_m, step.toe_off)));
    }
    if (slide > options_.support_slide_max_m) {
      return Text("the supporting foot slides by %.2f m", slide);
    }
    const int least = static_cast<int>(std::lround(kHalfSupportMinS * tracks_.fps));
    step.toe_off = std::min(std::max(step.toe_off, step.start + least), step.heel_strike - 1);
    step.heel_strike = std::max(std::min(step.heel_strike, step.end - least), step.toe_off + 1);
    step.fixed_contact = swing.fixed_index;
    step.before_contact = swing.before_index;
    step.after_contact = swing.before_index + 1;
    return {};
  }

 private:
  // Returns the number of frames between the swing and the centre of a double support that lasts
  // `frames` frames, limited by standing_max_s. If the recording cuts the support off, returns the
  // usual value if enough frames remain, and otherwise 0.
  [[nodiscard]] int Half(int frames, bool cut_off) const {
    double half = 0.5 * frames;
    if (cut_off && half < usual_half_) {
      half = std::min<double>(frames, usual_half_);
      if (half < kHalfSupportMinShare * usual_half_) return 0;
    }
    // Fast steps may have no frame with both feet on the ground. Then a support of one frame is the
    // closest approximation.
    return std::max(1, static_cast<int>(std::min(half, options_.standing_max_s * tracks_.fps)));
  }

  const BodyTracks& tracks_;
  const SegmentOptions& options_;
  double usual_half_;
};

}  // namespace

Segmentation Segment(const BodyTracks& tracks, const FootContacts& contacts,
                     const SegmentOptions& options) {
  STRIDEWIRE_CHECK(tracks.fps > 0.0);
  Segmentation result;
  std::vector<FrameRange> held;
  // Flights that are jumps, and flights that have already been rejected.
  std::vector<FrameRange> explained;
  for (const FrameRange& flight : FlightRanges(tracks, contacts)) {
    JumpFinding finding = FindJump(tracks, contacts, flight, options);
    if (finding.jump) {
      result.jumps.push_back(*finding.jump);
    } else {
      result.rejected.push_back({flight, std::move(finding.reason)});
      if (finding.held) held.push_back(flight);
    }
    explained.push_back(flight);
  }
  const std::vector<Swing> swings = FindSwings(contacts);
  const double usual_half =
      UsualHalfSupport(swings, tracks.size(), tracks.fps, options.standing_max_s);
  const StepFinder finder(tracks, options, usual_half);
  for (const Swing& swing : swings) {
    StepSegment step;
    std::string reason = finder.Find(swing, step);
    const int before = static_cast<int>(options.reaching_s * tracks.fps);
    const int after = static_cast<int>(options.letting_go_s * tracks.fps);
    if (reason.empty() && std::ranges::any_of(held, [&](const FrameRange& range) {
          return FrameRange{range.begin - before, range.end + after}.Overlaps(
              {step.start, step.end});
        })) {
      reason = "the figure reaches for or lets go of something that holds it";
    }
    if (reason.empty()) {
      result.steps.push_back(step);
    } else if (std::ranges::none_of(explained, [&](const FrameRange& flight) {
                 return flight.Overlaps(swing.frames);
               })) {
      result.rejected.push_back({swing.frames, std::move(reason)});
    }
  }
  std::ranges::sort(result.steps, {}, &StepSegment::start);
  std::ranges::sort(result.rejected, {}, [](const RejectedSpan& r) { return r.frames.begin; });
  return result;
}

}  // namespace stridewire
