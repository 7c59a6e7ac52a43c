// The scene of one world: its crowd, its terrain with decals, and its camera.

import * as THREE from 'three';

import type {World, WorldEvent} from '../sdk.js';
import {createCrowdPose} from '../sdk.js';
import type {Orbit} from './camera.js';
import {ViewCamera} from './camera.js';
import {CrowdMesh} from './crowd_mesh.js';
import type {Lights} from './crowd_mesh.js';
import {maxFootprints} from '../quality.js';
import type {FigureStyle} from '../quality.js';
import {floatsPerMatrix} from './kinematics.js';
import {TerrainSurface} from '../terrain_surface.js';
import {Footprints} from './footprints.js';
import {Grid} from './grid.js';
import type {TerrainColours} from './grid.js';
import {
  goalDecalKinds, makeBlobs, makeGoals, makePlannedFootprints, makeRings,
} from './ground_decals.js';
import {TerrainMesh} from './terrain_mesh.js';

const decalCapacity = 8192;
const maxPlannedFootprints = 64;
const maxGoalDecals = 1024;
/** Half the width of a decal, in metres. A heading arrow is larger while the user drags it. */
const goalSizeM = 0.24;
const waypointSizeM = 0.17;
const arrowSizeM = {heading: 0.16, draggedHeading: 0.26} as const;
/**
 * A foot counts as planted if the speed of its ball and its height above the ground are below these
 * limits.
 */
const plantedSpeedMPerS = 0.22;
const plantedHeightM = 0.14;

export interface ViewColours {
  lights: Lights;
  terrain: TerrainColours;
  shade: THREE.Color;
  left: THREE.Color;
  right: THREE.Color;
  accent: THREE.Color;
}

export interface ViewOptions {
  style: FigureStyle;
  coarse: boolean;
  shadows: boolean;
  simplified: boolean;
  /** Maximum number of footprints drawn. */
  maxFootprints: number;
  footprints: boolean;
  plantedFeet: boolean;
  /** True if the CPU renders. Terrain and crowd are then drawn in simpler ways. */
  readonly software: boolean;
}

/** A marker on the ground for a walk: its goal, a waypoint, or the heading at the goal. */
export interface GoalDecal {
  readonly kind: keyof typeof goalDecalKinds;
  readonly atM: readonly [number, number, number];
  readonly headingRad: number;
}

export class WorldView {
  readonly scene = new THREE.Scene();
  readonly viewCamera = new ViewCamera();
  readonly pose = createCrowdPose();
  crowd: CrowdMesh | null = null;
  readonly footprints: Footprints;
  /** The part of the page where the scene is drawn, in CSS pixels from the page's top left. */
  readonly viewport = {x: 0, y: 0, width: 1, height: 1};
  /** The part of `viewport` that no panel covers. */
  readonly freeArea = {x: 0, y: 0, width: 1, height: 1};
  /** True if the camera has framed the avatars at least once. */
  wasFramed = false;
  desiredDistanceM = 8;
  /** Numbers of goals and waypoints drawn. */
  goalCount = 0;
  waypointCount = 0;
  /** Id of the selected avatar; 0 if there is none. */
  selectedAvatar = 0;
  /** Id of the avatar that the camera follows; 0 if there is none. */
  followedAvatar = 0;

  private readonly grid: Grid;
  private readonly blobs = makeBlobs(decalCapacity);
  private readonly rings = makeRings(decalCapacity);
  private readonly options: ViewOptions;
  private readonly colours: ViewColours;
  /** Positions of the balls of both feet at `previousTimeS`, 6 numbers per avatar. */
  private previousBalls = new Float32Array(0);
  private previousAvatars = new Uint32Array(0);
  /** Two numbers per avatar, for its left and right foot: 1 if the foot is planted. */
  private planted = new Uint8Array(0);
  private previousTimeS = 0;
  private live = true;
  /** Heading of the last footprint of each avatar, by avatar id. */
  private readonly lastFootHeadings = new Map<number, number>();
  private readonly unsubscribe: (() => void)[];
  private readonly planned = makePlannedFootprints(maxPlannedFootprints);
  /** Describes the planned footprints. Their decals are uploaded only if this text changes. */
  private plannedVersion = '';
  private readonly goals = makeGoals(maxGoalDecals);
  private goalsVersion = '';
  private terrainMesh: TerrainMesh | null = null;
  terrain = new TerrainSurface(null);

