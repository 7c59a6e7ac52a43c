#pragma once

#include "stridewire/base/error.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Checks a message (STANDARD.md, "Meaning"). `M` is an alternative of Message. Error codes:
///   kOutOfRange     a number is not finite or out of range, or an id is 0
///   kMalformed      an unknown enumerator, a text that is not UTF-8, or a list that is too short
///   kLimitExceeded  too many items, or a text is too long
///   kShapeMismatch  lists that belong together have different lengths
///   kUnsupported    the pose mode does not allow the value
/// `Error::where` is the path of the field, for example "Request.items.length_m". `Error::index` is
/// the index of the item, or the offending integer if the field does not belong to an item.
template <typename M>
[[nodiscard]] Status Check(const M& message);

}  // namespace stridewire::protocol
