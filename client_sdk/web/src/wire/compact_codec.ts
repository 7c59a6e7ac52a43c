import {Malformed} from './malformed';
import type {RotationQuantization as RotationCode} from './messages';

const maxThreeSquared = 0.77;
const leastDecodedW = 0.9;
const rootStepM = 1 / 16384;
const maxRootSteps = 131_071 * 16384;

function bitsOf({bitsX, bitsY, bitsZ}: RotationCode): [number, number, number] {
  return [bitsX, bitsY, bitsZ];
}

/**
 * Checks a world's rotation codes against protocol/STANDARD.md, "Poses".
 * @throws Malformed a code is invalid
 */
export function checkRotationCodes(codes: readonly RotationCode[], jointCount: number): void {
  if (codes.length !== 0 && codes.length !== jointCount) {
    throw new Malformed('expected one per joint, or none', 'WorldInfo.rotationCodes');
  }
  codes.forEach((code, j) => {
    const wrong = (what: string): never => {
      throw new Malformed(what, 'WorldInfo.rotationCodes', j);
    };
    const {smallestThreeBits: freeBits, reference, low, step, leastW} = code;
    const bits = bitsOf(code);
    if (freeBits !== 0 ? freeBits < 8 || freeBits > 15 : j === 0) {
      wrong('free_bits is not 8 to 15; 0 is allowed except for the root');
    }
    const squared = reference.reduce((sum, x) => sum + x * x, 0);
    if (!(Math.abs(squared - 1) <= 1e-5)) wrong('reference is not a unit quaternion');
    if (!(leastW >= 0.3 - 1e-7 && leastW <= 1)) wrong('least_w is not from 0.3 to 1');
    for (let c = 0; c < 3; ++c) {
      if (!(Math.abs(low[c]!) <= 1)) wrong('low is not from -1 to 1');
      if (!(step[c]! >= 2 ** -20 && step[c]! <= 2)) wrong('step is not from 2^-20 to 2');
      if (bits[c]! > 16) wrong('has more than 16 bits');
    }
  });
}

/**
 * Checks the joints that reduced poses contain.
 * @throws Malformed they are not ascending from the root, or a joint's parent is missing
 */
export function checkReducedJoints(joints: Uint16Array, parents: readonly number[]): void {
  const wrong = (what: string, i: number): never => {
    throw new Malformed(what, 'WorldInfo.reducedJoints', i);
  };
  if (joints.length > parents.length) wrong('has more entries than joints', -1);
  joints.forEach((joint, i) => {
    if (joint >= parents.length) wrong('is not a joint', i);
    if (i === 0 ? joint !== 0 : joint <= joints[i - 1]!) wrong('is not ascending from the root', i);
    if (i > 0 && !joints.includes(parents[joint]!)) wrong('has no parent in the list', i);
  });
}

/** Decodes the compact poses of one world and one detail. */
export class CompactCodec {
  readonly jointCount: number;
  readonly poseBytes: number;
  /**
   * Bits per joint: first for "smallest three", then for x, y, z. All 0 for joints that poses do
   * not contain.
   */
  private readonly bits: Uint8Array;
  /**
   * Numbers per joint: reference x, y, z, w; low x, y, z; step x, y, z; square of the smallest
   * valid w.
   */
  private readonly numbers: Float64Array;

