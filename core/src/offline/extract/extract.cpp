#include "offline/extract/extract.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/check.h"
#include "offline/base/horizontal_distance.h"
#include "offline/base/text.h"
#include "offline/capture/glitch_repair.h"
#include "offline/capture/joint_noise.h"
#include "offline/capture/root_noise.h"
#include "offline/extract/body_tracks.h"
#include "offline/extract/explain.h"
#include "offline/extract/ground.h"
#include "offline/extract/heading.h"
#include "offline/extract/normalise.h"
#include "offline/extract/root_motion.h"
#include "offline/extract/stand_pose.h"
#include "offline/extract/still_ends.h"
#include "runtime/skeleton/foot_vector.h"
#include "runtime/weights/end_measures.h"
#include "stridewire/runtime/pose.h"

namespace stridewire {
namespace {

constexpr double kStandingYawS = 0.2;
// Jumps that turn by at most this (20 degrees) count as jumps straight ahead.
constexpr double kJumpStraightMaxRad = 0.35;

double HeadingBetween(const DVec3& from, const DVec3& to) {
  return std::atan2(to.x - from.x, to.z - from.z);
}

// Extracts the examples of one capture.
class Extractor {
 public:
  Extractor(const Capture& capture, const ExtractOptions& options)
      : capture_(capture), options_(options), clip_(capture.clip) {}

  Extraction Run() {
    out_.path = capture_.path;
    out_.frames = clip_.frame_count();
    out_.fps = clip_.fps;
    out_.unit_m = capture_.unit_m;
    out_.notes = capture_.notes;
    out_.skeleton = options_.target != nullptr ? *options_.target : capture_.skeleton;
    if (const Status valid = Check(); !valid) {
      out_.error = Describe(valid.error());
      return std::move(out_);
    }
    SetAsideStillEnds();
    const GlitchReport glitches = RepairGlitches(capture_.skeleton, first_frame_, clip_);
    flips_left_ = glitches.left;
    for (std::string& sentence : DescribeRepairs(capture_.skeleton, glitches, clip_.fps)) {
      out_.notes.push_back(std::move(sentence));
    }
    RemoveNoise();
    tracks_ = TrackBody(capture_.skeleton, clip_, first_frame_);
    const bool is_walk_on_the_spot = HandleWalkOnTheSpot();
    contacts_ = FindContacts(tracks_, options_.contacts);
    Segmentation segments;
    if (!is_walk_on_the_spot) segments = Segment(tracks_, contacts_, options_.segments);
    heading_rad_ = StrideHeading(tracks_, contacts_);
    STRIDEWIRE_CHECK(heading_rad_.size() == static_cast<std::size_t>(tracks_.size()));
    if (options_.target != nullptr) Retarget();
    ground_ = FindGround(contacts_);
    out_.has_contacts = ground_.has_contacts;
    for (int f = 0; f < 2; ++f) out_.ball_height_m[f] = ground_.ball_height_m[f];
    for (RejectedSpan& span : segments.rejected) Reject(span.frames, std::move(span.reason));
    for (const StepSegment& step : segments.steps) AddStep(step);
    for (const JumpSegment& jump : segments.jumps) AddJump(jump);
    if (out_.steps_left + out_.steps_right + out_.jumps == 0 && !is_walk_on_the_spot) {
      out_.no_movement_reason = ExplainNoMovement(tracks_, contacts_, !out_.rejected.empty());
    }
    std::ranges::sort(out_.rejected, {}, &RejectedTime::from_s);
    out_.stand = FindStand(out_.skeleton, clip_, tracks_, contacts_, ground_, heading_rad_);
    return std::move(out_);
  }

