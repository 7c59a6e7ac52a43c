// Builds a body mesh around any skeleton: tubes for trunk, limbs and feet, ellipsoids for the head,
// and mittens or fingers. Vertices are in the rest pose, and each follows at most two joints, so
// that a shader can skin the whole body.
//
//      ring    ring    ring          Every part is a closed tube (loft) through rings. A ring has a
//     (  )====(  )====(  )  cap      centre, two half axes and skin weights. Sizes are fractions of
//                                    the body's height, from anthropometric tables.

import {add, findBodyParts, length, mix, normalised, subtract} from './body_parts.js';
import type {Anchor, BodyParts, SkeletonLike, Vec} from './body_parts.js';

/** The part of the body that a vertex belongs to. The shader has a colour for each. */
export const Region = {skin: 0, shirt: 1, trousers: 2, shoes: 3, hair: 4} as const;

/**
 * A mesh in the rest pose. Vertex v follows joint joints[2v] with weight 1 - blends[v], and joint
 * joints[2v + 1] with weight blends[v].
 */
export interface BodyMesh {
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  readonly joints: Float32Array;
  readonly blends: Float32Array;
  readonly regions: Float32Array;
  readonly indices: Uint16Array | Uint32Array;
  readonly heightM: number;
}

/** Joint `a` has weight 1 - blend, joint `b` weight blend. */
interface SkinWeights {
  readonly a: number;
  readonly b: number;
  readonly blend: number;
}
/** An ellipse with half axes `u` and `v`. */
interface Ring {
  readonly centre: Vec;
  readonly u: Vec;
  readonly v: Vec;
  readonly weights: SkinWeights;
  readonly region: number;
}

const rigidTo = (joint: number): SkinWeights => ({a: joint, b: joint, blend: 0});

class MeshBuilder {
  readonly positions: number[] = [];
  readonly joints: number[] = [];
  readonly blends: number[] = [];
  readonly regions: number[] = [];
  readonly indices: number[] = [];

  /** If `coarse`, builds half as many rings and no small parts. */
  constructor(readonly coarse: boolean) {}

  vertex(p: Vec, weights: SkinWeights, region: number): number {
    this.positions.push(p[0], p[1], p[2]);
    this.joints.push(weights.a, weights.b);
    this.blends.push(weights.blend);
    this.regions.push(region);
    return this.blends.length - 1;
  }

  /**
   * Adds a closed tube through the rings in order. The cross product u x v must point along the
   * tube. `squareness` 1 makes ellipses; smaller values make them more like rectangles.
   */
  loft(all: readonly Ring[], segments: number, squareness = 1): void {
    const rings = this.coarse ? reduceRings(all) : all;
    const first = this.blends.length;
    for (const ring of rings) {
      for (let s = 0; s < segments; ++s) {
        const angle = (s / segments) * 2 * Math.PI;
        const c = Math.cos(angle);
        const d = Math.sin(angle);
        const x = Math.sign(c) * Math.pow(Math.abs(c), squareness);
        const y = Math.sign(d) * Math.pow(Math.abs(d), squareness);
        this.vertex(add(add(ring.centre, ring.u, x), ring.v, y), ring.weights, ring.region);
      }
    }
    for (let r = 0; r + 1 < rings.length; ++r) {
      for (let s = 0; s < segments; ++s) {
        const i = first + r * segments + s;
        const j = first + r * segments + ((s + 1) % segments);
        this.indices.push(i, j, j + segments, i, j + segments, i + segments);
      }
    }
    const start = this.vertex(rings[0]!.centre, rings[0]!.weights, rings[0]!.region);
    const end = rings[rings.length - 1]!;
    const stop = this.vertex(end.centre, end.weights, end.region);
    const last = first + (rings.length - 1) * segments;
    for (let s = 0; s < segments; ++s) {
      const t = (s + 1) % segments;
      this.indices.push(start, first + t, first + s, stop, last + s, last + t);
    }
  }
}

/** Removes every other ring, except the ends and those beside a change of region. */
function reduceRings(rings: readonly Ring[]): Ring[] {
  let skipped = true;
  return rings.filter((ring, i) => {
    const needed = i === 0 || i === rings.length - 1 || skipped ||
      rings[i - 1]!.region !== ring.region || rings[i + 1]!.region !== ring.region;
    skipped = !needed;
    return needed;
  });
}

