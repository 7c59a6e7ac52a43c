#ifndef STRIDEWIRE_STATUS_H
#define STRIDEWIRE_STATUS_H

#ifdef __cplusplus
extern "C" {
#endif

/// Result of a call or command. The first digit states who can correct the problem: 1xx the caller,
/// 2xx the author of the data, 3xx the network, 4xx the operator of the server. Codes x00 to x49
/// also occur in the protocol, codes x50 to x99 only in this library. Future versions may add
/// codes, so handle an unknown code according to its first digit.
///
/// The _MAX enumerator of this and other enums only fixes the size of the type. It is not a value.
typedef enum stridewire_status {
  STRIDEWIRE_OK = 0,

  STRIDEWIRE_INVALID_ARGUMENT = 100,
  STRIDEWIRE_OUT_OF_RANGE = 101,
  STRIDEWIRE_UNSUPPORTED = 102,
  STRIDEWIRE_VERSION_MISMATCH = 103,
  STRIDEWIRE_UNAUTHORISED = 104,
  STRIDEWIRE_NOT_ALLOWED = 105,
  STRIDEWIRE_NOT_JOINED = 106,
  STRIDEWIRE_NO_SUCH_WORLD = 107,
  STRIDEWIRE_NO_SUCH_AVATAR = 108,
  STRIDEWIRE_AVATAR_EXISTS = 109,
  STRIDEWIRE_NO_SUCH_SUBSCRIPTION = 110,
  STRIDEWIRE_SUBSCRIPTION_EXISTS = 111,
  STRIDEWIRE_BAD_SEQUENCE = 112,
  STRIDEWIRE_FORGOTTEN = 113,
  STRIDEWIRE_UNEXPECTED_MESSAGE = 114,
  STRIDEWIRE_ALREADY_JOINED = 115,
  STRIDEWIRE_DROPPED = 116,
  STRIDEWIRE_BUFFER_TOO_SMALL = 150,
  STRIDEWIRE_COMMANDS_FULL = 151,
  STRIDEWIRE_CLOSED = 152,
  STRIDEWIRE_ALREADY_CONNECTED = 153,
  STRIDEWIRE_CANCELLED = 154,

  STRIDEWIRE_MALFORMED = 200,
  STRIDEWIRE_NO_MOVEMENT = 201,
  STRIDEWIRE_PROTOCOL_ERROR = 250,

  STRIDEWIRE_TIMEOUT = 300,
  STRIDEWIRE_TOO_SLOW = 301,
  STRIDEWIRE_HOST_NOT_FOUND = 350,
  STRIDEWIRE_CONNECT_FAILED = 351,
  STRIDEWIRE_CONNECTION_LOST = 352,
  STRIDEWIRE_SESSION_LOST = 353,
  STRIDEWIRE_NOT_READY = 354,

  STRIDEWIRE_LIMIT_REACHED = 400,
  STRIDEWIRE_QUEUE_FULL = 401,
  STRIDEWIRE_SHUTTING_DOWN = 402,
  STRIDEWIRE_INTERNAL = 403,
  STRIDEWIRE_REPLACED = 404,
  STRIDEWIRE_OUT_OF_MEMORY = 450,
  STRIDEWIRE_STATUS_MAX = 0x7fffffff
} stridewire_status;

/// Returns a stable lower-case name such as "no_such_avatar", or "unknown" for an unknown code.
const char* stridewire_status_name(stridewire_status status);

/// Returns a sentence that describes a code. For an unknown code, it describes the class of codes
/// with the same first digit. Never NULL.
const char* stridewire_status_text(stridewire_status status);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  // STRIDEWIRE_STATUS_H