 private:
  [[nodiscard]] Status Check() const {
    if (clip_.frame_count() <= capture_.first_frame) {
      return Fail(ErrorCode::kInvalidArgument, "the capture has no usable frame", capture_.path);
    }
    if (capture_.skeleton.joint_count() != clip_.joint_count ||
        out_.skeleton.joint_count() != clip_.joint_count) {
      return Fail(ErrorCode::kShapeMismatch, "skeleton and motion have different joints",
                  capture_.path);
    }
    if (Status valid = capture_.skeleton.Validate(); !valid) return valid;
    return clip_.Validate();
  }

  // Excludes a still pose at either end of the capture if a jump separates it from the motion.
  void SetAsideStillEnds() {
    const FrameRange all{capture_.first_frame, clip_.frame_count()};
    const FrameRange frames = WithoutStillEnds(capture_.skeleton, clip_, capture_.first_frame);
    first_frame_ = frames.begin;
    if (frames.begin > all.begin) {
      out_.notes.push_back(
          Text("left out the first %d frames (%.2f s), a still pose before a jump to the motion",
               frames.begin - all.begin, (frames.begin - all.begin) / clip_.fps));
    }
    if (frames.end < all.end) {
      out_.notes.push_back(
          Text("left out the last %d frames (%.2f s), a still pose after a jump of the motion",
               all.end - frames.end, (all.end - frames.end) / clip_.fps));
      clip_.Resize(frames.end, clip_.joint_count);
    }
  }

  void RemoveNoise() {
    if (RemoveRootNoise(capture_.skeleton, first_frame_, clip_)) {
      out_.notes.push_back("smoothed the pelvis, which shakes");
    }
    std::string names;
    for (const int joint : RemoveJointNoise(capture_.skeleton, first_frame_, clip_)) {
      names += (names.empty() ? "" : ", ") +
               capture_.skeleton.joints[static_cast<std::size_t>(joint)].name;
    }
    if (!names.empty()) out_.notes.push_back("smoothed joints that vibrate: " + names);
  }

  // If the figure walks on the spot, derives its root motion. If that is not enabled, rejects the
  // capture and returns true.
  bool HandleWalkOnTheSpot() {
    const GroundTravel travel = MeasureGroundTravel(tracks_);
    if (!WalksOnTheSpot(tracks_, travel)) return false;
    if (!options_.derive_root_motion) {
      Reject({0, tracks_.size()},
             "walks on the spot: the feet slide backward along the ground while the pelvis stays "
             "in place. Export the animation with root motion, or use --root-motion to derive it "
             "from the standing foot");
      return true;
    }
    AddRootMotion(travel, first_frame_, clip_);
    tracks_ = TrackBody(capture_.skeleton, clip_, first_frame_);
    out_.notes.push_back(
        Text("walks on the spot: root motion of %.2f m is derived from the standing foot",
             HorizontalDistance(travel.position_m.front(), travel.position_m.back())));
    return false;
  }

  // Repeats all measurements on a figure with the target's bone lengths.
  void Retarget() {
    const double own = LegLength(capture_.skeleton);
    const double scale = own > 0.0 ? LegLength(out_.skeleton) / own : 1.0;
    for (Vec3& position : clip_.root_positions_m) position *= static_cast<float>(scale);
    tracks_ = TrackBody(out_.skeleton, clip_, first_frame_);
    STRIDEWIRE_CHECK(heading_rad_.size() == static_cast<std::size_t>(tracks_.size()));
    MeasureBallHeights(tracks_, options_.contacts, contacts_);
  }

  [[nodiscard]] double GroundBelow(Foot foot, int contact) const {
    STRIDEWIRE_CHECK(contact >= 0 && contact < static_cast<int>(contacts_.foot(foot).size()));
    return ground_.Below(foot,
                         contacts_.foot(foot)[static_cast<std::size_t>(contact)].ball_height_m);
  }

  void Reject(const FrameRange& frames, std::string reason) {
    out_.rejected.push_back({Seconds(frames.begin), Seconds(frames.end), std::move(reason)});
  }

