// Draws all avatars of a world, which share one skeleton. Bodies are instances of one mesh, skinned
// in the vertex shader: a float texture holds the joint matrices, three texels (rows) per joint.
// Alternatives are CPU skinning (`CpuSkinnedCrowd`) and lines (`StickFigureCrowd`).

import * as THREE from 'three';

import type {CrowdPose} from '../sdk.js';
import {restPositions} from './body_parts.js';
import type {SkeletonLike} from './body_parts.js';
import {transformPoint, floatsPerMatrix, computeJointTransforms} from './kinematics.js';
import {StickFigureCrowd} from './stick_figure_crowd.js';
import {buildBodyMesh} from './body_mesh.js';
import {CpuSkinnedCrowd} from './cpu_skinned_crowd.js';
import type {FigureStyle} from '../quality.js';
import type {TerrainSurface} from '../terrain_surface.js';

const textureWidth = 1024;

const vertexShader = /* glsl */ `
precision highp float;
precision highp int;
precision highp sampler2D;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform sampler2D matrices;
uniform int jointCount;
uniform vec4 shadow;   // xyz: direction towards the light; w: 1 projects to the ground
in vec3 position;
in vec3 normal;
in vec2 joints;
in float blend;
in float region;
in vec4 shirt;         // colour of the shirt; w is 1 if the avatar is selected
in float terrainHeight;
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
out float vSelected;
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
    world -= shadow.xyz * (max(world.y - terrainHeight, 0.0) / shadow.y);
    world.y = terrainHeight + 0.004;
  }
  // The colour of the shirt also selects those of skin, trousers and hair.
  float tint = fract(shirt.r * 7.13 + shirt.g * 3.71 + shirt.b * 5.37);
  vec3 skin = mix(vec3(0.87, 0.66, 0.53), vec3(0.55, 0.36, 0.26), smoothstep(0.45, 1.0, tint));
  vec3 trousers = mix(vec3(0.16, 0.20, 0.29), vec3(0.33, 0.31, 0.28), fract(tint * 3.3));
  vec3 hair = mix(vec3(0.11, 0.08, 0.06), vec3(0.42, 0.28, 0.15), fract(tint * 5.7));
  vec3 base = region < 0.5 ? skin : region < 1.5 ? shirt.rgb : region < 2.5 ? trousers :
    region < 3.5 ? vec3(0.13, 0.13, 0.15) : hair;
  vec4 seen = viewMatrix * vec4(world, 1.0);
#ifdef COARSE
  vec3 lit = base * (mix(groundLight, skyLight, n.y * 0.5 + 0.5) +
    vec3(1.0, 0.96, 0.9) * max(dot(n, sun), 0.0) * 1.15);
  lit = mix(lit, accent, shirt.w * 0.4);
  float far = clamp(-seen.z / fogDistance, 0.0, 1.0);
  vColour = mix(lit, fogColour, far * far * far);
#else
  vNormal = n;
  vWorld = world;
  vSelected = shirt.w;
  vColour = base;
#endif
  gl_Position = projectionMatrix * seen;
}`;

