// Height queries and ray casts on a world's terrain.

import type {Terrain, TerrainBox} from './sdk.js';

/**
 * Number of cells per side of the grid in which boxes are stored, so that heights are found fast.
 */
const cellsPerSide = 96;

export class TerrainSurface {
  private readonly cells: readonly (readonly TerrainBox[])[];
  private readonly minX: number;
  private readonly minZ: number;
  private readonly cellX: number;
  private readonly cellZ: number;

  /** `source` null means the plane y = 0. */
  constructor(readonly source: Terrain | null) {
    let [x0, z0, x1, z1] = [Infinity, Infinity, -Infinity, -Infinity];
    const boxes = source?.boxes ?? [];
    for (const {minM, maxM} of boxes) {
      x0 = Math.min(x0, minM[0]);
      z0 = Math.min(z0, minM[1]);
      x1 = Math.max(x1, maxM[0]);
      z1 = Math.max(z1, maxM[1]);
    }
    this.minX = x0;
    this.minZ = z0;
    this.cellX = Math.max(1e-6, (x1 - x0) / cellsPerSide);
    this.cellZ = Math.max(1e-6, (z1 - z0) / cellsPerSide);
    const cells: TerrainBox[][] = [];
    if (boxes.length > 0) {
      for (let i = 0; i < cellsPerSide * cellsPerSide; ++i) cells.push([]);
      for (const box of boxes) {
        const [fromX, toX] = [this.column(box.minM[0]), this.column(box.maxM[0])];
        const [fromZ, toZ] = [this.row(box.minM[1]), this.row(box.maxM[1])];
        for (let r = fromZ; r <= toZ; ++r) {
          for (let c = fromX; c <= toX; ++c) cells[r * cellsPerSide + c]!.push(box);
        }
      }
    }
    this.cells = cells;
  }

  /** Returns whether the terrain is the plane y = 0. */
  get isFlat(): boolean {
    return this.source === null;
  }

  get hasBoxes(): boolean {
    return this.cells.length > 0;
  }

  /**
   * Returns the height in metres: the highest of the height field and the boxes at this point, or 0
   * outside them.
   */
  heightAt(x: number, z: number): number {
    if (this.source === null) return 0;
    let height = this.fieldHeightAt(x, z);
    if (this.cells.length === 0) return height;
    const c = Math.floor((x - this.minX) / this.cellX);
    const r = Math.floor((z - this.minZ) / this.cellZ);
    if (c < 0 || r < 0 || c > cellsPerSide || r > cellsPerSide) return height;
    const row = Math.min(r, cellsPerSide - 1);
    const here = this.cells[row * cellsPerSide + Math.min(c, cellsPerSide - 1)]!;
    for (let i = 0; i < here.length; ++i) {
      const {minM, maxM, heightM} = here[i]!;
      if (heightM > height && x >= minM[0] && x <= maxM[0] && z >= minM[1] && z <= maxM[1]) {
        height = heightM;
      }
    }
    return height;
  }

  private fieldHeightAt(x: number, z: number): number {
    const field = this.source!.heightField;
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
   * Finds the first point where a ray hits the terrain. Writes it to `out`; returns false if there
   * is none within `maxDistanceM`. The direction (dx, dy, dz) must have length 1.
   */
  raycast(
    x: number, y: number, z: number, dx: number, dy: number, dz: number, maxDistanceM: number,
    out: {x: number; y: number; z: number}): boolean {
    let before = 0;
    let t = 0;
    while (t <= maxDistanceM) {
      const above = y + dy * t - this.heightAt(x + dx * t, z + dz * t);
      if (above <= 0) {
        // Bisects the last step. If it crossed a wall, the result is at the wall's foot or top.
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
      // A plane is hit exactly in one step. Over other terrain, steps are short.
      t += this.source === null ? (dy < -1e-6 ? above / -dy + 1e-6 : maxDistanceM + 1) :
        Math.min(0.25, Math.max(0.03, t * 0.01));
    }
    return false;
  }

  private column(x: number): number {
    return Math.min(cellsPerSide - 1, Math.max(0, Math.floor((x - this.minX) / this.cellX)));
  }
  private row(z: number): number {
    return Math.min(cellsPerSide - 1, Math.max(0, Math.floor((z - this.minZ) / this.cellZ)));
  }
}
