// Buffers for a crowd whose vertices are transformed on the CPU, so that the shader only projects
// them. The whole crowd is one draw call, which suits software renderers.

import * as THREE from 'three';

const vertexShader = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 fogColour;
uniform float fogDistance;
in vec3 position;
in vec3 tint;
SMOOTHNESS out vec3 vColour;
void main() {
  vec4 seen = viewMatrix * vec4(position, 1.0);
  float far = clamp(-seen.z / fogDistance, 0.0, 1.0);
  vColour = mix(tint, fogColour, far * far * far);
  gl_Position = projectionMatrix * seen;
}`;

const fragmentShader = /* glsl */ `
precision mediump float;
SMOOTHNESS in vec3 vColour;
out vec4 colour;
void main() { colour = vec4(vColour, 1.0); }`;

export class CpuCrowdGeometry {
  readonly buffers = new THREE.BufferGeometry();
  readonly material: THREE.RawShaderMaterial;
  /** World positions, 3 numbers per point; the points of one avatar are contiguous. */
  readonly positions: Float32Array;
  /** Colours, 4 numbers per point: red, green, blue, 255. */
  readonly tints: Uint8ClampedArray;
  private readonly position: THREE.BufferAttribute;
  private readonly tint: THREE.BufferAttribute;

  /**
   * `capacity` is the number of avatars, `pointCount` the number of points per avatar. `indices`
   * contains the lines or triangles of one avatar. If `flat`, each line or triangle has the colour
   * of its last point. Otherwise, colours are interpolated.
   */
  constructor(
    private readonly capacity: number, readonly pointCount: number,
    private readonly indices: ArrayLike<number>, flat: boolean, fogColour: THREE.Color) {
    this.positions = new Float32Array(capacity * pointCount * 3);
    this.tints = new Uint8ClampedArray(capacity * pointCount * 4).fill(255);
    this.position = new THREE.BufferAttribute(this.positions, 3);
    this.tint = new THREE.BufferAttribute(this.tints, 4, true);
    this.position.setUsage(THREE.DynamicDrawUsage);
    this.tint.setUsage(THREE.DynamicDrawUsage);
    const all = capacity * pointCount > 65535 ? new Uint32Array(capacity * indices.length) :
      new Uint16Array(capacity * indices.length);
    for (let i = 0; i < capacity; ++i) {
      for (let k = 0; k < indices.length; ++k) {
        all[i * indices.length + k] = i * pointCount + indices[k]!;
      }
    }
    this.buffers.setAttribute('position', this.position);
    this.buffers.setAttribute('tint', this.tint);
    this.buffers.setIndex(new THREE.BufferAttribute(all, 1));
    this.buffers.setDrawRange(0, 0);
    this.material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader, fragmentShader,
      defines: {SMOOTHNESS: flat ? 'flat' : 'smooth'},
      uniforms: {fogColour: {value: fogColour}, fogDistance: {value: 90}},
    });
  }

  /** Sets up an object that draws the buffers: never culled, and drawn after the terrain. */
  configure<T extends THREE.Object3D>(object: T): T {
    object.frustumCulled = false;
    object.renderOrder = 3;
    return object;
  }

  /** Uploads the positions of the first `count` avatars, and draws only these. */
  uploadPositions(count: number): void {
    this.buffers.setDrawRange(0, count * this.indices.length);
    this.position.clearUpdateRanges();
    this.position.addUpdateRange(0, count * this.pointCount * 3);
    this.position.needsUpdate = true;
  }

  /** Uploads the colours of the first `count` avatars. */
  uploadTints(count = this.capacity): void {
    this.tint.clearUpdateRanges();
    this.tint.addUpdateRange(0, count * this.pointCount * 4);
    this.tint.needsUpdate = true;
  }

  dispose(): void {
    this.buffers.dispose();
    this.material.dispose();
  }
}