  constructor(readonly world: World, colours: ViewColours, options: ViewOptions) {
    this.colours = colours;
    this.options = options;
    this.grid = new Grid(colours.terrain, options.software);
    this.footprints = new Footprints(maxFootprints, colours.left, colours.right);
    this.scene.add(this.grid.object, this.blobs.mesh, this.rings.mesh, this.footprints.decals.mesh,
      this.planned.mesh, this.goals.mesh);
    this.unsubscribe = [
      world.on('event', (event) => this.onEvent(event)),
      world.on('terrain', () => this.updateTerrain())];
    this.updateTerrain();
  }

  private updateTerrain(): void {
    if (this.world.terrain === this.terrain.source) return;
    if (this.terrainMesh) {
      this.scene.remove(this.terrainMesh.object);
      this.terrainMesh.dispose();
      this.terrainMesh = null;
    }
    this.terrain = new TerrainSurface(this.world.terrain);
    this.footprints.clear();
    this.plannedVersion = this.goalsVersion = 'outdated';
    if (this.terrain.isFlat) return;
    this.terrainMesh = new TerrainMesh(
      this.terrain, this.colours.terrain, this.colours.lights.sun, this.options.software);
    this.scene.add(this.terrainMesh.object);
  }

  /** Draws outlines where feet will land. */
  showPlannedFootprints(footprints: readonly {
    readonly atM: readonly [number, number, number]; readonly headingRad: number;
  }[]): void {
    const {accent} = this.colours;
    const version =
      footprints.map(({atM, headingRad}) => `${atM.join()}/${headingRad}`).join(' ') + accent.r;
    if (version === this.plannedVersion) return;
    this.plannedVersion = version;
    const count = Math.min(footprints.length, maxPlannedFootprints);
    for (let i = 0; i < count; ++i) {
      const {atM, headingRad} = footprints[i]!;
      this.planned.set(
        i, this.terrain, atM[0], atM[2], headingRad, 0.17, accent.r, accent.g, accent.b, 0.95);
    }
    this.planned.upload(count);
  }

  /** Draws the goals, headings and waypoints of walks. */
  showGoals(decals: readonly GoalDecal[]): void {
    const {r, g, b} = this.colours.accent;
    const version =
      decals.map(({kind, atM, headingRad}) => `${kind} ${atM.join()}/${headingRad}`).join(' ') + r;
    if (version === this.goalsVersion) return;
    this.goalsVersion = version;
    const count = Math.min(decals.length, maxGoalDecals);
    this.goalCount = this.waypointCount = 0;
    for (let i = 0; i < count; ++i) {
      const {kind, atM: [x, , z], headingRad} = decals[i]!;
      let [ahead, size] = [0, kind === 'goal' ? goalSizeM : waypointSizeM];
      if (kind === 'heading' || kind === 'draggedHeading') {
        size = arrowSizeM[kind];
        ahead = goalSizeM + 0.02 + size;
      }
      if (kind === 'goal') ++this.goalCount;
      if (kind === 'waypoint') ++this.waypointCount;
      this.goals.set(i, this.terrain,
        x + Math.sin(headingRad) * ahead, z + Math.cos(headingRad) * ahead,
        headingRad, size, r, g, b, goalDecalKinds[kind]);
    }
    this.goals.upload(count);
  }