// Fragment shader for coarse bodies, which are lit per vertex.
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
in float vSelected;
out vec4 colour;
void main() {
  vec3 n = normalize(vNormal);
  vec3 view = normalize(cameraPosition - vWorld);
  float key = max(dot(n, sun), 0.0);
  vec3 around = mix(groundLight, skyLight, n.y * 0.5 + 0.5);
  float rim = pow(1.0 - max(dot(n, view), 0.0), 3.0);
  vec3 lit = vColour * (around + vec3(1.0, 0.96, 0.9) * key * 1.15) + skyLight * rim * 0.16;
  lit = mix(lit, accent, vSelected * (0.1 + 0.75 * rim));
  float far = clamp(length(cameraPosition - vWorld) / fogDistance, 0.0, 1.0);
  lit = mix(lit, fogColour, far * far * far);
  // All colours are in display space, so there is no conversion at the end.
  colour = vec4(pow(lit, vec3(1.0 / 1.12)), 1.0);
}`;

const shadowFragment = /* glsl */ `
precision mediump float;
uniform vec4 shade;
out vec4 colour;
void main() { colour = shade; }`;

/** Lights and colours of the current theme. All crowds share one object. */
export interface Lights {
  sun: THREE.Vector3;
  skyLight: THREE.Color;
  groundLight: THREE.Color;
  fogColour: THREE.Color;
  accent: THREE.Color;
  shade: THREE.Vector4;
}

/** Returns a colour that depends only on the avatar's id. Consecutive ids have different hues. */
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
  /** World positions of all joints: 3 numbers per joint, `jointCount` joints per avatar. */
  positions = new Float32Array(0);
  /** Results of `computeJointTransforms` for all avatars. */
  matrices = new Float32Array(0);
  /** World positions of the balls of the left and right foot: 6 numbers per avatar. */
  footBalls = new Float32Array(0);
  avatars = new Uint32Array(0);
  count = 0;
  style: FigureStyle;

  private readonly lights: Lights;
  private readonly uniforms: Record<string, THREE.IUniform>;
  private readonly jointCount: number;
  private readonly colour = new THREE.Color();
  /** [index]: avatar whose colours have been uploaded at this index. */
  private readonly colouredAvatars: number[] = [];
  private geometry: THREE.InstancedBufferGeometry | null = null;
  private mesh: THREE.Mesh | null = null;
  private stickFigures: StickFigureCrowd | null = null;
  private cpuSkinned: CpuSkinnedCrowd | null = null;
  private shadowMesh: THREE.Mesh | null = null;
  private texture: THREE.DataTexture | null = null;
  private shirtAttribute: THREE.InstancedBufferAttribute | null = null;
  private terrainHeightAttribute: THREE.InstancedBufferAttribute | null = null;
  private terrainIsFlat = true;
  private selectedAvatar = 0;
  private segments = 0;
  private coarse = false;
  private simplified = false;
  private shadows = true;
  private capacity = 0;

  /** If `cpuSkinning`, uses `CpuSkinnedCrowd` for coarse bodies without shadows. */
  constructor(
    skeleton: SkeletonLike, style: FigureStyle, lights: Lights,
    private readonly cpuSkinning = false) {
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
    this.heightM = buildBodyMesh(skeleton, 5).heightM;
    this.reserve(16);
  }

  /**
   * If `coarse`, bodies have few faces and are lit per vertex. If `simplified`, stick figures have
   * few lines.
   */
  setStyle(style: FigureStyle, coarse: boolean, simplified: boolean): void {
    if (style === this.style && coarse === this.coarse && simplified === this.simplified) return;
    this.style = style;
    this.coarse = coarse;
    this.simplified = simplified;
    this.rebuild();
  }

  setShadows(on: boolean): void {
    if (on === this.shadows) return;
    this.shadows = on;
    // Shadows need the shader, which then also skins the bodies.
    if (this.cpuSkinning && this.coarse && this.style === 'bodies') this.rebuild();
    if (this.shadowMesh) this.shadowMesh.visible = on;
  }

  setSelected(avatar: number): void {
    if (avatar === this.selectedAvatar) return;
    this.selectedAvatar = avatar;
    this.colouredAvatars.length = 0;
  }

  /** Uploads all colours again with the next update. */
  invalidateColours(): void {
    this.colouredAvatars.length = 0;
  }

  /**
   * Draws these poses from now on. Allocates only if the crowd has grown, or if its size requires
   * another level of detail.
   */
  update(pose: CrowdPose, terrain: TerrainSurface | null = null): void {
    const size = pose.count * this.jointCount * floatsPerMatrix;
    if (size > this.matrices.length) this.reserve(pose.count);
    this.count = pose.count;
    const {jointCount, skeleton} = this;
    const legs = [skeleton.leftLeg, skeleton.rightLeg] as const;
    for (let i = 0; i < pose.count; ++i) {
      this.avatars[i] = pose.avatars[i]!;
      computeJointTransforms(skeleton, this.rest, pose.rootsM[i * 3]!, pose.rootsM[i * 3 + 1]!,
        pose.rootsM[i * 3 + 2]!, pose.rotations, i * jointCount * 4, this.matrices,
        i * jointCount * floatsPerMatrix, this.positions, i * jointCount * 3);
      for (let f = 0; f < 2; ++f) {
        const leg = legs[f]!;
        const ball = leg.ball >= 0 ? leg.ball : Math.max(leg.ankle, 0);
        transformPoint(this.matrices, (i * jointCount + ball) * floatsPerMatrix, this.positions,
          (i * jointCount + ball) * 3, leg.ballOffsetM, this.footBalls, i * 6 + f * 3);
      }
    }
    if (this.style === 'bodies' && this.desiredSegments() !== this.segments) this.rebuild();
    this.updateTerrainHeights(terrain);
    this.updateColours();
    if (this.geometry) this.geometry.instanceCount = pose.count;
    if (this.stickFigures) this.stickFigures.update(this.matrices, this.positions, pose.count);
    else if (this.cpuSkinned) this.cpuSkinned.update(this.matrices, pose.count);
    else if (this.texture) this.texture.needsUpdate = true;
  }

  /** Each avatar's shadow is projected to the terrain height at its root. */
  private updateTerrainHeights(terrain: TerrainSurface | null): void {
    const flat = terrain === null || terrain.isFlat;
    if (!this.terrainHeightAttribute || !this.geometry || (flat && this.terrainIsFlat)) return;
    this.terrainIsFlat = flat;
    const heights = this.terrainHeightAttribute.array as Float32Array;
    if (flat) heights.fill(0);
    for (let i = 0; i < this.count && !flat; ++i) {
      const at = i * this.jointCount * 3;
      heights[i] = terrain.heightAt(this.positions[at]!, this.positions[at + 2]!);
    }
    this.terrainHeightAttribute.needsUpdate = true;
  }

  /** Returns the number of segments of a limb's cross-section. Larger crowds have fewer. */
  private desiredSegments(): number {
    if (this.coarse) return this.count > 24 ? 4 : 5;
    return this.count > 300 ? 6 : this.count > 60 ? 8 : 12;
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
    this.stickFigures?.dispose();
    this.cpuSkinned?.dispose();
    this.geometry = this.mesh = this.shadowMesh = this.stickFigures = this.cpuSkinned = null;
    this.group.clear();
  }

  private updateColours(): void {
    if (!this.shirtAttribute) return;
    let changed = false;
    for (let i = 0; i < this.count; ++i) {
      const avatar = this.avatars[i]!;
      if (this.colouredAvatars[i] === avatar) continue;
      this.colouredAvatars[i] = avatar;
      shirtColour(avatar, this.colour);
      this.shirtAttribute.setXYZW(i, this.colour.r, this.colour.g, this.colour.b,
        avatar === this.selectedAvatar ? 1 : 0);
      this.stickFigures?.setColours(i, this.colour, avatar === this.selectedAvatar);
      this.cpuSkinned?.setColours(i, this.colour, avatar === this.selectedAvatar);
      changed = true;
    }
    if (changed) this.shirtAttribute.needsUpdate = true;
  }

  private reserve(minCapacity: number): void {
    let capacity = 16;
    while (capacity < minCapacity) capacity *= 2;
    this.capacity = capacity;
    const texels = capacity * this.jointCount * 3;
    const rows = Math.ceil(texels / textureWidth);
    this.matrices = new Float32Array(rows * textureWidth * 4);
    this.positions = new Float32Array(capacity * this.jointCount * 3);
    this.footBalls = new Float32Array(capacity * 6);
    this.avatars = new Uint32Array(capacity);
    this.texture?.dispose();
    this.texture = new THREE.DataTexture(
      this.matrices, textureWidth, rows, THREE.RGBAFormat, THREE.FloatType);
    this.texture.needsUpdate = true;
    this.uniforms['matrices']!.value = this.texture;
    this.shirtAttribute = new THREE.InstancedBufferAttribute(new Float32Array(capacity * 4), 4);
    this.shirtAttribute.setUsage(THREE.DynamicDrawUsage);
    this.terrainHeightAttribute = new THREE.InstancedBufferAttribute(new Float32Array(capacity), 1);
    this.terrainHeightAttribute.setUsage(THREE.DynamicDrawUsage);
    this.terrainIsFlat = true;
    this.colouredAvatars.length = 0;
    this.rebuild();
  }

  private rebuild(): void {
    this.clear();
    this.colouredAvatars.length = 0;
    if (this.style === 'lines') {
      this.stickFigures = new StickFigureCrowd(
        this.skeleton, this.lights, this.capacity, this.simplified);
      this.group.add(this.stickFigures.object);
      return;
    }
    const {uniforms, coarse} = this;
    const geometry = new THREE.InstancedBufferGeometry();
    this.segments = this.desiredSegments();
    const body = buildBodyMesh(this.skeleton, this.segments, coarse);
    if (coarse && this.cpuSkinning && !this.shadows) {
      this.cpuSkinned = new CpuSkinnedCrowd(body, this.jointCount, this.lights, this.capacity);
      this.group.add(this.cpuSkinned.object);
      return;
    }
    geometry.setAttribute('position', new THREE.BufferAttribute(body.positions, 3));
    geometry.setAttribute('normal', new THREE.BufferAttribute(body.normals, 3));
    geometry.setAttribute('joints', new THREE.BufferAttribute(body.joints, 2));
    geometry.setAttribute('blend', new THREE.BufferAttribute(body.blends, 1));
    geometry.setAttribute('region', new THREE.BufferAttribute(body.regions, 1));
    geometry.setIndex(new THREE.BufferAttribute(body.indices, 1));
    geometry.setAttribute('shirt', this.shirtAttribute!);
    geometry.setAttribute('terrainHeight', this.terrainHeightAttribute!);
    geometry.instanceCount = this.count;
    this.geometry = geometry;
    this.mesh = new THREE.Mesh(geometry, new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader, uniforms, defines: coarse ? {COARSE: 1} : {},
      fragmentShader: coarse ? coarseFragment : fragmentShader,
    }));
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 3;
    this.group.add(this.mesh);
    // Shadows are the same bodies, projected to the ground along the light. The stencil buffer
    // keeps overlapping shadows from darkening a pixel twice.
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
