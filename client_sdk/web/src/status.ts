import {native} from './native';

/**
 * Status codes, the same as in stridewire/status.h. The first digit states who can correct the
 * problem: 1xx the caller, 2xx the author of the data, 3xx the network, 4xx the operator of the
 * server.
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
  dropped: 116,
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

const names = new Map<number, string>(Object.entries(Status).map(([name, code]) => [code, name]));

/** Returns the stable name of a code, for example `no_such_avatar`; `unknown` for other codes. */
export function statusName(code: number): string {
  return names.get(code) ?? 'unknown';
}

/** Returns a readable sentence for a code; empty for 0. */
export function statusText(code: number): string {
  if (code === 0) return '';
  native().call.describe_status(code, 0);
  return native().text;
}
