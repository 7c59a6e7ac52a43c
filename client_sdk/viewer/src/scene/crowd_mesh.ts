// A crowd of one skeleton in one draw call: the body once an avatar, moved by the joints' matrices,
// which lie in one texture of floats: three texels a joint, row by row. Or lines, see `LineCrowd`.

import * as THREE from 'three';

import type {CrowdPose} from '../sdk.js';
import {restPositions} from './body_parts.js';
import type {SkeletonLike} from './body_parts.js';
import {carry, matrixFloats, solve} from './kinematics.js';
import {LineCrowd} from './stick_figure_crowd.js';
import {buildBody} from './body_mesh.js';
import {SkinnedCrowd} from './cpu_skinned_crowd.js';
import type {FigureStyle} from '../quality.js';
import type {Ground} from '../terrain_surface.js';

const textureWidth = 1024;

const vertexShader = /* glsl */ `
precision highp float;
precision highp int;
precision highp sampler2D;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform sampler2D matrices;
uniform int jointCount;
uniform vec4 shadow;   // xyz: where light comes from, w: 1 flattens to the ground
in vec3 position;
in vec3 normal;
in vec2 joints;
in float blend;
in float region;
in vec4 look;          // rgb of the shirt, 1 when chosen
in float ground;       // height of the ground beneath
#ifdef COARSE
uniform vec3 sun;
uniform vec3 skyLight;
uniform vec3 groundLight;
uniform vec3 fogColour;
uniform float fogDistance;
uniform vec3 accent;
out vec3 vColour;
#else
out vec3 vNormal;
out vec3 vWorld;
out vec3 vColour;
out float vChosen;
#endif

void rows(int joint, out vec4 a, out vec4 b, out vec4 c) {
  int texel = (gl_InstanceID * jointCount + joint) * 3;
  a = texelFetch(matrices, ivec2(texel % ${textureWidth}, texel / ${textureWidth}), 0);
  ++texel;
  b = texelFetch(matrices, ivec2(texel % ${textureWidth}, texel / ${textureWidth}), 0);
  ++texel;
  c = texelFetch(matrices, ivec2(texel % ${textureWidth}, texel / ${textureWidth}), 0);
}

void main() {
  vec4 a; vec4 b; vec4 c;
  rows(int(joints.x), a, b, c);
  if (blend > 0.0) {
    vec4 d; vec4 e; vec4 f;
    rows(int(joints.y), d, e, f);
    a = mix(a, d, blend);
    b = mix(b, e, blend);
    c = mix(c, f, blend);
  }
  vec4 p = vec4(position, 1.0);
  vec3 world = vec3(dot(a, p), dot(b, p), dot(c, p));
  vec3 n = vec3(dot(a.xyz, normal), dot(b.xyz, normal), dot(c.xyz, normal));
  if (shadow.w > 0.5) {
    world -= shadow.xyz * (max(world.y - ground, 0.0) / shadow.y);
    world.y = ground + 0.004;
  }
  // Trousers and hair differ a little from one avatar to the next, by the shirt's own colour.
  float tint = fract(look.r * 7.13 + look.g * 3.71 + look.b * 5.37);
  vec3 skin = mix(vec3(0.87, 0.66, 0.53), vec3(0.55, 0.36, 0.26), smoothstep(0.45, 1.0, tint));
  vec3 trousers = mix(vec3(0.16, 0.20, 0.29), vec3(0.33, 0.31, 0.28), fract(tint * 3.3));
  vec3 hair = mix(vec3(0.11, 0.08, 0.06), vec3(0.42, 0.28, 0.15), fract(tint * 5.7));
  vec3 base = region < 0.5 ? skin : region < 1.5 ? look.rgb : region < 2.5 ? trousers :
    region < 3.5 ? vec3(0.13, 0.13, 0.15) : hair;
  vec4 seen = viewMatrix * vec4(world, 1.0);
#ifdef COARSE
  vec3 lit = base * (mix(groundLight, skyLight, n.y * 0.5 + 0.5) +
    vec3(1.0, 0.96, 0.9) * max(dot(n, sun), 0.0) * 1.15);
  lit = mix(lit, accent, look.w * 0.4);
  float far = clamp(-seen.z / fogDistance, 0.0, 1.0);
  vColour = mix(lit, fogColour, far * far * far);
#else
  vNormal = n;
  vWorld = world;
  vChosen = look.w;
  vColour = base;
#endif
  gl_Position = projectionMatrix * seen;
}`;

