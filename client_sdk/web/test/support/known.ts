import assert from 'node:assert/strict';
import {decodePoses, type Message} from '../../src/testing';
import type {CrowdPose} from '../../src/types';
import {vectorInfo} from './vectors';

/** Values of all enumerators and message types. */
const enumerators = new Set([
  'Hello', 'JoinWorld', 'LeaveWorld', 'Spawn', 'Remove', 'Request', 'CancelQueue', 'Observe',
  'StopObserving', 'Ping', 'InspectAvatar', 'SetTerrain', 'SetLayers', 'SetPlanting',
  'FetchLibrary', 'Goodbye', 'Welcome', 'WorldInfo', 'Reply', 'PoseBatch', 'Events', 'Lagging',
  'Error', 'Pong', 'AvatarState', 'WorldTerrain', 'Movements', 'LibraryPiece', 'controller',
  'observer', 'full', 'quantised', 'movement', 'compact', 'compactReduced', 'compactRoot', 'all',
  'reduced', 'root', 'step', 'jump', 'stand', 'walk', 'none', 'afterMovement', 'now', 'auto',
  'left', 'right', 'stepLeft', 'stepRight', 'accepted', 'started', 'footStrike', 'finished',
  'idle', 'rejected', 'spawned', 'removed', 'entered', 'startX', 'startY', 'startZ', 'endX',
  'endY', 'endZ', 'turn', 'length', 'height', 'completed', 'cancelled', 'replaced',
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
 * module rejects them. */
export function checkMessage(message: Message, frame: ArrayBuffer): 'valid' | 'invalid pose' {
  assertValid(message);
  if (message.type !== 'PoseBatch') return 'valid';
  let poses: CrowdPose;
  try {
    poses = decodePoses(frame, vectorInfo());
  } catch {
    return 'invalid pose';
  }
  for (const x of poses.rootsM.subarray(0, 3 * poses.count)) {
    assert.ok(Number.isFinite(x), `root ${x}`);
  }
  const rotations = poses.rotations.subarray(0, 4 * poses.jointCount * poses.count);
  for (let j = 0; j < rotations.length; j += 4) {
    const length = Math.hypot(...rotations.subarray(j, j + 4));
    assert.ok(Math.abs(length - 1) <= 1.001e-3, `a rotation has length ${length}`);
  }
  return 'valid';
}
