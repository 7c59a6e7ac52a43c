import assert from 'node:assert/strict';
import {test} from 'node:test';
import type {CompactCodec} from '../src/wire/compact_codec';
import {decodeFrame} from '../src/wire/decode';
import {Encoder} from '../src/wire/encode';
import {MessageType} from '../generated/messages';
import type {BatchMode, ClientMessage} from '../src/wire/messages';
import {PoseReader} from '../src/wire/pose_codec';
import {toJson} from './support/to_json';
import {readVectors, vectorCodec} from './support/vectors';

const tolerance = 1e-6;  // For quantised rotations. Everything else is exact.

function sameValues(actual: unknown, expected: unknown, where: string): void {
  if (Array.isArray(expected)) {
    assert.ok(Array.isArray(actual), where);
    assert.equal(actual.length, expected.length, `${where}: length`);
    expected.forEach((value, i) => sameValues(actual[i], value, `${where}[${i}]`));
  } else if (expected !== null && typeof expected === 'object') {
    assert.ok(actual !== null && typeof actual === 'object', where);
    assert.deepEqual(Object.keys(actual).sort(), Object.keys(expected).sort(), where);
    for (const [name, value] of Object.entries(expected)) {
      sameValues((actual as never)[name], value, `${where}.${name}`);
    }
  } else if (typeof expected === 'number' && where.includes('rotations')) {
    assert.equal(typeof actual, 'number', where);
    assert.ok(Math.abs(actual as number - expected) <= tolerance, `${where}: ${actual}`);
  } else if (typeof expected === 'number' && !Number.isInteger(expected)) {
    // The JSON has the shortest decimal that identifies a float32.
    assert.ok(actual === expected || Math.fround(expected) === actual, `${where}: ${actual}`);
  } else {
    assert.equal(actual, expected, where);
  }
}

const vectors = readVectors();
const fromServer = (typeNumber: number): boolean => typeNumber >= MessageType.Goodbye;

test('every message type has a vector', () => {
  assert.deepEqual([...new Set(vectors.map((vector) => vector.typeNumber))].sort((a, b) => a - b),
                   Object.values(MessageType).sort((a, b) => a - b));
});

for (const vector of vectors) {
  const sender = fromServer(vector.typeNumber) ? 'server' : 'client';
  test(`decodes ${vector.name}`, () => {
    const message = decodeFrame(vector.frame, sender);
    assert.equal(message.type, vector.type);
    sameValues(toJson(message), vector.fields, vector.name);
  });

  if (sender === 'client' || vector.type === 'Goodbye') {
    test(`encodes ${vector.name}`, () => {
      const message = decodeFrame(vector.frame, 'client') as ClientMessage;
      const frame = new Encoder().encode(message);
      sameValues(toJson(decodeFrame(frame, 'client')), vector.fields, vector.name);
    });
  }
}

test('encodes a side of 0 differently from an absent side', () => {
  const vector = vectors.find(({name}) => name === 'request')!;
  const message = decodeFrame(vector.frame, 'client');
  assert.ok(message.type === 'Request');
  const step = message.items.find((item) => item.type === 'step')!;
  for (const sideM of [0, -0, null]) {
    const frame = new Encoder().encode({...message, items: [{...step, sideM}]});
    const back = decodeFrame(frame, 'client');
    assert.ok(back.type === 'Request');
    assert.equal(back.items[0]!.sideM, sideM);
  }
});

test('decodes compact poses in any order, and only with their codec', () => {
  const {frame} = vectors.find(({name}) => name === 'pose_batch_compact')!;
  const batch = decodeFrame(frame, 'server');
  assert.ok(batch.type === 'PoseBatch');
  assert.equal(batch.flags[1]! & 4, 4, 'the second pose is wide');
  const read = (codec: CompactCodec | null, order: number[]): (number[] | null)[] => {
    const reader = new PoseReader({...batch, mode: 'compact', codec});
    const poses: (number[] | null)[] = [];
    for (const i of order) {
      const rootM = new Float32Array(3);
      const rotations = new Float32Array(4 * batch.jointCount);
      poses[i] = reader.read(i, rootM, 0, rotations, 0) ? [...rootM, ...rotations] : null;
    }
    return poses;
  };
  const inOrder = read(vectorCodec('compact'), [0, 1, 2]);
  assert.ok(inOrder.every((pose) => pose !== null));
  assert.deepEqual(read(vectorCodec('compact'), [2, 0, 1]), inOrder);
  // A wide pose does not depend on the codec.
  assert.deepEqual(read(null, [0, 1, 2]), [null, inOrder[1], null]);
});

test('sets joints that a detail leaves out to their references', () => {
  const info = decodeFrame(vectors.find(({name}) => name === 'world_info_detail')!.frame, 'server');
  assert.ok(info.type === 'WorldInfo');
  const read = (name: string): Float32Array => {
    const batch = decodeFrame(vectors.find((vector) => vector.name === name)!.frame, 'server');
    assert.ok(batch.type === 'PoseBatch');
    const rotations = new Float32Array(4 * batch.jointCount);
    const mode = batch.mode as BatchMode;
    assert.ok(new PoseReader({...batch, mode, codec: vectorCodec(mode)})
      .read(0, new Float32Array(3), 0, rotations, 0));
    return rotations;
  };
  const all = read('pose_batch_compact');
  const batches: [string, {includes(joint: number): boolean}][] =
      [['pose_batch_fewer', info.reducedJoints], ['pose_batch_root', [0]]];
  for (const [name, joints] of batches) {
    const rotations = read(name);
    info.rotationCodes.forEach(({reference}, j) => {
      const expected =
          joints.includes(j) ? all.subarray(4 * j, 4 * j + 4) : Float32Array.from(reference);
      assert.deepEqual(rotations.subarray(4 * j, 4 * j + 4), expected, `${name}, joint ${j}`);
    });
  }
});