// Lit once a vertex.
const coarseFragment = /* glsl */ `
precision mediump float;
in vec3 vColour;
out vec4 colour;
void main() { colour = vec4(vColour, 1.0); }`;

const fragmentShader = /* glsl */ `
precision highp float;
uniform vec3 sun;
uniform vec3 cameraPosition;
uniform vec3 skyLight;
uniform vec3 groundLight;
uniform vec3 fogColour;
uniform float fogDistance;
uniform vec3 accent;
in vec3 vNormal;
in vec3 vWorld;
in vec3 vColour;
in float vChosen;
out vec4 colour;
void main() {
  vec3 n = normalize(vNormal);
  vec3 view = normalize(cameraPosition - vWorld);
  float key = max(dot(n, sun), 0.0);
  vec3 around = mix(groundLight, skyLight, n.y * 0.5 + 0.5);
  float rim = pow(1.0 - max(dot(n, view), 0.0), 3.0);
  vec3 lit = vColour * (around + vec3(1.0, 0.96, 0.9) * key * 1.15) + skyLight * rim * 0.16;
  lit = mix(lit, accent, vChosen * (0.1 + 0.75 * rim));
  float far = clamp(length(cameraPosition - vWorld) / fogDistance, 0.0, 1.0);
  lit = mix(lit, fogColour, far * far * far);
  // Display colours: the renderer writes what it is given.
  colour = vec4(pow(lit, vec3(1.0 / 1.12)), 1.0);
}`;

const shadowFragment = /* glsl */ `
precision mediump float;
uniform vec4 shade;
out vec4 colour;
void main() { colour = shade; }`;

/** Colours and lights that a theme gives; shared by every crowd. */
export interface Lights {
  sun: THREE.Vector3;
  skyLight: THREE.Color;
  groundLight: THREE.Color;
  fogColour: THREE.Color;
  accent: THREE.Color;
  shade: THREE.Vector4;
}

/** A hue an avatar keeps, from its number: neighbours differ. */
export function shirtColour(avatar: number, out: THREE.Color): THREE.Color {
  const hue = (avatar * 0.61803398875 + 0.07) % 1;
  const shift = (avatar * 0.754877666) % 1;
  return out.setHSL(hue, 0.42 + 0.2 * shift, 0.46 + 0.12 * ((avatar * 0.569840291) % 1),
    THREE.LinearSRGBColorSpace);
}

export class CrowdMesh {
  readonly group = new THREE.Group();
  readonly skeleton: SkeletonLike;
  readonly rest: Float32Array;
  readonly heightM: number;
  /** World positions of all joints: 3 a joint, jointCount joints an avatar. */
  positions = new Float32Array(0);
  matrices = new Float32Array(0);
  /** Balls of the left and right foot: 6 an avatar. */
  balls = new Float32Array(0);
  avatars = new Uint32Array(0);
  count = 0;
  style: FigureStyle;

  private readonly lights: Lights;
  private readonly uniforms: Record<string, THREE.IUniform>;
  private readonly jointCount: number;
  private readonly colour = new THREE.Color();
  private readonly lookAvatars: number[] = [];
  private geometry: THREE.InstancedBufferGeometry | null = null;
  private mesh: THREE.Mesh | null = null;
  private lines: LineCrowd | null = null;
  private skinned: SkinnedCrowd | null = null;
  private shadowMesh: THREE.Mesh | null = null;
  private texture: THREE.DataTexture | null = null;
  private look: THREE.InstancedBufferAttribute | null = null;
  private floor: THREE.InstancedBufferAttribute | null = null;
  private onPlane = true;
  private chosen = 0;
  private fineness = 0;
  private coarse = false;
  private simple = false;
  private shadows = true;
  private capacity = 0;

