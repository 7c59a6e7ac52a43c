#pragma once

#include "stridewire/base/error.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Checks that a message follows the rules of STANDARD.md, "Meaning". `M` is one of the structs
/// that Message can contain. Encoder and decoder both call it. Error codes:
///   kOutOfRange     a number is not finite or out of range, or an id is 0
///   kMalformed      an enumerator is unknown, or a text is not UTF-8
///   kLimitExceeded  too many items, or a text is too long
///   kShapeMismatch  lists that belong together have different lengths
/// `Error::where` is the path of the field, for example "Request.items.length_m". `Error::index` is
/// the index of the item, or the offending integer if the field does not belong to an item.
template <typename M>
[[nodiscard]] Status Check(const M& message);

}  // namespace stridewire::protocol
