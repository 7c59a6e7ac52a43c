/**
 * Status codes, the same as in stridewire/client.h. The hundreds state who can correct the problem:
 * 1xx the caller, 2xx the author of the data, 3xx the network, 4xx the operator of the server.
 * Codes x00 to x49 belong to the protocol; codes x50 to x99 come only from client libraries.
 */
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

const texts: {readonly [code: number]: string} = {
  100: 'An argument is invalid.',
  101: 'A number is out of range or not finite.',
  102: 'The server does not support this.',
  103: 'Client and server have no protocol version in common.',
  104: 'The token is missing or does not permit this.',
  105: 'Only controllers may do this.',
  106: 'The world is not joined.',
  107: 'There is no such world.',
  108: 'There is no such avatar in this world.',
  109: 'An avatar with this id exists already.',
  110: 'There is no such subscription.',
  111: 'A subscription with this number exists already.',
  112: 'A command has the wrong sequence number.',
  113: 'The server no longer has the reply to this command.',
  114: 'The message is not allowed in this state.',
  115: 'The world is already joined.',
  151: 'Too many commands are waiting for a reply.',
  152: 'The client is closed.',
  153: 'The client is already connected.',
  154: 'The client was closed before the reply arrived.',
  200: 'The message does not follow the protocol.',
  201: 'The motion library has no such movement.',
  250: 'The server violated the protocol.',
  300: 'The peer did not respond in time.',
  301: 'The peer reads too slowly.',
  351: 'The connection could not be established.',
  352: 'The connection was lost.',
  353: 'The session was lost before the reply arrived; the command may have been carried out.',
  354: 'The client or the world is not ready yet.',
  400: 'A limit was reached.',
  401: "The avatar's queue is full.",
  402: 'The server is shutting down.',
  403: 'The server has an internal error.',
  404: 'The session continues on another connection.',
};

const textByHundred = [
  '', 'The caller made an error.', 'The data is invalid.', 'The network has an error.',
  'The server has an error.'
];

const names = new Map<number, string>(Object.entries(Status).map(([name, code]) => [code, name]));

/** Returns the stable name of a code, for example `no_such_avatar`; `unknown` for other codes. */
export function statusName(code: number): string {
  return names.get(code) ?? 'unknown';
}

/** Returns a readable sentence for a code; empty for 0. */
export function statusText(code: number): string {
  if (code === 0) return '';
  return texts[code] ?? textByHundred[Math.floor(code / 100)] ?? `Unknown status ${code}.`;
}
