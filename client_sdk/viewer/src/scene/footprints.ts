// Footprints that are left behind and fade.

import * as THREE from 'three';

import type {Ground} from '../terrain_surface.js';
import {Marks} from './ground_decals.js';

const printFragment = /* glsl */ `
precision highp float;
uniform float now;
uniform float lasting;
uniform vec3 left;
uniform vec3 right;
in vec2 vAt;
in vec4 vAbout;    // time, foot, 0, 0
out vec4 colour;
float blot(vec2 p, vec2 c, vec2 r) { return 1.0 - smoothstep(0.8, 1.0, length((p - c) / r)); }
void main() {
  float age = now - vAbout.x;
  float fresh = age < 0.0 ? 0.0 : 1.0 - clamp(age / lasting, 0.0, 1.0);
  // The ball of the foot is the middle; the heel lies behind it.
  float shape = max(blot(vAt, vec2(0.0, 0.18), vec2(0.3, 0.52)),
                    blot(vAt, vec2(0.0, -0.72), vec2(0.22, 0.26)));
  float a = shape * sqrt(fresh) * 0.75;
  if (a < 0.01) discard;
  colour = vec4(vAbout.y < 0.5 ? left : right, a);
}`;

/** Footprints: the oldest give way to new ones. */
export class Footprints {
  readonly marks: Marks;
  /** How many are kept at most; up to the capacity. */
  limit: number;
  private next = 0;
  private total = 0;
  private unseen = 0;
  private readonly uniforms: Record<string, THREE.IUniform>;

  constructor(capacity: number, left: THREE.Color, right: THREE.Color) {
    this.limit = capacity;
    this.uniforms = {
      now: {value: 0}, lasting: {value: 14}, left: {value: left}, right: {value: right}};
    this.marks = new Marks(capacity, printFragment, 0.008, this.uniforms);
  }

  add(timeS: number, ground: Ground, x: number, z: number, heading: number, foot: number): void {
    this.marks.set(this.next % this.limit, ground, x, z, heading, 0.15, timeS, foot, 0, 0);
    ++this.next;
    ++this.total;
    ++this.unseen;
  }

  /** Another ground: where they were is no place any more. */
  clear(): void {
    this.next = 0;
    this.unseen = 0;
    this.marks.show(0);
  }

  /** Once a frame. */
  at(timeS: number): void {
    this.uniforms['now']!.value = timeS;
    if (this.unseen === 0 && this.marks.count <= this.limit) return;
    this.unseen = 0;
    this.marks.show(Math.min(this.next, this.limit));
  }

  /** Since the page was opened. */
  get laid(): number {
    return this.total;
  }
}
