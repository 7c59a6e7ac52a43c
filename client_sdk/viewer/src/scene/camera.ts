// The camera: orbits a target, pans, zooms, follows. Views side by side share angle and distance and
// keep a target each, so that two worlds are seen the same way.

import * as THREE from 'three';

import type {Ground} from '../terrain_surface.js';

const minDistanceM = 1.2;
const maxDistanceM = 160;

export class Orbit {
  azimuthRad = 0.65;
  elevationRad = 0.3;
  distanceM = 8;
  private wantAzimuth = 0.65;
  private wantElevation = 0.3;
  private wantDistance = 8;

  turn(azimuthRad: number, elevationRad: number): void {
    this.wantAzimuth += azimuthRad;
    this.wantElevation = Math.min(1.5, Math.max(0.03, this.wantElevation + elevationRad));
  }

  zoom(factor: number): void {
    this.wantDistance = Math.min(maxDistanceM, Math.max(minDistanceM, this.wantDistance * factor));
  }

  setDistance(distanceM: number): void {
    this.wantDistance = Math.min(maxDistanceM, Math.max(minDistanceM, distanceM));
  }

  /** Goes where it was told, softly; at once with `dtS` Infinity. */
  advance(dtS: number): void {
    const k = Number.isFinite(dtS) ? 1 - Math.exp(-dtS * 12) : 1;
    this.azimuthRad += (this.wantAzimuth - this.azimuthRad) * k;
    this.elevationRad += (this.wantElevation - this.elevationRad) * k;
    this.distanceM += (this.wantDistance - this.distanceM) * k;
  }
}

export interface Box {
  x: number;
  y: number;
  width: number;
  height: number;
}

export class ViewCamera {
  readonly camera = new THREE.PerspectiveCamera(42, 1, 0.1, 400);
  readonly target = new THREE.Vector3(0, 0.9, 0);
  /** How much further than the shared distance this view looks from. */
  scale = 1;
  wantScale = 1;
  private readonly want = new THREE.Vector3(0, 0.9, 0);

  moveTo(x: number, y: number, z: number, atOnce = false): void {
    this.want.set(x, y, z);
    if (atOnce) this.target.copy(this.want);
  }

  /** Moves the target in the ground plane, by shares of the view's height. */
  pan(orbit: Orbit, right: number, forward: number): void {
    const scale = orbit.distanceM * this.scale * 0.8;
    const s = Math.sin(orbit.azimuthRad);
    const c = Math.cos(orbit.azimuthRad);
    this.want.x += (c * right - s * forward) * scale;
    this.want.z += (-s * right - c * forward) * scale;
  }

  /**
   * `free` is what panels leave of the page: its middle is where the target is seen. `box` is what
   * is drawn, panels or not. Both in CSS pixels.
   */
  advance(orbit: Orbit, dtS: number, free: Box, box: Box, ground: Ground | null = null): void {
    const aspect = free.width / Math.max(1, free.height);
    this.target.lerp(this.want, 1 - Math.exp(-dtS * 7));
    this.scale += (this.wantScale - this.scale) * (1 - Math.exp(-dtS * 5));
    const distance = orbit.distanceM * this.scale;
    const flat = Math.cos(orbit.elevationRad) * distance;
    const x = this.target.x + Math.sin(orbit.azimuthRad) * flat;
    const z = this.target.z + Math.cos(orbit.azimuthRad) * flat;
    const y = this.target.y + Math.sin(orbit.elevationRad) * distance;
    this.camera.position.set(x, Math.max(0.15 + (ground?.heightAt(x, z) ?? 0), y), z);
    this.camera.aspect = aspect;
    // A narrow view keeps the width of a square one.
    this.camera.fov = aspect >= 1 ? 42 :
      2 * THREE.MathUtils.radToDeg(Math.atan(Math.tan(THREE.MathUtils.degToRad(21)) / Math.max(aspect, 0.55)));
    this.camera.near = Math.max(0.05, orbit.distanceM * 0.02);
    this.camera.setViewOffset(free.width, free.height, box.x - free.x, box.y - free.y, box.width,
      box.height);
    this.camera.lookAt(this.target);
    this.camera.updateMatrixWorld();
  }
}

