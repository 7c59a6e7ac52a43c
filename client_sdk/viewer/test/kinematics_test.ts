import assert from 'node:assert/strict';
import {test} from 'node:test';

import {restPositions} from '../src/scene/body_parts.js';
import type {SkeletonLike} from '../src/scene/body_parts.js';
import {transformPoint, floatsPerMatrix, computeJointTransforms} from '../src/scene/kinematics.js';
import {generatedSkeleton} from './skeletons.js';

function pose(
  skeleton: SkeletonLike, turns: Record<string, [number, number, number, number]>): Float32Array {
  const q = new Float32Array(skeleton.jointCount * 4);
  skeleton.names.forEach((name, j) => q.set(turns[name] ?? [0, 0, 0, 1], j * 4));
  return q;
}

function solved(skeleton: SkeletonLike, root: [number, number, number], rotations: Float32Array) {
  const matrices = new Float32Array(skeleton.jointCount * floatsPerMatrix);
  const positions = new Float32Array(skeleton.jointCount * 3);
  computeJointTransforms(skeleton, restPositions(skeleton), ...root, rotations, 0, matrices, 0,
    positions, 0);
  return {matrices, positions, at: (name: string): number[] => {
    const j = skeleton.names.indexOf(name);
    return [...positions.subarray(j * 3, j * 3 + 3)];
  }};
}

function near(actual: ArrayLike<number>, expected: number[], what = ''): void {
  expected.forEach((value, k) =>
    assert.ok(Math.abs(actual[k]! - value) < 1e-5,
      `${what} ${[...Array.from(actual)]} is not ${expected}`));
}

const half = Math.SQRT1_2;

test('keeps the rest pose, translated by the root', () => {
  const skeleton = generatedSkeleton();
  const rest = restPositions(skeleton);
  const {positions, matrices} = solved(skeleton, [1, 2, 3], pose(skeleton, {}));
  for (let j = 0; j < skeleton.jointCount; ++j) {
    near(positions.subarray(j * 3), [0, 1, 2].map((k) => rest[j * 3 + k]! + k + 1));
    near(matrices.subarray(j * floatsPerMatrix), [1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3]);
  }
});

test('rotates with the root: a left turn maps +Z to +X', () => {
  const skeleton = generatedSkeleton();
  const {at} = solved(skeleton, [0, 1, 0], pose(skeleton, {Hips: [0, half, 0, half]}));
  near(at('LeftFoot'), [0, 1 - 0.86, -0.085]);   // The left side is at the back.
  near(at('LeftToeBase'), [0.13, 1 - 0.928, -0.085]);
});

test('bends a knee backwards by a rotation about +X', () => {
  const skeleton = generatedSkeleton();
  const {at, matrices} = solved(skeleton, [0, 0, 0], pose(skeleton, {LeftLeg: [half, 0, 0, half]}));
  near(at('LeftLeg'), [0.085, -0.43, 0]);
  near(at('LeftFoot'), [0.085, -0.43, -0.43]);
  // The shin's matrix maps the ankle's rest position to the same point.
  const j = skeleton.names.indexOf('LeftLeg') * floatsPerMatrix;
  const rest = [0.085, -0.86, 0];
  near([0, 1, 2].map((r) => matrices[j + r * 4]! * rest[0]! + matrices[j + r * 4 + 1]! * rest[1]! +
    matrices[j + r * 4 + 2]! * rest[2]! + matrices[j + r * 4 + 3]!), [0.085, -0.43, -0.43]);
});

test('multiplies the parent rotation by the local rotation', () => {
  const skeleton = generatedSkeleton();
  // The root turns left by 90 degrees, then the upper arm down by 90 degrees about its own +Z.
  const {at} = solved(skeleton, [0, 0, 0],
    pose(skeleton, {Hips: [0, half, 0, half], LeftArm: [0, 0, -half, half]}));
  const shoulder = at('LeftArm');
  near(at('LeftForeArm'), [shoulder[0]!, shoulder[1]! - 0.29, shoulder[2]!]);
});

test('transforms a point with a joint', () => {
  const skeleton = generatedSkeleton();
  const {matrices, positions} =
    solved(skeleton, [0, 0, 0], pose(skeleton, {LeftToeBase: [-half, 0, 0, half]}));
  const j = skeleton.names.indexOf('LeftToeBase');
  const out = new Float32Array(4);
  transformPoint(matrices, j * floatsPerMatrix, positions, j * 3, [0, 0, 0.07], out, 1);
  near(out.subarray(1), [0.085, -0.928 + 0.07, 0.13]);
});

test('computes the same transforms for an avatar in a crowd as alone', () => {
  const skeleton = generatedSkeleton();
  const n = skeleton.jointCount;
  const rotations = new Float32Array(n * 4 * 3);
  for (let i = 0; i < 3; ++i) {
    rotations.set(pose(skeleton, {Spine: [Math.sin(i / 4), 0, 0, Math.cos(i / 4)]}), i * n * 4);
  }
  const matrices = new Float32Array(n * floatsPerMatrix * 3);
  const positions = new Float32Array(n * 9);
  const rest = restPositions(skeleton);
  for (let i = 0; i < 3; ++i) {
    computeJointTransforms(skeleton, rest, i, 0, 0, rotations, i * n * 4, matrices,
      i * n * floatsPerMatrix, positions, i * n * 3);
  }
  const alone = solved(skeleton, [2, 0, 0], rotations.slice(2 * n * 4));
  assert.deepEqual([...positions.subarray(2 * n * 3)], [...alone.positions]);
  assert.deepEqual([...matrices.subarray(2 * n * floatsPerMatrix)], [...alone.matrices]);
});