/** Returns two axes perpendicular to `along`. The first is as close to `side` as possible. */
function perpendicularAxes(along: Vec, side: Vec): [Vec, Vec] {
  const dot = along[0] * side[0] + along[1] * side[1] + along[2] * side[2];
  const u = normalised(add(side, along, -dot), Math.abs(along[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0]);
  const v: Vec = [
    along[1] * u[2] - along[2] * u[1], along[2] * u[0] - along[0] * u[2],
    along[0] * u[1] - along[1] * u[0],
  ];
  return [u, v];
}

function makeRing(
  centre: Vec, along: Vec, side: Vec, ru: number, rv: number, weights: SkinWeights,
  region: number): Ring {
  const [u, v] = perpendicularAxes(along, side);
  return {
    centre, u: [u[0] * ru, u[1] * ru, u[2] * ru], v: [v[0] * rv, v[1] * rv, v[2] * rv], weights,
    region,
  };
}

interface LimbSection {
  /** Position along the limb: 0 first joint, 1 second, 2 third. */
  readonly t: number;
  /** Radius as a fraction of the body's height. */
  readonly r: number;
  readonly region?: number;
}

/** Adds a limb of two bones with round ends. Both bones share the vertices near the bend. */
function addLimb(
  builder: MeshBuilder, from: Anchor, middle: Anchor, to: Anchor, stations: readonly LimbSection[],
  h: number, region: number, segments: number): void {
  const along = normalised(subtract(to.at, from.at), [0, -1, 0]);
  const side: Vec = Math.abs(along[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const rings: Ring[] = [];
  const addRoundEnd = (
    centre: Vec, r: number, weights: SkinWeights, direction: 1 | -1, endRegion: number): void => {
    for (const a of direction < 0 ? [0.25, 0.7] : [0.7, 0.25]) {
      const out = Math.sqrt(1 - a * a) * r * direction;
      rings.push(makeRing(add(centre, along, out), along, side, a * r, a * r, weights, endRegion));
    }
  };
  const first = stations[0]!;
  addRoundEnd(from.at, first.r * h, rigidTo(from.joint), -1, first.region ?? region);
  for (const {t, r, region: what} of stations) {
    const centre = t <= 1 ? mix(from.at, middle.at, t) : mix(middle.at, to.at, t - 1);
    // From t = 0.82 to 1.18, weights change from the first bone to the second.
    const blend = Math.min(1, Math.max(0, (t - 1) / 0.36 + 0.5));
    const weights: SkinWeights = blend <= 0 ? rigidTo(from.joint) :
      blend >= 1 ? rigidTo(middle.joint) : {a: from.joint, b: middle.joint, blend};
    rings.push(makeRing(centre, along, side, r * h, r * h, weights, what ?? region));
  }
  const last = stations[stations.length - 1]!;
  addRoundEnd(to.at, last.r * h, rigidTo(middle.joint), 1, last.region ?? region);
  builder.loft(rings, segments);
}

function addEllipsoid(
  builder: MeshBuilder, centre: Vec, up: Vec, side: Vec, radii: Vec, weights: SkinWeights,
  segments: number, slices: number, region: (latitude: number) => number): void {
  const rings: Ring[] = [];
  for (let i = 0; i <= slices; ++i) {
    const angle = ((i + 0.35) / (slices + 0.7) - 0.5) * Math.PI;
    const c = Math.cos(angle);
    rings.push(makeRing(add(centre, up, Math.sin(angle) * radii[1]), up, side, c * radii[0],
      c * radii[2], weights, region(angle)));
  }
  builder.loft(rings, segments);
}

/**
 * Skin weights of the trunk at height `y`. At the height of a joint, this joint and the one below
 * it have half of the weight each. Halfway between two joints, the lower one has the whole weight.
 */
function trunkWeights(trunk: readonly Anchor[], y: number): SkinWeights {
  let i = 0;
  while (i + 1 < trunk.length && trunk[i + 1]!.at[1] <= y) ++i;
  const here = trunk[i]!;
  const next = trunk[i + 1];
  if (!next) return rigidTo(here.joint);
  const t = (y - here.at[1]) / Math.max(next.at[1] - here.at[1], 1e-6);
  if (t > 0.5) return {a: here.joint, b: next.joint, blend: Math.min(t, 1) - 0.5};
  const before = trunk[i - 1];
  if (!before || t < 0) return rigidTo(here.joint);
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

function buildTrunk(builder: MeshBuilder, parts: BodyParts, segments: number): void {
  const h = parts.heightM;
  const trunk = parts.trunk;
  const root = trunk[0]!.at;
  const hipY = parts.legs.length > 0 ?
    parts.legs.reduce((sum, leg) => sum + leg.hip.at[1], 0) / parts.legs.length : root[1];
  const hipHalf = parts.legs.reduce((most, leg) => Math.max(most, Math.abs(leg.hip.at[0])), 0);
  const headY = parts.head.at[1];
  const shoulderY = parts.arms.length > 0 ?
    parts.arms.reduce((sum, arm) => sum + arm.shoulder.at[1], 0) / parts.arms.length :
    hipY + (headY - hipY) * 0.82;
  const shoulderHalf = parts.arms.reduce(
    (most, arm) => Math.max(most, Math.abs(arm.shoulder.at[0] - root[0])), 0) || 0.1 * h;
  const hips = Math.min(0.1 * h, Math.max(0.078 * h, hipHalf + 0.036 * h));
  const chest = Math.min(0.105 * h, Math.max(0.07 * h, shoulderHalf * 0.86));
  const span = Math.max(shoulderY - hipY, 0.05 * h);
  const y = (s: number): number => hipY + s * span;
  const table: [number, number, number, number, number][] = [
    // Columns: height, half width and half depth in metres, forward offset as a fraction of the
    // body's height, region.
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
    const weights = trunkWeights(trunk, height);
    rings.push(makeRing(centre, [0, 1, 0], side, depth, width, weights, region));
  }
  const neckTop = headY + 0.012 * h;
  if (neckTop > below) {
    const centre = add(trunkCentre(trunk, neckTop), [0, 0, 0.004 * h]);
    rings.push(makeRing(centre, [0, 1, 0], side, 0.031 * h, 0.029 * h, rigidTo(parts.head.joint),
      Region.skin));
  }
  builder.loft(rings, segments + 2, 0.86);
}

function buildHead(builder: MeshBuilder, parts: BodyParts, segments: number): void {
  const h = parts.heightM;
  const half = 0.068 * h;
  const weights = rigidTo(parts.head.joint);
  const centre: Vec = [
    parts.head.at[0], parts.crownY - half * 0.98, parts.head.at[2] + 0.014 * h];
  addEllipsoid(builder, centre, [0, 1, 0], [0, 0, 1], [half * 0.82, half, half * 0.68], weights,
    segments + 2, 6, () => Region.skin);
  // The hair is a second ellipsoid, higher and further back.
  addEllipsoid(builder, add(centre, [0, 0.024 * h, -0.011 * h]), [0, 1, 0.12], [0, 0, 1],
    [half * 0.8, half * 0.76, half * 0.74], weights, segments + 2, 5, () => Region.hair);
  if (builder.coarse) return;
  // The nose shows where the head faces.
  addEllipsoid(builder, add(centre, [0, -0.006 * h, half * 0.8]), [0, 1, 0], [0, 0, 1],
    [0.009 * h, 0.013 * h, 0.007 * h], weights, 6, 3, () => Region.skin);
}

function buildArm(builder: MeshBuilder, parts: BodyParts, index: number, segments: number): void {
  const h = parts.heightM;
  const arm = parts.arms[index]!;
  addLimb(builder, arm.shoulder, arm.elbow, arm.wrist, [
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
  const weights = rigidTo(arm.wrist.joint);
  const palm = (t: number, wide: number, thick: number): Ring =>
    makeRing(add(arm.wrist.at, along, reach * t), along, [0, 0, 1], wide * h, thick * h, weights,
      Region.skin);
  const fingers = !builder.coarse && countTips(parts, arm.wrist.joint) >= 4;
  if (fingers) {
    builder.loft([palm(-0.06, 0.012, 0.01), palm(0.12, 0.021, 0.014), palm(0.42, 0.026, 0.013),
      palm(0.55, 0.018, 0.008)], segments);
    const finger = (j: number): void => {
      for (const child of parts.children[j]!) {
        const from = restPosition(parts, j);
        const to = restPosition(parts, child);
        if (j !== arm.wrist.joint) addRod(builder, from, to, j, 0.0062 * h, Region.skin);
        if (parts.children[child]!.length === 0) {
          const on = normalised(subtract(to, from), along);
          addRod(builder, to, add(to, on, 0.014 * h), child, 0.0056 * h, Region.skin);
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
  addRod(builder, root, tip, arm.wrist.joint, 0.0085 * h, Region.skin);
}

function buildLeg(builder: MeshBuilder, parts: BodyParts, index: number, segments: number): void {
  const h = parts.heightM;
  const leg = parts.legs[index]!;
  addLimb(builder, leg.hip, leg.knee, leg.ankle, [
    {t: 0, r: 0.05}, {t: 0.25, r: 0.049}, {t: 0.55, r: 0.042}, {t: 0.85, r: 0.0355},
    {t: 1, r: 0.034}, {t: 1.12, r: 0.0335}, {t: 1.32, r: 0.035}, {t: 1.55, r: 0.031},
    {t: 1.85, r: 0.0245}, {t: 1.97, r: 0.0245},
  ], h, Region.trousers, segments);

  // The shoe is a tube from heel to toe. Its sole is perpendicular to the shin, as in standing,
  // because the legs may be spread in the rest pose. The sole is below the lower of ball and toes.
  const down = normalised(subtract(leg.ankle.at, leg.knee.at), [0, -1, 0]);
  const dot = (a: Vec, b: Vec): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const ankle = leg.ankle.at;
  const toBall = subtract(leg.ball.at, ankle);
  const toToe = subtract(leg.toe, ankle);
  const forward = normalised(add(toToe, down, -dot(toToe, down)), [0, 0, 1]);
  const lowest = Math.max(dot(toBall, down), dot(toToe, down), 0.018 * h);
  const sole = Math.min(0.06 * h, lowest + 0.01 * h);
  const ballAlong = Math.max(0.03 * h, dot(toBall, forward));
  const toeAlong =
    Math.max(ballAlong + 0.032 * h, Math.min(dot(toToe, forward), ballAlong + 0.05 * h));
  const foot = rigidTo(leg.ankle.joint);
  const toes = rigidTo(leg.ball.joint);
  const bend: SkinWeights = {a: leg.ankle.joint, b: leg.ball.joint, blend: 0.5};
  const up: Vec = [-down[0], -down[1], -down[2]];
  const slice = (
    along: number, half: number, high: number, weights: SkinWeights, lift = 0): Ring => {
    const centre = add(add(ankle, forward, along), down, sole - (high / 2 + lift) * h);
    return makeRing(centre, forward, up, (high / 2) * h, half * h, weights, Region.shoes);
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

/** Adds a round rod, for parts that need no special shape. */
function addRod(
  builder: MeshBuilder, from: Vec, to: Vec, joint: number, r: number, region: number): void {
  const along = normalised(subtract(to, from), [0, 1, 0]);
  const side: Vec = Math.abs(along[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
  const weights = rigidTo(joint);
  builder.loft([
    makeRing(add(from, along, -r * 0.8), along, side, r * 0.5, r * 0.5, weights, region),
    makeRing(from, along, side, r, r, weights, region),
    makeRing(to, along, side, r * 0.9, r * 0.9, weights, region),
    makeRing(add(to, along, r * 0.7), along, side, r * 0.45, r * 0.45, weights, region),
  ], 6);
}

function restPosition(parts: BodyParts, j: number): Vec {
  return [parts.rest[j * 3]!, parts.rest[j * 3 + 1]!, parts.rest[j * 3 + 2]!];
}

function countTips(parts: BodyParts, j: number): number {
  const below = parts.children[j]!;
  if (below.length === 0) return 1;
  return below.reduce((sum, child) => sum + countTips(parts, child), 0);
}

/**
 * Builds a body for `skeleton`. `segments`, at least 4, is the number of segments of a tube's
 * cross-section. `coarse` omits details that are not visible from a distance.
 */
export function buildBodyMesh(skeleton: SkeletonLike, segments = 9, coarse = false): BodyMesh {
  const parts = findBodyParts(skeleton);
  const builder = new MeshBuilder(coarse);
  const h = parts.heightM;
  if (parts.trunk.length > 1) {
    buildTrunk(builder, parts, segments);
    buildHead(builder, parts, segments);
  }
  for (let i = 0; i < parts.arms.length; ++i) buildArm(builder, parts, i, segments);
  for (let i = 0; i < parts.legs.length; ++i) buildLeg(builder, parts, i, segments);
  for (const j of parts.otherJoints) {
    const parent = skeleton.parents[j]!;
    const from = restPosition(parts, parent);
    const to = restPosition(parts, j);
    const l = length(subtract(to, from));
    if (l < 0.03 * h || insideTrunk(parts, to)) continue;
    addRod(builder, from, to, parent, Math.min(0.02 * h, 0.18 * l), Region.shirt);
  }
  if (builder.blends.length === 0) {
    // The skeleton has one joint, or all joints are at one point: add something visible.
    addEllipsoid(builder, [0, 0, 0], [0, 1, 0], [0, 0, 1], [0.1, 0.1, 0.1], rigidTo(0), 8, 5,
      () => Region.shirt);
  }
  const positions = new Float32Array(builder.positions);
  const indices = builder.blends.length > 65535 ?
    new Uint32Array(builder.indices) : new Uint16Array(builder.indices);
  return {
    positions, normals: smoothNormals(positions, indices),
    joints: new Float32Array(builder.joints), blends: new Float32Array(builder.blends),
    regions: new Float32Array(builder.regions), indices, heightM: h,
  };
}

function insideTrunk(parts: BodyParts, p: Vec): boolean {
  const first = parts.trunk[0]!.at;
  return Math.hypot(p[0] - first[0], p[2] - first[2]) < 0.11 * parts.heightM &&
    p[1] > first[1] - 0.05 * parts.heightM && p[1] < parts.head.at[1];
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
