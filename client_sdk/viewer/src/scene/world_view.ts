// One world as it is seen: its crowd, the marks on its ground, and a camera's target.

import * as THREE from 'three';

import type {World, WorldEvent} from '../sdk.js';
import {createCrowdPose} from '../sdk.js';
import type {Orbit} from './camera.js';
import {ViewCamera} from './camera.js';
import {CrowdMesh} from './crowd_mesh.js';
import type {Lights} from './crowd_mesh.js';
import {mostPrints} from '../quality.js';
import type {FigureStyle} from '../quality.js';
import {matrixFloats} from './kinematics.js';
import {Ground} from '../terrain_surface.js';
import {Footprints} from './footprints.js';
import {Grid} from './grid.js';
import type {GroundColours} from './grid.js';
import {blobs, goalKinds, goals, planned, rings} from './ground_decals.js';
import {TerrainMesh} from './terrain_mesh.js';

const markCapacity = 8192;
const mostPlanned = 64;
const mostGoalMarks = 1024;
/** Half the width of goals and places to pass; arrows lie before their goal, larger while they are turned. */
const goalSizeM = 0.24;
const waypointSizeM = 0.17;
const arrowSizeM = {heading: 0.16, turning: 0.26} as const;
/** A ball of the foot slower and lower than this carries the figure. */
const plantedSpeedMs = 0.22;
const plantedHeightM = 0.14;

export interface ViewColours {
  lights: Lights;
  ground: GroundColours;
  shade: THREE.Color;
  left: THREE.Color;
  right: THREE.Color;
  accent: THREE.Color;
}

export interface ViewOptions {
  style: FigureStyle;
  coarse: boolean;
  shadows: boolean;
  simple: boolean;
  /** Footprints kept at most. */
  mostPrints: number;
  prints: boolean;
  plants: boolean;
  /** What is quick to draw without a graphics card. */
  readonly plainGround: boolean;
}

/** What a walk ends at, the way it looks there (chosen just now: `turning`), and what it passes. */
export interface GoalMark {
  readonly kind: keyof typeof goalKinds;
  readonly atM: readonly [number, number, number];
  readonly headingRad: number;
}

export class WorldView {
  readonly scene = new THREE.Scene();
  readonly view = new ViewCamera();
  readonly pose = createCrowdPose();
  crowd: CrowdMesh | null = null;
  readonly footprints: Footprints;
  /** What is drawn, in CSS pixels from the top left; `free` is the part no panel covers. */
  readonly box = {x: 0, y: 0, width: 1, height: 1};
  readonly free = {x: 0, y: 0, width: 1, height: 1};
  framed = false;
  wantDistanceM = 8;
  /** How many goals and places to pass are marked. */
  goalCount = 0;
  waypointCount = 0;
  chosen = 0;
  following = 0;

  private readonly grid: Grid;
  private readonly blobs = blobs(markCapacity);
  private readonly rings = rings(markCapacity);
  private readonly options: ViewOptions;
  private readonly colours: ViewColours;
  private previous = new Float32Array(0);
  private previousAvatars = new Uint32Array(0);
  private planted = new Uint8Array(0);
  private previousS = 0;
  private live = true;
  private readonly headings = new Map<number, number>();
  private readonly unsubscribe: (() => void)[];
  private readonly planned = planned(mostPlanned);
  private plannedVersion = '';
  private readonly goals = goals(mostGoalMarks);
  private goalsVersion = '';
  private terrainMesh: TerrainMesh | null = null;
  /** What the world stands on. */
  ground = new Ground(null);

  constructor(readonly world: World, colours: ViewColours, options: ViewOptions) {
    this.colours = colours;
    this.options = options;
    this.grid = new Grid(colours.ground, options.plainGround);
    this.footprints = new Footprints(mostPrints, colours.left, colours.right);
    this.scene.add(this.grid.object, this.blobs.mesh, this.rings.mesh, this.footprints.marks.mesh,
      this.planned.mesh, this.goals.mesh);
    this.unsubscribe = [
      world.on('event', (event) => this.onEvent(event)), world.on('terrain', () => this.takeTerrain())];
    this.takeTerrain();
  }

