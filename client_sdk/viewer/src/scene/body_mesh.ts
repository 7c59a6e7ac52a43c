// A body around any skeleton: lofts along trunk, limbs and feet, an egg for the head, mittens or
// fingers. Vertices lie in the rest pose and follow at most two joints each, so that a body is one
// mesh that a shader moves by the joints' matrices.
//
//      ring    ring    ring          Every part is a closed tube of rings: a centre, two half
//     (  )====(  )====(  )  cap      axes, and who moves it. Sizes are shares of the figure's
//                                    height, as anthropometric tables give them.

import {add, figureOf, length, mix, normalised, subtract} from './body_parts.js';
import type {Anchor, Figure, SkeletonLike, Vec} from './body_parts.js';

/** What a vertex shows; the shader colours it. */
export const Region = {skin: 0, shirt: 1, trousers: 2, shoes: 3, hair: 4} as const;

/** A mesh in the rest pose. Vertex v follows joints[2v] by 1 - blends[v], joints[2v + 1] by blends[v]. */
export interface Body {
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  readonly joints: Float32Array;
  readonly blends: Float32Array;
  readonly regions: Float32Array;
  readonly indices: Uint16Array | Uint32Array;
  readonly heightM: number;
  readonly groundY: number;
}

interface Hold {
  readonly a: number;
  readonly b: number;
  readonly blend: number;
}
interface Ring {
  readonly centre: Vec;
  readonly u: Vec;
  readonly v: Vec;
  readonly hold: Hold;
  readonly region: number;
}

const rigid = (joint: number): Hold => ({a: joint, b: joint, blend: 0});

class Builder {
  readonly positions: number[] = [];
  readonly joints: number[] = [];
  readonly blends: number[] = [];
  readonly regions: number[] = [];
  readonly indices: number[] = [];

  /** `coarse`: half the rings, no small parts. */
  constructor(readonly coarse: boolean) {}

  vertex(p: Vec, hold: Hold, region: number): number {
    this.positions.push(p[0], p[1], p[2]);
    this.joints.push(hold.a, hold.b);
    this.blends.push(hold.blend);
    this.regions.push(region);
    return this.blends.length - 1;
  }

  /** A closed tube through the rings, in their order; u x v points along the way. */
  loft(all: readonly Ring[], segments: number, squareness = 1): void {
    const rings = this.coarse ? fewer(all) : all;
    const first = this.blends.length;
    for (const ring of rings) {
      for (let s = 0; s < segments; ++s) {
        const angle = (s / segments) * 2 * Math.PI;
        const c = Math.cos(angle);
        const d = Math.sin(angle);
        const x = Math.sign(c) * Math.pow(Math.abs(c), squareness);
        const y = Math.sign(d) * Math.pow(Math.abs(d), squareness);
        this.vertex(add(add(ring.centre, ring.u, x), ring.v, y), ring.hold, ring.region);
      }
    }
    for (let r = 0; r + 1 < rings.length; ++r) {
      for (let s = 0; s < segments; ++s) {
        const i = first + r * segments + s;
        const j = first + r * segments + ((s + 1) % segments);
        this.indices.push(i, j, j + segments, i, j + segments, i + segments);
      }
    }
    const start = this.vertex(rings[0]!.centre, rings[0]!.hold, rings[0]!.region);
    const end = rings[rings.length - 1]!;
    const stop = this.vertex(end.centre, end.hold, end.region);
    const last = first + (rings.length - 1) * segments;
    for (let s = 0; s < segments; ++s) {
      const t = (s + 1) % segments;
      this.indices.push(start, first + t, first + s, stop, last + s, last + t);
    }
  }
}

/** Every other ring, but the ends, where one region meets another, and the last of one. */
function fewer(rings: readonly Ring[]): Ring[] {
  let skipped = true;
  return rings.filter((ring, i) => {
    const needed = i === 0 || i === rings.length - 1 || skipped ||
      rings[i - 1]!.region !== ring.region || rings[i + 1]!.region !== ring.region;
    skipped = !needed;
    return needed;
  });
}

