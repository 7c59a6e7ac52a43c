#pragma once

#include <cstdint>
#include <string_view>

namespace stridewire::protocol {

/// Result of a command. The hundreds tell who can act. Future versions may add codes, so a receiver
/// treats an unknown code by its hundreds.
enum class StatusCode : std::uint16_t {
  kOk = 0,
  // 100 to 199: the caller made an invalid request.
  kInvalidArgument = 100,
  kOutOfRange = 101,
  kUnsupported = 102,
  kVersionMismatch = 103,
  kUnauthorised = 104,  ///< The auth token is missing or not sufficient.
  kNotAllowed = 105,    ///< Only a controller may send this command.
  kNotJoined = 106,
  kNoSuchWorld = 107,
  kNoSuchAvatar = 108,
  kAvatarExists = 109,
  kNoSuchSubscription = 110,
  kSubscriptionExists = 111,
  kBadSequence = 112,        ///< The `seq` of a command leaves a gap.
  kForgotten = 113,          ///< The Reply to this old `seq` is no longer stored.
  kUnexpectedMessage = 114,  ///< The state of the session does not allow the message.
  kAlreadyJoined = 115,
  // 200 to 299: the data is invalid.
  kMalformed = 200,   ///< The bytes violate the standard.
  kNoMovement = 201,  ///< The library has no such movement or layer.
  // 300 to 399: the network failed.
  kTimeout = 300,  ///< Nothing was received for too long.
  kTooSlow = 301,  ///< The peer does not read fast enough.
  // 400 to 499: the server failed.
  kLimitReached = 400,
  kQueueFull = 401,
  kShuttingDown = 402,
  kInternal = 403,
  kReplaced = 404,  ///< Another connection has taken over the session.
};

/// Returns a stable lower-case name such as "no_such_avatar", or "unknown" for an unknown code.
[[nodiscard]] std::string_view StatusCodeName(StatusCode code);

}  // namespace stridewire::protocol
