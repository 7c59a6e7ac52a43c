import assert from 'node:assert/strict';
import {test} from 'node:test';

import {FrameLimiter} from '../src/frame_limiter.js';

/** Times at which frames are drawn on a display with this refresh rate. */
function drawn(
  limiter: FrameLimiter, displayHz: number, fromMs: number, seconds: number): number[] {
  const times: number[] = [];
  for (let i = 0; i < displayHz * seconds; ++i) {
    const ms = fromMs + i * 1000 / displayHz;
    if (limiter.shouldDraw(ms)) times.push(ms);
  }
  return times;
}

test('reaches the requested frame rate on any display', () => {
  for (const displayHz of [50, 60, 144]) {
    for (const framesPerS of [1, 7, 15, 25, 48]) {
      const count = drawn(new FrameLimiter(framesPerS), displayHz, 12_345, 20).length;
      assert.ok(
        Math.abs(count - 20 * framesPerS) <= 2, `${framesPerS} at ${displayHz} Hz: ${count}`);
    }
    assert.equal(drawn(new FrameLimiter(Infinity), displayHz, 0, 5).length, 5 * displayHz);
    assert.equal(drawn(new FrameLimiter(240), displayHz, 0, 5).length, 5 * displayHz);
  }
});

test('does not draw faster after a pause', () => {
  const limiter = new FrameLimiter(10);
  drawn(limiter, 60, 0, 2);
  const times = drawn(limiter, 60, 60_000, 2);
  assert.ok(Math.abs(times.length - 20) <= 2, `${times.length}`);
  for (let i = 1; i < times.length; ++i) {
    assert.ok(times[i]! - times[i - 1]! > 49, `${times[i - 1]}, ${times[i]}`);
  }
});