/** Two axes across `along`; the first as near to `side` as can be. */
function across(along: Vec, side: Vec): [Vec, Vec] {
  const dot = along[0] * side[0] + along[1] * side[1] + along[2] * side[2];
  const u = normalised(add(side, along, -dot), Math.abs(along[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0]);
  const v: Vec = [
    along[1] * u[2] - along[2] * u[1], along[2] * u[0] - along[0] * u[2],
    along[0] * u[1] - along[1] * u[0],
  ];
  return [u, v];
}

function ring(
  centre: Vec, along: Vec, side: Vec, ru: number, rv: number, hold: Hold, region: number): Ring {
  const [u, v] = across(along, side);
  return {
    centre, u: [u[0] * ru, u[1] * ru, u[2] * ru], v: [v[0] * rv, v[1] * rv, v[2] * rv], hold,
    region,
  };
}

interface Station {
  readonly t: number;  // 0 first joint, 1 second, 2 third
  readonly r: number;  // share of the figure's height
  readonly region?: number;
}

/** A limb of two bones: round ends, and a bend shared by both in the middle. */
function limb(
  builder: Builder, from: Anchor, middle: Anchor, to: Anchor, stations: readonly Station[],
  h: number, region: number, segments: number): void {
  const along = normalised(subtract(to.at, from.at), [0, -1, 0]);
  const side: Vec = Math.abs(along[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const rings: Ring[] = [];
  const round = (centre: Vec, r: number, hold: Hold, where: number, what: number): void => {
    for (const a of where < 0 ? [0.25, 0.7] : [0.7, 0.25]) {
      const out = Math.sqrt(1 - a * a) * r * where;
      rings.push(ring(add(centre, along, out), along, side, a * r, a * r, hold, what));
    }
  };
  const first = stations[0]!;
  round(from.at, first.r * h, rigid(from.joint), -1, first.region ?? region);
  for (const {t, r, region: what} of stations) {
    const centre = t <= 1 ? mix(from.at, middle.at, t) : mix(middle.at, to.at, t - 1);
    // Across the bend, from 0.18 before it to 0.18 after it, the second bone takes over.
    const blend = Math.min(1, Math.max(0, (t - 1) / 0.36 + 0.5));
    const hold: Hold = blend <= 0 ? rigid(from.joint) : blend >= 1 ? rigid(middle.joint) :
      {a: from.joint, b: middle.joint, blend};
    rings.push(ring(centre, along, side, r * h, r * h, hold, what ?? region));
  }
  const last = stations[stations.length - 1]!;
  round(to.at, last.r * h, rigid(middle.joint), 1, last.region ?? region);
  builder.loft(rings, segments);
}

function egg(
  builder: Builder, centre: Vec, up: Vec, side: Vec, radii: Vec, hold: Hold, segments: number,
  slices: number, region: (latitude: number) => number): void {
  const rings: Ring[] = [];
  for (let i = 0; i <= slices; ++i) {
    const angle = ((i + 0.35) / (slices + 0.7) - 0.5) * Math.PI;
    const c = Math.cos(angle);
    rings.push(ring(add(centre, up, Math.sin(angle) * radii[1]), up, side, c * radii[0],
      c * radii[2], hold, region(angle)));
  }
  builder.loft(rings, segments);
}

/** Who moves a height of the trunk: halfway between two joints it is one's alone. */
function trunkHold(trunk: readonly Anchor[], y: number): Hold {
  let i = 0;
  while (i + 1 < trunk.length && trunk[i + 1]!.at[1] <= y) ++i;
  const here = trunk[i]!;
  const next = trunk[i + 1];
  if (!next) return rigid(here.joint);
  const t = (y - here.at[1]) / Math.max(next.at[1] - here.at[1], 1e-6);
  if (t > 0.5) return {a: here.joint, b: next.joint, blend: Math.min(t, 1) - 0.5};
  const before = trunk[i - 1];
  if (!before || t < 0) return rigid(here.joint);
  return {a: before.joint, b: here.joint, blend: 0.5 + t};
}

function trunkCentre(trunk: readonly Anchor[], y: number): Vec {
  let i = 0;
  while (i + 2 < trunk.length && trunk[i + 1]!.at[1] <= y) ++i;
  const a = trunk[i]!.at;
  const b = (trunk[i + 1] ?? trunk[i]!).at;
  const t = b[1] > a[1] ? Math.min(1, Math.max(0, (y - a[1]) / (b[1] - a[1]))) : 0;
  return [a[0] + (b[0] - a[0]) * t, y, a[2] + (b[2] - a[2]) * t];
}

function buildTrunk(builder: Builder, figure: Figure, segments: number): void {
  const h = figure.heightM;
  const trunk = figure.trunk;
  const root = trunk[0]!.at;
  const hipY = figure.legs.length > 0 ?
    figure.legs.reduce((sum, leg) => sum + leg.hip.at[1], 0) / figure.legs.length : root[1];
  const hipHalf = figure.legs.reduce((most, leg) => Math.max(most, Math.abs(leg.hip.at[0])), 0);
  const headY = figure.head.at[1];
  const shoulderY = figure.arms.length > 0 ?
    figure.arms.reduce((sum, arm) => sum + arm.shoulder.at[1], 0) / figure.arms.length :
    hipY + (headY - hipY) * 0.82;
  const shoulderHalf = figure.arms.reduce(
    (most, arm) => Math.max(most, Math.abs(arm.shoulder.at[0] - root[0])), 0) || 0.1 * h;
  const hips = Math.min(0.1 * h, Math.max(0.078 * h, hipHalf + 0.036 * h));
  const chest = Math.min(0.105 * h, Math.max(0.07 * h, shoulderHalf * 0.86));
  const span = Math.max(shoulderY - hipY, 0.05 * h);
  const y = (s: number): number => hipY + s * span;
  const table: [number, number, number, number, number][] = [
    // height, half width, half depth, forward, region
    [y(0) - 0.052 * h, 0.03 * h, 0.03 * h, -0.004, Region.trousers],
    [y(0) - 0.036 * h, hips * 0.82, 0.055 * h, -0.006, Region.trousers],
    [y(0.0), hips, 0.066 * h, -0.006, Region.trousers],
    [y(0.17), hips * 0.97, 0.064 * h, -0.002, Region.trousers],
    [y(0.19), hips * 0.97, 0.066 * h, -0.002, Region.shirt],
    [y(0.38), Math.min(hips, chest) * 0.86, 0.056 * h, 0.002, Region.shirt],
    [y(0.62), chest * 0.93, 0.064 * h, 0.004, Region.shirt],
    [y(0.84), chest * 1.04, 0.068 * h, 0.004, Region.shirt],
    [y(1.0), Math.max(chest, shoulderHalf * 0.97), 0.055 * h, -0.002, Region.shirt],
    [y(1.0) + 0.026 * h, shoulderHalf * 0.72, 0.043 * h, -0.004, Region.shirt],
    [y(1.0) + 0.045 * h, 0.04 * h, 0.036 * h, -0.002, Region.shirt],
    [y(1.0) + 0.047 * h, 0.033 * h, 0.034 * h, 0, Region.skin],
  ];
  const side: Vec = [0, 0, 1];
  const rings: Ring[] = [];
  let below = -Infinity;
  for (const [height, width, depth, forward, region] of table) {
    if (height <= below) continue;
    below = height;
    const centre = add(trunkCentre(trunk, height), [0, 0, forward * h]);
    rings.push(ring(centre, [0, 1, 0], side, depth, width, trunkHold(trunk, height), region));
  }
  const neckTop = headY + 0.012 * h;
  if (neckTop > below) {
    const centre = add(trunkCentre(trunk, neckTop), [0, 0, 0.004 * h]);
    rings.push(ring(centre, [0, 1, 0], side, 0.031 * h, 0.029 * h, rigid(figure.head.joint),
      Region.skin));
  }
  builder.loft(rings, segments + 2, 0.86);
}

function buildHead(builder: Builder, figure: Figure, segments: number): void {
  const h = figure.heightM;
  const half = 0.068 * h;
  const hold = rigid(figure.head.joint);
  const centre: Vec = [
    figure.head.at[0], figure.crownY - half * 0.98, figure.head.at[2] + 0.014 * h];
  egg(builder, centre, [0, 1, 0], [0, 0, 1], [half * 0.82, half, half * 0.68], hold, segments + 2,
    6, () => Region.skin);
  // Hair: a larger half egg, higher and further back.
  egg(builder, add(centre, [0, 0.024 * h, -0.011 * h]), [0, 1, 0.12], [0, 0, 1],
    [half * 0.8, half * 0.76, half * 0.74], hold, segments + 2, 5, () => Region.hair);
  if (builder.coarse) return;
  // A nose, so that one sees where it looks.
  egg(builder, add(centre, [0, -0.006 * h, half * 0.8]), [0, 1, 0], [0, 0, 1],
    [0.009 * h, 0.013 * h, 0.007 * h], hold, 6, 3, () => Region.skin);
}

function buildArm(builder: Builder, figure: Figure, index: number, segments: number): void {
  const h = figure.heightM;
  const arm = figure.arms[index]!;
  limb(builder, arm.shoulder, arm.elbow, arm.wrist, [
    {t: 0, r: 0.034}, {t: 0.3, r: 0.0305}, {t: 0.62, r: 0.0275},
    {t: 0.64, r: 0.026, region: Region.skin}, {t: 0.86, r: 0.0235, region: Region.skin},
    {t: 1, r: 0.023, region: Region.skin}, {t: 1.14, r: 0.024, region: Region.skin},
    {t: 1.35, r: 0.024, region: Region.skin}, {t: 1.7, r: 0.0185, region: Region.skin},
    {t: 2, r: 0.0155, region: Region.skin},
  ], h, Region.shirt, segments);
  const fore = normalised(subtract(arm.wrist.at, arm.elbow.at), [arm.side, 0, 0]);
  let out = subtract(arm.tip, arm.wrist.at);
  let reach = length(out);
  if (reach < 0.03 * h) {
    out = fore;
    reach = 0.1 * h;
  }
  reach = Math.min(Math.max(reach, 0.085 * h), 0.115 * h);
  const along = normalised(out, fore);
  const hold = rigid(arm.wrist.joint);
  const palm = (t: number, wide: number, thick: number): Ring =>
    ring(add(arm.wrist.at, along, reach * t), along, [0, 0, 1], wide * h, thick * h, hold,
      Region.skin);
  const fingers = !builder.coarse && countTips(figure, arm.wrist.joint) >= 4;
  if (fingers) {
    builder.loft([palm(-0.06, 0.012, 0.01), palm(0.12, 0.021, 0.014), palm(0.42, 0.026, 0.013),
      palm(0.55, 0.018, 0.008)], segments);
    const finger = (j: number): void => {
      for (const child of figure.children[j]!) {
        const from = restAt(figure, j);
        const to = restAt(figure, child);
        if (j !== arm.wrist.joint) bone(builder, from, to, j, 0.0062 * h, Region.skin);
        if (figure.children[child]!.length === 0) {
          const on = normalised(subtract(to, from), along);
          bone(builder, to, add(to, on, 0.014 * h), child, 0.0056 * h, Region.skin);
        }
        finger(child);
      }
    };
    finger(arm.wrist.joint);
    return;
  }
  builder.loft([palm(-0.06, 0.012, 0.01), palm(0.1, 0.02, 0.014), palm(0.38, 0.026, 0.014),
    palm(0.66, 0.023, 0.0115), palm(0.9, 0.017, 0.009), palm(1, 0.008, 0.005)], segments);
  if (builder.coarse) return;
  const root = add(add(arm.wrist.at, along, reach * 0.18), [0, 0, 0.018 * h]);
  const tip = add(add(arm.wrist.at, along, reach * 0.5), [0, 0, 0.04 * h]);
  bone(builder, root, tip, arm.wrist.joint, 0.0085 * h, Region.skin);
}

function buildLeg(builder: Builder, figure: Figure, index: number, segments: number): void {
  const h = figure.heightM;
  const leg = figure.legs[index]!;
  limb(builder, leg.hip, leg.knee, leg.ankle, [
    {t: 0, r: 0.05}, {t: 0.25, r: 0.049}, {t: 0.55, r: 0.042}, {t: 0.85, r: 0.0355},
    {t: 1, r: 0.034}, {t: 1.12, r: 0.0335}, {t: 1.32, r: 0.035}, {t: 1.55, r: 0.031},
    {t: 1.85, r: 0.0245}, {t: 1.97, r: 0.0245},
  ], h, Region.trousers, segments);

  // The shoe: a loft from heel to toe. Its sole lies across the shin, as it does when one stands
  // (a rest pose may straddle the legs), below the lowest of ball and toes.
  const down = normalised(subtract(leg.ankle.at, leg.knee.at), [0, -1, 0]);
  const dot = (a: Vec, b: Vec): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const ankle = leg.ankle.at;
  const toBall = subtract(leg.ball.at, ankle);
  const toToe = subtract(leg.toe, ankle);
  const way = normalised(add(toToe, down, -dot(toToe, down)), [0, 0, 1]);
  const sole = Math.min(0.06 * h, Math.max(dot(toBall, down), dot(toToe, down), 0.018 * h) + 0.01 * h);
  const ballAlong = Math.max(0.03 * h, dot(toBall, way));
  const toeAlong = Math.max(ballAlong + 0.032 * h, Math.min(dot(toToe, way), ballAlong + 0.05 * h));
  const foot = rigid(leg.ankle.joint);
  const toes = rigid(leg.ball.joint);
  const bend: Hold = {a: leg.ankle.joint, b: leg.ball.joint, blend: 0.5};
  const up: Vec = [-down[0], -down[1], -down[2]];
  const slice = (along: number, half: number, high: number, hold: Hold, lift = 0): Ring => {
    const centre = add(add(ankle, way, along), down, sole - (high / 2 + lift) * h);
    return ring(centre, way, up, (high / 2) * h, half * h, hold, Region.shoes);
  };
  const over = Math.min(0.06, Math.max(0.042, sole / h + 0.01));
  builder.loft([
    slice(-0.04 * h, 0.009, 0.024, foot, 0.006), slice(-0.034 * h, 0.018, 0.04, foot),
    slice(-0.012 * h, 0.0225, over, foot), slice(0.02 * h, 0.0235, over * 0.97, foot),
    slice(0.02 * h + (ballAlong - 0.02 * h) * 0.5, 0.0255, 0.042, foot),
    slice(ballAlong, 0.0285, 0.033, bend), slice((ballAlong + toeAlong) / 2, 0.027, 0.027, toes),
    slice(toeAlong, 0.02, 0.02, toes), slice(toeAlong + 0.009 * h, 0.008, 0.011, toes, 0.003),
  ], segments, 0.75);
}

/** A round rod, for whatever has no better shape. */
function bone(builder: Builder, from: Vec, to: Vec, joint: number, r: number, region: number): void {
  const along = normalised(subtract(to, from), [0, 1, 0]);
  const side: Vec = Math.abs(along[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const hold = rigid(joint);
  builder.loft([
    ring(add(from, along, -r * 0.8), along, side, r * 0.5, r * 0.5, hold, region),
    ring(from, along, side, r, r, hold, region), ring(to, along, side, r * 0.9, r * 0.9, hold, region),
    ring(add(to, along, r * 0.7), along, side, r * 0.45, r * 0.45, hold, region),
  ], 6);
}

function restAt(figure: Figure, j: number): Vec {
  return [figure.rest[j * 3]!, figure.rest[j * 3 + 1]!, figure.rest[j * 3 + 2]!];
}

function countTips(figure: Figure, j: number): number {
  const below = figure.children[j]!;
  if (below.length === 0) return 1;
  return below.reduce((sum, child) => sum + countTips(figure, child), 0);
}

/** A body for `skeleton`; `segments` is the fineness of its tubes, from 4 on; `coarse` leaves out what
 * is not seen from afar. */
export function buildBody(skeleton: SkeletonLike, segments = 9, coarse = false): Body {
  const figure = figureOf(skeleton);
  const builder = new Builder(coarse);
  const h = figure.heightM;
  if (figure.trunk.length > 1) {
    buildTrunk(builder, figure, segments);
    buildHead(builder, figure, segments);
  }
  for (let i = 0; i < figure.arms.length; ++i) buildArm(builder, figure, i, segments);
  for (let i = 0; i < figure.legs.length; ++i) buildLeg(builder, figure, i, segments);
  for (const j of figure.others) {
    const parent = skeleton.parents[j]!;
    const from = restAt(figure, parent);
    const to = restAt(figure, j);
    const l = length(subtract(to, from));
    if (l < 0.03 * h || insideTrunk(figure, to)) continue;
    bone(builder, from, to, parent, Math.min(0.02 * h, 0.18 * l), Region.shirt);
  }
  if (builder.blends.length === 0) {
    // One joint, or all in one place: still something to see.
    egg(builder, [0, 0, 0], [0, 1, 0], [0, 0, 1], [0.1, 0.1, 0.1], rigid(0), 8, 5,
      () => Region.shirt);
  }
  const positions = new Float32Array(builder.positions);
  const indices = builder.blends.length > 65535 ?
    new Uint32Array(builder.indices) : new Uint16Array(builder.indices);
  return {
    positions, normals: smoothNormals(positions, indices),
    joints: new Float32Array(builder.joints), blends: new Float32Array(builder.blends),
    regions: new Float32Array(builder.regions), indices, heightM: h, groundY: figure.groundY,
  };
}

function insideTrunk(figure: Figure, p: Vec): boolean {
  const first = figure.trunk[0]!.at;
  return Math.hypot(p[0] - first[0], p[2] - first[2]) < 0.11 * figure.heightM &&
    p[1] > first[1] - 0.05 * figure.heightM && p[1] < figure.head.at[1];
}

function smoothNormals(positions: Float32Array, indices: ArrayLike<number>): Float32Array {
  const normals = new Float32Array(positions.length);
  for (let i = 0; i < indices.length; i += 3) {
    const [a, b, c] = [indices[i]! * 3, indices[i + 1]! * 3, indices[i + 2]! * 3];
    const e: Vec = [
      positions[b]! - positions[a]!, positions[b + 1]! - positions[a + 1]!,
      positions[b + 2]! - positions[a + 2]!];
    const f: Vec = [
      positions[c]! - positions[a]!, positions[c + 1]! - positions[a + 1]!,
      positions[c + 2]! - positions[a + 2]!];
    const n: Vec = [
      e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    for (const v of [a, b, c]) for (let k = 0; k < 3; ++k) normals[v + k]! += n[k]!;
  }
  for (let v = 0; v < normals.length; v += 3) {
    const n = normalised([normals[v]!, normals[v + 1]!, normals[v + 2]!], [0, 1, 0]);
    normals.set(n, v);
  }
  return normals;
}
