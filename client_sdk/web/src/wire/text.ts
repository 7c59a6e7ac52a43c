import {Malformed} from './malformed';

const decoder = new TextDecoder('utf-8', {fatal: true, ignoreBOM: true});
const encoder = new TextEncoder();
const controls = /[\u0000-\u001f\u007f-\u009f]/;

/**
 * Decodes a text of at most `maxBytes` bytes.
 * @throws Malformed the text is too long, is not UTF-8, or has control characters
 */
export function readText(bytes: Uint8Array | null, maxBytes: number, field: string,
                         index = -1): string {
  if (bytes === null || bytes.length === 0) return '';
  if (bytes.length > maxBytes) throw new Malformed('text is too long', field, index);
  let text;
  try {
    text = decoder.decode(bytes);
  } catch {
    throw new Malformed('text is not UTF-8', field, index);
  }
  if (controls.test(text)) throw new Malformed('text has control characters', field, index);
  return text;
}

/** Same as readText, but rejects an empty text. */
export function readName(bytes: Uint8Array | null, maxBytes: number, field: string,
                         index = -1): string {
  const name = readText(bytes, maxBytes, field, index);
  if (name === '') throw new Malformed('name is empty', field, index);
  return name;
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
