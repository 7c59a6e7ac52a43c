import {Builder, ByteBuffer} from 'flatbuffers';
import {builders, readers} from '../../generated/codec';
import type {Message, MessageName} from '../../generated/messages';
import {Place, type Fields} from './check';

/** A message whose values have not been checked. */
export type Draft = Fields & {readonly type: MessageName};

export const frameHeaderBytes = 16;
const builder = new Builder(1024);

/** Returns the type number of the message in a frame. */
export function typeOfFrame(frame: ArrayBuffer): number {
  return frame.byteLength < frameHeaderBytes ? 0 : new DataView(frame).getUint16(6, true);
}

/** Reads a message from a frame that the WebAssembly module has accepted: this function checks
 * nothing. Lists of numbers are views of the frame. */
export function readMessage(frame: ArrayBuffer): Message {
  const bytes = new ByteBuffer(new Uint8Array(frame));
  bytes.setPosition(frameHeaderBytes);
  return readers[typeOfFrame(frame)]!(bytes);
}

/**
 * Writes a message and returns its payload, which is valid until the next call. Properties may be
 * absent if the schema states a default. Absent `seq`, `world` and `subscription` are written as 1,
 * because the WebAssembly module sets them in commands.
 * @throws Error a value has the wrong type, or does not fit into the type of its field. The
 *     WebAssembly module checks everything else.
 */
export function writeMessage(message: Draft): Uint8Array {
  builder.clear();
  builder.finish(builders[message.type](
      builder, {seq: 1, world: 1, subscription: 1, ...message}, new Place('')));
  return builder.asUint8Array();
}
