// Builds a stick figure for a skeleton: a line per bone, rings for the head and outlines of the
// feet. The simplified version has about half as many lines. A line has the colour of its second
// point.

import {add, findBodyParts, length, normalised, subtract} from './body_parts.js';
import type {SkeletonLike, Vec} from './body_parts.js';
import {Region} from './body_mesh.js';

export interface StickFigure {
  /** Number of points: the joints that lines use, and the extra points. */
  readonly pointCount: number;
  /** Pairs of point indices. */
  readonly lines: readonly number[];
  /** [point]: `Region` of the lines that end at this point. */
  readonly regions: Uint8Array;
  /** [point]: index of the joint at this point. The extra points come after these points. */
  readonly joints: Uint16Array;
  /** [extra point]: index of the joint that it moves with. */
  readonly extraJoints: Uint16Array;
  /** Positions of the extra points in the rest pose, 3 numbers per point. */
  readonly extraRest: Float32Array;
}

export function buildStickFigure(skeleton: SkeletonLike, simplified = false): StickFigure {
  const parts = findBodyParts(skeleton);
  const h = parts.heightM;
  const at = (j: number): Vec =>
    [parts.rest[j * 3]!, parts.rest[j * 3 + 1]!, parts.rest[j * 3 + 2]!];

  // The joint of each point. `point` adds a joint when a line first uses it.
  const joints: number[] = [];
  const place = new Map<number, number>();
  const regions: number[] = [];
  const point = (joint: number, region: number = Region.shirt): number => {
    let i = place.get(joint);
    if (i === undefined) {
      i = joints.length;
      joints.push(joint);
      regions.push(region);
      place.set(joint, i);
    }
    return i;
  };
  // Extra points have temporary indices -1, -2, ..., until the number of joint points is known.
  const extraJoints: number[] = [];
  const extraRest: number[] = [];
  const extraRegions: number[] = [];
  const extra = (joint: number, where: Vec, region: number): number => {
    extraJoints.push(joint);
    extraRest.push(...where);
    extraRegions.push(region);
    return -extraJoints.length;
  };

  const part = new Map<number, number>();
  for (const leg of parts.legs) {
    for (const joint of [leg.knee.joint, leg.ankle.joint]) part.set(joint, Region.trousers);
    if (leg.ball.joint !== leg.ankle.joint) part.set(leg.ball.joint, Region.shoes);
  }
  for (const arm of parts.arms) part.set(arm.wrist.joint, Region.skin);
  const lines: number[] = [];
  const bone = (from: number, to: number): void => {
    if (from === to || length(subtract(at(from), at(to))) < 1e-4) return;
    lines.push(point(from), point(to, part.get(to)));
  };
  if (simplified && parts.trunk.length > 1) {
    const first = parts.trunk[0]!.joint;
    const middle = parts.trunk[parts.trunk.length >> 1]!.joint;
    bone(first, middle);
    bone(middle, parts.head.joint);
    for (const {shoulder, elbow, wrist} of parts.arms) {
      bone(middle, shoulder.joint);
      bone(shoulder.joint, elbow.joint);
      bone(elbow.joint, wrist.joint);
    }
    for (const {hip, knee, ankle} of parts.legs) {
      bone(first, hip.joint);
      bone(hip.joint, knee.joint);
      bone(knee.joint, ankle.joint);
    }
  } else {
    for (let j = 1; j < skeleton.jointCount; ++j) {
      if (skeleton.parents[j]! >= 0) bone(skeleton.parents[j]!, j);
    }
  }

  const r = 0.06 * h;
  const centre: Vec = [parts.head.at[0], parts.crownY - r, parts.head.at[2] + 0.01 * h];
  const sides = simplified ? 4 : 6;
  for (const u of (simplified ? [[0.7, 0, 0.7]] : [[1, 0, 0], [0, 0, 1]]) as Vec[]) {
    const ring: number[] = [];
    for (let s = 0; s < sides; ++s) {
      const angle = (s + 0.5) / sides * 2 * Math.PI;
      ring.push(extra(parts.head.joint, add(
        add(centre, u, Math.cos(angle) * r * 0.8), [0, 1, 0], Math.sin(angle) * r), Region.skin));
    }
    ring.forEach((p, s) => lines.push(p, ring[(s + 1) % sides]!));
  }
  for (const {ankle, ball, toe} of parts.legs) {
    const tip = extra(ball.joint, toe, Region.shoes);
    if (!simplified) {
      const sole = parts.groundY;
      const back = normalised([ankle.at[0] - toe[0], 0, ankle.at[2] - toe[2]], [0, 0, -1]);
      const heel = extra(
        ankle.joint, add([ankle.at[0], sole, ankle.at[2]], back, 0.03 * h), Region.shoes);
      const pad = extra(ankle.joint, [ball.at[0], sole, ball.at[2]], Region.shoes);
      lines.push(point(ankle.joint), heel, heel, pad, pad, tip);
    }
    lines.push(point(ankle.joint), tip);
  }
  if (!simplified) {
    for (const arm of parts.arms) {
      lines.push(point(arm.wrist.joint), extra(arm.wrist.joint, arm.tip, Region.skin));
    }
  }
  if (lines.length === 0) lines.push(point(0), extra(0, add(at(0), [0, 0.2, 0]), Region.shirt));
  return {
    pointCount: joints.length + extraJoints.length,
    lines: lines.map((p) => p < 0 ? joints.length - 1 - p : p),
    regions: Uint8Array.from([...regions, ...extraRegions]), joints: Uint16Array.from(joints),
    extraJoints: Uint16Array.from(extraJoints), extraRest: Float32Array.from(extraRest),
  };
}