  /** `byScript`: coarse bodies are moved here and not by a shader, see `SkinnedCrowd`. */
  constructor(
    skeleton: SkeletonLike, style: FigureStyle, lights: Lights, private readonly byScript = false) {
    this.skeleton = skeleton;
    this.jointCount = skeleton.jointCount;
    this.rest = restPositions(skeleton);
    this.lights = lights;
    this.style = style;
    this.uniforms = {
      matrices: {value: null}, jointCount: {value: this.jointCount},
      shadow: {value: new THREE.Vector4(0, 1, 0, 0)}, sun: {value: lights.sun},
      skyLight: {value: lights.skyLight}, groundLight: {value: lights.groundLight},
      fogColour: {value: lights.fogColour}, fogDistance: {value: 90},
      accent: {value: lights.accent},
    };
    this.heightM = buildBody(skeleton, 5).heightM;
    this.grow(16);
  }

  /** `coarse`: bodies of few faces, lit once a vertex; `simple`: figures of few lines. */
  setStyle(style: FigureStyle, coarse: boolean, simple: boolean): void {
    if (style === this.style && coarse === this.coarse && simple === this.simple) return;
    this.style = style;
    this.coarse = coarse;
    this.simple = simple;
    this.build();
  }

  setShadows(on: boolean): void {
    if (on === this.shadows) return;
    this.shadows = on;
    // Shadows are the shader's: it moves the bodies, too, then.
    if (this.byScript && this.coarse && this.style === 'bodies') this.build();
    if (this.shadowMesh) this.shadowMesh.visible = on;
  }

  choose(avatar: number): void {
    if (avatar === this.chosen) return;
    this.chosen = avatar;
    this.lookAvatars.length = 0;
  }

  /** Colours may have changed. */
  redress(): void {
    this.lookAvatars.length = 0;
  }

  /** Takes the crowd's poses; allocates only when the crowd has grown. */
  update(pose: CrowdPose, ground: Ground | null = null): void {
    if (pose.count * this.jointCount * matrixFloats > this.matrices.length) this.grow(pose.count);
    this.count = pose.count;
    const {jointCount, skeleton} = this;
    const legs = [skeleton.leftLeg, skeleton.rightLeg] as const;
    for (let i = 0; i < pose.count; ++i) {
      this.avatars[i] = pose.avatars[i]!;
      solve(skeleton, this.rest, pose.rootsM[i * 3]!, pose.rootsM[i * 3 + 1]!,
        pose.rootsM[i * 3 + 2]!, pose.rotations, i * jointCount * 4, this.matrices,
        i * jointCount * matrixFloats, this.positions, i * jointCount * 3);
      for (let f = 0; f < 2; ++f) {
        const leg = legs[f]!;
        const ball = leg.ball >= 0 ? leg.ball : Math.max(leg.ankle, 0);
        carry(this.matrices, (i * jointCount + ball) * matrixFloats, this.positions,
          (i * jointCount + ball) * 3, leg.ballOffsetM, this.balls, i * 6 + f * 3);
      }
    }
    if (this.style === 'bodies' && this.finenessNow() !== this.fineness) this.build();
    this.stand(ground);
    this.dress();
    if (this.geometry) this.geometry.instanceCount = pose.count;
    if (this.lines) this.lines.update(this.matrices, this.positions, pose.count);
    else if (this.skinned) this.skinned.update(this.matrices, pose.count);
    else if (this.texture) this.texture.needsUpdate = true;
  }

  /** Shadows fall on what the avatar stands on. */
  private stand(ground: Ground | null): void {
    const flat = ground === null || ground.flat;
    if (!this.floor || !this.geometry || (flat && this.onPlane)) return;
    this.onPlane = flat;
    const heights = this.floor.array as Float32Array;
    if (flat) heights.fill(0);
    for (let i = 0; i < this.count && !flat; ++i) {
      const at = i * this.jointCount * 3;
      heights[i] = ground.heightAt(this.positions[at]!, this.positions[at + 2]!);
    }
    this.floor.needsUpdate = true;
  }

  /** Finer tubes while there are few, coarser ones in a crowd. */
  private finenessNow(): number {
    return this.coarse ? (this.count > 24 ? 4 : 5) : this.count > 300 ? 6 : this.count > 60 ? 8 : 12;
  }

  dispose(): void {
    this.clear();
    this.texture?.dispose();
  }

  private clear(): void {
    this.geometry?.dispose();
    for (const mesh of [this.mesh, this.shadowMesh]) {
      if (mesh) (mesh.material as THREE.Material).dispose();
    }
    this.lines?.dispose();
    this.skinned?.dispose();
    this.geometry = this.mesh = this.shadowMesh = this.lines = this.skinned = null;
    this.group.clear();
  }

