#pragma once

#include <vector>

#include "offline/extract/body_tracks.h"

namespace stridewire {

/// When a foot counts as standing. The figures fit an adult recorded in metres and were measured on
/// twelve captured walks: 0.35 m/s instead of 0.8 loses half of the steps.
struct ContactOptions {
  double speed_max_m_s = 0.8;  ///< A point slower than this ...
  double height_max_m = 0.06;  ///< ... and lower than this above its own resting height stands.
  double resting_percentile = 3.0;  ///< Percentile of a point's height taken as resting height.
  double smooth_s = 0.04;
  double gap_min_s = 0.05;       ///< Shorter gaps are filled,
  double contact_min_s = 0.07;   ///< shorter contacts dropped.
  double raised_floor_m = 0.10;  ///< Resting balls differ by more than this: not one floor.
};

/// A foot on the ground: frames of the BodyTracks (index 0 = its first frame).
struct Contact {
  FrameRange frames;
  double ball_height_m = 0.0;  ///< Height of the resting ball while it stands.
};

struct FootContacts {
  std::vector<Contact> feet[2];  ///< Indexed by Foot, in order of time, not overlapping
  bool single_floor = true;      ///< False on stairs and blocks: the height test was dropped.

  [[nodiscard]] const std::vector<Contact>& foot(Foot f) const { return feet[static_cast<int>(f)]; }
};

/// Finds when each foot stands: when any of ankle, ball and toe tip is slow and low (paper, Section
/// 6: contact is told by height and speed). The resting height is taken per point, since balls rest
/// 2 to 7 cm above the floor and not equally left and right. Nobody stands while falling freely, so
/// the top of a jump, where the feet are slow, is no contact.
[[nodiscard]] FootContacts FindContacts(const BodyTracks& tracks,
                                        const ContactOptions& options = {});

/// Measures `Contact::ball_height_m` of all contacts again, on other tracks of the same length.
void MeasureBallHeights(const BodyTracks& tracks, const ContactOptions& options,
                        FootContacts& contacts);

}  // namespace stridewire