  // Converts a frame of the tracks to seconds since the first frame of the capture.
  [[nodiscard]] double Seconds(int frame) const {
    return (tracks_.frames.begin + frame) / clip_.fps;
  }

  [[nodiscard]] const DVec3& Pelvis(int frame) const {
    return tracks_.pelvis_m[static_cast<std::size_t>(frame)];
  }

  [[nodiscard]] double Heading(int frame) const {
    return heading_rad_[static_cast<std::size_t>(frame)];
  }

  [[nodiscard]] DVec3 FeetCentre(int frame) const {
    const auto i = static_cast<std::size_t>(frame);
    return 0.5 * (tracks_.feet[0].ball_m[i] + tracks_.feet[1].ball_m[i]);
  }

  // Returns the vector from the fixed to the moving ball, in a frame with this heading.
  [[nodiscard]] DVec3 FootVectorAt(Foot moving, int frame, double heading_rad) const {
    const auto i = static_cast<std::size_t>(frame);
    return RotateYaw(-heading_rad,
                     tracks_.foot(moving).ball_m[i] - tracks_.foot(OtherFoot(moving)).ball_m[i]);
  }

  // Describes a joint flip within these frames that was not repaired. Returns an empty string if
  // there is none.
  [[nodiscard]] std::string FlipWithin(const FrameRange& frames) const {
    const FrameRange in_clip{frames.begin + tracks_.frames.begin,
                             frames.end + tracks_.frames.begin};
    for (const JointFlip& flip : flips_left_) {
      if (flip.frames.Overlaps(in_clip)) {
        return DescribeFlip(capture_.skeleton, flip, clip_.fps);
      }
    }
    return {};
  }

  [[nodiscard]] RawExample Cut(const FrameRange& frames, double heading_rad, double ground_m,
                               std::initializer_list<int> keyframes) const {
    RawExample example;
    const int shift = tracks_.frames.begin;
    example.clip =
        NormaliseClip(clip_, {frames.begin + shift, frames.end + shift}, heading_rad, ground_m);
    for (const int k : keyframes) {
      example.keytimes_s.push_back((k - frames.begin) / clip_.fps);
    }
    example.source = std::filesystem::path(capture_.path).filename().string() +
                     Text(" %.2f-%.2f s", Seconds(frames.begin), Seconds(frames.end - 1));
    return example;
  }

  void AddStep(const StepSegment& step) {
    STRIDEWIRE_CHECK(step.start < step.toe_off && step.toe_off < step.heel_strike);
    STRIDEWIRE_CHECK(step.heel_strike < step.end && step.end < tracks_.size());
    const FrameRange frames{step.start, step.end + 1};
    if (std::string flip = FlipWithin(frames); !flip.empty()) {
      Reject(frames, std::move(flip));
      return;
    }
    const MovementKind kind = StepKind(step.moving);
    (step.moving == Foot::kLeft ? out_.steps_left : out_.steps_right) += 1;
    const Foot fixed = OtherFoot(step.moving);
    const double ground = GroundBelow(fixed, step.fixed_contact);
    const double from = Heading(step.start);
    const double to = Heading(step.end);

    ExtractedExample general{
        kind, Cut(frames, from, ground, {step.start, step.toe_off, step.heel_strike, step.end})};
    const DVec3 d0 = FootVectorAt(step.moving, step.start, from);
    const DVec3 d1 = FootVectorAt(step.moving, step.end, to);
    general.example.parameters = {d0.x, d0.y, d0.z, d1.x, d1.y, d1.z, to - from};
    general.example.heading_change_rad = to - from;
    general.level = IsLevel(step);
    if (general.level) {
      auto& ground_m = general.ground_m[static_cast<std::size_t>(step.moving)];
      ground_m = {GroundBelow(step.moving, step.before_contact) - ground,
                  GroundBelow(step.moving, step.after_contact) - ground};
    }
    const auto ground_m = general.ground_m;
    out_.general_steps.push_back(std::move(general));

    double heading = 0.5 * (from + to);
    if (!IsStraight(step, heading)) return;
    ExtractedExample straight{
        kind, Cut(frames, heading, ground, {step.start, step.toe_off, step.heel_strike, step.end})};
    straight.ground_m = ground_m;
    straight.example.parameters = {FootVectorAt(step.moving, step.start, heading).z,
                                   FootVectorAt(step.moving, step.end, heading).z};
    out_.straight_steps.push_back(std::move(straight));
  }

