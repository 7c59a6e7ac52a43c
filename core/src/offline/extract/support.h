#pragma once

#include "offline/extract/contacts.h"

namespace stridewire {

/// Removes contacts in which a foot cannot carry the figure, for example because it hovers. A
/// contact remains if the pelvis is above the foot, the figure is not in free fall, and one of
/// these conditions holds:
///
/// - The other foot does not stand for a while, and is not more than 3 cm below this foot, so this
///   foot carries the figure alone.
/// - The foot is as low as the other foot, which stands as well, for a while.
/// - Seen from above, the pelvis is so close to this foot that the foot must carry a part of the
///   weight.
///
/// If feet leave the ground without a fall and come to rest above the floor, the figure hangs, for
/// example by its arms from a bar. These contacts are removed as well.
void RemoveUnsupported(const BodyTracks& tracks, const ContactOptions& options,
                       FootContacts& contacts);

}  // namespace stridewire
