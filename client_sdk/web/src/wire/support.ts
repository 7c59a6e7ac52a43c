import {ByteBuffer, type Builder} from 'flatbuffers';

/** Functions that the generated code calls to read and build messages. */

/** Contains a table without fields at position 4. */
export const absent = new ByteBuffer(Uint8Array.of(4, 0, 4, 0, 4, 0, 0, 0));
/** Contains any struct, with members that are 0. */
export const zeros = new ByteBuffer(new Uint8Array(64));

const decoder = new TextDecoder('utf-8', {ignoreBOM: true});

export function text(bytes: string | Uint8Array | null): string {
  return bytes === null ? '' : decoder.decode(bytes as Uint8Array);
}

/** Builds a list of structs. Builders write backwards. */
export function structs<T>(b: Builder, values: readonly T[],
                           start: (b: Builder, count: number) => void,
                           write: (value: T) => void): number {
  start(b, values.length);
  for (let i = values.length - 1; i >= 0; --i) write(values[i]!);
  return b.endVector();
}
