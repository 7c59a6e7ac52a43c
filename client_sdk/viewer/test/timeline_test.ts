import assert from 'node:assert/strict';
import {test} from 'node:test';

import {genericTime, stateAt} from '../src/timeline.js';

test('computes generic time as keytime index plus fraction, clamped at both ends', () => {
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

test('finds the last state that is not later than a time', () => {
  const states = [{timeS: 1}, {timeS: 2}, {timeS: 3}];
  assert.equal(stateAt(states, 2.5), states[1]);
  assert.equal(stateAt(states, 0.5), states[0]);
  assert.equal(stateAt(states, 9), states[2]);
  assert.equal(stateAt([], 1), null);
});