  /**
   * Returns the terrain point beneath a point of the page, or null if there is none within 120 m.
   */
  terrainPointAt(x: number, y: number): [number, number, number] | null {
    const {viewCamera: {camera}, viewport} = this;
    const origin = point.setFromMatrixPosition(camera.matrixWorld);
    const ray = direction.set(
      (x - viewport.x) / viewport.width * 2 - 1, 1 - (y - viewport.y) / viewport.height * 2, 0.5)
      .unproject(camera).sub(origin).normalize();
    const out = {x: 0, y: 0, z: 0};
    return this.terrain.raycast(
      origin.x, origin.y, origin.z, ray.x, ray.y, ray.z, 120, out) ? [out.x, out.y, out.z] : null;
  }

  get name(): string {
    return this.world.name;
  }

  dispose(): void {
    for (const unsubscribe of this.unsubscribe) unsubscribe();
    this.crowd?.dispose();
    this.terrainMesh?.dispose();
    this.planned.dispose();
    this.goals.dispose();
    this.blobs.dispose();
    this.rings.dispose();
    this.footprints.decals.dispose();
  }

  /**
   * Updates the scene to server time `timeS`, from the recording unless `live`. Returns the number
   * of avatars.
   */
  update(timeS: number, live: boolean): number {
    const skeleton = this.world.skeleton;
    if (!skeleton) return 0;
    if (!this.crowd || this.crowd.skeleton !== skeleton) {
      this.crowd?.dispose();
      if (this.crowd) this.scene.remove(this.crowd.group);
      this.crowd = new CrowdMesh(
        skeleton, this.options.style, this.colours.lights, this.options.software);
      this.scene.add(this.crowd.group);
    }
    this.live = live;
    const crowd = this.crowd;
    crowd.setStyle(this.options.style, this.options.coarse, this.options.simplified);
    crowd.setShadows(this.options.shadows);
    crowd.setSelected(this.selectedAvatar);
    if (live) this.world.sampleAll(timeS, this.pose);
    else this.world.recording.sampleAll(timeS, this.pose);
    crowd.update(this.pose, this.terrain);
    this.updateDecals(timeS);
    this.footprints.limit = this.options.maxFootprints;
    this.footprints.update(timeS);
    this.footprints.decals.mesh.visible = this.options.footprints;
    this.rings.mesh.visible = this.options.plantedFeet;
    return crowd.count;
  }

  /** Returns the index of an avatar in the crowd's arrays, or -1 if it is not drawn. */
  indexOf(avatar: number): number {
    const crowd = this.crowd;
    if (!crowd || avatar === 0) return -1;
    for (let i = 0; i < crowd.count; ++i) if (crowd.avatars[i] === avatar) return i;
    return -1;
  }

  /** Returns the position and heading of an avatar's root, or null if it is not drawn. */
  locate(avatar: number): {x: number; z: number; headingRad: number} | null {
    const i = this.indexOf(avatar);
    if (i < 0 || !this.crowd) return null;
    const n = this.crowd.skeleton.jointCount;
    const m = i * n * floatsPerMatrix;
    const {matrices, positions} = this.crowd;
    return {
      x: positions[i * n * 3]!, z: positions[i * n * 3 + 2]!,
      headingRad: Math.atan2(matrices[m + 2]!, matrices[m + 10]!)};
  }

  /** Aims the camera at the followed avatar. */
  aimAtFollowed(): void {
    const i = this.indexOf(this.followedAvatar);
    if (i < 0 || !this.crowd) return;
    const at = i * this.crowd.skeleton.jointCount * 3;
    const x = this.crowd.positions[at]!;
    const z = this.crowd.positions[at + 2]!;
    this.viewCamera.moveTo(x, this.terrain.heightAt(x, z) + this.crowd.heightM * 0.5, z);
  }

