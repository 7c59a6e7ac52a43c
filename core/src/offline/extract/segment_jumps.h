#pragma once

#include <optional>
#include <string>

#include "offline/extract/segment.h"
#include "stridewire/base/error.h"

namespace stridewire {

/// Returns the ranges of frames without ground contact that have frames with contact on both sides.
[[nodiscard]] std::vector<FrameRange> FlightRanges(const BodyTracks& tracks,
                                                   const FootContacts& contacts);

/// Returns true if the pelvis falls freely during a flight, that is, with 5 to 15 m/s^2.
[[nodiscard]] bool FallsFreely(const BodyTracks& tracks, const FrameRange& flight);

/// Returns true if a flight is part of a run: the figure travels, takes off from one foot and lands
/// on the other.
[[nodiscard]] bool IsRun(const BodyTracks& tracks, const FootContacts& contacts,
                         const FrameRange& flight);

/// The standing jump around a flight, or the reason why there is none.
struct JumpFinding {
  std::optional<JumpSegment> jump;
  std::string reason;
  /// True if both feet are in the air but the figure does not fall, for example because it hangs on
  /// a bar.
  bool held = false;
};
[[nodiscard]] JumpFinding FindJump(const BodyTracks& tracks, const FootContacts& contacts,
                                   const FrameRange& flight, const SegmentOptions& options);

}  // namespace stridewire
