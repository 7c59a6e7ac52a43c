import assert from 'node:assert/strict';
import {test} from 'node:test';

import type {Statistics} from '../src/sdk.js';
import {StreamCosts, nameOf, observationOf, type Stream} from '../src/pose_stream.js';

const all: Stream = {mode: 'quantised', detail: 'all', everyNTicks: 1};
const root: Stream = {mode: 'quantised', detail: 'root', everyNTicks: 4};

test('full poses have all joints, whatever detail is chosen', () => {
  assert.equal(observationOf({...root, mode: 'full'}).detail, 'all');
  assert.equal(nameOf({...root, mode: 'full'}), 'Full, ¼ rate');
  assert.equal(nameOf(root), 'Quantised, root, ¼ rate');
});

test('what streams cost is kept beside one another as long as there are as many avatars', () => {
  const costs = new StreamCosts();
  let ms = 0;
  let poseBytesReceived = 0;
  let posesReceived = 0;
  const run = (stream: Stream, avatars: number, seconds: number, bytesAPose: number) => {
    for (let i = 0; i < 20 * seconds; ++i) {
      ms += 50;
      const poses = 3 * avatars / stream.everyNTicks;
      posesReceived += poses;
      poseBytesReceived += poses * bytesAPose;
      costs.measure(ms, stream, avatars, {poseBytesReceived, posesReceived} as Statistics);
    }
  };
  run(all, 8, 1, 100);
  assert.deepEqual(costs.costs, []);  // not yet
  run(all, 8, 2, 100);
  assert.deepEqual(costs.costs, [
    {name: 'Quantised', now: true, bytesAPose: 100, bytesPerS: 48_000}]);
  // What was on its way is still of the stream before.
  run(root, 8, 0.4, 100);
  run(root, 8, 2, 20);
  assert.deepEqual(costs.costs, [
    {name: 'Quantised', now: false, bytesAPose: 100, bytesPerS: 48_000},
    {name: 'Quantised, root, ¼ rate', now: true, bytesAPose: 20, bytesPerS: 2400}]);
  run(root, 9, 0.2, 20);
  assert.deepEqual(costs.costs, []);
});