  /**
   * Returns centre and radius, in metres, of the area where avatars are; null if there are none.
   */
  bounds(): {x: number; z: number; radius: number} | null {
    const crowd = this.crowd;
    if (!crowd || crowd.count === 0) return null;
    const stride = crowd.skeleton.jointCount * 3;
    let [x0, x1, z0, z1] = [Infinity, -Infinity, Infinity, -Infinity];
    for (let i = 0; i < crowd.count; ++i) {
      const x = crowd.positions[i * stride]!;
      const z = crowd.positions[i * stride + 2]!;
      x0 = Math.min(x0, x);
      x1 = Math.max(x1, x);
      z0 = Math.min(z0, z);
      z1 = Math.max(z1, z);
    }
    const x = (x0 + x1) / 2;
    const z = (z0 + z1) / 2;
    let radius = 0;
    for (let i = 0; i < crowd.count; ++i) {
      radius = Math.max(radius,
        Math.hypot(crowd.positions[i * stride]! - x, crowd.positions[i * stride + 2]! - z));
    }
    return {x, z, radius};
  }

  /** Updates the camera and centres the grid. Call after `aimAtFollowed`. */
  updateCamera(orbit: Orbit, dtS: number): void {
    this.viewCamera.advance(orbit, dtS, this.freeArea, this.viewport, this.terrain);
    const {target, scale} = this.viewCamera;
    this.grid.follow(target.x, target.z, orbit.distanceM * scale);
  }

  /**
   * Returns an avatar that has a joint within `reachPx` of a point of the page; 0 if there is none.
   * Of several, it selects the one that is closest to the point and to the camera.
   */
  pick(x: number, y: number, reachPx: number): number {
    const crowd = this.crowd;
    if (!crowd) return 0;
    const n = crowd.skeleton.jointCount;
    let best = 0;
    let bestCost = Infinity;
    for (let i = 0; i < crowd.count; ++i) {
      let near = Infinity;
      let depth = 0;
      for (let j = 0; j < n; ++j) {
        if (!this.project(crowd.positions, (i * n + j) * 3)) continue;
        const d = Math.hypot(projected.x - x, projected.y - y);
        if (d < near) {
          near = d;
          depth = projected.z;
        }
      }
      // One metre of depth counts as much as 4 pixels.
      const cost = near + depth * 4;
      if (near <= reachPx && cost < bestCost) {
        bestCost = cost;
        best = crowd.avatars[i]!;
      }
    }
    return best;
  }

  /**
   * Projects the point whose x, y and z begin at index `at` of `points`. Writes its position on the
   * page in CSS pixels and its depth in metres to `projected`. Returns false if it is behind the
   * camera or less than 5 cm in front of it.
   */
  project(points: ArrayLike<number>, at: number): boolean {
    point.set(points[at]!, points[at + 1]!, points[at + 2]!);
    const depth = -point.applyMatrix4(this.viewCamera.camera.matrixWorldInverse).z;
    if (depth < 0.05) return false;
    point.applyMatrix4(this.viewCamera.camera.projectionMatrix);
    projected.x = this.viewport.x + (point.x * 0.5 + 0.5) * this.viewport.width;
    projected.y = this.viewport.y + (0.5 - point.y * 0.5) * this.viewport.height;
    projected.z = depth;
    return true;
  }

  /** Returns the position of a world point on the page, or null if it is behind the camera. */
  projectToPage(point: readonly [number, number, number]): {x: number; y: number} | null {
    return this.project(point, 0) ? {x: projected.x, y: projected.y} : null;
  }
  /** Number of planned footprints that are drawn now. */
  get plannedCount(): number {
    return this.planned.count;
  }

  private onEvent(event: WorldEvent): void {
    if (event.type === 'removed') this.lastFootHeadings.delete(event.avatar);
    if (event.type !== 'footStrike' || !event.foot) return;
    // The event has the position, but no heading. While live, the heading comes from the drawn
    // pose, about 0.1 s before the foot lands; otherwise from the avatar's previous footprint.
    if (this.live) {
      this.lastFootHeadings.set(event.avatar, this.footHeading(event.avatar, event.foot));
    }
    this.footprints.add(event.timeS, this.terrain, event.positionM[0], event.positionM[2],
      this.lastFootHeadings.get(event.avatar) ?? 0, event.foot === 'left' ? 0 : 1);
  }

