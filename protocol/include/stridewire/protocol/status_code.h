#pragma once

#include <cstdint>
#include <string_view>

namespace stridewire::protocol {

/// What came of a command, in ranges by who can act. Append only; a reader that does not know a
/// code goes by its hundred.
enum class StatusCode : std::uint16_t {
  kOk = 0,
  // 100 to 199: the caller asked for something that cannot be.
  kInvalidArgument = 100,
  kOutOfRange = 101,
  kUnsupported = 102,
  kVersionMismatch = 103,
  kUnauthorised = 104,  ///< No token, or one that does not allow this.
  kNotAllowed = 105,    ///< An observer gave a controller's command.
  kNotJoined = 106,
  kNoSuchWorld = 107,
  kNoSuchAvatar = 108,
  kAvatarExists = 109,
  kNoSuchSubscription = 110,
  kSubscriptionExists = 111,
  kBadSequence = 112,        ///< A seq that leaves a gap.
  kForgotten = 113,          ///< A seq done so long ago that its answer is no longer kept.
  kUnexpectedMessage = 114,  ///< Not in this state of the session (STATE_MACHINE.md).
  kAlreadyJoined = 115,
  // 200 to 299: data.
  kMalformed = 200,   ///< Bytes that do not follow the standard.
  kNoMovement = 201,  ///< The library has no movement of that kind, or no such layer.
  // 300 to 399: the network.
  kTimeout = 300,  ///< Nothing heard for too long.
  kTooSlow = 301,  ///< The peer does not read what it is sent.
  // 400 to 499: the server.
  kLimitReached = 400,
  kQueueFull = 401,
  kShuttingDown = 402,
  kInternal = 403,
  kReplaced = 404,  ///< The session went on over another connection.
};

/// Stable lower-case name, e.g. "no_such_avatar"; "unknown" for a code this build does not know.
[[nodiscard]] std::string_view StatusCodeName(StatusCode code);

}  // namespace stridewire::protocol
