import assert from 'node:assert/strict';
import {test} from 'node:test';

import {Orbit, ViewCamera} from '../src/scene/camera.js';

const page = {x: 0, y: 0, width: 800, height: 600};

// Returns how far the target of a camera moves along x while it follows an avatar.
function travelM(avatarX: (timeS: number) => number): number {
  const camera = new ViewCamera();
  const orbit = new Orbit();
  camera.moveTo(avatarX(0), 0.9, 0, true);
  let [least, most] = [Infinity, -Infinity];
  for (let frame = 0; frame < 600; ++frame) {
    camera.moveTo(avatarX(frame / 60), 0.9, 0);
    camera.advance(orbit, 1 / 60, page, page);
    least = Math.min(least, camera.target.x);
    most = Math.max(most, camera.target.x);
  }
  return most - least;
}

test('the camera does not sway with an avatar that shifts its weight', () => {
  assert.equal(travelM((timeS) => 0.03 * Math.sin(timeS)), 0);
});

test('the camera follows an avatar that walks', () => {
  const walkedM = travelM((timeS) => timeS);
  assert.ok(walkedM > 9.5 && walkedM < 10, `${walkedM} m of 10 m`);
});