  private dress(): void {
    if (!this.look) return;
    let changed = false;
    for (let i = 0; i < this.count; ++i) {
      const avatar = this.avatars[i]!;
      if (this.lookAvatars[i] === avatar) continue;
      this.lookAvatars[i] = avatar;
      shirtColour(avatar, this.colour);
      this.look.setXYZW(i, this.colour.r, this.colour.g, this.colour.b,
        avatar === this.chosen ? 1 : 0);
      this.lines?.dress(i, this.colour, avatar === this.chosen);
      this.skinned?.dress(i, this.colour, avatar === this.chosen);
      changed = true;
    }
    if (changed) this.look.needsUpdate = true;
  }

  private grow(atLeast: number): void {
    let capacity = 16;
    while (capacity < atLeast) capacity *= 2;
    this.capacity = capacity;
    const texels = capacity * this.jointCount * 3;
    const rows = Math.ceil(texels / textureWidth);
    this.matrices = new Float32Array(rows * textureWidth * 4);
    this.positions = new Float32Array(capacity * this.jointCount * 3);
    this.balls = new Float32Array(capacity * 6);
    this.avatars = new Uint32Array(capacity);
    this.texture?.dispose();
    this.texture = new THREE.DataTexture(
      this.matrices, textureWidth, rows, THREE.RGBAFormat, THREE.FloatType);
    this.texture.needsUpdate = true;
    this.uniforms['matrices']!.value = this.texture;
    this.look = new THREE.InstancedBufferAttribute(new Float32Array(capacity * 4), 4);
    this.look.setUsage(THREE.DynamicDrawUsage);
    this.floor = new THREE.InstancedBufferAttribute(new Float32Array(capacity), 1);
    this.floor.setUsage(THREE.DynamicDrawUsage);
    this.onPlane = true;
    this.lookAvatars.length = 0;
    this.build();
  }

  private build(): void {
    this.clear();
    this.lookAvatars.length = 0;
    if (this.style === 'lines') {
      this.lines = new LineCrowd(this.skeleton, this.lights, this.capacity, this.simple);
      this.group.add(this.lines.object);
      return;
    }
    const {uniforms, coarse} = this;
    const geometry = new THREE.InstancedBufferGeometry();
    this.fineness = this.finenessNow();
    const body = buildBody(this.skeleton, this.fineness, coarse);
    if (coarse && this.byScript && !this.shadows) {
      this.skinned = new SkinnedCrowd(body, this.jointCount, this.lights, this.capacity);
      this.group.add(this.skinned.object);
      return;
    }
    geometry.setAttribute('position', new THREE.BufferAttribute(body.positions, 3));
    geometry.setAttribute('normal', new THREE.BufferAttribute(body.normals, 3));
    geometry.setAttribute('joints', new THREE.BufferAttribute(body.joints, 2));
    geometry.setAttribute('blend', new THREE.BufferAttribute(body.blends, 1));
    geometry.setAttribute('region', new THREE.BufferAttribute(body.regions, 1));
    geometry.setIndex(new THREE.BufferAttribute(body.indices, 1));
    geometry.setAttribute('look', this.look!);
    geometry.setAttribute('ground', this.floor!);
    geometry.instanceCount = this.count;
    this.geometry = geometry;
    this.mesh = new THREE.Mesh(geometry, new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader, uniforms, defines: coarse ? {COARSE: 1} : {},
      fragmentShader: coarse ? coarseFragment : fragmentShader,
    }));
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 3;
    this.group.add(this.mesh);
    // The same bodies flattened along the light: a shadow, darkened once by the stencil.
    this.shadowMesh = new THREE.Mesh(geometry, new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader, fragmentShader: shadowFragment,
      uniforms: {
        ...uniforms, shade: {value: this.lights.shade},
        shadow: {value: new THREE.Vector4(
          this.lights.sun.x, this.lights.sun.y, this.lights.sun.z, 1)},
      },
      transparent: true, depthWrite: false, stencilWrite: true,
      stencilFunc: THREE.EqualStencilFunc, stencilRef: 0, stencilZPass: THREE.IncrementStencilOp,
    }));
    this.shadowMesh.frustumCulled = false;
    this.shadowMesh.renderOrder = 1;
    this.shadowMesh.visible = this.shadows;
    this.group.add(this.shadowMesh);
  }
}
