import assert from 'node:assert/strict';
import {test} from 'node:test';

import {readAddress} from '../src/url_options.js';
import {FrameCap} from '../src/frame_limiter.js';

/** Times at which frames are drawn, on a display of so many Hz. */
function drawn(cap: FrameCap, displayHz: number, fromMs: number, seconds: number): number[] {
  const times: number[] = [];
  for (let i = 0; i < displayHz * seconds; ++i) {
    const ms = fromMs + i * 1000 / displayHz;
    if (cap.draws(ms)) times.push(ms);
  }
  return times;
}

test('as many frames are drawn as asked for, on any display', () => {
  for (const displayHz of [50, 60, 144]) {
    for (const framesPerS of [1, 7, 15, 25, 48]) {
      const count = drawn(new FrameCap(framesPerS), displayHz, 12_345, 20).length;
      assert.ok(Math.abs(count - 20 * framesPerS) <= 2, `${framesPerS} at ${displayHz} Hz: ${count}`);
    }
    assert.equal(drawn(new FrameCap(Infinity), displayHz, 0, 5).length, 5 * displayHz);
    assert.equal(drawn(new FrameCap(240), displayHz, 0, 5).length, 5 * displayHz);
  }
});

test('after a pause frames come no faster', () => {
  const cap = new FrameCap(10);
  drawn(cap, 60, 0, 2);
  const times = drawn(cap, 60, 60_000, 2);
  assert.ok(Math.abs(times.length - 20) <= 2, `${times.length}`);
  for (let i = 1; i < times.length; ++i) assert.ok(times[i]! - times[i - 1]! > 49, `${times[i - 1]}, ${times[i]}`);
});

test('the address is taken where it makes sense', () => {
  const stream = {mode: 'quantised', detail: 'all', everyNTicks: 1};
  const nothing = {figures: 'auto', stream, quality: 'auto', framesPerS: Infinity, worlds: []};
  assert.deepEqual(readAddress(''), nothing);
  assert.deepEqual(readAddress('?figures=cubes&mode=half&detail=none&every=3&quality=best&frames=many&world='), nothing);
  for (const frames of ['0', '241', '-5', '1.5', '1e2', ' 9', '0015']) {
    assert.equal(readAddress(`?frames=${frames}`).framesPerS, Infinity, frames);
  }
  assert.deepEqual(
    readAddress('?world=a&world=b%20c&figures=lines&mode=full&detail=root&every=4&quality=low&frames=15'),
    {figures: 'lines', stream: {mode: 'full', detail: 'root', everyNTicks: 4}, quality: 'low', framesPerS: 15, worlds: ['a', 'b c']});
});