  private takeTerrain(): void {
    if (this.world.terrain === this.ground.terrain) return;
    if (this.terrainMesh) {
      this.scene.remove(this.terrainMesh.object);
      this.terrainMesh.dispose();
      this.terrainMesh = null;
    }
    this.ground = new Ground(this.world.terrain);
    this.footprints.clear();
    this.plannedVersion = this.goalsVersion = 'as it lay';
    if (this.ground.flat) return;
    this.terrainMesh = new TerrainMesh(
      this.ground, this.colours.ground, this.colours.lights.sun, this.options.plainGround);
    this.scene.add(this.terrainMesh.object);
  }

  /** Marks where feet are to land. */
  plan(footprints: readonly {readonly atM: readonly [number, number, number]; readonly headingRad: number}[]): void {
    const {accent} = this.colours;
    const version = footprints.map(({atM, headingRad}) => `${atM.join()}/${headingRad}`).join(' ') + accent.r;
    if (version === this.plannedVersion) return;
    this.plannedVersion = version;
    const count = Math.min(footprints.length, mostPlanned);
    for (let i = 0; i < count; ++i) {
      const {atM, headingRad} = footprints[i]!;
      this.planned.set(
        i, this.ground, atM[0], atM[2], headingRad, 0.17, accent.r, accent.g, accent.b, 0.95);
    }
    this.planned.show(count);
  }

  /** Marks of walks. */
  showGoals(marks: readonly GoalMark[]): void {
    const {r, g, b} = this.colours.accent;
    const version = marks.map(({kind, atM, headingRad}) => `${kind} ${atM.join()}/${headingRad}`).join(' ') + r;
    if (version === this.goalsVersion) return;
    this.goalsVersion = version;
    const count = Math.min(marks.length, mostGoalMarks);
    this.goalCount = this.waypointCount = 0;
    for (let i = 0; i < count; ++i) {
      const {kind, atM: [x, , z], headingRad} = marks[i]!;
      let [ahead, size] = [0, kind === 'goal' ? goalSizeM : waypointSizeM];
      if (kind === 'heading' || kind === 'turning') {
        size = arrowSizeM[kind];
        ahead = goalSizeM + 0.02 + size;
      }
      if (kind === 'goal') ++this.goalCount;
      if (kind === 'waypoint') ++this.waypointCount;
      this.goals.set(i, this.ground, x + Math.sin(headingRad) * ahead, z + Math.cos(headingRad) * ahead,
        headingRad, size, r, g, b, goalKinds[kind]);
    }
    this.goals.show(count);
  }

  /** Where a point of the page lies on the ground; null: nowhere near. */
  groundAt(x: number, y: number): [number, number, number] | null {
    const {camera} = this.view;
    const origin = point.setFromMatrixPosition(camera.matrixWorld);
    const way = direction.set(
      (x - this.box.x) / this.box.width * 2 - 1, 1 - (y - this.box.y) / this.box.height * 2, 0.5)
      .unproject(camera).sub(origin).normalize();
    const out = {x: 0, y: 0, z: 0};
    return this.ground.meet(
      origin.x, origin.y, origin.z, way.x, way.y, way.z, 120, out) ? [out.x, out.y, out.z] : null;
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
    this.footprints.marks.dispose();
  }

  /** Poses, matrices and marks for time `timeS`; how many avatars there are. */
  update(timeS: number, live: boolean): number {
    const skeleton = this.world.skeleton;
    if (!skeleton) return 0;
    if (!this.crowd || this.crowd.skeleton !== skeleton) {
      this.crowd?.dispose();
      if (this.crowd) this.scene.remove(this.crowd.group);
      this.crowd = new CrowdMesh(
        skeleton, this.options.style, this.colours.lights, this.options.plainGround);
      this.scene.add(this.crowd.group);
    }
    this.live = live;
    const crowd = this.crowd;
    crowd.setStyle(this.options.style, this.options.coarse, this.options.simple);
    crowd.setShadows(this.options.shadows);
    crowd.choose(this.chosen);
    if (live) this.world.sampleAll(timeS, this.pose);
    else this.world.recording.sampleAll(timeS, this.pose);
    crowd.update(this.pose, this.ground);
    this.mark(timeS);
    this.footprints.limit = this.options.mostPrints;
    this.footprints.at(timeS);
    this.footprints.marks.mesh.visible = this.options.prints;
    this.rings.mesh.visible = this.options.plants;
    return crowd.count;
  }

