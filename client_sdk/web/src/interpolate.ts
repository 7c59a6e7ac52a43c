/**
 * Four poses for cubic interpolation in an interval: before it, at its start, at its end, and after
 * it. If there is no pose before or after the interval, use the start or the end again.
 */
export interface Keys {
  /** Array that contains each of the four poses. */
  readonly roots: [Float32Array, Float32Array, Float32Array, Float32Array];
  readonly rotations: [Float32Array, Float32Array, Float32Array, Float32Array];
  /** Index of each pose in its array, counted in poses. */
  readonly places: [number, number, number, number];
  readonly timesS: [number, number, number, number];
}

const none = new Float32Array(0);

export function createKeys(): Keys {
  return {
    roots: [none, none, none, none],
    rotations: [none, none, none, none],
    places: [0, 0, 0, 0],
    timesS: [0, 0, 0, 0],
  };
}

/**
 * Computes the pose at `timeS` inside the interval by cubic Hermite interpolation. The result is
 * continuous with its first derivative and exact at the keys. Quaternions are interpolated in one
 * hemisphere and then normalised. Writes the root's position at `rootOut[rootAt]` and the
 * rotations of all joints at `out[outAt]`.
 */
export function interpolate(keys: Keys, timeS: number, jointCount: number, rootOut: Float32Array,
                            rootAt: number, out: Float32Array, outAt: number): void {
  const [beforeS, startS, endS, beyondS] = keys.timesS;
  const lengthS = endS - startS;
  const u = (timeS - startS) / lengthS;
  // Hermite basis. The slope at a key is the secant through its neighbours, in units of the
  // interval.
  const value = u * u * (3 - 2 * u);
  const slope0 = u * (1 - u) * (1 - u) * (lengthS / (endS - beforeS));
  const slope1 = u * u * (u - 1) * (lengthS / (beyondS - startS));
  // The sum is b * before + s * start + e * end + n * beyond.
  const b = -slope0;
  const s = 1 - value - slope1;
  const e = value + slope0;
  const n = slope1;

  const [p0, p1, p2, p3] = keys.places;
  const [r0, r1, r2, r3] = keys.roots;
  for (let i = 0; i < 3; ++i) {
    rootOut[rootAt + i] = b * r0[3 * p0 + i]! + s * r1[3 * p1 + i]! + e * r2[3 * p2 + i]! +
        n * r3[3 * p3 + i]!;
  }

  const [q0, q1, q2, q3] = keys.rotations;
  const size = 4 * jointCount;
  let i0 = p0 * size;
  let i1 = p1 * size;
  let i2 = p2 * size;
  let i3 = p3 * size;
  for (const end = outAt + size; outAt < end; outAt += 4, i0 += 4, i1 += 4, i2 += 4, i3 += 4) {
    const x1 = q1[i1]!, y1 = q1[i1 + 1]!, z1 = q1[i1 + 2]!, w1 = q1[i1 + 3]!;
    const x0 = q0[i0]!, y0 = q0[i0 + 1]!, z0 = q0[i0 + 2]!, w0 = q0[i0 + 3]!;
    const x2 = q2[i2]!, y2 = q2[i2 + 1]!, z2 = q2[i2 + 2]!, w2 = q2[i2 + 3]!;
    const x3 = q3[i3]!, y3 = q3[i3 + 1]!, z3 = q3[i3 + 2]!, w3 = q3[i3 + 3]!;
    const f0 = x0 * x1 + y0 * y1 + z0 * z1 + w0 * w1 < 0 ? -b : b;
    const sign2 = x1 * x2 + y1 * y2 + z1 * z2 + w1 * w2 < 0 ? -1 : 1;
    const f2 = sign2 * e;
    const f3 = x2 * x3 + y2 * y3 + z2 * z3 + w2 * w3 < 0 ? -sign2 * n : sign2 * n;
    const x = f0 * x0 + s * x1 + f2 * x2 + f3 * x3;
    const y = f0 * y0 + s * y1 + f2 * y2 + f3 * y3;
    const z = f0 * z0 + s * z1 + f2 * z2 + f3 * z3;
    const w = f0 * w0 + s * w1 + f2 * w2 + f3 * w3;
    const squared = x * x + y * y + z * z + w * w;
    if (squared > 1e-12) {
      const scale = 1 / Math.sqrt(squared);
      out[outAt] = x * scale;
      out[outAt + 1] = y * scale;
      out[outAt + 2] = z * scale;
      out[outAt + 3] = w * scale;
    } else {  // The quaternions cancel out, so keep the one at the start.
      out[outAt] = x1;
      out[outAt + 1] = y1;
      out[outAt + 2] = z1;
      out[outAt + 3] = w1;
    }
  }
}

/** Copies the pose with index `place`. The output is the same as that of `interpolate`. */
export function copyPose(roots: Float32Array, rotations: Float32Array, place: number,
                         jointCount: number, rootOut: Float32Array, rootAt: number,
                         out: Float32Array, outAt: number): void {
  const size = 4 * jointCount;
  const root = 3 * place;
  rootOut[rootAt] = roots[root]!;
  rootOut[rootAt + 1] = roots[root + 1]!;
  rootOut[rootAt + 2] = roots[root + 2]!;
  const from = place * size;
  for (let i = 0; i < size; ++i) out[outAt + i] = rotations[from + i]!;
}
