// Forward kinematics on typed arrays, for all joints of all avatars of a crowd.

import type {SkeletonLike} from './body_parts.js';

/** Size of a joint's matrix: three rows of four, rotation and translation. */
export const floatsPerMatrix = 12;

/**
 * Computes world transforms of one avatar's joints: matrices that map points of the rest pose to
 * the world, and world positions of the joints.
 *
 * `rest`: joint positions in the rest pose, 3 numbers per joint, from `restPositions`. `rotations`:
 * quaternions x, y, z, w, starting at index `rotationsAt`; the root's is in world space, the others
 * are relative to their parents. Writes 12 numbers per joint to `matrices` from index `matricesAt`,
 * and 3 per joint to `positions` from `positionsAt`. Never allocates.
 */
export function computeJointTransforms(
  skeleton: SkeletonLike, rest: Float32Array, rootX: number, rootY: number, rootZ: number,
  rotations: Float32Array, rotationsAt: number, matrices: Float32Array, matricesAt: number,
  positions: Float32Array, positionsAt: number): void {
  const {parents, offsetsM, jointCount} = skeleton;
  for (let j = 0; j < jointCount; ++j) {
    const q = rotationsAt + j * 4;
    const x = rotations[q]!;
    const y = rotations[q + 1]!;
    const z = rotations[q + 2]!;
    const w = rotations[q + 3]!;
    // Matrix of the local rotation.
    const l00 = 1 - 2 * (y * y + z * z);
    const l01 = 2 * (x * y - z * w);
    const l02 = 2 * (x * z + y * w);
    const l10 = 2 * (x * y + z * w);
    const l11 = 1 - 2 * (x * x + z * z);
    const l12 = 2 * (y * z - x * w);
    const l20 = 2 * (x * z - y * w);
    const l21 = 2 * (y * z + x * w);
    const l22 = 1 - 2 * (x * x + y * y);
    const m = matricesAt + j * floatsPerMatrix;
    const parent = j === 0 ? -1 : parents[j]!;
    let px = rootX;
    let py = rootY;
    let pz = rootZ;
    let r00 = l00, r01 = l01, r02 = l02, r10 = l10, r11 = l11, r12 = l12, r20 = l20, r21 = l21,
      r22 = l22;
    if (parent >= 0) {
      const p = matricesAt + parent * floatsPerMatrix;
      const a00 = matrices[p]!, a01 = matrices[p + 1]!, a02 = matrices[p + 2]!;
      const a10 = matrices[p + 4]!, a11 = matrices[p + 5]!, a12 = matrices[p + 6]!;
      const a20 = matrices[p + 8]!, a21 = matrices[p + 9]!, a22 = matrices[p + 10]!;
      r00 = a00 * l00 + a01 * l10 + a02 * l20;
      r01 = a00 * l01 + a01 * l11 + a02 * l21;
      r02 = a00 * l02 + a01 * l12 + a02 * l22;
      r10 = a10 * l00 + a11 * l10 + a12 * l20;
      r11 = a10 * l01 + a11 * l11 + a12 * l21;
      r12 = a10 * l02 + a11 * l12 + a12 * l22;
      r20 = a20 * l00 + a21 * l10 + a22 * l20;
      r21 = a20 * l01 + a21 * l11 + a22 * l21;
      r22 = a20 * l02 + a21 * l12 + a22 * l22;
      const ox = offsetsM[j * 3]!;
      const oy = offsetsM[j * 3 + 1]!;
      const oz = offsetsM[j * 3 + 2]!;
      const at = positionsAt + parent * 3;
      px = positions[at]! + a00 * ox + a01 * oy + a02 * oz;
      py = positions[at + 1]! + a10 * ox + a11 * oy + a12 * oz;
      pz = positions[at + 2]! + a20 * ox + a21 * oy + a22 * oz;
    }
    const out = positionsAt + j * 3;
    positions[out] = px;
    positions[out + 1] = py;
    positions[out + 2] = pz;
    const rx = rest[j * 3]!;
    const ry = rest[j * 3 + 1]!;
    const rz = rest[j * 3 + 2]!;
    matrices[m] = r00;
    matrices[m + 1] = r01;
    matrices[m + 2] = r02;
    matrices[m + 3] = px - (r00 * rx + r01 * ry + r02 * rz);
    matrices[m + 4] = r10;
    matrices[m + 5] = r11;
    matrices[m + 6] = r12;
    matrices[m + 7] = py - (r10 * rx + r11 * ry + r12 * rz);
    matrices[m + 8] = r20;
    matrices[m + 9] = r21;
    matrices[m + 10] = r22;
    matrices[m + 11] = pz - (r20 * rx + r21 * ry + r22 * rz);
  }
}

/** Transforms `offset`, a point in a joint's frame, to the world. Writes out[at] to out[at + 2]. */
export function transformPoint(
  matrices: Float32Array, matrixAt: number, positions: Float32Array, positionAt: number,
  offset: ArrayLike<number>, out: Float32Array, at: number): void {
  const x = offset[0] ?? 0;
  const y = offset[1] ?? 0;
  const z = offset[2] ?? 0;
  for (let k = 0; k < 3; ++k) {
    const row = matrixAt + k * 4;
    out[at + k] = positions[positionAt + k]! + matrices[row]! * x + matrices[row + 1]! * y +
      matrices[row + 2]! * z;
  }
}
