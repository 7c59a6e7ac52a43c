// A crowd drawn as stick figures, for software renderers and slow GPUs. The CPU computes the points
// of all avatars.

import * as THREE from 'three';

import {CpuCrowdGeometry} from './cpu_crowd_geometry.js';
import {buildStickFigure} from './stick_figure.js';
import type {StickFigure} from './stick_figure.js';
import type {SkeletonLike} from './body_parts.js';
import {floatsPerMatrix} from './kinematics.js';

export interface StickFigureLights {
  readonly fogColour: THREE.Color;
  readonly accent: THREE.Color;
}

export class StickFigureCrowd {
  readonly object: THREE.LineSegments;
  private readonly figure: StickFigure;
  private readonly jointCount: number;
  private readonly geometry: CpuCrowdGeometry;

  /**
   * `capacity` is the number of avatars. If `simplified`, figures have about half as many lines.
   */
  constructor(
    skeleton: SkeletonLike, private readonly lights: StickFigureLights, capacity: number,
    simplified: boolean) {
    this.figure = buildStickFigure(skeleton, simplified);
    this.jointCount = skeleton.jointCount;
    const {pointCount, lines} = this.figure;
    this.geometry = new CpuCrowdGeometry(capacity, pointCount, lines, true, lights.fogColour);
    this.object = this.geometry.configure(
      new THREE.LineSegments(this.geometry.buffers, this.geometry.material));
  }

  /** Updates the first `count` avatars, from the results of `computeJointTransforms`. */
  update(matrices: Float32Array, positions: Float32Array, count: number): void {
    const {figure: {joints, extraJoints, extraRest}, jointCount} = this;
    const out = this.geometry.positions;
    let to = 0;
    for (let i = 0; i < count; ++i) {
      for (let k = 0; k < joints.length; ++k) {
        const from = (i * jointCount + joints[k]!) * 3;
        out[to++] = positions[from]!;
        out[to++] = positions[from + 1]!;
        out[to++] = positions[from + 2]!;
      }
      const first = i * jointCount * floatsPerMatrix;
      for (let e = 0; e < extraJoints.length; ++e) {
        const m = first + extraJoints[e]! * floatsPerMatrix;
        const x = extraRest[e * 3]!;
        const y = extraRest[e * 3 + 1]!;
        const z = extraRest[e * 3 + 2]!;
        for (let row = m; row < m + floatsPerMatrix; row += 4) {
          out[to++] = matrices[row]! * x + matrices[row + 1]! * y + matrices[row + 2]! * z +
            matrices[row + 3]!;
        }
      }
    }
    this.geometry.uploadPositions(count);
  }

  /** Sets the colours of avatar `i`. A selected avatar has the accent colour. */
  setColours(i: number, shirt: THREE.Color, selected: boolean): void {
    const {figure: {regions, pointCount}} = this;
    const out = this.geometry.tints;
    for (let p = 0; p < pointCount; ++p) {
      const c = selected ? this.lights.accent : regionColour(regions[p]!, shirt);
      const at = (i * pointCount + p) * 4;
      out[at] = 255 * Math.min(1, c.r * 1.1 + 0.08);
      out[at + 1] = 255 * Math.min(1, c.g * 1.1 + 0.08);
      out[at + 2] = 255 * Math.min(1, c.b * 1.1 + 0.08);
    }
    this.geometry.uploadTints();
  }

  dispose(): void {
    this.geometry.dispose();
  }
}

const skin = new THREE.Color(0.8, 0.58, 0.46);
const trousers = new THREE.Color(0.36, 0.42, 0.52);
const shoes = new THREE.Color(0.3, 0.3, 0.33);

function regionColour(region: number, shirt: THREE.Color): THREE.Color {
  return region === 0 ? skin : region === 2 ? trousers : region === 3 ? shoes : shirt;
}
