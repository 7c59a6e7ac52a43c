// Flat terrain: a plane with a 1 m grid that fades with distance.

import * as THREE from 'three';

import {gridLines} from './grid_lines.js';

export interface TerrainColours {
  near: THREE.Color;
  /** Colour in the far distance, which is also the background. */
  far: THREE.Color;
  /** Colour of the lines every metre. */
  line: THREE.Color;
  /** Colour of the lines every five metres. */
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
  gl_Position = projectionMatrix * (viewMatrix * vec4(vWorld, 1.0));
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
${gridLines}
void main() {
  vec3 c = near;
  c = mix(c, line, grid(vWorld.xz, 1.1) * 0.8);
  c = mix(c, strong, grid(vWorld.xz / 5.0, 1.6) * 0.9);
  float d = clamp(length(cameraPosition - vWorld) / fogDistance, 0.0, 1.0);
  colour = vec4(mix(c, far, smoothstep(0.12, 1.0, d)), 1.0);
}`;

// Simplified grid for software renderers: a plane of one colour, and line primitives instead of
// lines computed per pixel.
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
in float kind;     // 0: plane, 1: line, 2: strong line
out vec4 vColour;
void main() {
  vec3 world = vec3(position.x + centre.x, 0.0, position.z + centre.z);
  vec3 c = kind < 0.5 ? near : kind < 1.5 ? mix(near, line, 0.75) : strong;
  float d = clamp(length(cameraPosition - world) / fogDistance, 0.0, 1.0);
  vColour = vec4(mix(c, far, smoothstep(0.12, 0.9, d)), 1.0);
  gl_Position = projectionMatrix * (viewMatrix * vec4(world, 1.0));
}`;

const plainFragment = /* glsl */ `
precision mediump float;
in vec4 vColour;
out vec4 colour;
void main() { colour = vColour; }`;

/**
 * A plane around the camera's target with lines every metre, and stronger ones every five metres.
 */
export class Grid {
  readonly object: THREE.Object3D;
  private readonly uniforms: Record<string, THREE.IUniform>;
  private fineLines: THREE.Object3D | null = null;

  /** `software` is true if the CPU renders. */
  constructor(colours: TerrainColours, software: boolean) {
    this.uniforms = {
      near: {value: colours.near}, far: {value: colours.far}, line: {value: colours.line},
      strong: {value: colours.strong}, centre: {value: new THREE.Vector3()},
      fogDistance: {value: 90},
    };
    this.object = software ? this.makeSimple() : this.makeDetailed();
  }

  /** Centres the plane on the strong lines near x, z. `distanceM` is the camera's distance. */
  follow(x: number, z: number, distanceM: number): void {
    // From far away, lines every metre would merge into a grey area.
    if (this.fineLines) this.fineLines.visible = distanceM < 24;
    const centre = this.uniforms['centre']!.value as THREE.Vector3;
    centre.set(Math.round(x / 5) * 5, 0, Math.round(z / 5) * 5);
  }

  private makeDetailed(): THREE.Object3D {
    const plane = new THREE.PlaneGeometry(400, 400, 8, 8).rotateX(-Math.PI / 2);
    const mesh = new THREE.Mesh(plane, new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: gridVertex, fragmentShader: gridFragment,
      uniforms: this.uniforms, depthWrite: false,
    }));
    mesh.frustumCulled = false;
    mesh.renderOrder = -3;
    return mesh;
  }

  private makeSimple(): THREE.Object3D {
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: plainVertex, fragmentShader: plainFragment,
      uniforms: this.uniforms, depthWrite: false, depthTest: false,
    });
    // Rings of vertices that are closer together near the centre, where colours change most.
    const plane = new THREE.BufferGeometry();
    const places: number[] = [0, 0, 0];
    const index: number[] = [];
    const sides = 20;
    const radii = [6, 13, 22, 34, 50, 75, 300];
    radii.forEach((radius, r) => {
      for (let k = 0; k < sides; ++k) {
        const angle = k / sides * 2 * Math.PI;
        places.push(radius * Math.sin(angle), 0, radius * Math.cos(angle));
        const here = 1 + r * sides + k;
        const next = 1 + r * sides + (k + 1) % sides;
        if (r === 0) index.push(0, here, next);
        else index.push(here - sides, here, next, here - sides, next, next - sides);
      }
    });
    plane.setAttribute('position', new THREE.BufferAttribute(new Float32Array(places), 3));
    plane.setIndex(index);
    const count = places.length / 3;
    plane.setAttribute('kind', new THREE.BufferAttribute(new Float32Array(count), 1));
    const group = new THREE.Group();
    const ground = new THREE.Mesh(plane, material);
    this.fineLines = new THREE.LineSegments(gridLineGeometry(20, 1), material);
    const strong = new THREE.LineSegments(gridLineGeometry(40, 5), material);
    ground.renderOrder = -3;
    this.fineLines.renderOrder = -2;
    strong.renderOrder = -1;
    ground.frustumCulled = this.fineLines.frustumCulled = strong.frustumCulled = false;
    group.add(ground, this.fineLines, strong);
    return group;
  }
}

/**
 * Returns grid lines in a square with sides of 2 * `half` metres. `every` 1: lines every metre
 * except the strong ones; `every` 5: only the strong lines, every five metres.
 */
function gridLineGeometry(half: number, every: number): THREE.BufferGeometry {
  const positions: number[] = [];
  const kinds: number[] = [];
  const piece = 8;  // Length of the pieces of a line, in metres. Each vertex has its own colour.
  for (let i = -half; i <= half; i += every) {
    if (every === 1 && i % 5 === 0) continue;
    for (let from = -half; from < half; from += piece) {
      const to = Math.min(half, from + piece);
      positions.push(i, 0, from, i, 0, to, from, 0, i, to, 0, i);
      const kind = every === 1 ? 1 : 2;
      kinds.push(kind, kind, kind, kind);
    }
  }
  const lines = new THREE.BufferGeometry();
  lines.setAttribute('position', new THREE.BufferAttribute(new Float32Array(positions), 3));
  lines.setAttribute('kind', new THREE.BufferAttribute(new Float32Array(kinds), 1));
  return lines;
}
