// The 3D preview of the library page: the synthesized step, and an example beside it.

import * as THREE from 'three';

import {makeRenderer} from '../renderer.js';
import type {RendererInfo} from '../renderer.js';
import {createCrowdPose} from '../sdk.js';
import {Orbit, ViewCamera, listenToPointers} from '../scene/camera.js';
import {CrowdMesh} from '../scene/crowd_mesh.js';
import type {SkeletonLike} from '../scene/body_parts.js';
import {Grid} from '../scene/grid.js';
import type {ViewColours} from '../scene/world_view.js';
import type {Clip} from './library_client.js';
import {durationOf, matchingTime, samplePose} from './clip_pose.js';

/** Distance between the two avatars. */
const spacingM = 1.1;

export class StepPreview {
  readonly canvas: HTMLCanvasElement;
  step: Clip | null = null;
  example: Clip | null = null;
  readonly pose = createCrowdPose();
  private readonly renderer: THREE.WebGLRenderer;
  private readonly scene = new THREE.Scene();
  private readonly view = new ViewCamera();
  private readonly orbit = new Orbit();
  private crowd: CrowdMesh | null = null;
  private skeleton: SkeletonLike | null = null;

  constructor(
    canvas: HTMLCanvasElement, info: RendererInfo, private readonly colours: ViewColours) {
    this.canvas = canvas;
    this.renderer = makeRenderer(canvas, info);
    this.scene.add(new Grid(colours.terrain, info.software).object);
    this.orbit.turn(0.2, -0.1);
    this.orbit.setDistance(4.2);
    this.orbit.advance(Infinity);
    listenToPointers(canvas, {
      orbit: (dx, dy) => this.orbit.turn(-dx * 0.006, dy * 0.006),
      pan: (dx, dy) => this.view.pan(
        this.orbit, -dx / Math.max(1, canvas.clientHeight), dy / Math.max(1, canvas.clientHeight)),
      zoom: (factor) => this.orbit.zoom(factor),
      click: () => {},
    });
    canvas.addEventListener('keydown', (e) => {
      const turn = {ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.08],
        ArrowDown: [0, -0.08]}[e.key];
      if (turn) this.orbit.turn(turn[0]!, turn[1]!);
      else if (e.key === '+' || e.key === '=') this.orbit.zoom(0.85);
      else if (e.key === '-') this.orbit.zoom(1.18);
      else return;
      e.preventDefault();
    });
  }

  setSkeleton(skeleton: SkeletonLike): void {
    this.crowd?.dispose();
    if (this.crowd) this.scene.remove(this.crowd.group);
    this.skeleton = skeleton;
    this.crowd = new CrowdMesh(skeleton, 'bodies', this.colours.lights);
    this.scene.add(this.crowd.group);
    this.step = null;
    this.example = null;
    const joints = skeleton.jointCount;
    this.pose.jointCount = joints;
    this.pose.avatars = new Uint32Array([1, 4]);
    this.pose.flags = new Uint8Array(2);
    this.pose.rootsM = new Float32Array(6);
    this.pose.rotations = new Float32Array(8 * joints);
  }

  setBackground(colour: THREE.Color): void {
    this.renderer.setClearColor(colour);
  }

  /** Draws the step at `timeS`, and the example at the same generic time. */
  draw(timeS: number, dtS: number): void {
    const {crowd, skeleton, step, example, pose} = this;
    const {clientWidth: width, clientHeight: height} = this.canvas;
    if (width === 0 || height === 0) return;
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== width || size.y !== height) this.renderer.setSize(width, height, false);
    if (crowd && skeleton && step) {
      const joints = skeleton.jointCount;
      pose.count = example ? 2 : 1;
      samplePose(step, joints, timeS, example ? spacingM / 2 : 0, pose.rootsM, pose.rotations, 0);
      if (example) {
        samplePose(example, joints, matchingTime(step, example, timeS), -spacingM / 2, pose.rootsM,
          pose.rotations, 1);
      }
      crowd.update(pose);
      const end = step.roots_m.length - 3;
      this.view.moveTo(0, crowd.heightM * 0.48, (step.roots_m[2]! + step.roots_m[end + 2]!) / 2);
    }
    this.orbit.advance(dtS);
    const box = {x: 0, y: 0, width, height};
    this.view.advance(this.orbit, dtS, box, box);
    this.renderer.clear();
    this.renderer.render(this.scene, this.view.camera);
  }

  /**
   * Returns the position for a label above avatar `index`, in CSS pixels, or null if it is not
   * drawn.
   */
  labelPosition(index: number): {x: number; y: number} | null {
    const {crowd} = this;
    if (!crowd || index >= crowd.count) return null;
    const root = index * crowd.skeleton.jointCount * 3;
    const point = new THREE.Vector3(
      crowd.positions[root]!, crowd.heightM * 1.04, crowd.positions[root + 2]!);
    point.project(this.view.camera);
    return {
      x: (point.x * 0.5 + 0.5) * this.canvas.clientWidth,
      y: (0.5 - point.y * 0.5) * this.canvas.clientHeight,
    };
  }

  get durationS(): number {
    return this.step ? durationOf(this.step) : 1;
  }
}