  private footHeading(avatar: number, foot: 'left' | 'right'): number {
    const crowd = this.crowd;
    const i = this.indexOf(avatar);
    if (!crowd || i < 0) return this.lastFootHeadings.get(avatar) ?? 0;
    const leg = foot === 'left' ? crowd.skeleton.leftLeg : crowd.skeleton.rightLeg;
    const ankle = (i * crowd.skeleton.jointCount + Math.max(leg.ankle, 0)) * 3;
    const ball = i * 6 + (foot === 'left' ? 0 : 3);
    return Math.atan2(crowd.footBalls[ball]! - crowd.positions[ankle]!,
      crowd.footBalls[ball + 2]! - crowd.positions[ankle + 2]!);
  }

  private updateDecals(timeS: number): void {
    const crowd = this.crowd!;
    const n = crowd.count;
    if (this.planted.length < n * 2) {
      this.planted = new Uint8Array(n * 4);
      this.previousBalls = new Float32Array(n * 12);
      this.previousAvatars = new Uint32Array(n * 2);
    }
    const dt = timeS - this.previousTimeS;
    const measurable = Math.abs(dt) > 0.004;
    const recent = Math.abs(dt) < 0.25;
    const stride = crowd.skeleton.jointCount * 3;
    const {terrain} = this;
    const {shade, accent, left, right} = this.colours;
    let blob = 0;
    let ring = 0;
    for (let i = 0; i < n; ++i) {
      const avatar = crowd.avatars[i]!;
      const sameAvatar = this.previousAvatars[i] === avatar;
      const selected = avatar === this.selectedAvatar;
      const rootAt = i * stride;
      if (blob < decalCapacity) {
        this.blobs.set(blob++, terrain, crowd.positions[rootAt]!, crowd.positions[rootAt + 2]!, 0,
          crowd.heightM * 0.28, shade.r, shade.g, shade.b, 0.5);
      }
      if (selected && ring < decalCapacity) {
        this.rings.set(ring++, terrain, crowd.positions[rootAt]!, crowd.positions[rootAt + 2]!, 0,
          crowd.heightM * 0.3, accent.r, accent.g, accent.b, 0.8);
      }
      for (let f = 0; f < 2; ++f) {
        const at = i * 6 + f * 3;
        const x = crowd.footBalls[at]!;
        const y = crowd.footBalls[at + 1]!;
        const z = crowd.footBalls[at + 2]!;
        const above = y - terrain.heightAt(x, z);
        const p = i * 2 + f;
        if (measurable) {
          const moved = Math.hypot(
            x - this.previousBalls[at]!, y - this.previousBalls[at + 1]!,
            z - this.previousBalls[at + 2]!);
          this.planted[p] = sameAvatar && recent && above < plantedHeightM &&
            moved / Math.abs(dt) < plantedSpeedMPerS ? 1 : 0;
          this.previousBalls[at] = x;
          this.previousBalls[at + 1] = y;
          this.previousBalls[at + 2] = z;
        }
        if (!this.options.simplified && blob < decalCapacity) {
          const near = Math.min(1, Math.max(0, 1 - above / 0.5));
          this.blobs.set(blob++, terrain, x, z, 0, crowd.heightM * 0.085,
            shade.r, shade.g, shade.b, 0.75 * near);
        }
        if (this.planted[p] && ring < decalCapacity) {
          const c = f === 0 ? left : right;
          this.rings.set(ring++, terrain, x, z, 0, crowd.heightM * 0.066, c.r, c.g, c.b, 0.95);
        }
      }
      if (measurable) this.previousAvatars[i] = avatar;
    }
    if (measurable) this.previousTimeS = timeS;
    this.blobs.upload(blob);
    this.rings.upload(ring);
  }
}

const point = new THREE.Vector3();
const direction = new THREE.Vector3();
/** Result of `WorldView.project`: x and y in CSS pixels, z in metres from the camera. */
export const projected = {x: 0, y: 0, z: 0};
