// The ground: a grid of metres that fades into the distance, and marks on it, each kind in one draw
// call: soft blobs beneath the figures, rings around planted feet, footprints left behind.

import * as THREE from 'three';

export interface GroundColours {
  near: THREE.Color;
  far: THREE.Color;
  line: THREE.Color;
  strong: THREE.Color;
}

const gridVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 centre;
in vec3 position;
out vec3 vWorld;
void main() {
  vWorld = vec3(position.x + centre.x, 0.0, position.z + centre.z);
  gl_Position = projectionMatrix * viewMatrix * vec4(vWorld, 1.0);
}`;

const gridFragment = /* glsl */ `
precision highp float;
uniform vec3 cameraPosition;
uniform vec3 near;
uniform vec3 far;
uniform vec3 line;
uniform vec3 strong;
uniform float fogDistance;
in vec3 vWorld;
out vec4 colour;
float grid(vec2 p, float width) {
  vec2 w = fwidth(p);
  vec2 g = abs(fract(p - 0.5) - 0.5) / max(w, vec2(1e-5));
  float l = 1.0 - min(min(g.x, g.y) / width, 1.0);
  return l * (1.0 - smoothstep(0.25, 0.7, max(w.x, w.y)));
}
void main() {
  vec3 c = near;
  c = mix(c, line, grid(vWorld.xz, 1.1) * 0.8);
  c = mix(c, strong, grid(vWorld.xz / 5.0, 1.6) * 0.9);
  float d = clamp(length(cameraPosition - vWorld) / fogDistance, 0.0, 1.0);
  colour = vec4(mix(c, far, smoothstep(0.12, 1.0, d)), 1.0);
}`;

// Without a graphics card a plane of one colour and some lines do.
const plainVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 cameraPosition;
uniform vec3 centre;
uniform vec3 near;
uniform vec3 far;
uniform vec3 line;
uniform vec3 strong;
uniform float fogDistance;
in vec3 position;
in float kind;     // 0 ground, 1 line, 2 strong line
out vec4 vColour;
void main() {
  vec3 world = vec3(position.x + centre.x, 0.0, position.z + centre.z);
  vec3 c = kind < 0.5 ? near : kind < 1.5 ? mix(near, line, 0.75) : strong;
  float d = clamp(length(cameraPosition - world) / fogDistance, 0.0, 1.0);
  vColour = vec4(mix(c, far, smoothstep(0.12, 0.9, d)), 1.0);
  gl_Position = projectionMatrix * viewMatrix * vec4(world, 1.0);
}`;

const plainFragment = /* glsl */ `
precision mediump float;
in vec4 vColour;
out vec4 colour;
void main() { colour = vColour; }`;

/** An endless plane with lines every metre, stronger every five. */
export class Grid {
  readonly object: THREE.Object3D;
  private readonly uniforms: Record<string, THREE.IUniform>;

  constructor(colours: GroundColours, plain: boolean) {
    this.uniforms = {
      near: {value: colours.near}, far: {value: colours.far}, line: {value: colours.line},
      strong: {value: colours.strong}, centre: {value: new THREE.Vector3()},
      fogDistance: {value: 90},
    };
    this.object = plain ? this.plain() : this.fine();
  }

  follow(x: number, z: number): void {
    (this.uniforms['centre']!.value as THREE.Vector3).set(Math.round(x / 5) * 5, 0, Math.round(z / 5) * 5);
  }

  private fine(): THREE.Object3D {
    const plane = new THREE.PlaneGeometry(400, 400, 8, 8).rotateX(-Math.PI / 2);
    const mesh = new THREE.Mesh(plane, new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: gridVertex, fragmentShader: gridFragment,
      uniforms: this.uniforms, depthWrite: false,
    }));
    mesh.frustumCulled = false;
    return mesh;
  }

  private plain(): THREE.Object3D {
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: plainVertex, fragmentShader: plainFragment,
      uniforms: this.uniforms, depthWrite: false, depthTest: false,
    });
    const plane = new THREE.PlaneGeometry(400, 400, 40, 40).rotateX(-Math.PI / 2);
    const count = plane.getAttribute('position').count;
    plane.setAttribute('kind', new THREE.BufferAttribute(new Float32Array(count), 1));
    const positions: number[] = [];
    const kinds: number[] = [];
    const half = 40;
    const piece = 8;
    for (let i = -half; i <= half; ++i) {
      for (let from = -half; from < half; from += piece) {
        const kind = i % 5 === 0 ? 2 : 1;
        positions.push(i, 0, from, i, 0, from + piece, from, 0, i, from + piece, 0, i);
        kinds.push(kind, kind, kind, kind);
      }
    }
    const lines = new THREE.BufferGeometry();
    lines.setAttribute('position', new THREE.BufferAttribute(new Float32Array(positions), 3));
    lines.setAttribute('kind', new THREE.BufferAttribute(new Float32Array(kinds), 1));
    const group = new THREE.Group();
    const ground = new THREE.Mesh(plane, material);
    const net = new THREE.LineSegments(lines, material);
    ground.renderOrder = -2;
    net.renderOrder = -1;
    ground.frustumCulled = net.frustumCulled = false;
    group.add(ground, net);
    return group;
  }
}

const markVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform float height;
in vec3 position;
in vec4 place;     // x, z, heading, size
in vec4 about;     // r, g, b, strength; or time for prints
out vec2 vAt;
out vec4 vAbout;
void main() {
  vAt = position.xz;
  vAbout = about;
  float c = cos(place.z), s = sin(place.z);
  vec2 p = position.xz * place.w;
  // Heading 0 looks along +Z and turns left: towards +X.
  vec2 q = vec2(p.x * c + p.y * s, -p.x * s + p.y * c);
  gl_Position = projectionMatrix * viewMatrix * vec4(place.x + q.x, height, place.y + q.y, 1.0);
}`;

const blobFragment = /* glsl */ `
precision mediump float;
in vec2 vAt;
in vec4 vAbout;
out vec4 colour;
void main() {
  float d = length(vAt);
  float a = 1.0 - smoothstep(0.0, 1.0, d);
  colour = vec4(vAbout.rgb, vAbout.a * a * a);
}`;

const ringFragment = /* glsl */ `
precision mediump float;
in vec2 vAt;
in vec4 vAbout;
out vec4 colour;
void main() {
  float d = length(vAt);
  float a = smoothstep(0.66, 0.74, d) * (1.0 - smoothstep(0.92, 1.0, d));
  float inside = (1.0 - smoothstep(0.66, 0.74, d)) * 0.28;
  colour = vec4(vAbout.rgb, vAbout.a * max(a, inside));
}`;

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

/** Many flat marks of one kind. */
export class Marks {
  readonly mesh: THREE.Mesh;
  count = 0;
  private readonly place: THREE.InstancedBufferAttribute;
  private readonly about: THREE.InstancedBufferAttribute;
  private readonly geometry = new THREE.InstancedBufferGeometry();

  constructor(
    readonly capacity: number, fragmentShader: string, height: number,
    uniforms: Record<string, THREE.IUniform> = {}) {
    const quad = new THREE.PlaneGeometry(2, 2).rotateX(-Math.PI / 2);
    this.geometry.setAttribute('position', quad.getAttribute('position'));
    this.geometry.setIndex(quad.getIndex());
    this.place = new THREE.InstancedBufferAttribute(new Float32Array(capacity * 4), 4);
    this.about = new THREE.InstancedBufferAttribute(new Float32Array(capacity * 4), 4);
    this.place.setUsage(THREE.DynamicDrawUsage);
    this.about.setUsage(THREE.DynamicDrawUsage);
    this.geometry.setAttribute('place', this.place);
    this.geometry.setAttribute('about', this.about);
    this.geometry.instanceCount = 0;
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: markVertex, fragmentShader,
      uniforms: {height: {value: height}, ...uniforms}, transparent: true, depthWrite: false,
      side: THREE.DoubleSide,
    });
    this.mesh = new THREE.Mesh(this.geometry, material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 2;
  }

  set(
    i: number, x: number, z: number, heading: number, size: number, a: number, b: number, c: number,
    d: number): void {
    this.place.setXYZW(i, x, z, heading, size);
    this.about.setXYZW(i, a, b, c, d);
  }

  /** How many are drawn, after some were set. */
  show(count: number): void {
    this.count = Math.min(count, this.capacity);
    this.geometry.instanceCount = this.count;
    for (const attribute of [this.place, this.about]) {
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, this.count * 4);
      attribute.needsUpdate = true;
    }
  }

  dispose(): void {
    this.geometry.dispose();
    (this.mesh.material as THREE.Material).dispose();
  }
}

export function blobs(capacity: number): Marks {
  return new Marks(capacity, blobFragment, 0.006);
}
export function rings(capacity: number): Marks {
  return new Marks(capacity, ringFragment, 0.01);
}

/** Footprints: the oldest give way to new ones. */
export class Footprints {
  readonly marks: Marks;
  private next = 0;
  private readonly uniforms: Record<string, THREE.IUniform>;

  constructor(capacity: number, left: THREE.Color, right: THREE.Color) {
    this.uniforms = {
      now: {value: 0}, lasting: {value: 14}, left: {value: left}, right: {value: right}};
    this.marks = new Marks(capacity, printFragment, 0.008, this.uniforms);
  }

  add(timeS: number, x: number, z: number, heading: number, foot: number): void {
    this.marks.set(this.next % this.marks.capacity, x, z, heading, 0.15, timeS, foot, 0, 0);
    ++this.next;
    this.marks.show(Math.min(this.next, this.marks.capacity));
  }

  at(timeS: number): void {
    this.uniforms['now']!.value = timeS;
  }

  get laid(): number {
    return this.next;
  }
}
