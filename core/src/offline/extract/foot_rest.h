#pragma once

#include "offline/extract/contacts.h"
#include "offline/extract/foot_paths.h"

namespace stridewire {

/// Finds the spans during which a foot is slow and near the height at which it rests in that span,
/// on the ground or in the air. Returns them as contacts, sorted by time and disjoint, with at
/// least one frame between them.
[[nodiscard]] std::vector<Contact> FindRests(const FootPaths& foot, double fps,
                                             const ContactOptions& options);

}  // namespace stridewire
