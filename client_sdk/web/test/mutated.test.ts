import assert from 'node:assert/strict';
import {test} from 'node:test';
import {MessageType} from '../generated/messages';
import {decodeMessage, type Sender} from '../src/testing';
import {numberFrom} from './support/environment';
import {checkMessage} from './support/known';
import {Random} from './support/random';
import {readVectors} from './support/vectors';

const frames = numberFrom('STRIDEWIRE_MUTATIONS', 5000);

/** Returns a copy of a frame with a few bytes, words or bits changed. Half of the copies keep their
 * header, because most frames with a changed header are rejected at once. */
function mutate(from: ArrayBuffer, random: Random): ArrayBuffer {
  let frame = from.slice(0);
  const first = random.below(2) === 0 ? 16 : 0;
  const changes = 1 + random.below(6);
  for (let change = 0; change < changes; ++change) {
    const view = new DataView(frame);
    const bytes = frame.byteLength;
    if (bytes <= first + 8) break;
    const at = first + random.below(bytes - first);
    const word = first + 4 * random.below((bytes - first) >> 2);
    switch (random.below(9)) {
      case 0: view.setUint8(at, view.getUint8(at) ^ (1 << random.below(8))); break;
      case 1: view.setUint8(at, random.below(256)); break;
      case 2: view.setUint32(word, random.below(2 ** 32), true); break;
      case 3: view.setUint32(word, random.below(64), true); break;
      case 4: view.setUint32(word, 0xffff_ffff - random.below(4), true); break;
      case 5: view.setUint32(word, view.getUint32(word, true) + random.below(65) - 32, true); break;
      case 6:
        view.setFloat32(word, [NaN, Infinity, -Infinity, 1e38][random.below(4)]!, true);
        break;
      case 7: {  // Copies bytes from elsewhere in the frame.
        const length = Math.min(1 + random.below(32), bytes - at);
        const source = random.below(bytes - length + 1);
        new Uint8Array(frame).copyWithin(at, source, source + length);
        break;
      }
      default: {  // Cuts the frame, half of the time with a matching header.
        frame = frame.slice(0, at);
        if (frame.byteLength >= 16 && random.below(2) === 0) {
          frame = frame.slice(0, frame.byteLength & ~7);
          new DataView(frame).setUint32(8, frame.byteLength - 16, true);
        }
      }
    }
  }
  return frame;
}

test(`${frames} mutated frames are rejected or decode to valid messages`, () => {
  const random = new Random('mutated frames');
  const vectors = readVectors().filter(({frame}) => frame.byteLength < 1 << 16);
  const count = {rejected: 0, valid: 0, 'invalid pose': 0};
  let slowestMs = 0;
  for (let i = 0; i < frames; ++i) {
    const vector = vectors[random.below(vectors.length)]!;
    const sender: Sender = vector.typeNumber < MessageType.Goodbye ? 'client' : 'server';
    const frame = mutate(vector.frame, random);
    const startedMs = performance.now();
    try {
      ++count[checkMessage(decodeMessage(frame, sender), frame)];
    } catch (error) {
      if (error instanceof assert.AssertionError || error instanceof WebAssembly.RuntimeError) {
        console.log(`frame ${i}, from ${vector.name}: ${Buffer.from(frame).toString('hex')}`);
        throw error;
      }
      ++count.rejected;
    }
    slowestMs = Math.max(slowestMs, performance.now() - startedMs);
  }
  console.log(`${JSON.stringify(count)}, slowest ${slowestMs.toFixed(1)} ms`);
  assert.equal(count.rejected + count.valid + count['invalid pose'], frames);
  // If nearly all or no mutations were rejected, this test would prove nothing.
  assert.ok(count.rejected > frames / 4 && count.valid > frames / 50, JSON.stringify(count));
});

const skip = globalThis.gc === undefined &&
  'measuring memory requires node --expose-gc, as in scripts/test.mjs';
if (skip) console.log(`mutated.test.ts skips a test: ${skip}`);

test('rejected frames do not leak memory', {skip}, () => {
  const random = new Random('memory of rejected frames');
  const vectors = readVectors().filter(({frame}) => frame.byteLength < 1 << 16);
  const round = (): void => {
    for (let i = 0; i < 2000; ++i) {
      const vector = vectors[random.below(vectors.length)]!;
      try {
        decodeMessage(mutate(vector.frame, random),
                    vector.typeNumber < MessageType.Goodbye ? 'client' : 'server');
      } catch (error) {
        assert.ok(!(error instanceof WebAssembly.RuntimeError));
      }
    }
    globalThis.gc!();
  };
  round();
  const before = process.memoryUsage();
  for (let i = 0; i < 5; ++i) round();
  const after = process.memoryUsage();
  const grown = after.heapUsed + after.arrayBuffers - before.heapUsed - before.arrayBuffers;
  assert.ok(grown < 4 << 20, `${grown} bytes leaked`);
});
