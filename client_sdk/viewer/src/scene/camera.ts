// The camera orbits a target. All views share the orbit's angles and distance, so worlds beside
// each other are seen from the same direction. Each view has its own target.

import * as THREE from 'three';

import type {TerrainSurface} from '../terrain_surface.js';

const minDistanceM = 1.2;
const maxDistanceM = 160;
const slackM = 0.06;

export class Orbit {
  azimuthRad = 0.65;
  elevationRad = 0.3;
  distanceM = 8;
  private desiredAzimuthRad = 0.65;
  private desiredElevationRad = 0.3;
  private desiredDistanceM = 8;

  turn(azimuthRad: number, elevationRad: number): void {
    this.desiredAzimuthRad += azimuthRad;
    this.desiredElevationRad =
      Math.min(1.5, Math.max(0.03, this.desiredElevationRad + elevationRad));
  }

  zoom(factor: number): void {
    this.setDistance(this.desiredDistanceM * factor);
  }

  setDistance(distanceM: number): void {
    this.desiredDistanceM = Math.min(maxDistanceM, Math.max(minDistanceM, distanceM));
  }

  /** Moves smoothly towards the desired values. With `dtS` Infinity, it reaches them at once. */
  advance(dtS: number): void {
    const k = Number.isFinite(dtS) ? 1 - Math.exp(-dtS * 12) : 1;
    this.azimuthRad += (this.desiredAzimuthRad - this.azimuthRad) * k;
    this.elevationRad += (this.desiredElevationRad - this.elevationRad) * k;
    this.distanceM += (this.desiredDistanceM - this.distanceM) * k;
  }
}

/** A rectangle of the page in CSS pixels. */
export interface PageRect {
  x: number;
  y: number;
  width: number;
  height: number;
}

export class ViewCamera {
  readonly camera = new THREE.PerspectiveCamera(42, 1, 0.1, 400);
  readonly target = new THREE.Vector3(0, 0.9, 0);
  /** This view's distance from its target, relative to the orbit's distance. */
  scale = 1;
  desiredScale = 1;
  private readonly desiredTarget = new THREE.Vector3(0, 0.9, 0);
  private readonly place = new THREE.Vector3();

  /**
   * Aims at a position, at once or gradually. The target stays up to `slackM` behind the position,
   * so that the view does not sway with a standing avatar that shifts its weight.
   */
  moveTo(x: number, y: number, z: number, atOnce = false): void {
    const place = this.place.set(x, y, z);
    if (atOnce) {
      this.desiredTarget.copy(place);
      this.target.copy(place);
      return;
    }
    const distanceM = this.desiredTarget.distanceTo(place);
    if (distanceM > slackM) this.desiredTarget.lerp(place, 1 - slackM / distanceM);
  }

  /** Moves the target in the ground plane. Arguments are fractions of the view's height. */
  pan(orbit: Orbit, right: number, forward: number): void {
    const scale = orbit.distanceM * this.scale * 0.8;
    const s = Math.sin(orbit.azimuthRad);
    const c = Math.cos(orbit.azimuthRad);
    this.desiredTarget.x += (c * right - s * forward) * scale;
    this.desiredTarget.z += (-s * right - c * forward) * scale;
  }

  /**
   * Advances by `dtS` seconds. The scene is drawn in `viewport`; the target appears at the centre
   * of `freeArea`, the part that no panel covers. The camera stays above `terrain`.
   */
  advance(
    orbit: Orbit, dtS: number, freeArea: PageRect, viewport: PageRect,
    terrain: TerrainSurface | null = null): void {
    const aspect = freeArea.width / Math.max(1, freeArea.height);
    this.target.lerp(this.desiredTarget, 1 - Math.exp(-dtS * 7));
    this.scale += (this.desiredScale - this.scale) * (1 - Math.exp(-dtS * 5));
    const distance = orbit.distanceM * this.scale;
    const flat = Math.cos(orbit.elevationRad) * distance;
    const x = this.target.x + Math.sin(orbit.azimuthRad) * flat;
    const z = this.target.z + Math.cos(orbit.azimuthRad) * flat;
    const y = this.target.y + Math.sin(orbit.elevationRad) * distance;
    this.camera.position.set(x, Math.max(0.15 + (terrain?.heightAt(x, z) ?? 0), y), z);
    this.camera.aspect = aspect;
    // A view that is taller than wide shows the same width of the scene as a square view.
    this.camera.fov = aspect >= 1 ? 42 :
      2 * THREE.MathUtils.radToDeg(
        Math.atan(Math.tan(THREE.MathUtils.degToRad(21)) / Math.max(aspect, 0.55)));
    this.camera.near = Math.max(0.05, orbit.distanceM * 0.02);
    this.camera.setViewOffset(
      freeArea.width, freeArea.height, viewport.x - freeArea.x, viewport.y - freeArea.y,
      viewport.width, viewport.height);
    this.camera.lookAt(this.target);
    this.camera.updateMatrixWorld();
  }
}

