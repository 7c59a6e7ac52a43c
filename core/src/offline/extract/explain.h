#pragma once

#include <string>

#include "offline/extract/contacts.h"
#include "offline/extract/segment.h"

namespace stridewire {

/// Returns why a capture contains no step and no jump, and what the user can do about it. Empty if
/// `has_rejections` is true and there is no common reason beyond those of the rejected spans.
[[nodiscard]] std::string ExplainNoMovement(const BodyTracks& tracks, const FootContacts& contacts,
                                            bool has_rejections);

}  // namespace stridewire
