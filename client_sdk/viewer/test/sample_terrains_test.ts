import assert from 'node:assert/strict';
import {test} from 'node:test';

import {makeSampleTerrain} from '../src/sample_terrains.js';
import {TerrainSurface} from '../src/terrain_surface.js';

test('sample terrains are valid, and flat where avatars spawn', () => {
  assert.equal(makeSampleTerrain('flat'), null);
  for (const name of ['stairs', 'ramp', 'slabs', 'hills'] as const) {
    const terrain = makeSampleTerrain(name)!;
    const surface = new TerrainSurface(terrain);
    assert.ok(Math.abs(surface.heightAt(0, 0)) < 0.03, name);
    const field = terrain.heightField;
    if (field) {
      assert.equal(field.heightsM.length, field.columns * field.rows);
      // No slope is steeper than 20 degrees, including the borders of the field.
      for (let x = -22; x < 22; x += 0.25) {
        for (let z = -22; z < 22; z += 0.25) {
          const slope = (surface.heightAt(x, z + 0.25) - surface.heightAt(x, z)) / 0.25;
          if (name !== 'hills') continue;
          assert.ok(Math.abs(slope) < Math.tan(20.5 * Math.PI / 180), `${name} ${x} ${z}`);
        }
      }
    }
    for (const {minM, maxM, heightM} of terrain.boxes) {
      assert.ok(minM[0] < maxM[0] && minM[1] < maxM[1] && heightM > 0);
    }
  }
});
