import assert from 'node:assert/strict';
import {test} from 'node:test';

import {randomMovements} from '../src/random_walkers.js';

test('turns towards home when far away, and requests only valid movements', () => {
  const seed = Date.now() % 100000;
  console.log('seed', seed);
  let state = seed + 1;
  const random = (): number => (state = (state * 48271) % 2147483647) / 2147483647;
  for (let i = 0; i < 500; ++i) {
    const heading = random() * 6.28;
    const far = randomMovements(3, 10, 0, heading, random);
    // Above 0 if home is to the left.
    const home = Math.sin(Math.atan2(-10, 0) - heading);
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
