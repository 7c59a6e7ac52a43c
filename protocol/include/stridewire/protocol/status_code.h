#pragma once

#include <cstdint>
#include <string_view>

namespace stridewire::protocol {

/// Result of a command. The first digit states who can correct the problem. Future versions may add
/// codes, so a receiver must judge an unknown code by its first digit.
enum class StatusCode : std::uint16_t {
  kOk = 0,
  // Codes 100 to 199: the caller made an invalid request.
  kInvalidArgument = 100,
  kOutOfRange = 101,
  kUnsupported = 102,
  kVersionMismatch = 103,
  kUnauthorised = 104,  ///< The auth token is missing or does not grant enough rights.
  /// An observer sent a command for avatars, or an Observe violated the rule that a subscription
  /// with a region must be the session's only one to that world.
  kNotAllowed = 105,
  kNotJoined = 106,
  kNoSuchWorld = 107,
  kNoSuchAvatar = 108,
  kAvatarExists = 109,
  kNoSuchSubscription = 110,
  kSubscriptionExists = 111,
  /// The `seq` of a command is not the next one, so a command is missing.
  kBadSequence = 112,
  /// The command was executed before, but its Reply is no longer stored.
  kForgotten = 113,
  kUnexpectedMessage = 114,  ///< The state of the session does not allow the message.
  kAlreadyJoined = 115,
  /// The request was cancelled or replaced, or its avatar was removed.
  kDropped = 116,
  // Codes 200 to 299: the data is invalid.
  kMalformed = 200,  ///< The bytes violate the protocol standard (STANDARD.md).
  /// The library has no such movement or layer, or the command needs foot planting, which is off or
  /// not supported by the skeleton.
  kNoMovement = 201,
  // Codes 300 to 399: the network failed.
  kTimeout = 300,  ///< Nothing was received for longer than the timeout.
  kTooSlow = 301,  ///< The peer does not read fast enough.
  // Codes 400 to 499: the server failed.
  kLimitReached = 400,
  kQueueFull = 401,
  kShuttingDown = 402,
  kInternal = 403,
  kReplaced = 404,  ///< Another connection has taken over the session.
};

/// Returns a stable lower-case name such as "no_such_avatar", or "unknown" for an unknown code.
[[nodiscard]] std::string_view StatusCodeName(StatusCode code);

}  // namespace stridewire::protocol
