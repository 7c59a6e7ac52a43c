import assert from 'node:assert/strict';
import {test} from 'node:test';

import {findBodyParts, restPositions} from '../src/scene/body_parts.js';
import {buildStickFigure} from '../src/scene/stick_figure.js';
import {Region, buildBodyMesh} from '../src/scene/body_mesh.js';
import {capturedSkeleton, makeSkeleton, generatedSkeleton} from './skeletons.js';
import type {Row} from './skeletons.js';

const skeletons =
  [['generated', generatedSkeleton()], ['captured', capturedSkeleton()]] as const;
for (const [name, skeleton] of skeletons) {
  test(`finds the body parts of the ${name} skeleton`, () => {
    const parts = findBodyParts(skeleton);
    const named = (joint: number): string => skeleton.names[joint]!;
    assert.equal(named(parts.head.joint), 'Head');
    assert.deepEqual(parts.arms.map((arm) => named(arm.shoulder.joint)).sort(),
      ['LeftArm', 'RightArm']);
    assert.deepEqual(parts.arms.map((arm) => named(arm.elbow.joint)).sort(),
      ['LeftForeArm', 'RightForeArm']);
    assert.deepEqual(parts.arms.map((arm) => named(arm.wrist.joint)).sort(),
      ['LeftHand', 'RightHand']);
    assert.deepEqual(parts.legs.map((leg) => named(leg.knee.joint)), ['LeftLeg', 'RightLeg']);
    for (let i = 1; i < parts.trunk.length; ++i) {
      assert.ok(parts.trunk[i]!.at[1] > parts.trunk[i - 1]!.at[1]);
    }
  });

  test(`builds a complete body for the ${name} skeleton`, () => {
    const body = buildBodyMesh(skeleton);
    const rest = restPositions(skeleton);
    const vertices = body.blends.length;
    assert.equal(body.positions.length, vertices * 3);
    assert.equal(body.joints.length, vertices * 2);
    assert.ok(body.positions.every(Number.isFinite) && body.normals.every(Number.isFinite));
    assert.ok(body.joints.every((j) => j >= 0 && j < skeleton.jointCount));
    assert.ok(body.blends.every((b) => b >= 0 && b <= 1));
    assert.ok([...body.indices].every((i) => i < vertices));
    // All regions are present, and vertices are near the joints that move them.
    for (const region of Object.values(Region)) {
      assert.ok(body.regions.includes(region), `region ${region}`);
    }
    for (let v = 0; v < vertices; ++v) {
      const j = body.joints[v * 2]!;
      const away = Math.hypot(...[0, 1, 2].map(
        (k) => body.positions[v * 3 + k]! - rest[j * 3 + k]!));
      assert.ok(away < 0.55 * body.heightM, `vertex ${v} is ${away} m from ${skeleton.names[j]}`);
    }
    // If the surfaces are closed and face outwards, the volume is positive. It must be that of a
    // person.
    let volume = 0;
    const p = body.positions;
    for (let i = 0; i < body.indices.length; i += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => body.indices[i + k]! * 3) as [number, number, number];
      volume += (p[a]! * (p[b + 1]! * p[c + 2]! - p[b + 2]! * p[c + 1]!) +
        p[a + 1]! * (p[b + 2]! * p[c]! - p[b]! * p[c + 2]!) +
        p[a + 2]! * (p[b]! * p[c + 1]! - p[b + 1]! * p[c]!)) / 6;
    }
    assert.ok(volume > 0.03 && volume < 0.14, `volume ${volume} m3`);
  });

  test(`builds a symmetric body for the ${name} skeleton`, () => {
    const {positions} = buildBodyMesh(skeleton);
    const reach = [0, 0];
    for (let i = 0; i < positions.length; i += 3) {
      reach[0] = Math.max(reach[0]!, positions[i]!);
      reach[1] = Math.max(reach[1]!, -positions[i]!);
    }
    assert.ok(Math.abs(reach[0]! - reach[1]!) < 0.02, `${reach}`);
  });

  test(`builds stick figures for the ${name} skeleton`, () => {
    for (const simplified of [false, true]) {
      const {lines, regions, pointCount, joints, extraJoints, extraRest} =
        buildStickFigure(skeleton, simplified);
      assert.equal(regions.length, pointCount);
      assert.equal(pointCount, joints.length + extraJoints.length);
      assert.equal(extraRest.length, extraJoints.length * 3);
      assert.ok(lines.length % 2 === 0 && lines.every((point) => point >= 0 && point < pointCount));
      if (simplified) assert.ok(lines.length / 2 <= 24, `${lines.length / 2} lines`);
      else assert.ok(lines.length / 2 >= skeleton.jointCount - 6);
      // A line has the colour of its end point, so a joint must not end two lines.
      const ends = lines.filter((_, i) => i % 2 === 1);
      joints.forEach((_, p) => assert.ok(ends.filter((end) => end === p).length <= 1));
      // Lines reach feet, hands and head.
      const reached = new Set(lines.map((p) => p < joints.length ? joints[p]! :
        extraJoints[p - joints.length]!));
      const parts = findBodyParts(skeleton);
      for (const {ball, knee} of parts.legs) {
        assert.ok(reached.has(ball.joint) && reached.has(knee.joint));
      }
      for (const {wrist, elbow} of parts.arms) {
        assert.ok(reached.has(wrist.joint) && reached.has(elbow.joint));
      }
      assert.ok(reached.has(parts.head.joint));
    }
  });

  test(`builds a coarse ${name} body of the same size with fewer faces`, () => {
    const fine = buildBodyMesh(skeleton, 8);
    const coarse = buildBodyMesh(skeleton, 5, true);
    assert.ok(coarse.indices.length < 0.45 * fine.indices.length,
      `${coarse.indices.length / 3} faces, ${fine.indices.length / 3}`);
    assert.ok(coarse.normals.every(Number.isFinite));
    for (let k = 0; k < 3; ++k) {
      const reach = (body: {positions: Float32Array}): number =>
        body.positions.reduce((most, v, i) => i % 3 === k ? Math.max(most, Math.abs(v)) : most, 0);
      assert.ok(Math.abs(reach(fine) - reach(coarse)) < 0.03);
    }
  });
}