  indexOf(avatar: number): number {
    const crowd = this.crowd;
    if (!crowd || avatar === 0) return -1;
    for (let i = 0; i < crowd.count; ++i) if (crowd.avatars[i] === avatar) return i;
    return -1;
  }

  /** Where an avatar stands and looks; null when it is not seen. */
  place(avatar: number): {x: number; z: number; headingRad: number} | null {
    const i = this.indexOf(avatar);
    if (i < 0 || !this.crowd) return null;
    const n = this.crowd.skeleton.jointCount;
    const m = i * n * matrixFloats;
    const {matrices, positions} = this.crowd;
    return {
      x: positions[i * n * 3]!, z: positions[i * n * 3 + 2]!,
      headingRad: Math.atan2(matrices[m + 2]!, matrices[m + 10]!)};
  }

  /** Aims at the avatar followed. */
  follow(): void {
    const i = this.indexOf(this.following);
    if (i < 0 || !this.crowd) return;
    const at = i * this.crowd.skeleton.jointCount * 3;
    const x = this.crowd.positions[at]!;
    const z = this.crowd.positions[at + 2]!;
    this.view.moveTo(x, this.ground.heightAt(x, z) + this.crowd.heightM * 0.5, z);
  }

  /** Centre and radius of all that lives here, on the ground; null when nothing does. */
  extent(): {x: number; z: number; radius: number} | null {
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

  /** Aims the grid and the camera; call after `follow`. */
  aim(orbit: Orbit, dtS: number): void {
    this.view.advance(orbit, dtS, this.free, this.box, this.ground);
    this.grid.follow(this.view.target.x, this.view.target.z, orbit.distanceM * this.view.scale);
  }

  /** The avatar whose joints come nearest to a point of the screen, within `reachPx`; 0: none. */
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
      // The nearer of two that overlap.
      const cost = near + depth * 4;
      if (near <= reachPx && cost < bestCost) {
        bestCost = cost;
        best = crowd.avatars[i]!;
      }
    }
    return best;
  }

  /** Where a point of the world is on the screen: `projected`; false behind the camera. */
  project(points: ArrayLike<number>, at: number): boolean {
    point.set(points[at]!, points[at + 1]!, points[at + 2]!);
    const depth = -point.applyMatrix4(this.view.camera.matrixWorldInverse).z;
    if (depth < 0.05) return false;
    point.applyMatrix4(this.view.camera.projectionMatrix);
    projected.x = this.box.x + (point.x * 0.5 + 0.5) * this.box.width;
    projected.y = this.box.y + (0.5 - point.y * 0.5) * this.box.height;
    projected.z = depth;
    return true;
  }

  /** The same for a single point; null behind the camera. */
  onPage(point: readonly [number, number, number]): {x: number; y: number} | null {
    return this.project(point, 0) ? {x: projected.x, y: projected.y} : null;
  }
  /** How many footprints are marked that wait. */
  get plannedCount(): number {
    return this.planned.count;
  }

  private onEvent(event: WorldEvent): void {
    if (event.type === 'removed') this.headings.delete(event.avatar);
    if (event.type !== 'footStrike' || !event.foot) return;
    // The event says where, the figure which way the foot points: a tenth of a second before it
    // lands, when live; else as it did last.
    if (this.live) this.headings.set(event.avatar, this.footHeading(event.avatar, event.foot));
    this.footprints.add(event.timeS, this.ground, event.positionM[0], event.positionM[2],
      this.headings.get(event.avatar) ?? 0, event.foot === 'left' ? 0 : 1);
  }

  private footHeading(avatar: number, foot: 'left' | 'right'): number {
    const crowd = this.crowd;
    const i = this.indexOf(avatar);
    if (!crowd || i < 0) return this.headings.get(avatar) ?? 0;
    const leg = foot === 'left' ? crowd.skeleton.leftLeg : crowd.skeleton.rightLeg;
    const ankle = (i * crowd.skeleton.jointCount + Math.max(leg.ankle, 0)) * 3;
    const ball = i * 6 + (foot === 'left' ? 0 : 3);
    return Math.atan2(crowd.balls[ball]! - crowd.positions[ankle]!,
      crowd.balls[ball + 2]! - crowd.positions[ankle + 2]!);
  }

  private mark(timeS: number): void {
    const crowd = this.crowd!;
    const n = crowd.count;
    if (this.planted.length < n * 2) {
      this.planted = new Uint8Array(n * 4);
      this.previous = new Float32Array(n * 12);
      this.previousAvatars = new Uint32Array(n * 2);
    }
    const dt = timeS - this.previousS;
    const measure = Math.abs(dt) > 0.004;
    const soon = Math.abs(dt) < 0.25;
    const stride = crowd.skeleton.jointCount * 3;
    const {ground} = this;
    const {shade, accent, left, right} = this.colours;
    let blob = 0;
    let ring = 0;
    for (let i = 0; i < n; ++i) {
      const avatar = crowd.avatars[i]!;
      const known = this.previousAvatars[i] === avatar;
      const chosen = avatar === this.chosen;
      const rootAt = i * stride;
      if (blob < markCapacity) {
        this.blobs.set(blob++, ground, crowd.positions[rootAt]!, crowd.positions[rootAt + 2]!, 0,
          crowd.heightM * 0.28, shade.r, shade.g, shade.b, 0.5);
      }
      if (chosen && ring < markCapacity) {
        this.rings.set(ring++, ground, crowd.positions[rootAt]!, crowd.positions[rootAt + 2]!, 0,
          crowd.heightM * 0.3, accent.r, accent.g, accent.b, 0.8);
      }
      for (let f = 0; f < 2; ++f) {
        const at = i * 6 + f * 3;
        const x = crowd.balls[at]!;
        const y = crowd.balls[at + 1]!;
        const z = crowd.balls[at + 2]!;
        const above = y - ground.heightAt(x, z);
        const p = i * 2 + f;
        if (measure) {
          const moved = Math.hypot(
            x - this.previous[at]!, y - this.previous[at + 1]!, z - this.previous[at + 2]!);
          this.planted[p] = known && soon && above < plantedHeightM &&
            moved / Math.abs(dt) < plantedSpeedMs ? 1 : 0;
          this.previous[at] = x;
          this.previous[at + 1] = y;
          this.previous[at + 2] = z;
        }
        if (!this.options.simple && blob < markCapacity) {
          const near = Math.min(1, Math.max(0, 1 - above / 0.5));
          this.blobs.set(blob++, ground, x, z, 0, crowd.heightM * 0.085, shade.r, shade.g, shade.b, 0.75 * near);
        }
        if (this.planted[p] && ring < markCapacity) {
          const c = f === 0 ? left : right;
          this.rings.set(ring++, ground, x, z, 0, crowd.heightM * 0.066, c.r, c.g, c.b, 0.95);
        }
      }
      if (measure) this.previousAvatars[i] = avatar;
    }
    if (measure) this.previousS = timeS;
    this.blobs.show(blob);
    this.rings.show(ring);
  }

  /** Whether the left and right foot of the avatar at `index` carry it. */
  feetPlanted(index: number): [boolean, boolean] {
    return [this.planted[index * 2] === 1, this.planted[index * 2 + 1] === 1];
  }
}

const point = new THREE.Vector3();
const direction = new THREE.Vector3();
/** The last point projected: CSS pixels, and metres from the camera. */
export const projected = {x: 0, y: 0, z: 0};
