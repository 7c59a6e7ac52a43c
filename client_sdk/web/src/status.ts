/** Status codes: of the protocol (x00 to x49), and of this package (x50 to x99), the same as in
 * stridewire/client.h. */
export const Status = {
  ok: 0,
  invalid_argument: 100,
  out_of_range: 101,
  unsupported: 102,
  version_mismatch: 103,
  unauthorised: 104,
  not_allowed: 105,
  not_joined: 106,
  no_such_world: 107,
  no_such_avatar: 108,
  avatar_exists: 109,
  no_such_subscription: 110,
  subscription_exists: 111,
  bad_sequence: 112,
  forgotten: 113,
  unexpected_message: 114,
  already_joined: 115,
  commands_full: 151,
  closed: 152,
  already_connected: 153,
  cancelled: 154,
  malformed: 200,
  no_movement: 201,
  protocol_error: 250,
  timeout: 300,
  too_slow: 301,
  connect_failed: 351,
  connection_lost: 352,
  session_lost: 353,
  not_ready: 354,
  limit_reached: 400,
  queue_full: 401,
  shutting_down: 402,
  internal: 403,
  replaced: 404,
} as const;

const sentences: {readonly [code: number]: string} = {
  100: 'An argument makes no sense.',
  101: 'A number is outside its range or not finite.',
  102: 'This is not supported yet.',
  103: 'The two sides have no version in common.',
  104: 'The token is missing or does not allow this.',
  105: 'Only a controller may do this.',
  106: 'The world was not joined, or was left.',
  107: 'There is no such world.',
  108: 'There is no such avatar in this world.',
  109: 'An avatar with this number exists already.',
  110: 'There is no such subscription.',
  113: 'The answer to this command is no longer kept.',
  115: 'This world was joined already.',
  151: 'Too many commands are without an answer.',
  152: 'The client is not connected and not about to be.',
  154: 'The client was disconnected before the answer came.',
  200: 'The bytes do not follow the standard.',
  201: 'The library has no movement of that kind.',
  250: 'The server sent what it may not send.',
  300: 'Nothing was heard for too long.',
  301: 'What the server sent was not read.',
  351: 'No connection could be made.',
  352: 'The connection was lost.',
  353: 'The session was lost before the answer came; whether it was done is not known.',
  400: 'A limit was reached.',
  401: "The avatar's queue is full.",
  402: 'The server is shutting down.',
  403: 'Something broke inside the server.',
  404: 'The session went on over another connection.',
};

const byHundred = [
  '', 'The caller asked for something that cannot be.', 'The data is not as it should be.',
  'Something went wrong in the network.', 'Something went wrong on the server.'
];

const names = new Map<number, string>(Object.entries(Status).map(([name, code]) => [code, name]));

/** Stable lower-case name, e.g. `no_such_avatar`; `unknown` for a code this package does not know. */
export function statusName(code: number): string {
  return names.get(code) ?? 'unknown';
}

/** A sentence for people; empty for 0. */
export function statusText(code: number): string {
  if (code === 0) return '';
  return sentences[code] ?? byHundred[Math.floor(code / 100)] ??
      'A status that this package does not know.';
}
