import {ByteBuffer} from 'flatbuffers';

/** Values and functions that the generated code uses to read messages. */

/** A buffer that contains a table without fields at position 4. */
export const absent = new ByteBuffer(Uint8Array.of(4, 0, 4, 0, 4, 0, 0, 0));
/** A buffer of zeros. Every struct that is read at position 0 has members that are 0. */
export const zeros = new ByteBuffer(new Uint8Array(64));

const decoder = new TextDecoder('utf-8', {ignoreBOM: true});

export function text(bytes: string | Uint8Array | null): string {
  return bytes === null ? '' : decoder.decode(bytes as Uint8Array);
}
