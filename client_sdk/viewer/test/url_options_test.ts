import assert from 'node:assert/strict';
import {test} from 'node:test';

import {parseUrlOptions} from '../src/url_options.js';

test('reads all options from the URL', () => {
  const search =
    '?world=a&world=b%20c&figures=lines&mode=full&detail=root&every=4&quality=low&frames=15';
  assert.deepEqual(parseUrlOptions(search), {
    figures: 'lines', poseStream: {mode: 'full', detail: 'root', everyNTicks: 4}, quality: 'low',
    maxFramesPerS: 15, worlds: ['a', 'b c']});
});

test('uses defaults for missing and invalid options', () => {
  const defaults = {
    figures: 'auto', poseStream: {mode: 'movement', detail: 'all', everyNTicks: 1},
    quality: 'auto', maxFramesPerS: Infinity, worlds: []};
  assert.deepEqual(parseUrlOptions(''), defaults);
  const invalid =
    '?figures=cubes&mode=half&detail=none&every=3&quality=best&frames=many&world=';
  assert.deepEqual(parseUrlOptions(invalid), defaults);
  for (const frames of ['0', '241', '-5', '1.5', '1e2', ' 9', '0015']) {
    assert.equal(parseUrlOptions(`?frames=${frames}`).maxFramesPerS, Infinity, frames);
  }
});
