#include <string_view>

#include "stridewire/base/version.h"
#include "stridewire/client.h"

namespace {

struct Entry {
  stridewire_status status;
  const char* name;
  const char* text;
};

constexpr Entry kEntries[] = {
    {STRIDEWIRE_OK, "ok", "Done."},
    {STRIDEWIRE_INVALID_ARGUMENT, "invalid_argument", "An argument is invalid."},
    {STRIDEWIRE_OUT_OF_RANGE, "out_of_range", "A number is outside its range or not finite."},
    {STRIDEWIRE_UNSUPPORTED, "unsupported", "This is not supported."},
    {STRIDEWIRE_VERSION_MISMATCH, "version_mismatch",
     "Client and server, or header and library, have different versions."},
    {STRIDEWIRE_UNAUTHORISED, "unauthorised", "The auth token is missing or not sufficient."},
    {STRIDEWIRE_NOT_ALLOWED, "not_allowed",
     "The command needs the role controller, or a region is not the only observation of its "
     "world."},
    {STRIDEWIRE_NOT_JOINED, "not_joined", "The world is not joined."},
    {STRIDEWIRE_NO_SUCH_WORLD, "no_such_world", "There is no such world."},
    {STRIDEWIRE_NO_SUCH_AVATAR, "no_such_avatar", "There is no such avatar in this world."},
    {STRIDEWIRE_AVATAR_EXISTS, "avatar_exists", "An avatar with this id already exists."},
    {STRIDEWIRE_NO_SUCH_SUBSCRIPTION, "no_such_subscription", "There is no such subscription."},
    {STRIDEWIRE_SUBSCRIPTION_EXISTS, "subscription_exists",
     "A subscription with this number already exists."},
    {STRIDEWIRE_BAD_SEQUENCE, "bad_sequence", "The sequence number of a command leaves a gap."},
    {STRIDEWIRE_FORGOTTEN, "forgotten", "The server no longer stores the reply to this command."},
    {STRIDEWIRE_UNEXPECTED_MESSAGE, "unexpected_message",
     "The message is not allowed in this state."},
    {STRIDEWIRE_ALREADY_JOINED, "already_joined", "The world is already joined."},
    {STRIDEWIRE_DROPPED, "dropped",
     "The request was cancelled or replaced, or its avatar was removed."},
    {STRIDEWIRE_BUFFER_TOO_SMALL, "buffer_too_small", "The buffer is too small."},
    {STRIDEWIRE_COMMANDS_FULL, "commands_full", "Too many commands are unanswered."},
    {STRIDEWIRE_CLOSED, "closed", "The client is not connected and does not try to connect."},
    {STRIDEWIRE_ALREADY_CONNECTED, "already_connected", "The client is already connected."},
    {STRIDEWIRE_CANCELLED, "cancelled", "The client was disconnected before the server answered."},
    {STRIDEWIRE_MALFORMED, "malformed", "The data is malformed."},
    {STRIDEWIRE_NO_MOVEMENT, "no_movement", "The library has no such movement or layer."},
    {STRIDEWIRE_PROTOCOL_ERROR, "protocol_error", "The server sent an invalid message."},
    {STRIDEWIRE_TIMEOUT, "timeout", "Nothing was received for too long."},
    {STRIDEWIRE_TOO_SLOW, "too_slow", "The receiver reads too slowly."},
    {STRIDEWIRE_HOST_NOT_FOUND, "host_not_found", "The host name cannot be resolved."},
    {STRIDEWIRE_CONNECT_FAILED, "connect_failed", "The connection failed."},
    {STRIDEWIRE_CONNECTION_LOST, "connection_lost", "The connection was lost."},
    {STRIDEWIRE_SESSION_LOST, "session_lost",
     "The session was lost before the server answered. The outcome is unknown."},
    {STRIDEWIRE_NOT_READY, "not_ready", "The data is not available yet."},
    {STRIDEWIRE_LIMIT_REACHED, "limit_reached", "A limit was reached."},
    {STRIDEWIRE_QUEUE_FULL, "queue_full", "The avatar's queue is full."},
    {STRIDEWIRE_SHUTTING_DOWN, "shutting_down", "The server is shutting down."},
    {STRIDEWIRE_INTERNAL, "internal", "The server has an internal error."},
    {STRIDEWIRE_REPLACED, "replaced", "Another connection has taken over the session."},
    {STRIDEWIRE_OUT_OF_MEMORY, "out_of_memory", "Not enough memory or threads."},
};

const Entry* Find(stridewire_status status) {
  for (const Entry& entry : kEntries) {
    if (entry.status == status) return &entry;
  }
  return nullptr;
}

}  // namespace

extern "C" {

const char* stridewire_status_name(stridewire_status status) {
  const Entry* entry = Find(status);
  return entry != nullptr ? entry->name : "unknown";
}

const char* stridewire_status_text(stridewire_status status) {
  if (const Entry* entry = Find(status)) return entry->text;
  switch (static_cast<int>(status) / 100) {
    case 1: return "The request is invalid.";
    case 2: return "The data is invalid.";
    case 3: return "A network error occurred.";
    case 4: return "A server error occurred.";
    default: return "Unknown status code.";
  }
}

const char* stridewire_version(void) { return stridewire::kVersion; }

}  // extern "C"