export interface PointerActions {
  orbit(dx: number, dy: number): void;
  pan(dx: number, dy: number, x: number, y: number): void;
  zoom(factor: number): void;
  click(x: number, y: number, double: boolean, shift: boolean): void;
  /**
   * Called on a touch, or on a press of the main button without Shift. If it returns true, the
   * gesture drags an object instead of the camera: `drag` follows for each movement, then either
   * `drop` (with the duration of the press), or `cancelDrag` if a second finger touches or the
   * browser cancels the press.
   */
  grab?(x: number, y: number, touch: boolean): boolean;
  drag?(x: number, y: number): void;
  drop?(pressedMs: number): void;
  cancelDrag?(): void;
}

/** A press that moves further than this is a drag, in CSS pixels. */
const clickPx = 6;

/**
 * Converts mouse and touch events of `element` to actions. Positions are in CSS pixels within it.
 */
export function listenToPointers(element: HTMLElement, actions: PointerActions): void {
  const pointers = new Map<number, {x: number; y: number}>();
  let moved = 0;
  let downStamp = 0;
  let lastClick = -1e9;
  let grabbed = false;
  const pointerPosition = (e: PointerEvent | WheelEvent): [number, number] => {
    const box = element.getBoundingClientRect();
    return [e.clientX - box.left, e.clientY - box.top];
  };
  element.addEventListener('pointerdown', (e) => {
    element.setPointerCapture(e.pointerId);
    if (pointers.size === 0) {
      moved = 0;
      downStamp = e.timeStamp;
      grabbed = e.button === 0 && !e.shiftKey &&
        (actions.grab?.(...pointerPosition(e), e.pointerType === 'touch') ?? false);
    } else if (grabbed) {
      grabbed = false;
      moved = Infinity;  // This gesture must not end as a click.
      actions.cancelDrag?.();
    }
    pointers.set(e.pointerId, {x: e.clientX, y: e.clientY});
  });
  element.addEventListener('pointermove', (e) => {
    const p = pointers.get(e.pointerId);
    if (!p) return;
    const dx = e.clientX - p.x;
    const dy = e.clientY - p.y;
    const [x, y] = pointerPosition(e);
    const distance = moved + Math.abs(dx) + Math.abs(dy);
    if (pointers.size === 1) {
      if (grabbed) actions.drag?.(x, y);
      else if (e.buttons & 6 || e.shiftKey) actions.pan(dx, dy, x, y);
      // The drag starts at the point of the press, because a slow page may receive it as one event.
      else if (distance <= clickPx) return;
      else actions.orbit(dx, dy);
    } else if (pointers.size === 2) {
      const other = [...pointers.entries()].find(([id]) => id !== e.pointerId)![1];
      const before = Math.hypot(p.x - other.x, p.y - other.y);
      const after = Math.hypot(e.clientX - other.x, e.clientY - other.y);
      if (before > 10 && after > 10) actions.zoom(before / after);
      actions.pan(dx / 2, dy / 2, x, y);
    }
    moved = distance;
    p.x = e.clientX;
    p.y = e.clientY;
  });
  const up = (e: PointerEvent): void => {
    const known = pointers.delete(e.pointerId);
    if (known && grabbed && pointers.size === 0) {
      grabbed = false;
      if (e.type === 'pointercancel') actions.cancelDrag?.();
      else actions.drop?.(e.timeStamp - downStamp);
      return;
    }
    if (!known || e.type === 'pointercancel' || pointers.size > 0) return;
    // Event timestamps are exact even if a busy page handles the events late.
    if (moved <= clickPx && e.timeStamp - downStamp < 600 && e.button === 0) {
      const [x, y] = pointerPosition(e);
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
