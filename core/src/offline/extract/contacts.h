#pragma once

#include <vector>

#include "offline/extract/body_tracks.h"

namespace stridewire {

/// Thresholds for ground contacts. They fit adults recorded in metres and were tuned on twelve
/// captured walks. For example, a maximum speed of 0.35 instead of 0.8 m/s loses half of the steps.
struct ContactOptions {
  double speed_max_m_s = 0.8;  ///< A point stands only if it is slower than this.
  /// A point stands only if it is at most this far above its resting height.
  double height_max_m = 0.06;
  /// The resting height of a point is this percentile of its heights.
  double resting_percentile = 3.0;
  double smooth_s = 0.04;
  double gap_min_s = 0.05;      ///< Gaps between contacts that are shorter than this are filled.
  double contact_min_s = 0.07;  ///< Contacts that are shorter than this are dropped.
  /// If the heights of resting balls differ by more than this, the capture has several floors.
  double raised_floor_m = 0.10;
};

/// A time span during which a foot is on the ground, in frames of the BodyTracks.
struct Contact {
  FrameRange frames;
  double ball_height_m = 0.0;  ///< Height of the resting ball during the contact.
};

struct FootContacts {
  /// Contacts of each foot, sorted by time and disjoint; indexed by Foot.
  std::vector<Contact> feet[2];
  /// True if the capture has a single floor; false on stairs and blocks, where the height test is
  /// not used.
  bool single_floor = true;

  [[nodiscard]] const std::vector<Contact>& foot(Foot f) const { return feet[static_cast<int>(f)]; }
};

/// Detects when each foot stands: when its ankle, ball or toe tip is slow and low (the criteria of
/// the paper, Section 6). The resting height is determined per point, since balls rest 2 to 7 cm
/// above the floor and differ between left and right. A figure in free fall does not stand, so the
/// top of a jump, where the feet are slow, is not a contact.
[[nodiscard]] FootContacts FindContacts(const BodyTracks& tracks,
                                        const ContactOptions& options = {});

/// Returns one flag per frame of the tracks: non-zero during the contacts.
[[nodiscard]] std::vector<char> StandingFrames(const std::vector<Contact>& contacts,
                                               int frame_count);

/// Measures `Contact::ball_height_m` of all contacts again on other tracks of the same length.
void MeasureBallHeights(const BodyTracks& tracks, const ContactOptions& options,
                        FootContacts& contacts);

}  // namespace stridewire
