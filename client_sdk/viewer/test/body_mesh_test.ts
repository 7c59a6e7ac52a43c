import assert from 'node:assert/strict';
import {test} from 'node:test';

import {figureOf, restPositions} from '../src/scene/body_parts.js';
import {lineFigure} from '../src/scene/stick_figure.js';
import {Region, buildBody} from '../src/scene/body_mesh.js';
import {captured, makeSkeleton, plain} from './skeletons.js';

for (const [name, skeleton] of [['plain', plain()], ['captured', captured()]] as const) {
  test(`finds limbs of the ${name} skeleton`, () => {
    const figure = figureOf(skeleton);
    const named = (joint: number): string => skeleton.names[joint]!;
    assert.equal(named(figure.head.joint), 'Head');
    assert.deepEqual(figure.arms.map((arm) => named(arm.shoulder.joint)).sort(), ['LeftArm', 'RightArm']);
    assert.deepEqual(figure.arms.map((arm) => named(arm.elbow.joint)).sort(), ['LeftForeArm', 'RightForeArm']);
    assert.deepEqual(figure.arms.map((arm) => named(arm.wrist.joint)).sort(), ['LeftHand', 'RightHand']);
    assert.deepEqual(figure.legs.map((leg) => named(leg.knee.joint)), ['LeftLeg', 'RightLeg']);
    for (let i = 1; i < figure.trunk.length; ++i) {
      assert.ok(figure.trunk[i]!.at[1] > figure.trunk[i - 1]!.at[1]);
    }
  });

  test(`wraps the ${name} skeleton in a whole body`, () => {
    const body = buildBody(skeleton);
    const rest = restPositions(skeleton);
    const vertices = body.blends.length;
    assert.equal(body.positions.length, vertices * 3);
    assert.equal(body.joints.length, vertices * 2);
    assert.ok(body.positions.every(Number.isFinite) && body.normals.every(Number.isFinite));
    assert.ok(body.joints.every((j) => j >= 0 && j < skeleton.jointCount));
    assert.ok(body.blends.every((b) => b >= 0 && b <= 1));
    assert.ok([...body.indices].every((i) => i < vertices));
    // Everything a person has is there, and lies near the joints that move it.
    for (const region of Object.values(Region)) assert.ok(body.regions.includes(region), `region ${region}`);
    for (let v = 0; v < vertices; ++v) {
      const j = body.joints[v * 2]!;
      const away = Math.hypot(...[0, 1, 2].map((k) => body.positions[v * 3 + k]! - rest[j * 3 + k]!));
      assert.ok(away < 0.55 * body.heightM, `vertex ${v} lies ${away} m from ${skeleton.names[j]}`);
    }
    // Closed surfaces, seen from outside: the volume is that of a person, and positive.
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

  test(`is the same on both sides: ${name}`, () => {
    const {positions} = buildBody(skeleton);
    const reach = [0, 0];
    for (let i = 0; i < positions.length; i += 3) {
      reach[0] = Math.max(reach[0]!, positions[i]!);
      reach[1] = Math.max(reach[1]!, -positions[i]!);
    }
    assert.ok(Math.abs(reach[0]! - reach[1]!) < 0.02, `${reach}`);
  });

  test(`has lines of the ${name} skeleton`, () => {
    for (const simple of [false, true]) {
      const {lines, regions, pointCount, joints, extraJoints, extraRest} = lineFigure(skeleton, simple);
      assert.equal(regions.length, pointCount);
      assert.equal(pointCount, joints.length + extraJoints.length);
      assert.equal(extraRest.length, extraJoints.length * 3);
      assert.ok(lines.length % 2 === 0 && lines.every((point) => point >= 0 && point < pointCount));
      if (simple) assert.ok(lines.length / 2 <= 24, `${lines.length / 2} lines`);
      else assert.ok(lines.length / 2 >= skeleton.jointCount - 6);
      // A line's colour is that of its end: no joint ends two lines.
      const ends = lines.filter((_, i) => i % 2 === 1);
      joints.forEach((_, p) => assert.ok(ends.filter((end) => end === p).length <= 1));
      // Feet, hands and head are reached.
      const reached = new Set(lines.map((p) => p < joints.length ? joints[p]! : extraJoints[p - joints.length]!));
      const figure = figureOf(skeleton);
      for (const leg of figure.legs) assert.ok(reached.has(leg.ball.joint) && reached.has(leg.knee.joint));
      for (const arm of figure.arms) assert.ok(reached.has(arm.wrist.joint) && reached.has(arm.elbow.joint));
      assert.ok(reached.has(figure.head.joint));
    }
  });

  test(`a coarse ${name} body is the same person with fewer faces`, () => {
    const fine = buildBody(skeleton, 8);
    const coarse = buildBody(skeleton, 5, true);
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

test('makes something of skeletons that are no people', () => {
  const odd = [
    makeSkeleton([['Only', '', 0, 0, 0]], [], ['a', 'b', 'c', 'd']),
    makeSkeleton([['A', '', 0, 0, 0], ['B', 'A', 0, 0, 0], ['C', 'B', 0, 0, 0]], [], ['a', 'b', 'c', 'd']),
    makeSkeleton([['A', '', 0, 0, 0], ['B', 'A', 3, 0, 0], ['C', 'B', 3, 0, 0], ['D', 'A', -2, -2, 5]], [],
      ['a', 'b', 'c', 'd']),
    makeSkeleton(Array.from({length: 256}, (_, i) =>
      [`J${i}`, i === 0 ? '' : `J${i - 1}`, 0, i % 2 ? 0.1 : -0.1, 0.05] as [string, string, number, number, number]),
    [], ['a', 'b', 'c', 'd']),
  ];
  for (const skeleton of odd) {
    for (const simple of [false, true]) {
      const figure = lineFigure(skeleton, simple);
      assert.ok(figure.lines.length > 0 && figure.extraRest.every(Number.isFinite));
    }
    for (const body of [buildBody(skeleton), buildBody(skeleton, 4, true)]) {
      assert.ok(body.positions.every(Number.isFinite));
      assert.ok(body.joints.every((j) => j >= 0 && j < skeleton.jointCount));
    }
    assert.ok(buildBody(skeleton).indices.length > 0);
  }
});

test('has fewer vertices when coarse', () => {
  assert.ok(buildBody(plain(), 6).blends.length < 0.6 * buildBody(plain(), 12).blends.length);
});
