import assert from 'node:assert/strict';
import {test} from 'node:test';

import {matchingTime, samplePose, timeAtGenericTime} from '../src/library/clip_pose.js';
import {roundScaleTop, widestParameters} from '../src/library/library_page.js';
import {LatestRequest} from '../src/library/library_client.js';
import type {Clip} from '../src/library/library_client.js';
import {scaleColour} from '../src/library/parameter_plane.js';

function clip(keytimesS: number[], timesS: number[], roots: number[], rotations: number[]): Clip {
  return {
    times_s: timesS, roots_m: roots, rotations, keytimes_s: keytimesS, heading_change_rad: 0,
    weights: [1], weight_sum: 1, applied: [0], measured: [0],
  };
}

test('matches times of two movements by generic time', () => {
  const a = clip([0, 0.2, 1], [0, 1], [0, 0, 0, 0, 0, 1], [0, 0, 0, 1, 0, 0, 0, 1]);
  const b = clip([0, 0.6, 0.8], [0, 0.8], [0, 0, 0, 0, 0, 1], [0, 0, 0, 1, 0, 0, 0, 1]);
  assert.equal(timeAtGenericTime(b.keytimes_s, 1.5), 0.7);
  assert.ok(Math.abs(matchingTime(a, b, 0.1) - 0.3) < 1e-12);
  assert.ok(Math.abs(matchingTime(a, b, 0.6) - 0.7) < 1e-12);
  assert.equal(matchingTime(a, b, 1), 0.8);
  assert.equal(matchingTime(a, b, 9), 0.8);
});

test('interpolates rotations along the shorter arc, with unit length', () => {
  const s = Math.SQRT1_2;
  // The second frame is a quarter turn with the opposite sign.
  const it = clip([0, 1], [0, 0.5, 1], [0, 1, 0, 0, 1, 1, 0, 1, 2],
    [0, 0, 0, 1, 0, -s, 0, -s, 0, 1, 0, 0]);
  const roots = new Float32Array(6);
  const rotations = new Float32Array(8);
  samplePose(it, 1, 0.25, 0.5, roots, rotations, 1);
  assert.deepEqual([...roots.subarray(3)], [0.5, 1, 0.5]);
  const [x, y, z, w] = rotations.subarray(4);
  assert.ok(Math.abs(Math.hypot(x!, y!, z!, w!) - 1) < 1e-6);
  assert.ok(Math.abs(2 * Math.atan2(y!, w!) - Math.PI / 4) < 1e-6);
  samplePose(it, 1, 7, 0, roots, rotations, 0);
  assert.equal(roots[2], 2);
});

test('colours become lighter with the value, and the scale ends at a round number', () => {
  let last = -1;
  for (let i = 0; i <= 20; ++i) {
    const [r, g, b] = scaleColour(i / 20);
    const light = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    assert.ok(light > last, `${i}`);
    last = light;
  }
  assert.deepEqual(scaleColour(-3), scaleColour(0));
  assert.deepEqual(scaleColour(3), scaleColour(1));
  assert.equal(roundScaleTop(2.8), 3);
  assert.equal(roundScaleTop(0.013), 0.015);
  assert.ok(roundScaleTop(0) > 0);
});

test('selects the parameters with the widest range as axes', () => {
  const parameter = (name: string, min: number, max: number) => ({name, min, max});
  const group = (parameters: ReturnType<typeof parameter>[]) =>
    ({kind: 'jump', parameters, sites: []});
  assert.deepEqual(widestParameters(group([parameter('length_m', 0, 1)])), [0, 0]);
  assert.deepEqual(widestParameters(group([
    parameter('start_x_m', 0, 0.1), parameter('end_z_m', 0, 0.7), parameter('turn_rad', -1, 1)])),
    [1, 2]);
});

test('executes only the newest of the requests that wait', async () => {
  const done: number[] = [];
  const failed: string[] = [];
  let release = (): void => {};
  const latest = new LatestRequest<number>(async (request) => {
    await new Promise<void>((resolve) => (release = resolve));
    if (request === 3) throw new Error('three');
    done.push(request);
  }, (error) => failed.push(error.message));
  latest.submit(1);
  latest.submit(2);
  latest.submit(3);
  release();
  await new Promise((resolve) => setTimeout(resolve));
  release();
  await new Promise((resolve) => setTimeout(resolve));
  latest.submit(4);
  release();
  await new Promise((resolve) => setTimeout(resolve));
  assert.deepEqual(done, [1, 4]);
  assert.deepEqual(failed, ['three']);
});
