import assert from 'node:assert/strict';
import {test} from 'node:test';

import type {Terrain} from '../src/sdk.js';
import {Ground, makeTerrain} from '../src/terrain_surface.js';

const box = (x0: number, z0: number, x1: number, z1: number, heightM: number) =>
  ({minM: [x0, z0] as const, maxM: [x1, z1] as const, heightM});

test('no terrain is flat at 0', () => {
  const ground = new Ground(null);
  assert.ok(ground.flat);
  assert.equal(ground.heightAt(3, -7), 0);
  const out = {x: 0, y: 0, z: 0};
  assert.ok(ground.meet(1, 2, 3, 0, -Math.SQRT1_2, Math.SQRT1_2, 100, out));
  assert.ok(Math.abs(out.x - 1) < 1e-6 && out.y === 0 && Math.abs(out.z - 5) < 1e-4);
  assert.equal(ground.meet(0, 2, 0, 0, 0.6, 0.8, 100, out), false);
});

test('the highest of field and boxes counts, borders included, 0 beside them', () => {
  const terrain: Terrain = {
    heightField: {
      originM: [-1, -1], cellM: 2, columns: 2, rows: 2, heightsM: Float32Array.of(0, 1, 2, 3)},
    boxes: [box(0, 0, 0.5, 0.5, 4), box(0.25, 0.25, 9, 9, 0.5), box(20, 20, 21, 21, -3)],
  };
  const ground = new Ground(terrain);
  // x fastest; bilinear in between.
  assert.equal(ground.heightAt(-1, -1), 0);
  assert.equal(ground.heightAt(1, -1), 1);
  assert.equal(ground.heightAt(-1, 1), 2);
  assert.ok(Math.abs(ground.heightAt(-0.5, 0.5) - 1.75) < 1e-6);
  assert.equal(ground.heightAt(0, 0), 4);
  assert.equal(ground.heightAt(0.5, 0.5), 4);
  assert.equal(ground.heightAt(9, 9), 0.5);
  assert.equal(ground.heightAt(9.01, 9), 0);
  assert.equal(ground.heightAt(20.5, 20.5), 0);
  assert.equal(ground.heightAt(-1.01, 0), 0);
});

test('many boxes are found as by looking at each', () => {
  const seed = 20260;
  let state = seed;
  const random = (): number => (state = (state * 48271) % 2147483647) / 2147483647;
  const boxes = Array.from({length: 400}, () => {
    const [x, z] = [random() * 40 - 20, random() * 60 - 30];
    return box(x, z, x + 0.05 + random() * 3, z + 0.05 + random() * 3, random());
  });
  const ground = new Ground({heightField: null, boxes});
  for (let i = 0; i < 2000; ++i) {
    const [x, z] = [random() * 50 - 25, random() * 70 - 35];
    let height = 0;
    for (const {minM, maxM, heightM} of boxes) {
      if (x >= minM[0] && x <= maxM[0] && z >= minM[1] && z <= maxM[1]) height = Math.max(height, heightM);
    }
    assert.equal(ground.heightAt(x, z), height, `seed ${seed}, ${x}, ${z}`);
  }
});

test('a line of sight meets the top that is nearest, or a wall', () => {
  const ground = new Ground({heightField: null, boxes: [box(-1, 2, 1, 3, 1)]});
  const out: {x: number; y: number; z: number} = {x: 0, y: 0, z: 0};
  const height = (): number => out.y;
  // Down on the top.
  assert.ok(ground.meet(0, 5, -1.5, 0, -Math.SQRT1_2, Math.SQRT1_2, 100, out));
  assert.ok(height() === 1 && Math.abs(out.z - 2.5) < 0.01, JSON.stringify(out));
  // Against its side.
  assert.ok(ground.meet(0, 0.5, 0, 0, -0.01, 0.99995, 100, out));
  assert.ok(Math.abs(out.z - 2) < 0.01, JSON.stringify(out));
  // Past it.
  assert.ok(ground.meet(2, 1, 0, 0, -0.6, 0.8, 100, out));
  assert.ok(height() === 0 && Math.abs(out.z - 4 / 3) < 0.01, JSON.stringify(out));
});

test('the grounds to try are within what a server takes, and flat where avatars are put', () => {
  assert.equal(makeTerrain('flat'), null);
  for (const name of ['stairs', 'ramp', 'stones', 'hills'] as const) {
    const terrain = makeTerrain(name)!;
    const ground = new Ground(terrain);
    assert.ok(Math.abs(ground.heightAt(0, 0)) < 0.03, name);
    const field = terrain.heightField;
    if (field) {
      assert.equal(field.heightsM.length, field.columns * field.rows);
      // Nowhere steeper than 20 degrees, within the field and at its borders.
      for (let x = -22; x < 22; x += 0.25) {
        for (let z = -22; z < 22; z += 0.25) {
          const slope = (ground.heightAt(x, z + 0.25) - ground.heightAt(x, z)) / 0.25;
          if (name === 'hills') assert.ok(Math.abs(slope) < Math.tan(20.5 * Math.PI / 180), `${name} ${x} ${z}`);
        }
      }
    }
    for (const {minM, maxM, heightM} of terrain.boxes) {
      assert.ok(minM[0] < maxM[0] && minM[1] < maxM[1] && heightM > 0);
    }
  }
});
