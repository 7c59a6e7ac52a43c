#pragma once

#include <string>
#include <vector>

#include "offline/extract/body_tracks.h"
#include "offline/extract/contacts.h"

namespace stridewire {

struct SegmentOptions {
  double standing_max_s = 0.4;        ///< A standing phase beyond this from a step is cut off.
  double swing_min_s = 0.1;           ///< Shorter lifts of a foot are no step,
  double swing_max_s = 2.0;           ///< nor are longer ones.
  double moved_min_m = 0.04;          ///< A foot that lands nearer than this and has not turned by
  double turned_min_rad = 0.09;       ///< ... this much has not stepped.
  double support_slide_max_m = 0.12;  ///< The fixed ball stays within this while the other swings.
  double flight_min_s = 0.15;         ///< Jump: both feet off the ground,
  double flight_max_s = 1.0;
  double feet_apart_max_s = 0.15;  ///< and left and landed together.
  double reaching_s = 0.7;    ///< Steps ending less than this before hanging on something reach
  double letting_go_s = 1.0;  ///< for it; those starting less than this after let go of it.
  double still_m_s = 0.1;     ///< Pelvis slower than this stands still.
};

/// A step of `moving`, frames of the tracks: centre of the double support before, toe-off,
/// heel-strike, centre of the double support after.
struct StepSegment {
  Foot moving = Foot::kLeft;
  int start = 0;
  int toe_off = 0;
  int heel_strike = 0;
  int end = 0;
  int fixed_contact = 0;   ///< Index of the fixed foot's contact, which contains the swing
  int before_contact = 0;  ///< of the moving foot's before
  int after_contact = 0;   ///< and after
};

/// A jump from standing to standing, frames of the tracks.
struct JumpSegment {
  int start = 0;
  int crouch = 0;  ///< Pelvis lowest before toe-off
  int toe_off = 0;
  int landing = 0;
  int absorb = 0;  ///< Pelvis lowest after landing
  int end = 0;
  bool settled = true;             ///< False when the figure walks on before it has come to rest.
  int before_contact[2] = {0, 0};  ///< Indices of the contacts it leaves, by foot
  int after_contact[2] = {0, 0};   ///< and lands in
};

/// A stretch that looked like a movement and was left out.
struct RejectedSpan {
  FrameRange frames;
  std::string reason;
};

struct Segmentation {
  std::vector<StepSegment> steps;  ///< By start
  std::vector<JumpSegment> jumps;
  std::vector<RejectedSpan> rejected;
};

/// Cuts a recording into steps (paper, Section 6: from the centre of one double support to the
/// centre of the next) and standing jumps. Never fails: what cannot be used is in `rejected`.
[[nodiscard]] Segmentation Segment(const BodyTracks& tracks, const FootContacts& contacts,
                                   const SegmentOptions& options = {});

}  // namespace stridewire
