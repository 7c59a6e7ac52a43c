#pragma once

#include "stridewire/base/error.h"
#include "stridewire/protocol/messages.h"

namespace stridewire::protocol {

/// Checks that a message follows the rules of STANDARD.md, "Meaning". Encoder and decoder both call
/// it. Error codes:
///   kOutOfRange     a number is not finite, or an id is 0
///   kMalformed      an enumerator is unknown, or a text is not UTF-8
///   kLimitExceeded  too many items, or a text is too long
///   kShapeMismatch  lists that belong together have different lengths
/// `Error::where` names the field, for example "Request.length_m", and `index` is the item.
[[nodiscard]] Status Check(const Hello& m);
[[nodiscard]] Status Check(const JoinWorld& m);
[[nodiscard]] Status Check(const LeaveWorld& m);
[[nodiscard]] Status Check(const Spawn& m);
[[nodiscard]] Status Check(const Remove& m);
[[nodiscard]] Status Check(const Request& m);
[[nodiscard]] Status Check(const CancelQueue& m);
[[nodiscard]] Status Check(const Observe& m);
[[nodiscard]] Status Check(const StopObserving& m);
[[nodiscard]] Status Check(const Ping& m);
[[nodiscard]] Status Check(const InspectAvatar& m);
[[nodiscard]] Status Check(const Goodbye& m);
[[nodiscard]] Status Check(const Welcome& m);
[[nodiscard]] Status Check(const WorldInfo& m);
[[nodiscard]] Status Check(const Reply& m);
[[nodiscard]] Status Check(const PoseBatch& m);
[[nodiscard]] Status Check(const Events& m);
[[nodiscard]] Status Check(const Lagging& m);
[[nodiscard]] Status Check(const ErrorNotice& m);
[[nodiscard]] Status Check(const Pong& m);
[[nodiscard]] Status Check(const AvatarState& m);
[[nodiscard]] Status Check(const SetTerrain& m);
[[nodiscard]] Status Check(const SetLayers& m);
[[nodiscard]] Status Check(const SetPlanting& m);
[[nodiscard]] Status Check(const WorldTerrain& m);
[[nodiscard]] Status Check(const FetchLibrary& m);
[[nodiscard]] Status Check(const Movements& m);
[[nodiscard]] Status Check(const LibraryPiece& m);

}  // namespace stridewire::protocol
