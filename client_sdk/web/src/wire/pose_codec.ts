import type {PoseMode} from '../types';

const componentScale = 1 / (Math.SQRT2 * 16383);
const zero = 16384;
const maxThreeSquared = 0.7502;
const rootStepM = 1 / 16384;
const maxRootSteps = 131_071 * 16384;
const leastSquared = (1 - 1e-3) ** 2;
const mostSquared = (1 + 1e-3) ** 2;

/** Bytes of one pose. */
export function poseBytes(mode: PoseMode, jointCount: number): number {
  return 12 + (mode === 'full' ? 16 : 6) * jointCount;
}

/** Reads the poses of one batch. Its memory is one view a batch, none a pose. */
export class PoseReader {
  private full: Float32Array | null = null;
  private words: Uint16Array | null = null;

  /** `poses` begins on a multiple of 4 of its buffer, as a verified message's do. */
  constructor(poses: Uint8Array, private readonly mode: PoseMode,
              private readonly jointCount: number) {
    if (mode === 'full') {
      this.full = new Float32Array(poses.buffer, poses.byteOffset, poses.byteLength >> 2);
    } else {
      this.words = new Uint16Array(poses.buffer, poses.byteOffset, poses.byteLength >> 1);
    }
  }

  /**
   * Pose number `index`: the root to `rootM[rootAt ...]`, x, y, z, w of each joint to
   * `rotations[rotationsAt ...]`. False: it is none; what was written then has no meaning.
   */
  read(index: number, rootM: Float32Array, rootAt: number, rotations: Float32Array,
       rotationsAt: number): boolean {
    return this.mode === 'full' ? this.readFull(index, rootM, rootAt, rotations, rotationsAt)
                                : this.readQuantised(index, rootM, rootAt, rotations, rotationsAt);
  }

  private readFull(index: number, rootM: Float32Array, rootAt: number, rotations: Float32Array,
                   rotationsAt: number): boolean {
    const from = this.full!;
    const count = 4 * this.jointCount;
    let at = index * (3 + count);
    const x = from[at++]!;
    const y = from[at++]!;
    const z = from[at++]!;
    rootM[rootAt] = x;
    rootM[rootAt + 1] = y;
    rootM[rootAt + 2] = z;
    if (!Number.isFinite(x) || !Number.isFinite(y) || !Number.isFinite(z)) return false;
    let good = true;
    for (let i = 0; i < count; i += 4, at += 4) {
      const a = from[at]!;
      const b = from[at + 1]!;
      const c = from[at + 2]!;
      const d = from[at + 3]!;
      const squared = a * a + b * b + c * c + d * d;
      good = good && squared >= leastSquared && squared <= mostSquared;  // Not for NaN, too.
      const to = rotationsAt + i;
      rotations[to] = a;
      rotations[to + 1] = b;
      rotations[to + 2] = c;
      rotations[to + 3] = d;
    }
    return good;
  }

  private readQuantised(index: number, rootM: Float32Array, rootAt: number,
                        rotations: Float32Array, rotationsAt: number): boolean {
    const from = this.words!;
    let at = index * (6 + 3 * this.jointCount);
    let good = true;
    for (let i = 0; i < 3; ++i, at += 2) {
      const steps = from[at]! | (from[at + 1]! << 16);
      good = good && steps <= maxRootSteps && steps >= -maxRootSteps;
      rootM[rootAt + i] = steps * rootStepM;
    }
    const end = rotationsAt + 4 * this.jointCount;
    for (let to = rotationsAt; to < end; to += 4, at += 3) {
      const u = from[at]!;
      const v = from[at + 1]!;
      const w = from[at + 2]!;
      const a = ((u & 0x7fff) - zero) * componentScale;
      const b = ((v & 0x7fff) - zero) * componentScale;
      const c = (w - zero) * componentScale;
      const squared = a * a + b * b + c * c;
      // Zero and the high bit of the last are not written by an encoder.
      if ((u & 0x7fff) === 0 || (v & 0x7fff) === 0 || w === 0 || w > 0x7fff ||
          squared > maxThreeSquared) {
        return false;
      }
      const left = Math.sqrt(1 - squared);
      switch ((u >> 15) | ((v >> 15) << 1)) {
        case 0:
          rotations[to] = left;
          rotations[to + 1] = a;
          rotations[to + 2] = b;
          rotations[to + 3] = c;
          break;
        case 1:
          rotations[to] = a;
          rotations[to + 1] = left;
          rotations[to + 2] = b;
          rotations[to + 3] = c;
          break;
        case 2:
          rotations[to] = a;
          rotations[to + 1] = b;
          rotations[to + 2] = left;
          rotations[to + 3] = c;
          break;
        default:
          rotations[to] = a;
          rotations[to + 1] = b;
          rotations[to + 2] = c;
          rotations[to + 3] = left;
      }
    }
    return good;
  }
}