test('builds a mesh for skeletons that are not human', () => {
  const odd = [
    makeSkeleton([['Only', '', 0, 0, 0]], [], ['a', 'b', 'c', 'd']),
    makeSkeleton([['A', '', 0, 0, 0], ['B', 'A', 0, 0, 0], ['C', 'B', 0, 0, 0]], [],
      ['a', 'b', 'c', 'd']),
    makeSkeleton(
      [['A', '', 0, 0, 0], ['B', 'A', 3, 0, 0], ['C', 'B', 3, 0, 0], ['D', 'A', -2, -2, 5]], [],
      ['a', 'b', 'c', 'd']),
    makeSkeleton(Array.from({length: 256}, (_, i) =>
      [`J${i}`, i === 0 ? '' : `J${i - 1}`, 0, i % 2 ? 0.1 : -0.1, 0.05] as Row),
    [], ['a', 'b', 'c', 'd']),
  ];
  for (const skeleton of odd) {
    for (const simplified of [false, true]) {
      const parts = buildStickFigure(skeleton, simplified);
      assert.ok(parts.lines.length > 0 && parts.extraRest.every(Number.isFinite));
    }
    for (const body of [buildBodyMesh(skeleton), buildBodyMesh(skeleton, 4, true)]) {
      assert.ok(body.positions.every(Number.isFinite));
      assert.ok(body.joints.every((j) => j >= 0 && j < skeleton.jointCount));
    }
    assert.ok(buildBodyMesh(skeleton).indices.length > 0);
  }
});

test('builds fewer vertices with fewer segments', () => {
  const vertices = (segments: number): number =>
    buildBodyMesh(generatedSkeleton(), segments).blends.length;
  assert.ok(vertices(6) < 0.6 * vertices(12));
});
