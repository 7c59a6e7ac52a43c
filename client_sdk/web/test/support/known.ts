import assert from 'node:assert/strict';
import type {BatchMode, Message} from '../../src/wire/messages';
import {PoseReader} from '../../src/wire/pose_codec';
import {vectorCodec} from './vectors';

/** Values of all enumerators and message types. */
const enumerators = new Set([
  'Hello', 'JoinWorld', 'LeaveWorld', 'Spawn', 'Remove', 'Request', 'CancelQueue', 'Observe',
  'StopObserving', 'Ping', 'InspectAvatar', 'SetTerrain', 'SetLayers', 'SetPlanting',
  'FetchLibrary', 'Goodbye', 'Welcome', 'WorldInfo', 'Reply', 'PoseBatch', 'Events', 'Lagging',
  'Error', 'Pong', 'AvatarState', 'WorldTerrain', 'Movements', 'LibraryPiece', 'controller',
  'observer', 'full', 'quantised', 'movement', 'compact', 'compactFewer', 'compactRoot', 'all',
  'reduced', 'root', 'step', 'jump', 'stand', 'walk', 'none', 'afterMovement', 'now', 'auto',
  'left', 'right', 'stepLeft', 'stepRight', 'accepted', 'started', 'footStrike', 'finished',
  'idle', 'rejected', 'spawned', 'removed', 'entered', 'startX', 'startY', 'startZ', 'endX',
  'endY', 'endZ', 'turn', 'length', 'height',
]);
/** Text fields that are not enumerators. */
const freeTexts = new Set([
  'text', 'reason', 'name', 'clientName', 'authToken', 'serverName', 'serverVersion', 'libraryHash',
  'layer', 'layers', 'hash'
]);

/** Asserts that numbers are finite, enumerators are known, and texts are short and printable. */
export function assertValid(value: unknown, field = ''): void {
  switch (typeof value) {
    case 'number': assert.ok(Number.isFinite(value), `${field}: ${value}`); break;
    case 'bigint': assert.ok(value >= 0n && value < 2n ** 64n, `${field}: ${value}`); break;
    case 'string':
      if (freeTexts.has(field)) {
        assert.ok(Buffer.byteLength(value) <= 4096, `${field}: ${value.length} characters`);
        assert.ok(!/[\u0000-\u001f\u007f-\u009f]/.test(value), field);
      } else {
        assert.ok(enumerators.has(value), `${field}: ${value}`);
      }
      break;
    case 'object':
      if (value === null) break;
      if (ArrayBuffer.isView(value)) {
        if (value instanceof Float32Array || value instanceof Float64Array) {
          for (const number of value) assert.ok(Number.isFinite(number), `${field}: ${number}`);
        }
        break;
      }
      for (const [name, entry] of Object.entries(value)) {
        assertValid(entry, Array.isArray(value) ? field : name);
      }
      break;
    default: assert.equal(typeof value, 'boolean', field);
  }
}

/** Asserts that a message is valid. Poses of a batch must be finite with unit rotations, unless the
 * reader rejects them. */
export function checkMessage(message: Message): 'valid' | 'invalid pose' {
  assertValid(message);
  if (message.type !== 'PoseBatch') return 'valid';
  const mode = message.mode as BatchMode;
  const reader = new PoseReader({...message, mode, codec: vectorCodec(mode)});
  const rootM = new Float32Array(3);
  const rotations = new Float32Array(4 * message.jointCount);
  for (let i = 0; i < message.avatars.length; ++i) {
    rootM.fill(NaN);
    rotations.fill(NaN);
    if (!reader.read(i, rootM, 0, rotations, 0)) return 'invalid pose';
    for (const x of rootM) assert.ok(Number.isFinite(x), `root ${x}`);
    for (let j = 0; j < rotations.length; j += 4) {
      const length = Math.hypot(rotations[j]!, rotations[j + 1]!, rotations[j + 2]!,
                                rotations[j + 3]!);
      assert.ok(Math.abs(length - 1) <= 1.001e-3, `a rotation has length ${length}`);
    }
  }
  return 'valid';
}
