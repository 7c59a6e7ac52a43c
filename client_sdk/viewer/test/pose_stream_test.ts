import assert from 'node:assert/strict';
import {test} from 'node:test';

import type {Statistics} from '../src/sdk.js';
import {StreamCosts, streamName, observationFor, type PoseStream} from '../src/pose_stream.js';

const all: PoseStream = {mode: 'quantised', detail: 'all', everyNTicks: 1};
const root: PoseStream = {mode: 'quantised', detail: 'root', everyNTicks: 4};

test('requests all joints unless poses are quantised', () => {
  assert.equal(observationFor({...root, mode: 'movement'}).detail, 'all');
  assert.equal(streamName({...root, mode: 'movement'}), 'Movement, ¼ rate');
  assert.equal(observationFor({...root, mode: 'full'}).detail, 'all');
  assert.equal(streamName({...root, mode: 'full'}), 'Full, ¼ rate');
  assert.equal(streamName(root), 'Quantised, root only, ¼ rate');
});

test('keeps the costs of all streams used until the number of avatars changes', () => {
  const costs = new StreamCosts();
  let ms = 0;
  let poseBytesReceived = 0;
  let posesReceived = 0;
  const run = (stream: PoseStream, avatars: number, seconds: number, bytesPerPose: number) => {
    for (let i = 0; i < 20 * seconds; ++i) {
      ms += 50;
      const poses = 3 * avatars / stream.everyNTicks;
      posesReceived += poses;
      poseBytesReceived += poses * bytesPerPose;
      costs.measure(ms, stream, avatars, {poseBytesReceived, posesReceived} as Statistics);
    }
  };
  run(all, 8, 1, 100);
  assert.deepEqual(costs.costs, []);  // The measuring window is not complete.
  run(all, 8, 2, 100);
  assert.deepEqual(costs.costs, [
    {name: 'Quantised', active: true, bytesPerPose: 100, bytesPerS: 48_000}]);
  // Poses of the previous stream still arrive for a short time.
  run(root, 8, 0.4, 100);
  run(root, 8, 2, 20);
  assert.deepEqual(costs.costs, [
    {name: 'Quantised', active: false, bytesPerPose: 100, bytesPerS: 48_000},
    {name: 'Quantised, root only, ¼ rate', active: true, bytesPerPose: 20, bytesPerS: 2400}]);
  run(root, 9, 0.2, 20);
  assert.deepEqual(costs.costs, []);
});
