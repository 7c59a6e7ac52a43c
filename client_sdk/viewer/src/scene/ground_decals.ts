// Marks on the ground, each kind in one draw call: soft blobs beneath the figures, rings around planted
// feet, outlines where feet are to land, goals of walks.

import * as THREE from 'three';

import type {Ground} from '../terrain_surface.js';

// Four corners a mark, worked out once where it is set: drawn as instances, each mark would be a
// draw of its own for a processor.
const markVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
in vec3 position;
in vec2 corner;
in vec4 about;     // r, g, b, strength; or time for prints
out vec2 vAt;
out vec4 vAbout;
void main() {
  vAt = corner;
  vAbout = about;
  gl_Position = projectionMatrix * (viewMatrix * vec4(position, 1.0));
}`;

const blobFragment = /* glsl */ `
precision mediump float;
in vec2 vAt;
in vec4 vAbout;
out vec4 colour;
void main() {
  float a = max(1.0 - dot(vAt, vAt), 0.0);
  colour = vec4(vAbout.rgb, vAbout.a * a * a * a);
}`;

const ringFragment = /* glsl */ `
precision mediump float;
in vec2 vAt;
in vec4 vAbout;
out vec4 colour;
void main() {
  float d = length(vAt);
  float inside = clamp((0.74 - d) * 12.5, 0.0, 1.0);
  float a = clamp((1.0 - d) * 12.5, 0.0, 1.0) * (1.0 - 0.72 * inside);
  colour = vec4(vAbout.rgb, vAbout.a * a);
}`;

// Where a foot is to land: the outline of a footprint.
const plannedFragment = /* glsl */ `
precision highp float;
in vec2 vAt;
in vec4 vAbout;
out vec4 colour;
float edge(vec2 p, vec2 c, vec2 r) {
  float d = length((p - c) / r);
  return smoothstep(0.66, 0.76, d) * (1.0 - smoothstep(0.9, 1.0, d)) + 0.25 * (1.0 - step(0.76, d));
}
void main() {
  float a = max(edge(vAt, vec2(0.0, 0.14), vec2(0.42, 0.62)), edge(vAt, vec2(0.0, -0.72), vec2(0.3, 0.27)));
  colour = vec4(vAbout.rgb, vAbout.a * a);
}`;

// Where a walk ends, an arrow the way it looks there, and places it passes, by the last of `about`.
const goalFragment = /* glsl */ `
precision highp float;
in vec2 vAt;
in vec4 vAbout;
out vec4 colour;
float within(float d, float edge) { return 1.0 - smoothstep(edge - 0.07, edge, d); }
void main() {
  float a;
  if (vAbout.w < 0.5) {
    float d = length(vAt);
    a = max(within(d, 1.0) * (1.0 - within(d, 0.8) * 0.8), within(d, 0.27));
  } else if (vAbout.w < 1.5) {
    float across = abs(vAt.x);
    a = within(across - (1.0 - vAt.y) * 0.45, 0.0) * within(-0.8 - vAt.y + (0.9 - across) * 0.5, 0.0);
  } else {
    float d = abs(vAt.x) + abs(vAt.y);
    a = within(d, 1.0) * (1.0 - within(d, 0.66) * 0.8);
  }
  colour = vec4(vAbout.rgb, 0.95 * a);
}`;

const corners = [-1, -1, 1, -1, 1, 1, -1, 1] as const;

/** Many flat marks of one kind. */
export class Marks {
  readonly mesh: THREE.Mesh;
  count = 0;
  private readonly position: THREE.BufferAttribute;
  private readonly about: THREE.BufferAttribute;
  private readonly geometry = new THREE.BufferGeometry();
  private firstSet = Infinity;
  private lastSet = -1;

  /** `height`: how far above the ground, so that kinds lie over one another. */
  constructor(
    readonly capacity: number, fragmentShader: string, private readonly height: number,
    uniforms: Record<string, THREE.IUniform> = {}) {
    this.position = new THREE.BufferAttribute(new Float32Array(capacity * 12), 3);
    this.about = new THREE.BufferAttribute(new Float32Array(capacity * 16), 4);
    const corner = new Int8Array(capacity * 8);
    const index = capacity * 4 > 65535 ? new Uint32Array(capacity * 6) : new Uint16Array(capacity * 6);
    for (let i = 0; i < capacity; ++i) {
      corner.set(corners, i * 8);
      // Anticlockwise from above.
      index.set([i * 4, i * 4 + 2, i * 4 + 1, i * 4, i * 4 + 3, i * 4 + 2], i * 6);
    }
    this.position.setUsage(THREE.DynamicDrawUsage);
    this.about.setUsage(THREE.DynamicDrawUsage);
    this.geometry.setAttribute('position', this.position);
    this.geometry.setAttribute('about', this.about);
    this.geometry.setAttribute('corner', new THREE.BufferAttribute(corner, 2));
    this.geometry.setIndex(new THREE.BufferAttribute(index, 1));
    this.geometry.setDrawRange(0, 0);
    this.mesh = new THREE.Mesh(this.geometry, new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: markVertex, fragmentShader, uniforms,
      transparent: true, depthWrite: false,
    }));
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 2;
  }

  /** Lies on the ground, on a slope each corner at its own height. */
  set(
    i: number, ground: Ground, x: number, z: number, heading: number, size: number, a: number,
    b: number, c: number, d: number): void {
    let y = ground.heightAt(x, z);
    // Among boxes it lies level, and so does a large one anywhere: on the highest beneath it.
    const large = size > 0.3 && !ground.flat;
    const level = large || ground.hasBoxes;
    if (large) {
      for (const [u, v] of [[-1, -1], [1, -1], [1, 1], [-1, 1]] as const) {
        y = Math.max(y, Math.min(y + 0.3, ground.heightAt(x + u * size * 0.7, z + v * size * 0.7)));
      }
    }
    const places = this.position.array as Float32Array;
    const about = this.about.array as Float32Array;
    // Heading 0 looks along +Z and turns left: towards +X.
    const cos = Math.cos(heading) * size;
    const sin = Math.sin(heading) * size;
    let at = i * 12;
    let to = i * 16;
    for (let k = 0; k < 4; ++k) {
      const u = corners[k * 2]!;
      const v = corners[k * 2 + 1]!;
      const cx = x + u * cos + v * sin;
      const cz = z - u * sin + v * cos;
      const cy = ground.flat || level ? y : ground.heightAt(cx, cz);
      places[at++] = cx;
      places[at++] = (Math.abs(cy - y) < size * 0.8 ? cy : y) + this.height;
      places[at++] = cz;
      about[to++] = a;
      about[to++] = b;
      about[to++] = c;
      about[to++] = d;
    }
    // Not beneath a rise in its middle.
    if (!ground.flat && !level) {
      const first = i * 12;
      const middle = (places[first + 1]! + places[first + 4]! + places[first + 7]! + places[first + 10]!) / 4;
      const lift = Math.max(0, y + this.height - middle);
      for (let k = 1; k < 12; k += 3) places[first + k]! += lift;
    }
    if (i < this.firstSet) this.firstSet = i;
    if (i > this.lastSet) this.lastSet = i;
  }

  /** How many are drawn, after some were set. */
  show(count: number): void {
    this.count = Math.min(count, this.capacity);
    this.geometry.setDrawRange(0, this.count * 6);
    if (this.lastSet < this.firstSet) return;
    const first = this.firstSet;
    const set = this.lastSet - first + 1;
    this.position.clearUpdateRanges();
    this.position.addUpdateRange(first * 12, set * 12);
    this.position.needsUpdate = true;
    this.about.clearUpdateRanges();
    this.about.addUpdateRange(first * 16, set * 16);
    this.about.needsUpdate = true;
    this.firstSet = Infinity;
    this.lastSet = -1;
  }

  dispose(): void {
    this.geometry.dispose();
    (this.mesh.material as THREE.Material).dispose();
  }
}

export function blobs(capacity: number): Marks {
  return new Marks(capacity, blobFragment, 0.006);
}
export function planned(capacity: number): Marks {
  return new Marks(capacity, plannedFragment, 0.014);
}
export const goalKinds = {goal: 0, heading: 1, turning: 1, waypoint: 2} as const;
export function goals(capacity: number): Marks {
  return new Marks(capacity, goalFragment, 0.016);
}
export function rings(capacity: number): Marks {
  return new Marks(capacity, ringFragment, 0.01);
}