  [[nodiscard]] bool IsLevel(const StepSegment& step) const {
    const double ground = GroundBelow(OtherFoot(step.moving), step.fixed_contact);
    for (const int contact : {step.before_contact, step.after_contact}) {
      if (std::fabs(GroundBelow(step.moving, contact) - ground) > options_.level_rise_max_m) {
        return false;
      }
    }
    return true;
  }

  // Returns true for a forward step on level ground, and sets `heading` to its direction.
  [[nodiscard]] bool IsStraight(const StepSegment& step, double& heading) const {
    const double turn = Heading(step.end) - Heading(step.start);
    if (!IsLevel(step) || std::fabs(turn) > options_.straight_turn_max_rad) return false;
    // The pelvis sways over the standing foot, so its path leads to alternate sides from step to
    // step. The path of the feet does not.
    const DVec3 start = FeetCentre(step.start);
    const DVec3 end = FeetCentre(step.end);
    if (HorizontalDistance(start, end) > options_.displacement_heading_min_m) {
      const double direction = UnwrapAngle(HeadingBetween(start, end), heading);
      if (std::fabs(direction - heading) > options_.straight_drift_max_rad) return false;
      heading = direction;
    }
    const double own_side = SideSign(step.moving);
    for (const int frame : {step.start, step.end}) {
      const double side = own_side * FootVectorAt(step.moving, frame, heading).x;
      if (side < -0.05 || side > options_.straight_side_max_m) return false;
    }
    return FootVectorAt(step.moving, step.end, heading).z >
           FootVectorAt(step.moving, step.start, heading).z;
  }

  // Returns the mean pelvis yaw around a moment of standing. It is the heading at the ends of a
  // jump, for which the stride heading averages over too long a time.
  [[nodiscard]] double StandingYaw(int frame) const {
    const int reach = static_cast<int>(std::lround(kStandingYawS * 0.5 * clip_.fps));
    const int begin = std::max(0, frame - reach);
    const int end = std::min(tracks_.size(), frame + reach + 1);
    double sum = 0.0;
    for (int i = begin; i < end; ++i) sum += tracks_.pelvis_yaw_rad[static_cast<std::size_t>(i)];
    return sum / (end - begin);
  }

  void AddJump(const JumpSegment& jump) {
    STRIDEWIRE_CHECK(jump.start < jump.crouch && jump.crouch < jump.toe_off &&
                     jump.toe_off < jump.landing);
    STRIDEWIRE_CHECK(jump.landing < jump.absorb && jump.absorb < jump.end &&
                     jump.end < tracks_.size());
    const FrameRange frames{jump.start, jump.end + 1};
    if (std::string flip = FlipWithin(frames); !flip.empty()) {
      Reject(frames, std::move(flip));
      return;
    }
    out_.jumps += 1;
    double from = StandingYaw(jump.start);
    double to = StandingYaw(jump.end);
    const DVec3 centre_from = FeetCentre(jump.start);
    const DVec3 centre_to = FeetCentre(jump.end);
    if (std::fabs(to - from) <= kJumpStraightMaxRad) {
      double heading = 0.5 * (from + to);
      if (HorizontalDistance(centre_from, centre_to) > options_.displacement_heading_min_m) {
        const double direction = UnwrapAngle(HeadingBetween(centre_from, centre_to), heading);
        if (std::fabs(direction - heading) <= options_.straight_drift_max_rad) heading = direction;
      }
      from = to = heading;
    }
    double ground = 0.0;
    double rise = 0.0;
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const double before = GroundBelow(foot, jump.before_contact[static_cast<int>(foot)]);
      const double after = GroundBelow(foot, jump.after_contact[static_cast<int>(foot)]);
      ground += 0.5 * before;
      rise += 0.5 * (after - before);
    }
    ExtractedExample out{
        MovementKind::kJump,
        Cut(frames, from, ground,
            {jump.start, jump.crouch, jump.toe_off, jump.landing, jump.absorb, jump.end}),
        jump.settled};
    for (const Foot foot : {Foot::kLeft, Foot::kRight}) {
      const auto f = static_cast<std::size_t>(foot);
      out.ground_m[f] = {GroundBelow(foot, jump.before_contact[f]) - ground,
                         GroundBelow(foot, jump.after_contact[f]) - ground - rise};
    }
    const double length = RotateYaw(-from, centre_to - centre_from).z;
    out.example.parameters = {length, rise, to - from};
    out.example.heading_change_rad = to - from;
    if (!jump.settled) {
      out_.notes.push_back("the jump of " + out.example.source +
                           " does not come to rest; its end is in motion");
    }
    out_.jump_examples.push_back(std::move(out));
  }

