import assert from 'node:assert/strict';
import {test} from 'node:test';

import {shareOut} from '../src/scene/view_layout.js';

const views = (n: number) => Array.from({length: n}, () => ({
  free: {x: 0, y: 0, width: 0, height: 0}, box: {x: 0, y: 0, width: 0, height: 0}}));

test('what panels leave free is shared equally, boxes go on to the edges and leave no gap', () => {
  for (const n of [1, 2, 3, 4]) {
    const wide = views(n);
    shareOut(wide, {x0: 100, x1: 900, y0: 40, y1: 540}, 1000, 600);
    wide.forEach(({free, box}, i) => {
      assert.ok(Math.abs(free.width - 800 / n) < 1e-9 && Math.abs(free.x - 100 - i * 800 / n) < 1e-9);
      assert.deepEqual([free.y, free.height, box.y, box.height], [40, 500, 0, 600]);
      assert.ok(Math.abs(box.x - (i === 0 ? 0 : wide[i - 1]!.box.x + wide[i - 1]!.box.width)) < 1e-9);
    });
    assert.ok(Math.abs(wide[n - 1]!.box.x + wide[n - 1]!.box.width - 1000) < 1e-9);

    const high = views(n);
    shareOut(high, {x0: 0, x1: 390, y0: 80, y1: 700}, 390, 844);
    high.forEach(({free, box}, i) => {
      assert.ok(Math.abs(free.height - 620 / n) < 1e-9 && Math.abs(free.y - 80 - i * 620 / n) < 1e-9);
      assert.deepEqual([free.x, free.width, box.x, box.width], [0, 390, 0, 390]);
      assert.ok(Math.abs(box.y - (i === 0 ? 0 : high[i - 1]!.box.y + high[i - 1]!.box.height)) < 1e-9);
    });
    assert.ok(Math.abs(high[n - 1]!.box.y + high[n - 1]!.box.height - 844) < 1e-9);
  }
});
