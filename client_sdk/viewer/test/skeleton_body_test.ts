import assert from 'node:assert/strict';
import {test} from 'node:test';

import {figureOf, restPositions} from '../src/scene/figure.js';
import {Region, buildBody, buildLines} from '../src/scene/skeleton_body.js';
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
    const lines = buildLines(skeleton);
    assert.equal(lines.positions.length, lines.regions.length * 3);
    assert.equal(lines.regions.length % 2, 0);
    assert.ok(lines.regions.length / 2 >= skeleton.jointCount - 6);
    assert.ok(lines.positions.every(Number.isFinite));
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
    for (const body of [buildBody(skeleton), buildLines(skeleton)]) {
      assert.ok(body.positions.every(Number.isFinite));
      assert.ok(body.joints.every((j) => j >= 0 && j < skeleton.jointCount));
    }
    assert.ok(buildBody(skeleton).indices.length > 0);
  }
});

test('has fewer vertices when coarse', () => {
  assert.ok(buildBody(plain(), 6).blends.length < 0.6 * buildBody(plain(), 12).blends.length);
});
