// Where the page looks from: at everybody, at the one followed, or where somebody turned it to.

import {Orbit} from './scene/camera.js';
import type {Chosen, Shown} from './world_pane.js';

const followDistanceM = 5.2;

/** One orbit for all views; each has its own centre. */
export class CameraControl {
  readonly orbit = new Orbit();
  /** Keeps everybody in sight, till somebody pans, zooms or follows. */
  framing = true;

  constructor(private readonly shown: readonly Shown[]) {}

  get following(): boolean {
    return this.shown.some(({view}) => view.following !== 0);
  }
  frameAll(): void {
    this.framing = true;
    this.unfollow();
  }
  unfollow(): void {
    for (const {view} of this.shown) view.following = 0;
  }
  /** Follows that one, or no longer. */
  toggleFollow({shown, avatar}: Chosen): void {
    const on = shown.view.following !== avatar;
    this.unfollow();
    if (!on) return;
    shown.view.following = avatar;
    this.framing = false;
    this.orbit.setDistance(followDistanceM);
  }
  zoom(factor: number): void {
    this.framing = false;
    this.orbit.zoom(factor);
  }
  /** By pixels; all views where there is none below the pointer. */
  pan(dx: number, dy: number, below: Shown | null): void {
    this.framing = false;
    for (const each of this.shown) {
      if (each !== below && this.shown.length > 1) continue;
      each.view.following = 0;
      const scale = 1 / Math.max(1, each.view.free.height);
      each.view.view.pan(this.orbit, -dx * scale, dy * scale);
    }
  }
  advance(dtS: number): void {
    let nearest = Infinity;
    for (const {view} of this.shown) {
      view.follow();
      view.view.wantScale = 1;
      if (view.following) continue;
      const extent = view.extent();
      if (!extent) continue;
      if (this.framing || !view.framed) {
        view.view.moveTo(extent.x, 0.8, extent.z, !view.framed);
        view.framed = true;
        // Views that are higher than wide see as much sideways as square ones, see ViewCamera.
        const aspect = Math.min(1.7, Math.max(1, view.free.width / Math.max(1, view.free.height)));
        view.wantDistanceM = Math.min(
          110, Math.max(4.4, (extent.radius + 0.7) / (0.384 * aspect) + 0.3 * extent.radius));
        nearest = Math.min(nearest, view.wantDistanceM);
      }
    }
    if (this.framing && nearest < Infinity) {
      this.orbit.setDistance(nearest);
      for (const {view} of this.shown) view.view.wantScale = view.wantDistanceM / nearest;
    }
    this.orbit.advance(dtS);
    for (const {view} of this.shown) view.aim(this.orbit, dtS);
  }
}
