import {StridewireError} from './error';
import {Status, statusName, statusText} from './status';
import type {Reply} from './types';
import type {Reply as ReplyMessage} from '../generated/messages';

/** Makes a reply from a status, and from the message of the server if there is one. */
export function makeReply(code: number, text: string, message?: ReplyMessage): Reply {
  const items = (message?.items ?? []).map((item) => ({
    ...item, status: statusName(item.code), text: item.text || statusText(item.code)
  }));
  return {
    ok: code === 0,
    code,
    status: statusName(code),
    // If the server refused only some items, `code` is the status of the first of them.
    text: text || items.find((item) => item.code === code)?.text || statusText(code),
    accepted: message?.accepted ?? 0,
    items,
  };
}

/**
 * Makes the reply to a command that was not sent because of this error. Throws the error if the
 * WebAssembly module has stopped, because the client can then no longer work.
 */
export function refusal(error: unknown): Reply {
  if (error instanceof WebAssembly.RuntimeError) throw error;
  if (error instanceof StridewireError) return makeReply(error.code, error.message);
  return makeReply(Status.invalid_argument, error instanceof Error ? error.message : '');
}
