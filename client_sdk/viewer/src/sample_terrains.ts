// Terrains that a user can give to a world.

import type {Terrain, TerrainBox} from './sdk.js';

export type SampleTerrainName = 'flat' | 'stairs' | 'ramp' | 'slabs' | 'hills';

/**
 * Returns null for flat terrain. Every sample terrain is flat at the origin, where avatars spawn.
 */
export function makeSampleTerrain(name: SampleTerrainName): Terrain | null {
  if (name === 'flat') return null;
  if (name === 'stairs') {
    const boxes: TerrainBox[] = [];
    const [rise, tread, steps, from] = [0.16, 0.55, 6, 1.5];
    for (let i = 0; i < steps; ++i) {
      boxes.push({
        minM: [-3, from + i * tread], maxM: [3, from + (2 * steps - i) * tread + 2],
        heightM: rise * (i + 1)});
    }
    return {heightField: null, boxes};
  }
  if (name === 'slabs') {
    // Slabs in a row along +Z. Distances and heights vary, but are the same every time.
    const boxes: TerrainBox[] = [];
    let z = 0.9;
    for (let i = 0; i < 24; ++i) {
      const height = 0.06 + 0.09 * (0.5 + 0.5 * Math.sin(i * 2.4));
      boxes.push({minM: [-1.2, z], maxM: [1.2, z + 0.42], heightM: height});
      z += 0.5 + 0.12 * (0.5 + 0.5 * Math.sin(i * 1.7));
    }
    return {heightField: null, boxes};
  }
  const [columns, rows, cellM] = name === 'ramp' ? [17, 41, 0.5] : [81, 81, 0.5];
  const originM = name === 'ramp' ? [-4, 1] as const : [-20, -20] as const;
  const heightsM = new Float32Array(columns * rows);
  for (let r = 0; r < rows; ++r) {
    for (let c = 0; c < columns; ++c) {
      const x = originM[0] + c * cellM;
      const z = originM[1] + r * cellM;
      const edge = Math.min(1, Math.min(c, r, columns - 1 - c, rows - 1 - r) / 6);
      // The ramp rises at 12 degrees, is level at the top, and descends at 12 degrees.
      heightsM[r * columns + c] = name === 'ramp' ?
        Math.max(0, Math.min(z - originM[1], 7, originM[1] + (rows - 1) * cellM - z)) *
          Math.tan(12 * Math.PI / 180) :
        0.45 * edge * Math.min(1, Math.hypot(x, z) / 3) *
          (Math.sin(x * 0.55 + 0.4) * Math.cos(z * 0.48) + 0.4 * Math.sin(x * 0.9 - z * 0.7) + 0.6);
    }
  }
  return {heightField: {originM, cellM, columns, rows, heightsM}, boxes: []};
}
