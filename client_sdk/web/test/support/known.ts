import assert from 'node:assert/strict';
import type {Message} from '../../src/wire/messages';
import {PoseReader} from '../../src/wire/pose_codec';
import {vectorCodec} from './vectors';

const texts = new Set([
  'Hello', 'JoinWorld', 'LeaveWorld', 'Spawn', 'Remove', 'Request', 'CancelQueue', 'Observe',
  'StopObserving', 'Ping', 'InspectAvatar', 'Goodbye', 'Welcome', 'WorldInfo', 'Reply', 'PoseBatch',
  'compact', 'compactFewer', 'compactRoot', 'all', 'fewer', 'root', 'Events', 'Lagging', 'Error', 'Pong', 'AvatarState', 'SetTerrain', 'WorldTerrain', 'SetLayers', 'SetPlanting', 'FetchLibrary', 'Movements', 'LibraryPiece', 'controller', 'observer', 'full',
  'quantised', 'movement', 'step', 'jump', 'stand', 'walk', 'none', 'afterMovement', 'now', 'auto', 'left', 'right', 'stepLeft',
  'stepRight', 'accepted', 'started', 'footStrike', 'finished', 'idle', 'rejected', 'spawned',
  'removed', 'entered', 'startX', 'startY', 'startZ', 'endX', 'endY', 'endZ', 'turn', 'length', 'height',
]);
/** Fields whose texts are free; all others are enumerators. */
const free = new Set([
  'text', 'reason', 'name', 'clientName', 'authToken', 'serverName', 'serverVersion', 'libraryHash',
  'layer', 'layers', 'hash'
]);

/** Every number finite, every enumerator one that is known, every text clean and short. */
export function onlyKnown(value: unknown, field = ''): void {
  switch (typeof value) {
    case 'number': assert.ok(Number.isFinite(value), `${field}: ${value}`); break;
    case 'bigint': assert.ok(value >= 0n && value < 2n ** 64n, `${field}: ${value}`); break;
    case 'string':
      if (free.has(field)) {
        assert.ok(Buffer.byteLength(value) <= 4096, `${field}: ${value.length} characters`);
        assert.ok(!/[\u0000-\u001f\u007f-\u009f]/.test(value), field);
      } else {
        assert.ok(texts.has(value), `${field}: ${value}`);
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
        onlyKnown(entry, Array.isArray(value) ? field : name);
      }
      break;
    default: assert.equal(typeof value, 'boolean', field);
  }
}

/** As onlyKnown, with the poses of a batch: refused ones are counted, others are finite and unit. */
export function checkMessage(message: Message): 'known' | 'refused pose' {
  onlyKnown(message);
  if (message.type !== 'PoseBatch') return 'known';
  message.codec = vectorCodec(message.mode);
  const reader = new PoseReader(message);
  const rootM = new Float32Array(3);
  const rotations = new Float32Array(4 * message.jointCount);
  for (let i = 0; i < message.avatars.length; ++i) {
    rootM.fill(NaN);
    rotations.fill(NaN);
    if (!reader.read(i, rootM, 0, rotations, 0)) return 'refused pose';
    for (const x of rootM) assert.ok(Number.isFinite(x), `root ${x}`);
    for (let j = 0; j < rotations.length; j += 4) {
      const length = Math.hypot(rotations[j]!, rotations[j + 1]!, rotations[j + 2]!,
                                rotations[j + 3]!);
      assert.ok(Math.abs(length - 1) <= 1.001e-3, `length ${length} of a rotation`);
    }
  }
  return 'known';
}
