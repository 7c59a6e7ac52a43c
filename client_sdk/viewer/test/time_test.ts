import assert from 'node:assert/strict';
import {test} from 'node:test';

import {Playback} from '../src/playback.js';
import {meanSince, parseMetrics} from '../src/prometheus.js';
import {genericTime, stateAt} from '../src/timeline.js';
import {movements} from '../src/random_walkers.js';

test('generic time is the keytime index and the share of the way to the next', () => {
  const keys = [0, 0.3, 0.8, 1];
  assert.equal(genericTime(keys, -1), 0);
  assert.equal(genericTime(keys, 0), 0);
  assert.ok(Math.abs(genericTime(keys, 0.15) - 0.5) < 1e-12);
  assert.equal(genericTime(keys, 0.3), 1);
  assert.ok(Math.abs(genericTime(keys, 0.9) - 2.5) < 1e-12);
  assert.equal(genericTime(keys, 5), 3);
  assert.equal(genericTime([], 1), 0);
  assert.equal(genericTime([0, 0, 1], 0.5), 1.5);
});

test('the state shown is the last not after the time', () => {
  const states = [{timeS: 1}, {timeS: 2}, {timeS: 3}];
  assert.equal(stateAt(states, 2.5), states[1]);
  assert.equal(stateAt(states, 0.5), states[0]);
  assert.equal(stateAt(states, 9), states[2]);
  assert.equal(stateAt([], 1), null);
});

const recorded = {firstS: 80, lastS: 100};

test('live shows the render time', () => {
  const playback = new Playback();
  assert.equal(playback.advance(0.016, 100, recorded), 100);
  assert.ok(playback.live);
});

test('pausing holds the time and going on stays behind by as much', () => {
  const playback = new Playback();
  playback.advance(0.016, 100, recorded);
  playback.pause();
  assert.equal(playback.advance(1, 101, {firstS: 81, lastS: 101}), 100);
  playback.resume();
  assert.equal(playback.advance(1, 102, {firstS: 82, lastS: 102}), 101);
  assert.ok(!playback.live);
});

test('paused for longer than is kept, it shows the oldest', () => {
  const playback = new Playback();
  playback.advance(0.016, 100, recorded);
  playback.pause();
  assert.equal(playback.advance(30, 130, {firstS: 110, lastS: 130}), 110);
});

test('slow motion falls behind and full speed does not catch up', () => {
  const playback = new Playback();
  playback.advance(0.016, 100, recorded);
  playback.setRate(0.25);
  assert.equal(playback.advance(1, 101, recorded), 100.25);
  playback.setRate(1);
  assert.equal(playback.advance(1, 102, recorded), 101.25);
  playback.goLive();
  assert.equal(playback.advance(1, 103, recorded), 103);
});

test('never shows what has not come, and is live again at the end', () => {
  const playback = new Playback();
  playback.advance(0.016, 100, recorded);
  playback.seek(200);
  assert.equal(playback.advance(0.016, 100.1, recorded), 100.1);
  assert.ok(playback.live);
});

test('seeks back, paused', () => {
  const playback = new Playback();
  playback.advance(0.016, 100, recorded);
  playback.pause();
  playback.seek(90);
  assert.equal(playback.advance(0.5, 100.5, recorded), 90);
});

test('reads Prometheus text: labels summed, buckets left out', () => {
  const metrics = parseMetrics([
    '# HELP x y', 'a_total 5', 'b{shard="0"} 1.5', 'b{shard="1"} 2.5', 't_bucket{le="1"} 7', 't_sum 0.5',
    't_count 10', 'bad NaNs', ''].join('\n'));
  assert.equal(metrics.get('a_total'), 5);
  assert.equal(metrics.get('b'), 4);
  assert.equal(metrics.has('t_bucket'), false);
  assert.equal(metrics.has('bad'), false);
  assert.equal(meanSince(metrics, new Map([['t_sum', 0.3], ['t_count', 8]]), 't')!.toFixed(6), '0.100000');
  assert.equal(meanSince(metrics, metrics, 't'), null);
});

test('wanderers turn towards home when far away, and ask only for what a server can do', () => {
  const seed = Date.now() % 100000;
  console.log('seed', seed);
  let state = seed + 1;
  const random = (): number => (state = (state * 48271) % 2147483647) / 2147483647;
  for (let i = 0; i < 500; ++i) {
    const heading = random() * 6.28;
    const far = movements(3, 10, 0, heading, random);
    const home = Math.sin(Math.atan2(-10, 0) - heading);  // above 0: home is to the left
    for (const item of far) {
      assert.ok(item.type === 'step' || item.type === 'jump' || item.type === 'stand');
      assert.equal(item.avatar, 3);
      if (item.type === 'step') {
        assert.ok(item.lengthM! > 0.3 && item.lengthM! < 0.8 && Math.abs(item.turnRad!) <= 0.35);
        if (Math.abs(home) > 0.05) assert.equal(Math.sign(item.turnRad!), Math.sign(home));
      }
    }
  }
});
