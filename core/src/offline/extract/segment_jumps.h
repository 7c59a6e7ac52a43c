#pragma once

#include <optional>
#include <string>

#include "stridewire/base/error.h"
#include "offline/extract/segment.h"

namespace stridewire {

/// Frames during which neither foot stands, between two frames at which one does.
[[nodiscard]] std::vector<FrameRange> FlightRanges(const BodyTracks& tracks,
                                                   const FootContacts& contacts);

/// The standing jump around a flight, or why it is none.
struct JumpFinding {
  std::optional<JumpSegment> jump;
  std::string reason;
  bool held = false;  ///< Both feet in the air, yet not falling
};
[[nodiscard]] JumpFinding FindJump(const BodyTracks& tracks, const FootContacts& contacts,
                                   const FrameRange& flight, const SegmentOptions& options);

}  // namespace stridewire
