import {maxBulkBytes, maxControlBytes, maxHelloBytes} from '../../generated/limits';
import {bulkMessages, MessageType, type MessageName} from '../../generated/messages';
import {Malformed} from './malformed';

export type Sender = 'client' | 'server';

export const frameHeaderBytes = 16;
const magic = 0x1a505753;  // "SWP", 0x1a
const frameVersion = 1;

const names = new Map<number, MessageName>(
    Object.entries(MessageType).map(([name, type]) => [type, name as MessageName]));
const bulk = new Set(bulkMessages);

export function isBulk(name: MessageName): boolean {
  return bulk.has(name);
}

function maySend(sender: Sender, name: MessageName): boolean {
  return name === 'Goodbye' || (sender === 'client') === (MessageType[name] < MessageType.Goodbye);
}

/** Returns the size limit of a payload. `controlBytes` and `bulkBytes` are the server's limits. */
export function maxPayloadBytes(name: MessageName, controlBytes = maxControlBytes,
                                bulkBytes = maxBulkBytes): number {
  if (isBulk(name)) return Math.min(bulkBytes, maxBulkBytes);
  const control = Math.min(controlBytes, maxControlBytes);
  return name === 'Hello' ? Math.min(control, maxHelloBytes) : control;
}

/**
 * Checks the header of a complete frame, in the order of the standard, and returns its message
 * type.
 * @throws Malformed the header is invalid
 */
export function readFrameHeader(view: DataView, sender: Sender): MessageName {
  if (view.byteLength < frameHeaderBytes) {
    throw new Malformed('is shorter than its header', 'frame', view.byteLength);
  }
  if (view.getUint32(0, true) !== magic) {
    throw new Malformed('does not begin with the magic bytes', 'frame');
  }
  const version = view.getUint16(4, true);
  if (version !== frameVersion) throw new Malformed(`version ${version} is unknown`, 'frame');
  const type = view.getUint16(6, true);
  const name = names.get(type);
  if (name === undefined) throw new Malformed(`message type ${type} is unknown`, 'frame');
  if (!maySend(sender, name)) throw new Malformed(`${name} may not be sent by this side`, 'frame');
  if (view.getUint32(12, true) !== 0) throw new Malformed('flags are not zero', 'frame');
  const bytes = view.getUint32(8, true);
  if (bytes > maxPayloadBytes(name)) {
    throw new Malformed(`a payload of ${bytes} bytes is longer than the limit of ${name}`, 'frame');
  }
  if (bytes === 0 || bytes % 8 !== 0) {
    throw new Malformed('payload length is not a positive multiple of 8', 'frame');
  }
  if (view.byteLength !== frameHeaderBytes + bytes) {
    throw new Malformed('length differs from its header', 'frame');
  }
  return name;
}

/** Returns a frame that contains a copy of a finished FlatBuffers message. */
export function makeFrame(name: MessageName, message: Uint8Array): ArrayBuffer {
  const bytes = Math.ceil(message.byteLength / 8) * 8;
  const frame = new ArrayBuffer(frameHeaderBytes + bytes);
  const view = new DataView(frame);
  view.setUint32(0, magic, true);
  view.setUint16(4, frameVersion, true);
  view.setUint16(6, MessageType[name], true);
  view.setUint32(8, bytes, true);
  new Uint8Array(frame, frameHeaderBytes).set(message);
  return frame;
}
