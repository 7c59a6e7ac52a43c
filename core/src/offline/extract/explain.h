#pragma once

#include <string>

#include "offline/extract/contacts.h"
#include "offline/extract/segment.h"

namespace stridewire {

/// Returns why a capture contains no step and no jump, and what the user can do about it. Returns
/// an empty string if `has_rejections` is true and the rejected spans are the only reasons.
[[nodiscard]] std::string ExplainNoMovement(const BodyTracks& tracks, const FootContacts& contacts,
                                            bool has_rejections);

}  // namespace stridewire
