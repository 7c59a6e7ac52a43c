import assert from 'node:assert/strict';
import {test} from 'node:test';

import {Quality, levelCount, softwareLevel} from '../src/quality.js';

/** Draws for some seconds, each frame taking what `frameMs` says of the level. */
function draw(quality: Quality, fromMs: number, seconds: number, frameMs: (level: number) => number,
              avatars = 10): number {
  let ms = fromMs;
  while (ms < fromMs + seconds * 1000) {
    ms += frameMs(quality.level);
    quality.frame(ms, avatars);
  }
  return ms;
}

test('a fast machine draws at the finest', () => {
  const quality = new Quality(false);
  draw(quality, 0, 60, () => 16.7, 1000);
  assert.equal(quality.level, 0);
  assert.equal(quality.lowered, false);
});

test('a slow one goes down until frames come fast enough, and stays there', () => {
  const quality = new Quality(false);
  const cost = (level: number): number => 60 - 12 * level;
  draw(quality, 0, 30, cost);
  const at = quality.level;
  assert.ok(cost(at) <= 23 && cost(at - 1) > 23, `level ${at}`);
  assert.ok(quality.lowered);
});

test('what proved too slow is tried more and more rarely', () => {
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

test('a moment of slowness is made good', () => {
  const quality = new Quality(false);
  let ms = draw(quality, 0, 10, () => 30);
  assert.ok(quality.level > 0);
  ms = draw(quality, ms, 90, () => 10);
  assert.equal(quality.level, 0);
});

test('a display that shows 30 pictures a second loses nothing by it', () => {
  const quality = new Quality(false);
  draw(quality, 0, 60, () => 33.3);
  assert.equal(quality.level, 0);
});

test('a page in the background says nothing', () => {
  const quality = new Quality(false);
  let ms = draw(quality, 0, 5, () => 16.7);
  for (let i = 0; i < 20; ++i) quality.frame(ms += 60_000, 10);
  assert.equal(quality.level, 0);
});

test('a processor starts with what its crowd allows, lines for a large one', () => {
  const quality = new Quality(true);
  draw(quality, 0, 1, () => 20, 1);
  assert.equal(quality.detail.style, 'bodies');
  draw(quality, 2000, 1, () => 20, 1000);
  assert.equal(quality.detail.style, 'lines');
  assert.equal(quality.level, softwareLevel(1000));
  draw(quality, 4000, 100, () => 20, 1000);
  assert.equal(quality.level, softwareLevel(1000), 'it never goes finer than that');
  draw(quality, 110_000, 60, (level) => 20 * (levelCount - level) + 10, 1000);
  assert.equal(quality.level, levelCount - 1);
});

test('a processor keeps bodies for a few, however slow', () => {
  const quality = new Quality(true);
  draw(quality, 0, 60, (level) => 200 - 40 * level, 8);
  assert.equal(quality.detail.style, 'bodies');
  assert.ok(quality.level > softwareLevel(8));
});

test('what is chosen stays', () => {
  const quality = new Quality(true);
  for (const [choice, level] of [['high', 0], ['low', levelCount - 1]] as const) {
    quality.choice = choice;
    draw(quality, 0, 30, () => 200, 1000);
    assert.equal(quality.level, level);
    assert.equal(quality.lowered, false);
  }
});

test('who asks for few frames gets fine ones', () => {
  for (const software of [false, true]) {
    const quality = new Quality(software, 1000 / 15);
    const finest = software ? softwareLevel(10) : 0;
    let ms = draw(quality, 0, 60, () => 1000 / 15);
    assert.equal(quality.level, finest);
    ms = draw(quality, ms, 5, (level) => level > finest ? 1000 / 15 : 120);
    assert.ok(quality.level > finest, 'slow for 15 a second too');
    draw(quality, ms, 90, () => 1000 / 15);
    assert.equal(quality.level, finest);
  }
});
