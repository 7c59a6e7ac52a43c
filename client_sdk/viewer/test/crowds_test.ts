import assert from 'node:assert/strict';
import {test} from 'node:test';

import * as THREE from 'three';

import {floatsPerMatrix, computeJointTransforms} from '../src/scene/kinematics.js';
import {restPositions} from '../src/scene/body_parts.js';
import {StickFigureCrowd} from '../src/scene/stick_figure_crowd.js';
import {buildStickFigure} from '../src/scene/stick_figure.js';
import {Region, buildBodyMesh} from '../src/scene/body_mesh.js';
import {CpuSkinnedCrowd} from '../src/scene/cpu_skinned_crowd.js';
import {capturedSkeleton} from './skeletons.js';

const lights = {
  sun: new THREE.Vector3(0, 1, 0), skyLight: new THREE.Color(0.5, 0.5, 0.5),
  groundLight: new THREE.Color(0.2, 0.2, 0.2), fogColour: new THREE.Color(0, 0, 0),
  accent: new THREE.Color(0, 0, 1),
};
const skeleton = capturedSkeleton();
const n = skeleton.jointCount;

/**
 * Two avatars: one in the rest pose above the origin, one elsewhere, turned left with a bent knee.
 */
function crowd() {
  const matrices = new Float32Array(2 * n * floatsPerMatrix);
  const positions = new Float32Array(2 * n * 3);
  const rest = restPositions(skeleton);
  const rotations = new Float32Array(2 * n * 4);
  for (let j = 0; j < 2 * n; ++j) rotations[j * 4 + 3] = 1;
  const half = Math.SQRT1_2;
  rotations.set([0, half, 0, half], n * 4);
  rotations.set([Math.sin(0.4), 0, 0, Math.cos(0.4)], (n + skeleton.names.indexOf('LeftLeg')) * 4);
  computeJointTransforms(skeleton, rest, 0, 1, 0, rotations, 0, matrices, 0, positions, 0);
  computeJointTransforms(skeleton, rest, 3, 1, -2, rotations, n * 4, matrices, n * floatsPerMatrix,
    positions, n * 3);
  return {matrices, positions};
}

/** A point of the rest pose, transformed by a joint of the second avatar. */
function moved(matrices: Float32Array, joint: number, p: ArrayLike<number>): number[] {
  const m = (n + joint) * floatsPerMatrix;
  return [0, 4, 8].map((row) => matrices[m + row]! * p[0]! + matrices[m + row + 1]! * p[1]! +
    matrices[m + row + 2]! * p[2]! + matrices[m + row + 3]!);
}

test('CPU skinning transforms and lights vertices', () => {
  const body = buildBodyMesh(skeleton, 5, true);
  const skinned = new CpuSkinnedCrowd(body, n, lights, 16);
  const {matrices} = crowd();
  skinned.setColours(0, new THREE.Color(1, 0, 0), false);
  skinned.setColours(1, new THREE.Color(0, 1, 0), false);
  skinned.update(matrices, 2);
  const vertices = body.blends.length;
  const at = skinned.object.geometry.getAttribute('position').array;
  const tint = skinned.object.geometry.getAttribute('tint').array;
  let green = 0;
  for (let v = 0; v < vertices; ++v) {
    const p = body.positions.subarray(v * 3, v * 3 + 3);
    const a = moved(matrices, body.joints[v * 2]!, p);
    const b = moved(matrices, body.joints[v * 2 + 1]!, p);
    for (let k = 0; k < 3; ++k) {
      assert.ok(Math.abs(at[v * 3 + k]! - (p[k]! + (k === 1 ? 1 : 0))) < 1e-5);
      const expected = a[k]! + (b[k]! - a[k]!) * body.blends[v]!;
      assert.ok(Math.abs(at[(vertices + v) * 3 + k]! - expected) < 1e-4, `vertex ${v}`);
    }
    if (body.regions[v] !== Region.shirt) continue;
    // Vertices that face up are brighter than those that face down, and the shirts differ.
    const [r, g] = [tint[v * 4]!, tint[(vertices + v) * 4 + 1]!];
    assert.ok(r > 0 && tint[v * 4 + 1] === 0 && tint[(vertices + v) * 4] === 0);
    const up = body.normals[v * 3 + 1]!;
    if (up > 0.9) assert.ok(r > 200, `${r}`);
    if (up < -0.7) assert.ok(r < 100, `${r}`);
    if (g > 0) ++green;
  }
  assert.ok(green > 10);
  assert.equal(skinned.object.geometry.drawRange.count, 2 * body.indices.length);
});

test('stick figures have points at joints and at points that move with joints', () => {
  for (const simplified of [false, true]) {
    const lines = new StickFigureCrowd(skeleton, lights, 16, simplified);
    const figure = buildStickFigure(skeleton, simplified);
    const {matrices, positions} = crowd();
    lines.update(matrices, positions, 2);
    const at = lines.object.geometry.getAttribute('position').array;
    for (let p = 0; p < figure.pointCount; ++p) {
      const e = p - figure.joints.length;
      const joint = (n + (figure.joints[p] ?? 0)) * 3;
      const expected = e < 0 ? positions.subarray(joint, joint + 3) :
        moved(matrices, figure.extraJoints[e]!, figure.extraRest.subarray(e * 3, e * 3 + 3));
      for (let k = 0; k < 3; ++k) {
        const error = Math.abs(at[(figure.pointCount + p) * 3 + k]! - expected[k]!);
        assert.ok(error < 1e-5, `point ${p}`);
      }
    }
    assert.equal(lines.object.geometry.drawRange.count, 2 * figure.lines.length);
  }
});
