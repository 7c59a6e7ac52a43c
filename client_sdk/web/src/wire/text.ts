import {Malformed} from './malformed';

const decoder = new TextDecoder('utf-8', {fatal: true, ignoreBOM: true});
const encoder = new TextEncoder();
const controls = /[\u0000-\u001f\u007f-\u009f]/;

/** Decodes a text. Calls `fail` if it is not UTF-8 or has control characters. */
export function readText(bytes: Uint8Array, fail: (what: string) => never): string {
  let text;
  try {
    text = decoder.decode(bytes);
  } catch {
    return fail('text is not UTF-8');
  }
  return controls.test(text) ? fail('text has control characters') : text;
}

/**
 * Checks a text before it is sent.
 * @throws Malformed the text is too long, or has control characters or lone surrogates
 */
export function checkText(text: unknown, maxBytes: number, field: string): void {
  if (typeof text !== 'string') throw new Malformed('expected a string', field);
  const bytes = encoder.encode(text);
  if (bytes.length > maxBytes) {
    throw new Malformed(`expected at most ${maxBytes} bytes, got ${bytes.length}`, field);
  }
  if (controls.test(text) || decoder.decode(bytes) !== text) {
    throw new Malformed('contains control characters or lone surrogates', field);
  }
}

/** Same as checkText, but rejects an empty text. */
export function checkName(name: unknown, maxBytes: number, field: string): void {
  checkText(name, maxBytes, field);
  if (name === '') throw new Malformed('is empty', field);
}
