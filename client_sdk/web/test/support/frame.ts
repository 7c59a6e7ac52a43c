import {MessageType, type MessageName} from '../../generated/messages';

/** Returns a frame that contains a copy of a finished FlatBuffers message. */
export function makeFrame(name: MessageName, message: Uint8Array): ArrayBuffer {
  const bytes = Math.ceil(message.byteLength / 8) * 8;
  const frame = new ArrayBuffer(16 + bytes);
  const view = new DataView(frame);
  view.setUint32(0, 0x1a505753, true);
  view.setUint16(4, 1, true);
  view.setUint16(6, MessageType[name], true);
  view.setUint32(8, bytes, true);
  new Uint8Array(frame, 16).set(message);
  return frame;
}
