import {decoders} from '../../generated/decoders';
import {maxCrowdTables, maxFewTables} from '../../generated/limits';
import type {Message} from '../../generated/messages';
import {tableNumbers} from '../../generated/tables';
import {frameHeaderBytes, isBulk, readFrameHeader, type Sender} from './frame';
import {Malformed} from './malformed';
import {Reader} from './reader';
import {verify} from './verify';

/**
 * Decodes a frame and checks it against protocol/STANDARD.md: first its structure, then the meaning
 * of its fields. The poses of a batch are checked later, by PoseReader. Lists of numbers are views
 * of the frame.
 * @throws Malformed the frame is invalid; no other error is thrown
 */
export function decodeFrame(frame: ArrayBuffer, sender: Sender): Message {
  const name = readFrameHeader(new DataView(frame), sender);
  const payload = new DataView(frame, frameHeaderBytes);
  if (!verify(payload, tableNumbers[name], isBulk(name) ? maxCrowdTables : maxFewTables)) {
    throw new Malformed('is not a well-formed FlatBuffers message', name);
  }
  return decoders[name](new Reader(payload, name), payload.getUint32(0, true));
}
