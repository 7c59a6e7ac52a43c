import {Malformed} from './malformed';

const decoder = new TextDecoder('utf-8', {fatal: true, ignoreBOM: true});
const encoder = new TextEncoder();
const controls = /[\u0000-\u001f\u007f-\u009f]/;

/** Text of at most `maxBytes` bytes, UTF-8 without control characters.
 * @throws Malformed */
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

/** As readText, and not empty. */
export function readName(bytes: Uint8Array | null, maxBytes: number, field: string,
                         index = -1): string {
  const name = readText(bytes, maxBytes, field, index);
  if (name === '') throw new Malformed('name is empty', field, index);
  return name;
}

/** Whether such a text may be sent. Lone surrogates would not come back as they were. */
export function checkText(text: unknown, maxBytes: number, field: string): void {
  if (typeof text !== 'string') throw new Malformed('is not a text', field);
  const bytes = encoder.encode(text);
  if (bytes.length > maxBytes) throw new Malformed(`is longer than ${maxBytes} bytes`, field);
  if (controls.test(text) || decoder.decode(bytes) !== text) {
    throw new Malformed('is not Unicode without control characters', field);
  }
}

export function checkName(name: unknown, maxBytes: number, field: string): void {
  checkText(name, maxBytes, field);
  if (name === '') throw new Malformed('is empty', field);
}
