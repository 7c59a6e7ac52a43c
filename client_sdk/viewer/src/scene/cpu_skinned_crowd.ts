// A crowd of coarse bodies for software renderers: JavaScript skins and lights the vertices of all
// avatars. A software renderer is much slower at skinning in a shader, and processes every instance
// as a separate draw.

import * as THREE from 'three';

import {CpuCrowdGeometry} from './cpu_crowd_geometry.js';
import {floatsPerMatrix} from './kinematics.js';
import type {BodyMesh} from './body_mesh.js';

export interface BodyLights {
  readonly sun: THREE.Vector3;
  readonly skyLight: THREE.Color;
  readonly groundLight: THREE.Color;
  readonly fogColour: THREE.Color;
  readonly accent: THREE.Color;
}

const regionCount = 5;

export class CpuSkinnedCrowd {
  readonly object: THREE.Mesh;
  private readonly geometry: CpuCrowdGeometry;
  /** Colours of the body regions, 15 numbers per avatar. */
  private readonly palette: Float32Array;

  constructor(
    private readonly body: BodyMesh, private readonly jointCount: number,
    private readonly lights: BodyLights, capacity: number) {
    this.palette = new Float32Array(capacity * regionCount * 3);
    this.geometry = new CpuCrowdGeometry(
      capacity, body.blends.length, body.indices, false, lights.fogColour);
    this.object = this.geometry.configure(
      new THREE.Mesh(this.geometry.buffers, this.geometry.material));
  }

  /** Sets the colours of avatar `i`, computed as in the shader of `CrowdMesh`. */
  setColours(i: number, shirt: THREE.Color, selected: boolean): void {
    const tint = fract(shirt.r * 7.13 + shirt.g * 3.71 + shirt.b * 5.37);
    const dark = Math.min(1, Math.max(0, (tint - 0.45) / 0.55));
    const skin = dark * dark * (3 - 2 * dark);
    const legs = fract(tint * 3.3);
    const hair = fract(tint * 5.7);
    const colours = [
      [mix(0.87, 0.55, skin), mix(0.66, 0.36, skin), mix(0.53, 0.26, skin)],
      [shirt.r, shirt.g, shirt.b],
      [mix(0.16, 0.33, legs), mix(0.2, 0.31, legs), mix(0.29, 0.28, legs)],
      [0.13, 0.13, 0.15],
      [mix(0.11, 0.42, hair), mix(0.08, 0.28, hair), mix(0.06, 0.15, hair)],
    ];
    const {accent} = this.lights;
    const share = selected ? 0.4 : 0;
    colours.forEach((colour, region) => {
      const at = (i * regionCount + region) * 3;
      this.palette[at] = mix(colour[0]!, accent.r, share);
      this.palette[at + 1] = mix(colour[1]!, accent.g, share);
      this.palette[at + 2] = mix(colour[2]!, accent.b, share);
    });
  }

  /**
   * Skins the first `count` avatars with matrices from `computeJointTransforms`. Never allocates.
   */
  update(matrices: Float32Array, count: number): void {
    const {body: {positions, normals, joints, blends, regions}, jointCount, palette} = this;
    const {sun, skyLight, groundLight} = this.lights;
    const {pointCount: vertexCount, positions: out, tints: tint} = this.geometry;
    let to = 0;
    let toTint = 0;
    for (let i = 0; i < count; ++i) {
      const first = i * jointCount * floatsPerMatrix;
      for (let v = 0; v < vertexCount; ++v) {
        const x = positions[v * 3]!;
        const y = positions[v * 3 + 1]!;
        const z = positions[v * 3 + 2]!;
        const blend = blends[v]!;
        const a = first + joints[v * 2]! * floatsPerMatrix;
        const b = first + joints[v * 2 + 1]! * floatsPerMatrix;
        let px = matrices[a]! * x + matrices[a + 1]! * y + matrices[a + 2]! * z + matrices[a + 3]!;
        let py = matrices[a + 4]! * x + matrices[a + 5]! * y + matrices[a + 6]! * z +
          matrices[a + 7]!;
        let pz = matrices[a + 8]! * x + matrices[a + 9]! * y + matrices[a + 10]! * z +
          matrices[a + 11]!;
        if (blend > 0) {
          px += blend * (matrices[b]! * x + matrices[b + 1]! * y + matrices[b + 2]! * z +
            matrices[b + 3]! - px);
          py += blend * (matrices[b + 4]! * x + matrices[b + 5]! * y + matrices[b + 6]! * z +
            matrices[b + 7]! - py);
          pz += blend * (matrices[b + 8]! * x + matrices[b + 9]! * y + matrices[b + 10]! * z +
            matrices[b + 11]! - pz);
        }
        out[to++] = px;
        out[to++] = py;
        out[to++] = pz;
        // The joint with the larger weight rotates the normal.
        const m = blend > 0.5 ? b : a;
        const u = normals[v * 3]!;
        const s = normals[v * 3 + 1]!;
        const w = normals[v * 3 + 2]!;
        const nx = matrices[m]! * u + matrices[m + 1]! * s + matrices[m + 2]! * w;
        const ny = matrices[m + 4]! * u + matrices[m + 5]! * s + matrices[m + 6]! * w;
        const nz = matrices[m + 8]! * u + matrices[m + 9]! * s + matrices[m + 10]! * w;
        const key = 1.15 * Math.max(0, nx * sun.x + ny * sun.y + nz * sun.z);
        const up = ny * 0.5 + 0.5;
        const p = (i * regionCount + regions[v]!) * 3;
        tint[toTint++] = 255 * palette[p]! *
          (groundLight.r + (skyLight.r - groundLight.r) * up + key);
        tint[toTint++] = 255 * palette[p + 1]! *
          (groundLight.g + (skyLight.g - groundLight.g) * up + 0.96 * key);
        tint[toTint++] = 255 * palette[p + 2]! *
          (groundLight.b + (skyLight.b - groundLight.b) * up + 0.9 * key);
        ++toTint;
      }
    }
    this.geometry.uploadPositions(count);
    this.geometry.uploadTints(count);
  }

  dispose(): void {
    this.geometry.dispose();
  }
}

function fract(x: number): number {
  return x - Math.floor(x);
}
function mix(a: number, b: number, t: number): number {
  return a + (b - a) * t;
}
