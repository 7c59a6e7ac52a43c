// Decals on the ground, one draw call per kind: soft blobs beneath avatars, rings around planted
// feet, outlines where feet will land, and goals of walks.

import * as THREE from 'three';

import type {TerrainSurface} from '../terrain_surface.js';

// Each decal has four vertices, which the CPU computes once when the decal is set. Instancing would
// be slower with a software renderer, which processes every instance as a separate draw.
const decalVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
in vec2 corner;
in vec4 data;      // red, green, blue, opacity; other meanings for footprints and goals
out vec2 vAt;
out vec4 vData;
void main() {
  vAt = corner;
  vData = data;
  gl_Position = projectionMatrix * (viewMatrix * vec4(position, 1.0));
}`;

const blobFragment = /* glsl */ `
precision mediump float;
in vec2 vAt;
in vec4 vData;
out vec4 colour;
void main() {
  float a = max(1.0 - dot(vAt, vAt), 0.0);
  colour = vec4(vData.rgb, vData.a * a * a * a);
}`;

const ringFragment = /* glsl */ `
precision mediump float;
in vec2 vAt;
in vec4 vData;
out vec4 colour;
void main() {
  float d = length(vAt);
  float inside = clamp((0.74 - d) * 12.5, 0.0, 1.0);
  float a = clamp((1.0 - d) * 12.5, 0.0, 1.0) * (1.0 - 0.72 * inside);
  colour = vec4(vData.rgb, vData.a * a);
}`;

// Fragment shader for the outline of a footprint, where a foot will land.
const plannedFragment = /* glsl */ `
precision highp float;
in vec2 vAt;
in vec4 vData;
out vec4 colour;
float edge(vec2 p, vec2 c, vec2 r) {
  float d = length((p - c) / r);
  return smoothstep(0.66, 0.76, d) * (1.0 - smoothstep(0.9, 1.0, d)) + 0.25 * (1.0 - step(0.76, d));
}
void main() {
  float a = max(edge(vAt, vec2(0.0, 0.14), vec2(0.42, 0.62)),
                edge(vAt, vec2(0.0, -0.72), vec2(0.3, 0.27)));
  colour = vec4(vData.rgb, vData.a * a);
}`;

// Fragment shader for a decal of a walk. `data.w` selects the shape: 0 goal, 1 heading arrow, 2
// waypoint.
const goalFragment = /* glsl */ `
precision highp float;
in vec2 vAt;
in vec4 vData;
out vec4 colour;
float within(float d, float edge) { return 1.0 - smoothstep(edge - 0.07, edge, d); }
void main() {
  float a;
  if (vData.w < 0.5) {
    float d = length(vAt);
    a = max(within(d, 1.0) * (1.0 - within(d, 0.8) * 0.8), within(d, 0.27));
  } else if (vData.w < 1.5) {
    float across = abs(vAt.x);
    a = within(across - (1.0 - vAt.y) * 0.45, 0.0) *
        within(-0.8 - vAt.y + (0.9 - across) * 0.5, 0.0);
  } else {
    float d = abs(vAt.x) + abs(vAt.y);
    a = within(d, 1.0) * (1.0 - within(d, 0.66) * 0.8);
  }
  colour = vec4(vData.rgb, 0.95 * a);
}`;

const corners = [-1, -1, 1, -1, 1, 1, -1, 1] as const;

/** Flat decals of one kind. */
export class GroundDecals {
  readonly mesh: THREE.Mesh;
  count = 0;
  private readonly position: THREE.BufferAttribute;
  private readonly data: THREE.BufferAttribute;
  private readonly geometry = new THREE.BufferGeometry();
  private firstChanged = Infinity;
  private lastChanged = -1;

  /**
   * `liftM` is the height above the ground. It differs between kinds, so that decals which overlap
   * do not flicker.
   */
  constructor(
    readonly capacity: number, fragmentShader: string, private readonly liftM: number,
    uniforms: Record<string, THREE.IUniform> = {}) {
    this.position = new THREE.BufferAttribute(new Float32Array(capacity * 12), 3);
    this.data = new THREE.BufferAttribute(new Float32Array(capacity * 16), 4);
    const corner = new Int8Array(capacity * 8);
    const index =
      capacity * 4 > 65535 ? new Uint32Array(capacity * 6) : new Uint16Array(capacity * 6);
    for (let i = 0; i < capacity; ++i) {
      corner.set(corners, i * 8);
      // Counterclockwise as seen from above.
      index.set([i * 4, i * 4 + 2, i * 4 + 1, i * 4, i * 4 + 3, i * 4 + 2], i * 6);
    }
    this.position.setUsage(THREE.DynamicDrawUsage);
    this.data.setUsage(THREE.DynamicDrawUsage);
    this.geometry.setAttribute('position', this.position);
    this.geometry.setAttribute('data', this.data);
    this.geometry.setAttribute('corner', new THREE.BufferAttribute(corner, 2));
    this.geometry.setIndex(new THREE.BufferAttribute(index, 1));
    this.geometry.setDrawRange(0, 0);
    this.mesh = new THREE.Mesh(this.geometry, new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: decalVertex, fragmentShader, uniforms,
      transparent: true, depthWrite: false,
    }));
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 2;
  }

  /**
   * Places decal `i` on the ground, facing `headingRad`. On a slope, each corner has its own
   * height. (a, b, c, d) is the `data` of the shader. Call `upload` afterwards.
   */
  set(
    i: number, terrain: TerrainSurface, x: number, z: number, headingRad: number,
    halfSizeM: number, a: number, b: number, c: number, d: number): void {
    let y = terrain.heightAt(x, z);
    // A decal is horizontal if it is large or the terrain has boxes. A large decal is placed at the
    // height of the highest terrain beneath it.
    const large = halfSizeM > 0.3 && !terrain.isFlat;
    const level = large || terrain.hasBoxes;
    if (large) {
      for (const [u, v] of [[-1, -1], [1, -1], [1, 1], [-1, 1]] as const) {
        const height = terrain.heightAt(x + u * halfSizeM * 0.7, z + v * halfSizeM * 0.7);
        y = Math.max(y, Math.min(y + 0.3, height));
      }
    }
    const places = this.position.array as Float32Array;
    const data = this.data.array as Float32Array;
    // A heading of 0 faces +Z, and positive headings turn left, towards +X.
    const cos = Math.cos(headingRad) * halfSizeM;
    const sin = Math.sin(headingRad) * halfSizeM;
    let at = i * 12;
    let to = i * 16;
    for (let k = 0; k < 4; ++k) {
      const u = corners[k * 2]!;
      const v = corners[k * 2 + 1]!;
      const cx = x + u * cos + v * sin;
      const cz = z - u * sin + v * cos;
      const cy = terrain.isFlat || level ? y : terrain.heightAt(cx, cz);
      places[at++] = cx;
      places[at++] = (Math.abs(cy - y) < halfSizeM * 0.8 ? cy : y) + this.liftM;
      places[at++] = cz;
      data[to++] = a;
      data[to++] = b;
      data[to++] = c;
      data[to++] = d;
    }
    // Raises the decal if the terrain is higher at its centre than the mean of its corners.
    if (!terrain.isFlat && !level) {
      const first = i * 12;
      const middle =
        (places[first + 1]! + places[first + 4]! + places[first + 7]! + places[first + 10]!) / 4;
      const lift = Math.max(0, y + this.liftM - middle);
      for (let k = 1; k < 12; k += 3) places[first + k]! += lift;
    }
    if (i < this.firstChanged) this.firstChanged = i;
    if (i > this.lastChanged) this.lastChanged = i;
  }

  /**
   * Uploads the decals that were set since the last call, and limits drawing to the first `count`
   * decals.
   */
  upload(count: number): void {
    this.count = Math.min(count, this.capacity);
    this.geometry.setDrawRange(0, this.count * 6);
    if (this.lastChanged < this.firstChanged) return;
    const first = this.firstChanged;
    const set = this.lastChanged - first + 1;
    this.position.clearUpdateRanges();
    this.position.addUpdateRange(first * 12, set * 12);
    this.position.needsUpdate = true;
    this.data.clearUpdateRanges();
    this.data.addUpdateRange(first * 16, set * 16);
    this.data.needsUpdate = true;
    this.firstChanged = Infinity;
    this.lastChanged = -1;
  }

  dispose(): void {
    this.geometry.dispose();
    (this.mesh.material as THREE.Material).dispose();
  }
}

export function makeBlobs(capacity: number): GroundDecals {
  return new GroundDecals(capacity, blobFragment, 0.006);
}
export function makePlannedFootprints(capacity: number): GroundDecals {
  return new GroundDecals(capacity, plannedFragment, 0.014);
}
/** Value of `data.w` for each kind of goal decal. */
export const goalDecalKinds = {goal: 0, heading: 1, draggedHeading: 1, waypoint: 2} as const;
export function makeGoals(capacity: number): GroundDecals {
  return new GroundDecals(capacity, goalFragment, 0.016);
}
export function makeRings(capacity: number): GroundDecals {
  return new GroundDecals(capacity, ringFragment, 0.01);
}