export interface PointerActions {
  orbit(dx: number, dy: number): void;
  pan(dx: number, dy: number, x: number, y: number): void;
  zoom(factor: number): void;
  click(x: number, y: number, twice: boolean, shift: boolean): void;
  /** Something lies there that is dragged instead of the view; then `drag` till `drop`, or till `release`
   * where another finger comes or the press is taken away. */
  grab?(x: number, y: number, touch: boolean): boolean;
  drag?(x: number, y: number): void;
  drop?(heldMs: number): void;
  release?(): void;
}

/** Who moves further than that drags; in CSS pixels. */
const clickPx = 6;

/** Mouse and touch on `element`; positions in CSS pixels within it. */
export function listenToPointers(element: HTMLElement, actions: PointerActions): void {
  const pointers = new Map<number, {x: number; y: number}>();
  let moved = 0;
  let downStamp = 0;
  let lastClick = -1e9;
  let grabbed = false;
  const where = (e: PointerEvent | WheelEvent): [number, number] => {
    const box = element.getBoundingClientRect();
    return [e.clientX - box.left, e.clientY - box.top];
  };
  element.addEventListener('pointerdown', (e) => {
    element.setPointerCapture(e.pointerId);
    if (pointers.size === 0) {
      moved = 0;
      downStamp = e.timeStamp;
      grabbed = e.button === 0 && !e.shiftKey &&
        (actions.grab?.(...where(e), e.pointerType === 'touch') ?? false);
    } else if (grabbed) {
      grabbed = false;
      moved = Infinity;  // It is no click either.
      actions.release?.();
    }
    pointers.set(e.pointerId, {x: e.clientX, y: e.clientY});
  });
  element.addEventListener('pointermove', (e) => {
    const p = pointers.get(e.pointerId);
    if (!p) return;
    const dx = e.clientX - p.x;
    const dy = e.clientY - p.y;
    const [x, y] = where(e);
    const way = moved + Math.abs(dx) + Math.abs(dy);
    if (pointers.size === 1) {
      if (grabbed) actions.drag?.(x, y);
      else if (e.buttons & 6 || e.shiftKey) actions.pan(dx, dy, x, y);
      // From where it went down: between two slow frames a whole drag is one event.
      else if (way <= clickPx) return;
      else actions.orbit(dx, dy);
    } else if (pointers.size === 2) {
      const other = [...pointers.entries()].find(([id]) => id !== e.pointerId)![1];
      const before = Math.hypot(p.x - other.x, p.y - other.y);
      const after = Math.hypot(e.clientX - other.x, e.clientY - other.y);
      if (before > 10 && after > 10) actions.zoom(before / after);
      actions.pan(dx / 2, dy / 2, x, y);
    }
    moved = way;
    p.x = e.clientX;
    p.y = e.clientY;
  });
  const up = (e: PointerEvent): void => {
    const known = pointers.delete(e.pointerId);
    if (known && grabbed && pointers.size === 0) {
      grabbed = false;
      if (e.type === 'pointercancel') actions.release?.();
      else actions.drop?.(e.timeStamp - downStamp);
      return;
    }
    if (!known || e.type === 'pointercancel' || pointers.size > 0) return;
    // When it happened, not when a busy page came to hear of it.
    if (moved <= clickPx && e.timeStamp - downStamp < 600 && e.button === 0) {
      const [x, y] = where(e);
      actions.click(x, y, e.timeStamp - lastClick < 350, e.shiftKey);
      lastClick = e.timeStamp;
    }
  };
  element.addEventListener('pointerup', up);
  element.addEventListener('pointercancel', up);
  element.addEventListener('contextmenu', (e) => e.preventDefault());
  element.addEventListener('wheel', (e) => {
    e.preventDefault();
    const lines = e.deltaMode === 1 ? 16 : 1;
    actions.zoom(Math.exp(Math.max(-120, Math.min(120, e.deltaY * lines)) * 0.0016));
  }, {passive: false});
}
