import assert from 'node:assert/strict';
import {test} from 'node:test';
import {MessageType} from '../generated/messages';
import {decodeMessage, decodePoses, encodeMessage} from '../src/testing';
import {toJson} from './support/to_json';
import {readVectors, vectorInfo} from './support/vectors';

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

test('every message type has a vector', () => {
  assert.deepEqual([...new Set(vectors.map((vector) => vector.typeNumber))].sort((a, b) => a - b),
                   Object.values(MessageType).sort((a, b) => a - b));
});

for (const vector of vectors) {
  test(`decodes and encodes ${vector.name}`, () => {
    const message = decodeMessage(vector.frame);
    assert.equal(message.type, vector.type);
    sameValues(toJson(message, vector.frame), vector.fields, vector.name);
    assert.deepEqual(Buffer.from(encodeMessage(message)), Buffer.from(vector.frame));
  });
}

test('encodes a side of 0 differently from an absent side', () => {
  const vector = vectors.find(({name}) => name === 'request')!;
  const message = decodeMessage(vector.frame);
  assert.ok(message.type === 'Request');
  const step = message.items.find((item) => item.type === 'step')!;
  for (const sideM of [0, null]) {
    const back = decodeMessage(encodeMessage({...message, items: [{...step, sideM}]}));
    assert.ok(back.type === 'Request');
    assert.equal(back.items[0]!.sideM, sideM);
  }
});

test('refuses to encode invalid messages', () => {
  const vector = vectors.find(({name}) => name === 'request')!;
  const message = decodeMessage(vector.frame);
  assert.ok(message.type === 'Request');
  const [item] = message.items;
  for (const [change, why] of [
    [{avatar: 0}, /avatar: expected/], [{avatar: 2 ** 32}, /avatar\[0\]: expected an integer/],
    [{lengthM: NaN}, /lengthM\[0\]: expected a finite number, got NaN/],
    [{type: 'fly'}, /type\[0\]: expected one of step, jump, stand, walk, got fly/],
    [{exactOnly: 1}, /exactOnly\[0\]: expected true or false/],
    [{requestId: -1n}, /requestId\[0\]: expected a bigint/],
  ] as const) {
    assert.throws(() => encodeMessage({...message, items: [{...item!, ...change as object}]}), why);
  }
  assert.throws(() => encodeMessage({...message, items: []}), /items/);
});

test('decodes compact poses only with the WorldInfo of their world', () => {
  const {frame} = vectors.find(({name}) => name === 'pose_batch_compact')!;
  assert.equal(decodePoses(frame, vectorInfo()).count, 3);
  assert.throws(() => decodePoses(frame));
});

test('sets joints that a detail leaves out to their references', () => {
  const info = decodeMessage(vectorInfo());
  assert.ok(info.type === 'WorldInfo');
  const read = (name: string): Float32Array => decodePoses(
      vectors.find((vector) => vector.name === name)!.frame, vectorInfo()).rotations;
  const all = read('pose_batch_compact');
  const batches: [string, {includes(joint: number): boolean}][] =
      [['pose_batch_reduced', info.reducedJoints], ['pose_batch_root', [0]]];
  for (const [name, joints] of batches) {
    const rotations = read(name);
    info.rotationQuantizations.forEach(({reference}, j) => {
      const expected =
          joints.includes(j) ? all.subarray(4 * j, 4 * j + 4) : Float32Array.from(reference);
      assert.deepEqual(rotations.subarray(4 * j, 4 * j + 4), expected, `${name}, joint ${j}`);
    });
  }
});