  const Capture& capture_;
  const ExtractOptions& options_;
  Clip clip_;
  int first_frame_ = 0;
  Extraction out_;
  std::vector<JointFlip> flips_left_;
  BodyTracks tracks_;
  FootContacts contacts_;
  Ground ground_;
  std::vector<double> heading_rad_;
};

// Some conversions declare a lower frame rate than that of the recording. Steps then take several
// seconds, and none is found. If there are several steps at a usual frame rate, returns a sentence
// that suggests it. Otherwise, returns an empty string.
std::string AdviseFrameRate(const Capture& capture, const ExtractOptions& options) {
  constexpr double kUsualRates[] = {120.0, 60.0};
  constexpr double kClearlyFaster = 1.5;
  constexpr int kSeveral = 3;
  Extraction most;
  for (const double fps : kUsualRates) {
    if (fps < kClearlyFaster * capture.clip.fps) continue;
    Capture faster = capture;
    faster.clip.fps = fps;
    Extraction extraction = Extractor(faster, options).Run();
    if (std::min(extraction.steps_left, extraction.steps_right) >
        std::min(most.steps_left, most.steps_right)) {
      most = std::move(extraction);
    }
  }
  if (most.steps_left + most.steps_right < kSeveral) return {};
  return Text(
      "at %.0f frames per second there would be %d left and %d right steps, so Frame Time may be "
      "wrong; try --fps %.0f",
      most.fps, most.steps_left, most.steps_right, most.fps);
}

}  // namespace

void MeasureStepParameters(const Skeleton& skeleton, std::span<const ParameterName> names,
                           Foot moving, RawExample& step) {
  const Clip& clip = step.clip;
  const EndMeasures ends = {.start_m = FootVector(skeleton, clip.frame(0), moving, 0.0),
                            .end_m = FootVector(skeleton, clip.frame(clip.frame_count() - 1),
                                                moving, step.heading_change_rad),
                            .heading_change_rad = step.heading_change_rad};
  step.parameters.clear();
  for (const ParameterName name : names) step.parameters.push_back(ParameterOf(ends, name));
}

Extraction Extract(const Capture& capture, const ExtractOptions& options) {
  Extraction extraction = Extractor(capture, options).Run();
  if (extraction.steps_left + extraction.steps_right + extraction.jumps == 0 &&
      extraction.error.empty()) {
    std::string& reason = extraction.no_movement_reason;
    const std::string advice = AdviseFrameRate(capture, options);
    if (!advice.empty() && !reason.empty()) reason += "; " + advice;
    if (!advice.empty() && reason.empty()) extraction.notes.push_back(advice);
  }
  return extraction;
}

}  // namespace stridewire
