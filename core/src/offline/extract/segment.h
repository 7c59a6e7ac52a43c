#pragma once

#include <string>
#include <vector>

#include "offline/extract/body_tracks.h"
#include "offline/extract/contacts.h"

namespace stridewire {

/// Thresholds that decide which parts of a recording are steps and jumps.
struct SegmentOptions {
  /// Maximum time between the swing and the start or end of a step, while both feet stand.
  double standing_max_s = 0.4;
  double swing_min_s = 0.1;  ///< Minimum duration of a swing.
  double swing_max_s = 2.0;  ///< Maximum duration of a swing.
  /// In a step, the foot moves by at least moved_min_m or turns by at least turned_min_rad.
  double moved_min_m = 0.04;
  double turned_min_rad = 0.09;
  double support_slide_max_m = 0.12;  ///< Maximum motion of the other foot's ball during a swing.
  double flight_min_s = 0.15;         ///< Minimum duration of the flight of a jump.
  double flight_max_s = 1.0;          ///< Maximum duration of the flight of a jump.
  /// In a jump, this is the maximum time between the moments at which the two feet leave the
  /// ground, and also between those at which they land.
  double feet_apart_max_s = 0.15;
  /// Steps that end less than this before the figure hangs by its arms are rejected.
  double reaching_s = 0.7;
  /// Steps that start less than this after the figure has stopped hanging are rejected.
  double letting_go_s = 1.0;
  double still_m_s = 0.1;  ///< The figure stands still if its pelvis is slower than this.
};

/// A step, in frames of the tracks. It lasts from the centre of the double support before the swing
/// to the centre of the double support after it.
struct StepSegment {
  Foot moving = Foot::kLeft;
  int start = 0;
  int toe_off = 0;
  int heel_strike = 0;
  int end = 0;
  int fixed_contact = 0;   ///< Index of the contact of the fixed foot that contains the swing.
  int before_contact = 0;  ///< Index of the contact of the moving foot before the swing.
  int after_contact = 0;   ///< Index of the contact of the moving foot after the swing.
};

/// A jump from standing to standing, in frames of the tracks.
struct JumpSegment {
  int start = 0;
  int crouch = 0;  ///< Lowest pelvis before toe-off.
  int toe_off = 0;
  int landing = 0;
  int absorb = 0;  ///< Lowest pelvis after landing.
  int end = 0;
  bool settled = true;             ///< False if the figure walks on without coming to rest.
  int before_contact[2] = {0, 0};  ///< Indices of the contacts before the flight, by foot.
  int after_contact[2] = {0, 0};   ///< Indices of the contacts after the flight, by foot.
};

/// A range of frames that resembles a movement but is not usable.
struct RejectedSpan {
  FrameRange frames;
  std::string reason;
};

struct Segmentation {
  std::vector<StepSegment> steps;  ///< Steps, sorted by their start.
  std::vector<JumpSegment> jumps;
  std::vector<RejectedSpan> rejected;
};

/// Finds the steps and standing jumps of a recording. Steps last from the centre of one double
/// support to the centre of the next (paper, Section 6). Never fails: `rejected` lists unusable
/// ranges.
[[nodiscard]] Segmentation Segment(const BodyTracks& tracks, const FootContacts& contacts,
                                   const SegmentOptions& options = {});

}  // namespace stridewire
