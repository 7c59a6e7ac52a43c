#pragma once

#include "stridewire/base/error.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Whether a message means something (STANDARD.md, "Meaning"). Encoding and decoding both ask.
/// kOutOfRange: a number not finite or an id 0; kMalformed: an unknown enumerator, text that is not
/// UTF-8; kLimitExceeded: too many items, too long a text; kShapeMismatch: counts that do not
/// match. `where` is the field, e.g. "Request.length_m", and `index` the item.
[[nodiscard]] Status Check(const Hello& message);
[[nodiscard]] Status Check(const JoinWorld& message);
[[nodiscard]] Status Check(const LeaveWorld& message);
[[nodiscard]] Status Check(const Spawn& message);
[[nodiscard]] Status Check(const Remove& message);
[[nodiscard]] Status Check(const Request& message);
[[nodiscard]] Status Check(const CancelQueue& message);
[[nodiscard]] Status Check(const Observe& message);
[[nodiscard]] Status Check(const StopObserving& message);
[[nodiscard]] Status Check(const Ping& message);
[[nodiscard]] Status Check(const Goodbye& message);
[[nodiscard]] Status Check(const Welcome& message);
[[nodiscard]] Status Check(const WorldInfo& message);
[[nodiscard]] Status Check(const Reply& message);
[[nodiscard]] Status Check(const PoseBatch& message);
[[nodiscard]] Status Check(const Events& message);
[[nodiscard]] Status Check(const Lagging& message);
[[nodiscard]] Status Check(const ErrorNotice& message);
[[nodiscard]] Status Check(const Pong& message);

}  // namespace stridewire::protocol
