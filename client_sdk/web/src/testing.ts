/** Tools for programs that test implementations of the protocol. */
import {MessageType, type Message} from '../generated/messages';
import {native} from './native';
import {createCrowdPose, CrowdReader} from './pose_buffers';
import type {CrowdPose} from './types';
import {readMessage, typeOfFrame, writeMessage} from './wire/frame';

export type {Message} from '../generated/messages';

/** Side that sends a message. */
export type Sender = 'client' | 'server';

function senderOf(type: number): Sender {
  return type < MessageType.Goodbye ? 'client' : 'server';
}

function check(frame: Uint8Array, sender: Sender): void {
  const bytes = native().setInput(frame);
  if (native().call.check_frame(bytes, Number(sender === 'client')) === 0) {
    throw new Error(native().text);
  }
}

/**
 * Decodes a frame. Lists of numbers are views of the frame. The poses of a batch stay encoded, see
 * `decodePoses`.
 * @param sender the side that sent the frame; absent: the side that may send its message
 * @throws Error the frame does not follow protocol/STANDARD.md
 */
export function decodeMessage(frame: ArrayBuffer, sender = senderOf(typeOfFrame(frame))): Message {
  check(new Uint8Array(frame), sender);
  return readMessage(frame);
}

/**
 * Encodes a message as a frame, with the same bytes as the native libraries.
 * @throws Error the message does not follow protocol/STANDARD.md
 */
export function encodeMessage(message: Message): ArrayBuffer {
  const bytes = native().call.encode_frame(
      MessageType[message.type], native().setInput(writeMessage({...message})));
  if (bytes === 0) throw new Error(native().text);
  return native().bytes(native().results[0]!, bytes).buffer;
}

/**
 * Decodes the poses of a batch, in its order. `flags` are those of the batch.
 * @param info the WorldInfo frame of the batch's world, for compact poses
 * @throws Error the batch or one of its poses is invalid
 */
export function decodePoses(batch: ArrayBuffer, info = new ArrayBuffer(0)): CrowdPose {
  native().setInput(new Uint8Array(info), new Uint8Array(batch));
  const count = native().call.decode_poses(info.byteLength, batch.byteLength);
  if (count < 0) throw new Error(native().text);
  const out = createCrowdPose();
  new CrowdReader().read(count, out);
  return out;
}
