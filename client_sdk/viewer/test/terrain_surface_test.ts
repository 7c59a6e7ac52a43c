import assert from 'node:assert/strict';
import {test} from 'node:test';

import type {Terrain} from '../src/sdk.js';
import {TerrainSurface} from '../src/terrain_surface.js';

const box = (x0: number, z0: number, x1: number, z1: number, heightM: number) =>
  ({minM: [x0, z0] as const, maxM: [x1, z1] as const, heightM});

test('treats a world without terrain as the plane y = 0', () => {
  const surface = new TerrainSurface(null);
  assert.ok(surface.isFlat);
  assert.equal(surface.heightAt(3, -7), 0);
  const out = {x: 0, y: 0, z: 0};
  assert.ok(surface.raycast(1, 2, 3, 0, -Math.SQRT1_2, Math.SQRT1_2, 100, out));
  assert.ok(Math.abs(out.x - 1) < 1e-6 && out.y === 0 && Math.abs(out.z - 5) < 1e-4);
  assert.equal(surface.raycast(0, 2, 0, 0, 0.6, 0.8, 100, out), false);
});

test('uses the highest of field and boxes, including their borders, and 0 outside', () => {
  const terrain: Terrain = {
    heightField: {
      originM: [-1, -1], cellM: 2, columns: 2, rows: 2, heightsM: Float32Array.of(0, 1, 2, 3)},
    boxes: [box(0, 0, 0.5, 0.5, 4), box(0.25, 0.25, 9, 9, 0.5), box(20, 20, 21, 21, -3)],
  };
  const surface = new TerrainSurface(terrain);
  // Heights are stored with x fastest, and interpolated bilinearly.
  assert.equal(surface.heightAt(-1, -1), 0);
  assert.equal(surface.heightAt(1, -1), 1);
  assert.equal(surface.heightAt(-1, 1), 2);
  assert.ok(Math.abs(surface.heightAt(-0.5, 0.5) - 1.75) < 1e-6);
  assert.equal(surface.heightAt(0, 0), 4);
  assert.equal(surface.heightAt(0.5, 0.5), 4);
  assert.equal(surface.heightAt(9, 9), 0.5);
  assert.equal(surface.heightAt(9.01, 9), 0);
  assert.equal(surface.heightAt(20.5, 20.5), 0);
  assert.equal(surface.heightAt(-1.01, 0), 0);
});

test('finds the same heights among many boxes as an exhaustive search', () => {
  const seed = 20260;
  let state = seed;
  const random = (): number => (state = (state * 48271) % 2147483647) / 2147483647;
  const boxes = Array.from({length: 400}, () => {
    const [x, z] = [random() * 40 - 20, random() * 60 - 30];
    return box(x, z, x + 0.05 + random() * 3, z + 0.05 + random() * 3, random());
  });
  const surface = new TerrainSurface({heightField: null, boxes});
  for (let i = 0; i < 2000; ++i) {
    const [x, z] = [random() * 50 - 25, random() * 70 - 35];
    let height = 0;
    for (const {minM, maxM, heightM} of boxes) {
      if (x >= minM[0] && x <= maxM[0] && z >= minM[1] && z <= maxM[1]) {
        height = Math.max(height, heightM);
      }
    }
    assert.equal(surface.heightAt(x, z), height, `seed ${seed}, ${x}, ${z}`);
  }
});

test('casts rays at the nearest top or wall', () => {
  const surface = new TerrainSurface({heightField: null, boxes: [box(-1, 2, 1, 3, 1)]});
  const out: {x: number; y: number; z: number} = {x: 0, y: 0, z: 0};
  const height = (): number => out.y;
  // Hits the top from above.
  assert.ok(surface.raycast(0, 5, -1.5, 0, -Math.SQRT1_2, Math.SQRT1_2, 100, out));
  assert.ok(height() === 1 && Math.abs(out.z - 2.5) < 0.01, JSON.stringify(out));
  // Hits the side.
  assert.ok(surface.raycast(0, 0.5, 0, 0, -0.01, 0.99995, 100, out));
  assert.ok(Math.abs(out.z - 2) < 0.01, JSON.stringify(out));
  // Passes the box.
  assert.ok(surface.raycast(2, 1, 0, 0, -0.6, 0.8, 100, out));
  assert.ok(height() === 0 && Math.abs(out.z - 4 / 3) < 0.01, JSON.stringify(out));
});
