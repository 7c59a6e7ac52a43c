import assert from 'node:assert/strict';
import {test} from 'node:test';

import {restPositions} from '../src/scene/body_parts.js';
import type {SkeletonLike} from '../src/scene/body_parts.js';
import {carry, matrixFloats, solve} from '../src/scene/kinematics.js';
import {plain} from './skeletons.js';

function pose(skeleton: SkeletonLike, turns: Record<string, [number, number, number, number]>): Float32Array {
  const q = new Float32Array(skeleton.jointCount * 4);
  skeleton.names.forEach((name, j) => q.set(turns[name] ?? [0, 0, 0, 1], j * 4));
  return q;
}

function solved(skeleton: SkeletonLike, root: [number, number, number], rotations: Float32Array) {
  const matrices = new Float32Array(skeleton.jointCount * matrixFloats);
  const positions = new Float32Array(skeleton.jointCount * 3);
  solve(skeleton, restPositions(skeleton), ...root, rotations, 0, matrices, 0, positions, 0);
  return {matrices, positions, at: (name: string): number[] => {
    const j = skeleton.names.indexOf(name);
    return [...positions.subarray(j * 3, j * 3 + 3)];
  }};
}

function near(actual: ArrayLike<number>, expected: number[], what = ''): void {
  expected.forEach((value, k) =>
    assert.ok(Math.abs(actual[k]! - value) < 1e-5, `${what} ${[...Array.from(actual)]} is not ${expected}`));
}

const half = Math.SQRT1_2;

test('leaves the rest pose where it is, moved by the root', () => {
  const skeleton = plain();
  const rest = restPositions(skeleton);
  const {positions, matrices} = solved(skeleton, [1, 2, 3], pose(skeleton, {}));
  for (let j = 0; j < skeleton.jointCount; ++j) {
    near(positions.subarray(j * 3), [0, 1, 2].map((k) => rest[j * 3 + k]! + k + 1));
    near(matrices.subarray(j * matrixFloats), [1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3]);
  }
});

test('turns by the root to the left: +Z goes to +X', () => {
  const skeleton = plain();
  const {at} = solved(skeleton, [0, 1, 0], pose(skeleton, {Hips: [0, half, 0, half]}));
  near(at('LeftFoot'), [0, 1 - 0.86, -0.085]);   // its left side is behind
  near(at('LeftToeBase'), [0.13, 1 - 0.928, -0.085]);
});

test('bends a knee backwards about +X', () => {
  const skeleton = plain();
  const {at, matrices} = solved(skeleton, [0, 0, 0], pose(skeleton, {LeftLeg: [half, 0, 0, half]}));
  near(at('LeftLeg'), [0.085, -0.43, 0]);
  near(at('LeftFoot'), [0.085, -0.43, -0.43]);
  // The shin's matrix takes the rest ankle to the same place, and the toes' frame turned with it.
  const j = skeleton.names.indexOf('LeftLeg') * matrixFloats;
  const rest = [0.085, -0.86, 0];
  near([0, 1, 2].map((r) => matrices[j + r * 4]! * rest[0]! + matrices[j + r * 4 + 1]! * rest[1]! +
    matrices[j + r * 4 + 2]! * rest[2]! + matrices[j + r * 4 + 3]!), [0.085, -0.43, -0.43]);
});

test('turns children within their parents: parent times local', () => {
  const skeleton = plain();
  // Root a quarter to the left, then the upper arm a quarter down about its own +Z.
  const {at} = solved(skeleton, [0, 0, 0],
    pose(skeleton, {Hips: [0, half, 0, half], LeftArm: [0, 0, -half, half]}));
  const shoulder = at('LeftArm');
  near(at('LeftForeArm'), [shoulder[0]!, shoulder[1]! - 0.29, shoulder[2]!]);
});

test('carries a point with a joint', () => {
  const skeleton = plain();
  const {matrices, positions} = solved(skeleton, [0, 0, 0], pose(skeleton, {LeftToeBase: [-half, 0, 0, half]}));
  const j = skeleton.names.indexOf('LeftToeBase');
  const out = new Float32Array(4);
  carry(matrices, j * matrixFloats, positions, j * 3, [0, 0, 0.07], out, 1);
  near(out.subarray(1), [0.085, -0.928 + 0.07, 0.13]);
});

test('solves an avatar among others as alone', () => {
  const skeleton = plain();
  const n = skeleton.jointCount;
  const rotations = new Float32Array(n * 4 * 3);
  for (let i = 0; i < 3; ++i) {
    rotations.set(pose(skeleton, {Spine: [Math.sin(i / 4), 0, 0, Math.cos(i / 4)]}), i * n * 4);
  }
  const matrices = new Float32Array(n * matrixFloats * 3);
  const positions = new Float32Array(n * 9);
  const rest = restPositions(skeleton);
  for (let i = 0; i < 3; ++i) {
    solve(skeleton, rest, i, 0, 0, rotations, i * n * 4, matrices, i * n * matrixFloats, positions, i * n * 3);
  }
  const alone = solved(skeleton, [2, 0, 0], rotations.slice(2 * n * 4));
  assert.deepEqual([...positions.subarray(2 * n * 3)], [...alone.positions]);
  assert.deepEqual([...matrices.subarray(2 * n * matrixFloats)], [...alone.matrices]);
});
