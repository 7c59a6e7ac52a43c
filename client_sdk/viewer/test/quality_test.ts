import assert from 'node:assert/strict';
import {test} from 'node:test';

import {Quality, levelCount, initialSoftwareLevel} from '../src/quality.js';

/**
 * Draws for some seconds; `frameMs` is the time of a frame at a level. Returns the time at the end.
 */
function draw(
  quality: Quality, fromMs: number, seconds: number, frameMs: (level: number) => number,
  avatars = 10): number {
  let ms = fromMs;
  while (ms < fromMs + seconds * 1000) {
    ms += frameMs(quality.level);
    quality.onFrame(ms, avatars);
  }
  return ms;
}

test('uses the finest level on a fast machine', () => {
  const quality = new Quality(false);
  draw(quality, 0, 60, () => 16.7, 1000);
  assert.equal(quality.level, 0);
  assert.equal(quality.lowered, false);
});

test('lowers the level until frames are fast enough, and keeps it', () => {
  const quality = new Quality(false);
  const cost = (level: number): number => 60 - 12 * level;
  draw(quality, 0, 30, cost);
  const at = quality.level;
  assert.ok(cost(at) <= 23 && cost(at - 1) > 23, `level ${at}`);
  assert.ok(quality.lowered);
});

test('retries a level that was too slow less and less often', () => {
  const quality = new Quality(false);
  let finer = 0;
  let before = 0;
  let ms = 0;
  const tries: number[] = [];
  for (let minute = 0; minute < 16; ++minute) {
    finer = 0;
    for (let i = 0; i < 60; ++i) {
      ms = draw(quality, ms, 1, (level) => level < 3 ? 40 : 16.7);
      if (quality.level < before) ++finer;
      before = quality.level;
    }
    tries.push(finer);
  }
  assert.ok(tries.slice(0, 4).reduce((a, b) => a + b) > tries.slice(8, 12).reduce((a, b) => a + b),
    tries.join(' '));
  assert.ok(tries.slice(8).every((n) => n <= 1), tries.join(' '));
});

test('returns to the finest level after a short slow period', () => {
  const quality = new Quality(false);
  let ms = draw(quality, 0, 10, () => 30);
  assert.ok(quality.level > 0);
  ms = draw(quality, ms, 90, () => 10);
  assert.equal(quality.level, 0);
});

test('keeps the finest level on a 30 Hz display', () => {
  const quality = new Quality(false);
  draw(quality, 0, 60, () => 33.3);
  assert.equal(quality.level, 0);
});

test('ignores the frame rate of a page in the background', () => {
  const quality = new Quality(false);
  let ms = draw(quality, 0, 5, () => 16.7);
  for (let i = 0; i < 20; ++i) quality.onFrame(ms += 60_000, 10);
  assert.equal(quality.level, 0);
});

test('starts a software renderer at a level for its crowd, with lines for a large one', () => {
  const quality = new Quality(true);
  draw(quality, 0, 1, () => 20, 1);
  assert.equal(quality.settings.style, 'bodies');
  draw(quality, 2000, 1, () => 20, 1000);
  assert.equal(quality.settings.style, 'lines');
  assert.equal(quality.level, initialSoftwareLevel(1000));
  draw(quality, 4000, 100, () => 20, 1000);
  assert.equal(quality.level, initialSoftwareLevel(1000), 'the initial level is also the finest');
  draw(quality, 110_000, 60, (level) => 20 * (levelCount - level) + 10, 1000);
  assert.equal(quality.level, levelCount - 1);
});

test('keeps bodies for a small crowd on a slow software renderer', () => {
  const quality = new Quality(true);
  draw(quality, 0, 60, (level) => 200 - 40 * level, 8);
  assert.equal(quality.settings.style, 'bodies');
  assert.ok(quality.level > initialSoftwareLevel(8));
});

test('keeps a level that the user has chosen', () => {
  const quality = new Quality(true);
  for (const [choice, level] of [['high', 0], ['low', levelCount - 1]] as const) {
    quality.choice = choice;
    draw(quality, 0, 30, () => 200, 1000);
    assert.equal(quality.level, level);
    assert.equal(quality.lowered, false);
  }
});

test('uses the finest level at a low frame rate limit', () => {
  for (const software of [false, true]) {
    const quality = new Quality(software, 1000 / 15);
    const finest = software ? initialSoftwareLevel(10) : 0;
    let ms = draw(quality, 0, 60, () => 1000 / 15);
    assert.equal(quality.level, finest);
    ms = draw(quality, ms, 5, (level) => level > finest ? 1000 / 15 : 120);
    assert.ok(quality.level > finest, 'too slow even for 15 frames per second');
    draw(quality, ms, 90, () => 1000 / 15);
    assert.equal(quality.level, finest);
  }
});
