// The ground of a world, to be asked: how high it is somewhere, and where a line of sight meets it.

import type {Terrain, TerrainBox} from './sdk.js';

/** Boxes are found by cells, so many along each side. */
const cellsAcross = 96;

export class Ground {
  private readonly cells: readonly (readonly TerrainBox[])[];
  private readonly minX: number;
  private readonly minZ: number;
  private readonly cellX: number;
  private readonly cellZ: number;

  constructor(readonly terrain: Terrain | null) {
    let [x0, z0, x1, z1] = [Infinity, Infinity, -Infinity, -Infinity];
    const boxes = terrain?.boxes ?? [];
    for (const {minM, maxM} of boxes) {
      x0 = Math.min(x0, minM[0]);
      z0 = Math.min(z0, minM[1]);
      x1 = Math.max(x1, maxM[0]);
      z1 = Math.max(z1, maxM[1]);
    }
    this.minX = x0;
    this.minZ = z0;
    this.cellX = Math.max(1e-6, (x1 - x0) / cellsAcross);
    this.cellZ = Math.max(1e-6, (z1 - z0) / cellsAcross);
    const cells: TerrainBox[][] = [];
    if (boxes.length > 0) {
      for (let i = 0; i < cellsAcross * cellsAcross; ++i) cells.push([]);
      for (const box of boxes) {
        const [fromX, toX] = [this.column(box.minM[0]), this.column(box.maxM[0])];
        const [fromZ, toZ] = [this.row(box.minM[1]), this.row(box.maxM[1])];
        for (let r = fromZ; r <= toZ; ++r) {
          for (let c = fromX; c <= toX; ++c) cells[r * cellsAcross + c]!.push(box);
        }
      }
    }
    this.cells = cells;
  }

  /** Whether it is the plane y = 0. */
  get flat(): boolean {
    return this.terrain === null;
  }

  get hasBoxes(): boolean {
    return this.cells.length > 0;
  }

  /** The highest of field and boxes there; 0 beside both. */
  heightAt(x: number, z: number): number {
    if (this.terrain === null) return 0;
    let height = this.fieldAt(x, z);
    if (this.cells.length === 0) return height;
    const c = Math.floor((x - this.minX) / this.cellX);
    const r = Math.floor((z - this.minZ) / this.cellZ);
    if (c < 0 || r < 0 || c > cellsAcross || r > cellsAcross) return height;
    const here = this.cells[Math.min(r, cellsAcross - 1) * cellsAcross + Math.min(c, cellsAcross - 1)]!;
    for (let i = 0; i < here.length; ++i) {
      const {minM, maxM, heightM} = here[i]!;
      if (heightM > height && x >= minM[0] && x <= maxM[0] && z >= minM[1] && z <= maxM[1]) {
        height = heightM;
      }
    }
    return height;
  }

  private fieldAt(x: number, z: number): number {
    const field = this.terrain!.heightField;
    if (field === null) return 0;
    const {originM, cellM, columns, rows, heightsM} = field;
    const u = (x - originM[0]) / cellM;
    const v = (z - originM[1]) / cellM;
    if (!(u >= 0 && v >= 0 && u <= columns - 1 && v <= rows - 1)) return 0;
    const c = Math.min(columns - 2, Math.floor(u));
    const r = Math.min(rows - 2, Math.floor(v));
    const i = r * columns + c;
    const [s, t] = [u - c, v - r];
    return (heightsM[i]! * (1 - s) + heightsM[i + 1]! * s) * (1 - t) +
      (heightsM[i + columns]! * (1 - s) + heightsM[i + columns + 1]! * s) * t;
  }

  /**
   * Where a ray first meets the ground within `farM`, into `out` (x, y, z); false: it does not.
   * The direction has length 1.
   */
  meet(
    x: number, y: number, z: number, dx: number, dy: number, dz: number, farM: number,
    out: {x: number; y: number; z: number}): boolean {
    let before = 0;
    let t = 0;
    while (t <= farM) {
      const above = y + dy * t - this.heightAt(x + dx * t, z + dz * t);
      if (above <= 0) {
        // Halve the last stretch; where it went through a wall that is the wall's foot or top.
        for (let i = 0; i < 24; ++i) {
          const middle = (before + t) / 2;
          if (y + dy * middle > this.heightAt(x + dx * middle, z + dz * middle)) before = middle;
          else t = middle;
        }
        out.x = x + dx * t;
        out.z = z + dz * t;
        out.y = this.heightAt(out.x, out.z);
        return true;
      }
      before = t;
      // The plane is met exactly by one step; over terrain steps are short.
      t += this.terrain === null ? (dy < -1e-6 ? above / -dy + 1e-6 : farM + 1) :
        Math.min(0.25, Math.max(0.03, t * 0.01));
    }
    return false;
  }

  private column(x: number): number {
    return Math.min(cellsAcross - 1, Math.max(0, Math.floor((x - this.minX) / this.cellX)));
  }
  private row(z: number): number {
    return Math.min(cellsAcross - 1, Math.max(0, Math.floor((z - this.minZ) / this.cellZ)));
  }
}

export type TerrainName = 'flat' | 'stairs' | 'ramp' | 'stones' | 'hills';

/** Grounds to try; all start flat where avatars are put. */
export function makeTerrain(name: TerrainName): Terrain | null {
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
  if (name === 'stones') {
    // Slabs in a ladder: distances and heights differ, the same ones every time.
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
      // Twelve degrees up, some level ground, and down again.
      heightsM[r * columns + c] = name === 'ramp' ?
        Math.max(0, Math.min(z - originM[1], 7, originM[1] + (rows - 1) * cellM - z)) * Math.tan(12 * Math.PI / 180) :
        0.45 * edge * Math.min(1, Math.hypot(x, z) / 3) *
          (Math.sin(x * 0.55 + 0.4) * Math.cos(z * 0.48) + 0.4 * Math.sin(x * 0.9 - z * 0.7) + 0.6);
    }
  }
  return {heightField: {originM, cellM, columns, rows, heightsM}, boxes: []};
}
