import assert from 'node:assert/strict';
import {test} from 'node:test';

import {Playback} from '../src/playback.js';

const recorded = {firstS: 80, lastS: 100};

test('shows the render time while live', () => {
  const playback = new Playback();
  assert.equal(playback.advance(0.016, 100, recorded), 100);
  assert.ok(playback.live);
});

test('holds the time while paused, and keeps the delay after resuming', () => {
  const playback = new Playback();
  playback.advance(0.016, 100, recorded);
  playback.pause();
  assert.equal(playback.advance(1, 101, {firstS: 81, lastS: 101}), 100);
  playback.resume();
  assert.equal(playback.advance(1, 102, {firstS: 82, lastS: 102}), 101);
  assert.ok(!playback.live);
});

test('shows the oldest recorded time after a pause longer than the recording', () => {
  const playback = new Playback();
  playback.advance(0.016, 100, recorded);
  playback.pause();
  assert.equal(playback.advance(30, 130, {firstS: 110, lastS: 130}), 110);
});

test('falls behind in slow motion, and does not catch up at full speed', () => {
  const playback = new Playback();
  playback.advance(0.016, 100, recorded);
  playback.setRate(0.25);
  assert.equal(playback.advance(1, 101, recorded), 100.25);
  playback.setRate(1);
  assert.equal(playback.advance(1, 102, recorded), 101.25);
  playback.goLive();
  assert.equal(playback.advance(1, 103, recorded), 103);
});

test('never passes the render time, and becomes live when it reaches that', () => {
  const playback = new Playback();
  playback.advance(0.016, 100, recorded);
  playback.seek(200);
  assert.equal(playback.advance(0.016, 100.1, recorded), 100.1);
  assert.ok(playback.live);
});

test('seeks back while paused', () => {
  const playback = new Playback();
  playback.advance(0.016, 100, recorded);
  playback.pause();
  playback.seek(90);
  assert.equal(playback.advance(0.5, 100.5, recorded), 90);
});
