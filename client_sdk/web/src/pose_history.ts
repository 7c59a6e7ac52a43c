import {copyPose, createKeys, interpolate} from './interpolate';
import {PoseFlag} from './types';

const keys = createKeys();

/** Ring buffer of the last poses of one avatar, oldest first. It allocates only in the constructor.
 * A full buffer overwrites its oldest pose. */
export class PoseHistory {
  readonly roots: Float32Array;
  readonly rotations: Float32Array;
  private readonly ticks: Float64Array;
  private readonly timesS: Float64Array;
  private readonly flags: Uint8Array;
  private first = 0;
  private count = 0;
  /** Slot of the pose at or before the last sampled time. Set by `sample`. */
  sampledSlot = 0;

  /** `capacity`, in poses, and `jointCount` must be above 0. */
  constructor(private readonly capacity: number, readonly jointCount: number) {
    this.roots = new Float32Array(3 * capacity);
    this.rotations = new Float32Array(4 * jointCount * capacity);
    this.ticks = new Float64Array(capacity);
    this.timesS = new Float64Array(capacity);
    this.flags = new Uint8Array(capacity);
  }

  /** Returns the memory of a history in bytes. */
  static bytes(capacity: number, jointCount: number): number {
    return 512 + capacity * (12 + 16 * jointCount + 8 + 8 + 1);
  }

  get size(): number {
    return this.count;
  }
  /** Tick of the newest pose. Valid only if `size` is above 0. */
  get newestTick(): number {
    return this.ticks[this.slot(this.count - 1)]!;
  }
  get newestTimeS(): number {
    return this.timesS[this.slot(this.count - 1)]!;
  }
  tickOf(slot: number): number {
    return this.ticks[slot]!;
  }
  timeOf(slot: number): number {
    return this.timesS[slot]!;
  }
  flagsOf(slot: number): number {
    return this.flags[slot]!;
  }

  /** Returns whether a pose of this tick and time is newer than all stored poses. */
  accepts(tick: number, timeS: number): boolean {
    return this.count === 0 || (tick > this.newestTick && timeS > this.newestTimeS);
  }

  /** Returns the slot for the next pose, and drops the oldest pose if the buffer is full. Write the
   * pose to this slot of `roots` and `rotations`, then call `commit` to add it. */
  nextSlot(): number {
    if (this.count === this.capacity) {
      this.first = (this.first + 1) % this.capacity;
      --this.count;
    }
    return this.slot(this.count);
  }

  commit(tick: number, timeS: number, flags: number): void {
    const slot = this.slot(this.count++);
    this.ticks[slot] = tick;
    this.timesS[slot] = timeS;
    this.flags[slot] = flags;
  }

  /**
   * Computes the pose at `timeS` by cubic interpolation. The last pose is held before a
   * discontinuity and after the newest pose. Returns 1 if interpolated and 2 if held. Returns 0 and
   * writes nothing if `timeS` is before the oldest pose.
   */
  sample(timeS: number, rootOut: Float32Array, rootAt: number, out: Float32Array,
         outAt: number): 0 | 1 | 2 {
    let low = 0;
    let high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.timesS[this.slot(middle)]! > timeS) {
        high = middle;
      } else {
        low = middle + 1;
      }
    }
    if (low === 0) return 0;
    const i = this.slot(low - 1);
    this.sampledSlot = i;
    const exact = this.timesS[i] === timeS;
    const j = this.slot(low);
    if (exact || low === this.count || (this.flags[j]! & PoseFlag.discontinuity) !== 0) {
      copyPose(this.roots, this.rotations, i, this.jointCount, rootOut, rootAt, out, outAt);
      return exact ? 1 : 2;
    }
    const before =
        low > 1 && (this.flags[i]! & PoseFlag.discontinuity) === 0 ? this.slot(low - 2) : i;
    const next = low + 1 < this.count ? this.slot(low + 1) : j;
    const beyond = next !== j && (this.flags[next]! & PoseFlag.discontinuity) === 0 ? next : j;
    this.setKey(0, before);
    this.setKey(1, i);
    this.setKey(2, j);
    this.setKey(3, beyond);
    interpolate(keys, timeS, this.jointCount, rootOut, rootAt, out, outAt);
    return 1;
  }

  private setKey(key: number, slot: number): void {
    keys.roots[key] = this.roots;
    keys.rotations[key] = this.rotations;
    keys.places[key] = slot;
    keys.timesS[key] = this.timesS[slot]!;
  }

  private slot(i: number): number {
    const slot = this.first + i;
    return slot < this.capacity ? slot : slot - this.capacity;
  }
}
