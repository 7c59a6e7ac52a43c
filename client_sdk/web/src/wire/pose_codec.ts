import type {PoseMode} from '../types';
import type {CompactCodec} from './compact_codec';
import type {BatchMode} from './messages';

const componentScale = 1 / (Math.SQRT2 * 16383);
const zero = 16384;
const maxThreeSquared = 0.7502;
const rootStepM = 1 / 16384;
const maxRootSteps = 131_071 * 16384;
const leastSquared = (1 - 1e-3) ** 2;
const mostSquared = (1 + 1e-3) ** 2;

/** Flag of an avatar in a compact batch: its pose is encoded as in mode `quantised`. */
const uncompressedFlag = 4;

/**
 * Returns the size of each compact pose in a batch of `length` bytes. Uncompressed poses are larger
 * and do not count. Returns 0 if all poses are uncompressed, and -1 if `length` does not fit.
 */
export function compactPoseBytes(flags: Uint8Array, length: number, jointCount: number): number {
  let uncompressedCount = 0;
  for (let i = 0; i < flags.length; ++i) uncompressedCount += (flags[i]! & uncompressedFlag) >> 2;
  const rest = length - uncompressedCount * poseBytes('quantised', jointCount);
  const compact = flags.length - uncompressedCount;
  if (compact === 0) return rest === 0 ? 0 : -1;
  return rest >= 0 && rest % compact === 0 ? rest / compact : -1;
}

/** Returns the size of a pose in bytes. */
export function poseBytes(mode: PoseMode, jointCount: number): number {
  return 12 + (mode === 'full' ? 16 : 6) * jointCount;
}

/** The fields of a batch that PoseReader needs. */
interface Poses {
  readonly mode: BatchMode;
  readonly jointCount: number;
  readonly flags: Uint8Array;
  /** Must start at a multiple of 4 within its buffer. Verified messages guarantee this. */
  readonly poses: Uint8Array;
  readonly codec: CompactCodec | null;
}

/** Decodes the poses of a batch. Does not allocate per pose. */
export class PoseReader {
  private readonly jointCount: number;
  private full: Float32Array | null = null;
  private words: Uint16Array | null = null;
  private readonly compactBytes: number;
  /** Compact batches: index of the next pose, and where it starts in `words`. */
  private next = 0;
  private nextAt = 0;

  constructor(private readonly batch: Poses) {
    const {mode, poses, flags, jointCount} = batch;
    this.jointCount = jointCount;
    if (mode === 'full') {
      this.full = new Float32Array(poses.buffer, poses.byteOffset, poses.byteLength >> 2);
    } else {
      this.words = new Uint16Array(poses.buffer, poses.byteOffset, poses.byteLength >> 1);
    }
    this.compactBytes = mode === 'full' || mode === 'quantised' ? 0 :
      compactPoseBytes(flags, poses.length, jointCount);
  }

  /**
   * Decodes pose `index`. Writes the root's position at `rootM[rootAt]` and the x, y, z, w of all
   * joints at `rotations[rotationsAt]`. Returns false if the pose is invalid; the output is then
   * invalid as well. Compact batches are fastest in ascending order.
   */
  read(index: number, rootM: Float32Array, rootAt: number, rotations: Float32Array,
       rotationsAt: number): boolean {
    switch (this.batch.mode) {
      case 'full': return this.readFull(index, rootM, rootAt, rotations, rotationsAt);
      case 'quantised':
        return this.readQuantised(index * (6 + 3 * this.jointCount), rootM, rootAt, rotations,
                                  rotationsAt);
      default: return this.readCompact(index, rootM, rootAt, rotations, rotationsAt);
    }
  }

  private readCompact(index: number, rootM: Float32Array, rootAt: number, rotations: Float32Array,
                      rotationsAt: number): boolean {
    const {flags, codec} = this.batch;
    if (index < this.next) {
      this.next = 0;
      this.nextAt = 0;
    }
    const uncompressedWords = 6 + 3 * this.jointCount;
    const compactWords = this.compactBytes >> 1;
    for (; this.next < index; ++this.next) {
      const isUncompressed = (flags[this.next]! & uncompressedFlag) !== 0;
      this.nextAt += isUncompressed ? uncompressedWords : compactWords;
    }
    if ((flags[index]! & uncompressedFlag) !== 0) {
      return this.readQuantised(this.nextAt, rootM, rootAt, rotations, rotationsAt);
    }
    // A compact pose can only be decoded with the codec that it was encoded with.
    if (codec === null || codec.jointCount !== this.jointCount ||
        codec.poseBytes !== this.compactBytes) {
      return false;
    }
    return codec.read(this.words!, this.nextAt, rootM, rootAt, rotations, rotationsAt);
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
      // The comparison is false for NaN.
      good = good && squared >= leastSquared && squared <= mostSquared;
      const to = rotationsAt + i;
      rotations[to] = a;
      rotations[to + 1] = b;
      rotations[to + 2] = c;
      rotations[to + 3] = d;
    }
    return good;
  }

  private readQuantised(at: number, rootM: Float32Array, rootAt: number,
                        rotations: Float32Array, rotationsAt: number): boolean {
    const from = this.words!;
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
      // No encoder writes a component of zero or the high bit of the last word.
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