  /**
   * `codes` must have at least one entry and pass checkRotationCodes. `included` lists the joints
   * that poses contain and must pass checkReducedJoints; empty: all joints. Other joints are set to
   * their references.
   */
  constructor(codes: readonly RotationCode[], included: ArrayLike<number> = []) {
    const contained = new Set(Array.from(included));
    this.jointCount = codes.length;
    this.bits = new Uint8Array(4 * codes.length);
    this.numbers = new Float64Array(11 * codes.length);
    let count = 0;
    codes.forEach((code, j) => {
      if (contained.size > 0 && !contained.has(j)) {
        // All other numbers stay 0, so that the decoded difference from the reference is 0.
        this.numbers.set(code.reference, 11 * j);
        return;
      }
      const {smallestThreeBits: freeBits} = code;
      const bits = bitsOf(code);
      this.bits.set([freeBits, ...bits], 4 * j);
      const step = freeBits > 0 ? [1 / (Math.SQRT2 * (2 ** (freeBits - 1) - 1)), 0, 0] : code.step;
      const leastW = leastDecodedW * code.leastW;
      this.numbers.set([...code.reference, ...code.low, ...step, leastW ** 2], 11 * j);
      count += freeBits > 0 ? 2 + 3 * freeBits : bits[0] + bits[1] + bits[2];
    });
    this.poseBytes = 12 + 2 * Math.ceil(count / 16);
  }

  /**
   * Decodes the pose that starts at `words[at]`; `words` must contain it completely. Writes the
   * root's position at `rootM[rootAt]` and the x, y, z, w of all joints at
   * `rotations[rotationsAt]`. Returns false if the pose is invalid; the output is then invalid as
   * well.
   */
  read(words: Uint16Array, at: number, rootM: Float32Array, rootAt: number, rotations: Float32Array,
       rotationsAt: number): boolean {
    const {bits, numbers} = this;
    const end = at + (this.poseBytes >> 1);
    for (let i = 0; i < 3; ++i, at += 2) {
      const steps = words[at]! | (words[at + 1]! << 16);
      if (steps > maxRootSteps || steps < -maxRootSteps) return false;
      rootM[rootAt + i] = steps * rootStepM;
    }
    let unread = 0;  // Number of unread bits in `window`, which are its lowest bits.
    let window = 0;
    for (let j = 0, n = 0, to = rotationsAt; j < bits.length; j += 4, n += 11, to += 4) {
      const free = bits[j]!;
      let largest = 0;
      if (free > 0) {
        if (unread < 2) {
          window |= words[at++]! << unread;
          unread += 16;
        }
        largest = window & 3;
        window >>>= 2;
        unread -= 2;
      }
      let a = 0;
      let b = 0;
      let c = 0;
      for (let k = 0; k < 3; ++k) {
        const count = free > 0 ? free : bits[j + 1 + k]!;
        if (unread < count) {
          window |= words[at++]! << unread;
          unread += 16;
        }
        const number = window & ((1 << count) - 1);
        window >>>= count;
        unread -= count;
        let value;
        if (free > 0) {
          if (number === 0) return false;
          value = (number - (1 << (free - 1))) * numbers[n + 7]!;
        } else {
          value = numbers[n + 4 + k]! + number * numbers[n + 7 + k]!;
        }
        if (k === 0) a = value;
        else if (k === 1) b = value;
        else c = value;
      }
      const squared = a * a + b * b + c * c;
      if (free > 0) {
        if (squared > maxThreeSquared) return false;
        const left = Math.sqrt(1 - squared);
        rotations[to] = largest === 0 ? left : a;
        rotations[to + 1] = largest === 0 ? a : largest === 1 ? left : b;
        rotations[to + 2] = largest < 2 ? b : largest === 2 ? left : c;
        rotations[to + 3] = largest === 3 ? left : c;
        continue;
      }
      const wSquared = 1 - squared;
      if (!(wSquared >= numbers[n + 10]!)) return false;
      const w = Math.sqrt(wSquared);
      const rx = numbers[n]!;
      const ry = numbers[n + 1]!;
      const rz = numbers[n + 2]!;
      const rw = numbers[n + 3]!;
      rotations[to] = rw * a + rx * w + ry * c - rz * b;
      rotations[to + 1] = rw * b - rx * c + ry * w + rz * a;
      rotations[to + 2] = rw * c + rx * b - ry * a + rz * w;
      rotations[to + 3] = rw * w - rx * a - ry * b - rz * c;
    }
    while (at < end) window |= words[at++]!;
    return window === 0;
  }
}
