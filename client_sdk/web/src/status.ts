import {Status} from '../generated/native';
import {native} from './native';

export {Status};

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
