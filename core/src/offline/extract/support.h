#pragma once

#include "offline/extract/contacts.h"

namespace stridewire {

/// Removes the contacts during which a foot cannot carry the figure, for example because it hovers.
/// A contact remains if the pelvis is above the foot, the figure is not in free fall, and one of
/// these holds:
///
/// - the other foot is in the air above it for a while, so this foot stands alone;
/// - the foot is as low as the other one for a while, which stands as well;
/// - the pelvis is so far between both feet that this foot must carry a part of the weight.
///
/// Feet that leave the ground without a fall and come to rest above the floor hang in the air, for
/// example below a bar. Their contacts are removed, too.
void RemoveUnsupported(const BodyTracks& tracks, const ContactOptions& options,
                       FootContacts& contacts);

}  // namespace stridewire
