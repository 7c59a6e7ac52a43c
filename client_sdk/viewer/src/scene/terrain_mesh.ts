// Terrain that is not flat: meshes of the height field and the boxes, with the 1 m grid on top.

import * as THREE from 'three';

import type {HeightField, Terrain} from '../sdk.js';
import type {TerrainSurface} from '../terrain_surface.js';
import type {TerrainColours} from './grid.js';
import {gridLines} from './grid_lines.js';

const vertexShader = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 sun;
in vec3 position;
in vec3 normal;
out vec3 vWorld;
out vec3 vLight;   // x: brightness; y: 1 for tops, 0 for sides; z: distance from the camera
void main() {
  vec4 seen = viewMatrix * vec4(position, 1.0);
  vWorld = position;
  vLight = vec3(0.62 + 0.5 * dot(normal, sun), step(0.5, normal.y), -seen.z);
  gl_Position = projectionMatrix * seen;
}`;

const fragmentShader = /* glsl */ `
precision highp float;
uniform vec3 near;
uniform vec3 far;
uniform vec3 line;
uniform vec3 strong;
uniform float fogDistance;
in vec3 vWorld;
in vec3 vLight;
out vec4 colour;
#ifndef NO_GRID
${gridLines}
#endif
void main() {
  vec3 c = mix(near, line, 0.28) * vLight.x;
#ifndef NO_GRID
  c = mix(c, line, grid(vWorld.xz, 1.1) * 0.8 * vLight.y);
  c = mix(c, strong, grid(vWorld.xz / 5.0, 1.6) * 0.9 * vLight.y);
#endif
  float d = clamp(vLight.z / fogDistance, 0.0, 1.0);
  colour = vec4(mix(c, far, smoothstep(0.12, 1.0, d)), 1.0);
}`;

const lineVertex = /* glsl */ `
precision highp float;
uniform mat4 viewMatrix;
uniform mat4 projectionMatrix;
uniform vec3 far;
uniform vec3 strong;
uniform float fogDistance;
in vec3 position;
out vec3 vColour;
void main() {
  vec4 seen = viewMatrix * vec4(position, 1.0);
  vColour = mix(strong, far, smoothstep(0.12, 0.9, clamp(-seen.z / fogDistance, 0.0, 1.0)));
  gl_Position = projectionMatrix * seen;
}`;

const lineFragment = /* glsl */ `
precision mediump float;
in vec3 vColour;
out vec4 colour;
void main() { colour = vec4(vColour, 1.0); }`;

/** Upper limit of cells drawn per side of a height field. Finer fields are subsampled. */
const maxCells = {software: 96, hardware: 384};
/** Maximum number of boxes drawn. If there are more, the smallest are not drawn. */
const maxBoxes = {software: 2000, hardware: 20_000};
/** Height of the lines above the surface, so that the surface does not hide them. */
const liftM = 0.004;

export class TerrainMesh {
  readonly object = new THREE.Group();

  /** `software` is true if the CPU renders. */
  constructor(
    terrain: TerrainSurface, colours: TerrainColours, sun: THREE.Vector3, software: boolean) {
    const {source} = terrain;
    if (source === null) return;
    const uniforms = {
      near: {value: colours.near}, far: {value: colours.far}, line: {value: colours.line},
      strong: {value: colours.strong}, sun: {value: sun}, fogDistance: {value: 90},
    };
    const surface = new MeshData();
    const lines: number[] = [];
    const limit = software ? 'software' : 'hardware';
    if (source.heightField) {
      addField(surface, source.heightField, maxCells[limit]);
      if (software) addGridLines(lines, source.heightField);
    }
    addBoxes(surface, lines, source, maxBoxes[limit]);
    const mesh = new THREE.Mesh(surface.geometry(), new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader, fragmentShader, uniforms,
      defines: software ? {NO_GRID: 1} : {},
      polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1,
    }));
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(lines), 3));
    const edges = new THREE.LineSegments(geometry, new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: lineVertex, fragmentShader: lineFragment, uniforms,
    }));
    mesh.frustumCulled = edges.frustumCulled = false;
    mesh.renderOrder = 0;
    edges.renderOrder = 1;
    this.object.add(mesh, edges);
  }

  dispose(): void {
    for (const child of this.object.children) {
      const {geometry, material} = child as THREE.Mesh;
      geometry.dispose();
      (material as THREE.Material).dispose();
    }
  }
}

/** Collects vertices and triangles. */
class MeshData {
  readonly positions: number[] = [];
  readonly normals: number[] = [];
  readonly indices: number[] = [];

  vertex(x: number, y: number, z: number, nx: number, ny: number, nz: number): void {
    this.positions.push(x, y, z);
    this.normals.push(nx, ny, nz);
  }
  /** Corners are counterclockwise as seen from outside. */
  quad(
    corners: readonly (readonly [number, number, number])[], nx: number, ny: number,
    nz: number): void {
    const first = this.positions.length / 3;
    for (const [x, y, z] of corners) this.vertex(x, y, z, nx, ny, nz);
    this.indices.push(first, first + 1, first + 2, first, first + 2, first + 3);
  }
  geometry(): THREE.BufferGeometry {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.Float32BufferAttribute(this.positions, 3));
    geometry.setAttribute('normal', new THREE.Float32BufferAttribute(this.normals, 3));
    geometry.setIndex(this.indices);
    return geometry;
  }
}

/**
 * Returns the indices of at most `cells` + 1 evenly spaced samples of `count`, including the first
 * and last.
 */
function sampledIndices(count: number, cells: number): number[] {
  const every = Math.max(1, Math.ceil((count - 1) / cells));
  const out: number[] = [];
  for (let i = 0; i < count - 1; i += every) out.push(i);
  out.push(count - 1);
  return out;
}

function addField(surface: MeshData, field: HeightField, cells: number): void {
  const {originM, cellM, columns, rows, heightsM} = field;
  const across = sampledIndices(columns, cells);
  const along = sampledIndices(rows, cells);
  const at = (c: number, r: number): number => heightsM[r * columns + c]!;
  const first = surface.positions.length / 3;
  for (const r of along) {
    for (const c of across) {
      const [c0, c1] = [Math.max(0, c - 1), Math.min(columns - 1, c + 1)];
      const [r0, r1] = [Math.max(0, r - 1), Math.min(rows - 1, r + 1)];
      const nx = -(at(c1, r) - at(c0, r)) / ((c1 - c0) * cellM);
      const nz = -(at(c, r1) - at(c, r0)) / ((r1 - r0) * cellM);
      const l = Math.hypot(nx, 1, nz);
      surface.vertex(
        originM[0] + c * cellM, at(c, r), originM[1] + r * cellM, nx / l, 1 / l, nz / l);
    }
  }
  for (let j = 0; j + 1 < along.length; ++j) {
    for (let i = 0; i + 1 < across.length; ++i) {
      const a = first + j * across.length + i;
      const b = a + across.length;
      surface.indices.push(a, b, a + 1, a + 1, b, b + 1);
    }
  }
}

/**
 * Adds lines along the height field, about one per metre, but fewer if the field is large. Used
 * with software renderers, where the fragment shader draws no grid.
 */
function addGridLines(lines: number[], field: HeightField): void {
  const {originM, cellM, columns, rows, heightsM} = field;
  const every = Math.max(1, Math.round(1 / cellM), Math.ceil(Math.max(columns, rows) / 80));
  const step = Math.max(1, Math.ceil(Math.max(columns, rows) / 160));
  const point = (c: number, r: number): void => {
    lines.push(originM[0] + c * cellM, heightsM[r * columns + c]! + liftM, originM[1] + r * cellM);
  };
  for (let r = 0; r < rows; r += every) {
    for (let c = 0; c + 1 < columns; c += step) {
      point(c, r);
      point(Math.min(columns - 1, c + step), r);
    }
  }
  for (let c = 0; c < columns; c += every) {
    for (let r = 0; r + 1 < rows; r += step) {
      point(c, r);
      point(c, Math.min(rows - 1, r + step));
    }
  }
}

function addBoxes(surface: MeshData, lines: number[], terrain: Terrain, limit: number): void {
  const low = Math.min(0, ...(terrain.heightField ? [lowest(terrain.heightField.heightsM)] : []));
  const size = ({minM, maxM}: Terrain['boxes'][number]): number =>
    (maxM[0] - minM[0]) * (maxM[1] - minM[1]);
  const boxes = terrain.boxes.length <= limit ? terrain.boxes :
    [...terrain.boxes].sort((a, b) => size(b) - size(a)).slice(0, limit);
  for (const {minM: [x0, z0], maxM: [x1, z1], heightM: h} of boxes) {
    if (h <= low) continue;
    surface.quad([[x0, h, z0], [x0, h, z1], [x1, h, z1], [x1, h, z0]], 0, 1, 0);
    surface.quad([[x0, low, z1], [x1, low, z1], [x1, h, z1], [x0, h, z1]], 0, 0, 1);
    surface.quad([[x1, low, z0], [x0, low, z0], [x0, h, z0], [x1, h, z0]], 0, 0, -1);
    surface.quad([[x1, low, z1], [x1, low, z0], [x1, h, z0], [x1, h, z1]], 1, 0, 0);
    surface.quad([[x0, low, z0], [x0, low, z1], [x0, h, z1], [x0, h, z0]], -1, 0, 0);
    const y = h + liftM;
    lines.push(
      x0, y, z0, x0, y, z1, x0, y, z1, x1, y, z1, x1, y, z1, x1, y, z0, x1, y, z0, x0, y, z0);
    for (const [x, z] of [[x0, z0], [x0, z1], [x1, z0], [x1, z1]] as const) {
      lines.push(x, low, z, x, h, z);
    }
  }
}

function lowest(heights: Float32Array): number {
  let low = Infinity;
  for (let i = 0; i < heights.length; ++i) low = Math.min(low, heights[i]!);
  return low;
}
