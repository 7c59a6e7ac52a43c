// Footprints that avatars leave on the ground and that fade with time.

import * as THREE from 'three';

import type {TerrainSurface} from '../terrain_surface.js';
import {GroundDecals} from './ground_decals.js';

const footprintFragment = /* glsl */ `
precision highp float;
uniform float now;
uniform float fadeS;
uniform vec3 left;
uniform vec3 right;
in vec2 vAt;
in vec4 vData;     // time of the foot strike, foot, 0, 0
out vec4 colour;
float blot(vec2 p, vec2 c, vec2 r) { return 1.0 - smoothstep(0.8, 1.0, length((p - c) / r)); }
void main() {
  float age = now - vData.x;
  float fresh = age < 0.0 ? 0.0 : 1.0 - clamp(age / fadeS, 0.0, 1.0);
  // The ball of the foot is at the centre, the heel behind it.
  float shape = max(blot(vAt, vec2(0.0, 0.18), vec2(0.3, 0.52)),
                    blot(vAt, vec2(0.0, -0.72), vec2(0.22, 0.26)));
  float a = shape * sqrt(fresh) * 0.75;
  if (a < 0.01) discard;
  colour = vec4(vData.y < 0.5 ? left : right, a);
}`;

/** A ring buffer of footprints: new ones replace the oldest. */
export class Footprints {
  readonly decals: GroundDecals;
  /** Maximum number of footprints drawn, at most the capacity. */
  limit: number;
  private next = 0;
  private total = 0;
  private pendingUploads = 0;
  private readonly uniforms: Record<string, THREE.IUniform>;

  constructor(capacity: number, left: THREE.Color, right: THREE.Color) {
    this.limit = capacity;
    this.uniforms = {
      now: {value: 0}, fadeS: {value: 14}, left: {value: left}, right: {value: right}};
    this.decals = new GroundDecals(capacity, footprintFragment, 0.008, this.uniforms);
  }

  /** `timeS` is server time; `foot` is 0 for left, 1 for right. */
  add(
    timeS: number, terrain: TerrainSurface, x: number, z: number, headingRad: number,
    foot: number): void {
    this.decals.set(this.next % this.limit, terrain, x, z, headingRad, 0.15, timeS, foot, 0, 0);
    ++this.next;
    ++this.total;
    ++this.pendingUploads;
  }

  /** Removes all footprints, for example because the terrain has changed. */
  clear(): void {
    this.next = 0;
    this.pendingUploads = 0;
    this.decals.upload(0);
  }

  /** Call once per frame with the server time that is shown. */
  update(timeS: number): void {
    this.uniforms['now']!.value = timeS;
    if (this.pendingUploads === 0 && this.decals.count <= this.limit) return;
    this.pendingUploads = 0;
    this.decals.upload(Math.min(this.next, this.limit));
  }

  /** Number of footprints added so far, including those that are no longer drawn. */
  get addedCount(): number {
    return this.total;
  }
}
