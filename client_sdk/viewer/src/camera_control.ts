// The cameras of all panes: they frame all avatars, follow one, or stay where the user moved them.

import {Orbit} from './scene/camera.js';
import type {AvatarSelection, WorldPane} from './world_pane.js';

const followDistanceM = 5.2;

/** All panes share the camera's angles and distance, but each has its own camera target. */
export class CameraControl {
  readonly orbit = new Orbit();
  /** True while the cameras keep all avatars in view. Panning, zooming and following end it. */
  framesAll = true;

  constructor(private readonly panes: readonly WorldPane[]) {}

  get following(): boolean {
    return this.panes.some(({view}) => view.followedAvatar !== 0);
  }
  frameAll(): void {
    this.framesAll = true;
    this.unfollow();
  }
  unfollow(): void {
    for (const {view} of this.panes) view.followedAvatar = 0;
  }
  /** Follows the avatar, or stops following it. */
  toggleFollow({pane, avatar}: AvatarSelection): void {
    const on = pane.view.followedAvatar !== avatar;
    this.unfollow();
    if (!on) return;
    pane.view.followedAvatar = avatar;
    this.framesAll = false;
    this.orbit.setDistance(followDistanceM);
  }
  zoom(factor: number): void {
    this.framesAll = false;
    this.orbit.zoom(factor);
  }
  /**
   * Pans by a pointer movement in CSS pixels. If there are several panes, only the one beneath the
   * pointer moves.
   */
  pan(dx: number, dy: number, below: WorldPane | null): void {
    this.framesAll = false;
    for (const each of this.panes) {
      if (each !== below && this.panes.length > 1) continue;
      each.view.followedAvatar = 0;
      const scale = 1 / Math.max(1, each.view.freeArea.height);
      each.view.viewCamera.pan(this.orbit, -dx * scale, dy * scale);
    }
  }
  /** Call once per frame, after the views have been updated. */
  advance(dtS: number): void {
    let nearest = Infinity;
    for (const {view} of this.panes) {
      view.aimAtFollowed();
      view.viewCamera.desiredScale = 1;
      if (view.followedAvatar) continue;
      const extent = view.bounds();
      if (!extent) continue;
      if (this.framesAll || !view.wasFramed) {
        view.viewCamera.moveTo(extent.x, 0.8, extent.z, !view.wasFramed);
        view.wasFramed = true;
        // A view that is taller than wide shows the same width as a square view (ViewCamera).
        const {width, height} = view.freeArea;
        const aspect = Math.min(1.7, Math.max(1, width / Math.max(1, height)));
        const distanceM = Math.min(
          110, Math.max(4.4, (extent.radius + 0.7) / (0.384 * aspect) + 0.3 * extent.radius));
        // Smaller changes come from standing avatars that shift their weight.
        if (Math.abs(distanceM - view.desiredDistanceM) > 0.03 * distanceM) {
          view.desiredDistanceM = distanceM;
        }
        nearest = Math.min(nearest, view.desiredDistanceM);
      }
    }
    if (this.framesAll && nearest < Infinity) {
      this.orbit.setDistance(nearest);
      for (const {view} of this.panes) {
        view.viewCamera.desiredScale = view.desiredDistanceM / nearest;
      }
    }
    this.orbit.advance(dtS);
    for (const {view} of this.panes) view.updateCamera(this.orbit, dtS);
  }
}
