// A crowd drawn by lines, for machines whose processor draws: the points of all avatars are worked
// out here and lie in one buffer, so that the shader only projects them.

import * as THREE from 'three';

import {CrowdPoints} from './cpu_crowd_geometry.js';
import {lineFigure} from './stick_figure.js';
import type {LineFigure} from './stick_figure.js';
import type {SkeletonLike} from './body_parts.js';
import {matrixFloats} from './kinematics.js';

export interface LineLights {
  readonly fogColour: THREE.Color;
  readonly accent: THREE.Color;
}

export class LineCrowd {
  readonly object: THREE.LineSegments;
  private readonly figure: LineFigure;
  private readonly jointCount: number;
  private readonly points: CrowdPoints;

  constructor(skeleton: SkeletonLike, private readonly lights: LineLights, capacity: number,
    simple: boolean) {
    this.figure = lineFigure(skeleton, simple);
    this.jointCount = skeleton.jointCount;
    const {pointCount, lines} = this.figure;
    this.points = new CrowdPoints(capacity, pointCount, lines, true, lights.fogColour);
    this.object = this.points.drawnBy(
      new THREE.LineSegments(this.points.geometry, this.points.material));
  }

  get pointCount(): number {
    return this.figure.pointCount;
  }

  /** Points of the first `count` avatars, from what `solve` gave. */
  update(matrices: Float32Array, positions: Float32Array, count: number): void {
    const {figure: {joints, extraJoints, extraRest}, jointCount} = this;
    const out = this.points.positions;
    let to = 0;
    for (let i = 0; i < count; ++i) {
      for (let k = 0; k < joints.length; ++k) {
        const from = (i * jointCount + joints[k]!) * 3;
        out[to++] = positions[from]!;
        out[to++] = positions[from + 1]!;
        out[to++] = positions[from + 2]!;
      }
      const first = i * jointCount * matrixFloats;
      for (let e = 0; e < extraJoints.length; ++e) {
        const m = first + extraJoints[e]! * matrixFloats;
        const x = extraRest[e * 3]!;
        const y = extraRest[e * 3 + 1]!;
        const z = extraRest[e * 3 + 2]!;
        out[to++] = matrices[m]! * x + matrices[m + 1]! * y + matrices[m + 2]! * z + matrices[m + 3]!;
        out[to++] = matrices[m + 4]! * x + matrices[m + 5]! * y + matrices[m + 6]! * z + matrices[m + 7]!;
        out[to++] = matrices[m + 8]! * x + matrices[m + 9]! * y + matrices[m + 10]! * z + matrices[m + 11]!;
      }
    }
    this.points.moved(count);
  }

  /** Colours of one avatar: `shirt`, or the accent when it is chosen. */
  dress(i: number, shirt: THREE.Color, chosen: boolean): void {
    const {figure: {regions, pointCount}} = this;
    const out = this.points.tints;
    for (let p = 0; p < pointCount; ++p) {
      const c = chosen ? this.lights.accent : regionColour(regions[p]!, shirt);
      const at = (i * pointCount + p) * 4;
      out[at] = 255 * Math.min(1, c.r * 1.1 + 0.08);
      out[at + 1] = 255 * Math.min(1, c.g * 1.1 + 0.08);
      out[at + 2] = 255 * Math.min(1, c.b * 1.1 + 0.08);
    }
    this.points.tinted();
  }

  dispose(): void {
    this.points.dispose();
  }
}

const skin = new THREE.Color(0.8, 0.58, 0.46);
const trousers = new THREE.Color(0.36, 0.42, 0.52);
const shoes = new THREE.Color(0.3, 0.3, 0.33);

function regionColour(region: number, shirt: THREE.Color): THREE.Color {
  return region === 0 ? skin : region === 2 ? trousers : region === 3 ? shoes : shirt;
}
