#include "stridewire/protocol/status_code.h"

namespace stridewire::protocol {

std::string_view StatusCodeName(StatusCode code) {
  switch (code) {
    case StatusCode::kOk: return "ok";
    case StatusCode::kInvalidArgument: return "invalid_argument";
    case StatusCode::kOutOfRange: return "out_of_range";
    case StatusCode::kUnsupported: return "unsupported";
    case StatusCode::kVersionMismatch: return "version_mismatch";
    case StatusCode::kUnauthorised: return "unauthorised";
    case StatusCode::kNotAllowed: return "not_allowed";
    case StatusCode::kNotJoined: return "not_joined";
    case StatusCode::kNoSuchWorld: return "no_such_world";
    case StatusCode::kNoSuchAvatar: return "no_such_avatar";
    case StatusCode::kAvatarExists: return "avatar_exists";
    case StatusCode::kNoSuchSubscription: return "no_such_subscription";
    case StatusCode::kSubscriptionExists: return "subscription_exists";
    case StatusCode::kBadSequence: return "bad_sequence";
    case StatusCode::kForgotten: return "forgotten";
    case StatusCode::kUnexpectedMessage: return "unexpected_message";
    case StatusCode::kAlreadyJoined: return "already_joined";
    case StatusCode::kDropped: return "dropped";
    case StatusCode::kMalformed: return "malformed";
    case StatusCode::kNoMovement: return "no_movement";
    case StatusCode::kTimeout: return "timeout";
    case StatusCode::kTooSlow: return "too_slow";
    case StatusCode::kLimitReached: return "limit_reached";
    case StatusCode::kQueueFull: return "queue_full";
    case StatusCode::kShuttingDown: return "shutting_down";
    case StatusCode::kInternal: return "internal";
    case StatusCode::kReplaced: return "replaced";
  }
  return "unknown";
}

}  // namespace stridewire::protocol
