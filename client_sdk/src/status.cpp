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
    {STRIDEWIRE_INVALID_ARGUMENT, "invalid_argument", "An argument makes no sense."},
    {STRIDEWIRE_OUT_OF_RANGE, "out_of_range", "A number is outside its range or not finite."},
    {STRIDEWIRE_UNSUPPORTED, "unsupported", "This is not supported yet."},
    {STRIDEWIRE_VERSION_MISMATCH, "version_mismatch", "The two sides have no version in common."},
    {STRIDEWIRE_UNAUTHORISED, "unauthorised", "The token is missing or does not allow this."},
    {STRIDEWIRE_NOT_ALLOWED, "not_allowed", "Only a controller may do this."},
    {STRIDEWIRE_NOT_JOINED, "not_joined", "The world was not joined, or was left."},
    {STRIDEWIRE_NO_SUCH_WORLD, "no_such_world", "There is no such world."},
    {STRIDEWIRE_NO_SUCH_AVATAR, "no_such_avatar", "There is no such avatar in this world."},
    {STRIDEWIRE_AVATAR_EXISTS, "avatar_exists", "An avatar with this number exists already."},
    {STRIDEWIRE_NO_SUCH_SUBSCRIPTION, "no_such_subscription", "There is no such subscription."},
    {STRIDEWIRE_SUBSCRIPTION_EXISTS, "subscription_exists",
     "A subscription with this number exists already."},
    {STRIDEWIRE_BAD_SEQUENCE, "bad_sequence", "A command was numbered out of sequence."},
    {STRIDEWIRE_FORGOTTEN, "forgotten", "The answer to this command is no longer kept."},
    {STRIDEWIRE_UNEXPECTED_MESSAGE, "unexpected_message", "The message does not belong here."},
    {STRIDEWIRE_ALREADY_JOINED, "already_joined", "This world was joined already."},
    {STRIDEWIRE_BUFFER_TOO_SMALL, "buffer_too_small", "There is more than the buffer holds."},
    {STRIDEWIRE_COMMANDS_FULL, "commands_full", "Too many commands are without an answer."},
    {STRIDEWIRE_CLOSED, "closed", "The client is not connected and not about to be."},
    {STRIDEWIRE_ALREADY_CONNECTED, "already_connected", "The client is connected already."},
    {STRIDEWIRE_CANCELLED, "cancelled", "The client was disconnected before the answer came."},
    {STRIDEWIRE_MALFORMED, "malformed", "The bytes do not follow the standard."},
    {STRIDEWIRE_NO_MOVEMENT, "no_movement", "The library has no movement of that kind."},
    {STRIDEWIRE_PROTOCOL_ERROR, "protocol_error", "The server sent what it may not send."},
    {STRIDEWIRE_TIMEOUT, "timeout", "Nothing was heard for too long."},
    {STRIDEWIRE_TOO_SLOW, "too_slow", "The peer does not read what it is sent."},
    {STRIDEWIRE_HOST_NOT_FOUND, "host_not_found", "The host's name is not known."},
    {STRIDEWIRE_CONNECT_FAILED, "connect_failed", "No connection could be made."},
    {STRIDEWIRE_CONNECTION_LOST, "connection_lost", "The connection was lost."},
    {STRIDEWIRE_SESSION_LOST, "session_lost",
     "The session was lost before the answer came; whether it was done is not known."},
    {STRIDEWIRE_NOT_READY, "not_ready", "This is not known yet."},
    {STRIDEWIRE_LIMIT_REACHED, "limit_reached", "A limit was reached."},
    {STRIDEWIRE_QUEUE_FULL, "queue_full", "The avatar's queue is full."},
    {STRIDEWIRE_SHUTTING_DOWN, "shutting_down", "The server is shutting down."},
    {STRIDEWIRE_INTERNAL, "internal", "Something broke inside the server."},
    {STRIDEWIRE_REPLACED, "replaced", "The session went on over another connection."},
    {STRIDEWIRE_OUT_OF_MEMORY, "out_of_memory", "No memory or thread was left."},
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
    case 1: return "The caller asked for something that cannot be.";
    case 2: return "The data is not as it should be.";
    case 3: return "Something went wrong in the network.";
    case 4: return "Something went wrong on the server.";
    default: return "A status that this library does not know.";
  }
}

const char* stridewire_version(void) { return stridewire::kVersion; }

}  // extern "C"
