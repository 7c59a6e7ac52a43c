// Skeletons for tests, in the format in which the client library describes them.

import type {LegLike, SkeletonLike} from '../src/scene/body_parts.js';

/** Name, parent's name, and offset from the parent in metres. */
export type Row = [name: string, parent: string, x: number, y: number, z: number];

/** `legNames`: names of hip, knee, ankle and ball, without the side. */
export function makeSkeleton(
  rows: Row[], ends: [string, number, number, number][],
  legNames: [string, string, string, string]): SkeletonLike {
  const names = rows.map(([name]) => name);
  const index = (name: string): number => names.indexOf(name);
  const leg = (side: string): LegLike => {
    const [hip, knee, ankle, ball] =
      legNames.map((name) => index(side + name)) as [number, number, number, number];
    const end = ends.find(([name]) => index(name) === ball && ball >= 0);
    return {
      hip, knee, ankle, ball, ballOffsetM: [0, 0, 0],
      toeTipOffsetM: end ? [end[1], end[2], end[3]] : [0, 0, 0]};
  };
  return {
    jointCount: rows.length, names, parents: Int16Array.from(
      rows.map(([, parent]) => index(parent))),
    offsetsM: Float32Array.from(rows.flatMap(([, , x, y, z]) => [x, y, z])),
    endSites: ends.map(([name, x, y, z]) => ({joint: index(name), offsetM: [x, y, z]})),
    leftLeg: leg('Left'), rightLeg: leg('Right'),
  };
}

/** Like the skeleton of the generated library: straight legs, arms stretched sideways. */
export function generatedSkeleton(): SkeletonLike {
  const rows: Row[] = [['Hips', '', 0, 0, 0]];
  const ends: [string, number, number, number][] = [];
  for (const [side, s] of [['Left', 1], ['Right', -1]] as const) {
    rows.push([`${side}UpLeg`, 'Hips', 0.085 * s, 0, 0],
      [`${side}Leg`, `${side}UpLeg`, 0, -0.43, 0],
      [`${side}Foot`, `${side}Leg`, 0, -0.43, 0],
      [`${side}ToeBase`, `${side}Foot`, 0, -0.068, 0.13]);
    ends.push([`${side}ToeBase`, 0, 0, 0.07]);
  }
  rows.push(['Spine', 'Hips', 0, 0.12, 0], ['Spine1', 'Spine', 0, 0.18, 0],
    ['Neck', 'Spine1', 0, 0.2, 0],
    ['Head', 'Neck', 0, 0.09, 0]);
  ends.push(['Head', 0, 0.18, 0]);
  for (const [side, s] of [['Left', 1], ['Right', -1]] as const) {
    rows.push([`${side}Shoulder`, 'Spine1', 0.03 * s, 0.15, 0],
      [`${side}Arm`, `${side}Shoulder`, 0.15 * s, 0, 0],
      [`${side}ForeArm`, `${side}Arm`, 0.29 * s, 0, 0],
      [`${side}Hand`, `${side}ForeArm`, 0.25 * s, 0, 0]);
    ends.push([`${side}Hand`, 0.17 * s, 0, 0]);
  }
  return makeSkeleton(rows, ends, ['UpLeg', 'Leg', 'Foot', 'ToeBase']);
}

/**
 * Like a captured skeleton: joints at the same point, spread legs, long collar bones, five fingers.
 */
export function capturedSkeleton(): SkeletonLike {
  const rows: Row[] = [['Hips', '', 0, 0, 0]];
  const ends: [string, number, number, number][] = [];
  for (const [side, s] of [['Left', 1], ['Right', -1]] as const) {
    rows.push([`${side}HipJoint`, 'Hips', 0, 0, 0],
      [`${side}UpLeg`, `${side}HipJoint`, 0.077 * s, -0.1, 0.047],
      [`${side}Leg`, `${side}UpLeg`, 0.138 * s, -0.38, 0],
      [`${side}Foot`, `${side}Leg`, 0.145 * s, -0.397, 0],
      [`${side}ToeBase`, `${side}Foot`, 0.009 * s, -0.024, 0.131]);
    ends.push([`${side}ToeBase`, 0, 0, 0.06]);
  }
  rows.push(['LowerBack', 'Hips', 0, 0, 0], ['Spine', 'LowerBack', 0, 0.115, -0.01],
    ['Spine1', 'Spine', 0, 0.116, 0], ['Neck', 'Spine1', 0, 0, 0],
    ['Neck1', 'Neck', 0, 0.099, 0.01],
    ['Head', 'Neck1', 0, 0.099, 0]);
  ends.push(['Head', 0, 0.1, 0]);
  for (const [side, s] of [['Left', 1], ['Right', -1]] as const) {
    rows.push([`${side}Shoulder`, 'Spine1', 0, 0, 0],
      [`${side}Arm`, `${side}Shoulder`, 0.19 * s, 0.068, -0.018],
      [`${side}ForeArm`, `${side}Arm`, 0.281 * s, 0, 0],
      [`${side}Hand`, `${side}ForeArm`, 0.197 * s, 0, 0]);
    for (let finger = 0; finger < 5; ++finger) {
      rows.push([`${side}Finger${finger}`, `${side}Hand`, 0.06 * s, 0, 0.02 * (finger - 2)],
        [`${side}Finger${finger}b`, `${side}Finger${finger}`, 0.03 * s, 0, 0]);
    }
  }
  return makeSkeleton(rows, ends, ['UpLeg', 'Leg', 'Foot', 'ToeBase']);
}
