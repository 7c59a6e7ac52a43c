import assert from 'node:assert/strict';
import {test} from 'node:test';

import {layOutViews} from '../src/scene/view_layout.js';

const views = (n: number) => Array.from({length: n}, () => ({
  freeArea: {x: 0, y: 0, width: 0, height: 0}, viewport: {x: 0, y: 0, width: 0, height: 0}}));

test('divides the free area equally, and covers the page with viewports without gaps', () => {
  for (const n of [1, 2, 3, 4]) {
    const wide = views(n);
    layOutViews(wide, {x0: 100, x1: 900, y0: 40, y1: 540}, 1000, 600);
    wide.forEach(({freeArea, viewport}, i) => {
      assert.ok(Math.abs(freeArea.width - 800 / n) < 1e-9);
      assert.ok(Math.abs(freeArea.x - 100 - i * 800 / n) < 1e-9);
      assert.deepEqual([freeArea.y, freeArea.height, viewport.y, viewport.height],
        [40, 500, 0, 600]);
      assert.ok(Math.abs(viewport.x - (i === 0 ? 0 :
        wide[i - 1]!.viewport.x + wide[i - 1]!.viewport.width)) < 1e-9);
    });
    assert.ok(Math.abs(wide[n - 1]!.viewport.x + wide[n - 1]!.viewport.width - 1000) < 1e-9);

    const high = views(n);
    layOutViews(high, {x0: 0, x1: 390, y0: 80, y1: 700}, 390, 844);
    high.forEach(({freeArea, viewport}, i) => {
      assert.ok(Math.abs(freeArea.height - 620 / n) < 1e-9);
      assert.ok(Math.abs(freeArea.y - 80 - i * 620 / n) < 1e-9);
      assert.deepEqual([freeArea.x, freeArea.width, viewport.x, viewport.width], [0, 390, 0, 390]);
      assert.ok(Math.abs(viewport.y - (i === 0 ? 0 :
        high[i - 1]!.viewport.y + high[i - 1]!.viewport.height)) < 1e-9);
    });
    assert.ok(Math.abs(high[n - 1]!.viewport.y + high[n - 1]!.viewport.height - 844) < 1e-9);
  }
});
