#pragma once

#include <vector>

#include "offline/extract/body_tracks.h"

namespace stridewire {

/// Thresholds for ground contacts. They suit recordings of adults and were tuned on twelve
/// captured walks.
struct ContactOptions {
  double speed_max_m_s = 0.8;  ///< Maximum speed of a standing point.
  /// Maximum height of a standing point above its resting height during that contact.
  double height_max_m = 0.06;
  double smooth_s = 0.04;       ///< Paths of feet are smoothed over this time.
  double gap_min_s = 0.05;      ///< Shorter gaps between contacts are closed.
  double contact_min_s = 0.07;  ///< Shorter contacts are dropped.
};

/// A time span during which a foot is on the ground, in frames of the BodyTracks.
struct Contact {
  FrameRange frames;
  double ball_height_m = 0.0;  ///< Height at which the ball of the foot rests during the contact.
};

struct FootContacts {
  /// [Foot]: contacts sorted by time and disjoint. At least one frame separates successive contacts
  /// of a foot.
  std::vector<Contact> feet[2];

  [[nodiscard]] const std::vector<Contact>& foot(Foot f) const { return feet[static_cast<int>(f)]; }
};

/// Detects when each foot stands: when its ankle, ball or toe tip is slow and low (the criteria of
/// the paper, Section 6).
///
/// Heights are relative to the resting height of the foot in that contact, so inclined floors,
/// kerbs, steps and blocks need no special case. A slow foot in the air is not a contact:
/// RemoveUnsupported() removes contacts of feet that carry no weight.
[[nodiscard]] FootContacts FindContacts(const BodyTracks& tracks,
                                        const ContactOptions& options = {});

/// Returns one flag per frame of the tracks: non-zero during the contacts.
[[nodiscard]] std::vector<char> StandingFrames(const std::vector<Contact>& contacts,
                                               int frame_count);

/// Measures `Contact::ball_height_m` of all contacts again, on other tracks of the same length.
void MeasureBallHeights(const BodyTracks& tracks, const ContactOptions& options,
                        FootContacts& contacts);

}  // namespace stridewire
