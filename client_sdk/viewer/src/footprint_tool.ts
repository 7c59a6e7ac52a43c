// The footprint tool: a click on the ground requests a step to that point. Outlines show where feet
// will land, and the outline of a queued step can be dragged to another point.

import {pointText} from './dom.js';
import type {Inspector} from './panels/inspector.js';
import {nextRequestId} from './request_ids.js';
import type {MovementRequest, QueuedRequest, Vec3, WorldEvent} from './sdk.js';
import type {AvatarSelection, WorldPane} from './world_pane.js';

/** The parts of the page that the tool uses. */
export interface FootprintHost {
  readonly panes: readonly WorldPane[];
  selection(): AvatarSelection | null;
  /** Returns whether the page shows the live view instead of the recording. */
  live(): boolean;
  /** Returns the last state of the selected avatar that the server reported. */
  inspected(): Inspector['state'];
  /** Returns the pane whose world receives commands. */
  commandedPane(): WorldPane | null;
  /** Returns the avatars that receive commands. */
  targets(): number[];
  /** Returns whether a step is rejected if the foot cannot reach the exact point. */
  exactOnly(): boolean;
  /** Returns the pane at a point of the page. */
  paneAt(x: number, y: number): WorldPane | null;
  goLive(): void;
  /** Shows a message to the user. */
  notify(text: string): void;
}

interface Footprint {
  readonly atM: Vec3;
  readonly headingRad: number;
}

/** Radius around an outline's centre within which it can be dragged, in CSS pixels. */
const grabPx = 18;
/** Time for which the nearest reachable footprint of a rejected step is outlined. */
const nearestShownMs = 8000;

export class FootprintTool {
  private active_ = false;
  /** The queued step whose outline the user is dragging. */
  private dragged: {
    readonly pane: WorldPane; readonly avatar: number; readonly requestId: bigint;
    atM: readonly [number, number, number]; moved: boolean;
  } | null = null;
  /** The nearest reachable footprint of the last step that was rejected. */
  private nearestReachable:
    Footprint & {readonly pane: WorldPane; readonly untilMs: number} | null = null;
  /** Steps to footprints that this page has requested. */
  private readonly requests = new Set<bigint>();

  constructor(private readonly host: FootprintHost) {}

  /** Returns whether clicks on the ground request steps. */
  get active(): boolean {
    return this.active_;
  }

  setActive(on: boolean): void {
    this.active_ = on;
    if (!on) return;
    this.host.notify(this.host.selection() ? 'Click where the next foot should land.' :
      'Select an avatar, then click where its next foot should land.');
  }

  /** Requests a step of the selected avatar to a point of the page. */
  requestStep(pane: WorldPane, x: number, y: number): void {
    const atM = pane.view.terrainPointAt(x, y);
    const avatars = this.host.targets();
    if (atM === null) return;
    if (avatars.length !== 1 || this.host.commandedPane() !== pane) {
      this.host.notify('Select one avatar of this world to place a footprint.');
      return;
    }
    const avatar = avatars[0]!;
    this.host.goLive();
    const requestId = nextRequestId();
    this.nearestReachable = null;
    const exact = this.host.exactOnly();
    this.requests.add(requestId);
    void pane.world.request([
      {avatar, type: 'step', requestId, foot: 'auto', atM, ...(exact ? {exactOnly: true} : {})},
    ]).then((reply) => {
      this.host.notify(reply.ok ? `Requested a step to ${pointText(atM)}.` :
        `Refused: ${reply.items[0]?.text || reply.text}`);
    });
  }

  /**
   * If the event rejects a step that this page has requested, outlines the nearest reachable
   * footprint for a while.
   */
  onEvent(pane: WorldPane, event: WorldEvent): void {
    if (event.type === 'finished') this.requests.delete(event.requestId);
    if (event.type !== 'rejected' || !this.requests.delete(event.requestId)) return;
    // In some cases, for example without foot planting, the server reports no nearest footprint.
    if (event.positionM.every((x) => x === 0)) return;
    this.nearestReachable = {
      pane, atM: event.positionM, headingRad: event.nearestHeadingRad,
      untilMs: performance.now() + nearestShownMs};
    this.update();
  }

  /** Returns the planned landings of the feet in the current movement of the inspected avatar. */
  private upcomingLandings(pane: WorldPane): Footprint[] {
    const selection = this.host.selection();
    const state = selection?.pane === pane && this.host.live() ? this.host.inspected() : null;
    if (!state?.movement || state.avatar !== selection!.avatar) return [];
    return state.movement.landings.map(({positionM, headingRad}) => ({atM: positionM, headingRad}));
  }

  /** Returns the queued steps of the inspected avatar that have a footprint. */
  private queuedFootprints(pane: WorldPane): QueuedRequest[] {
    const selection = this.host.selection();
    const state = selection?.pane === pane && this.host.live() ? this.host.inspected() : null;
    return state && state.avatar === selection!.avatar ?
      state.queue.filter(({type, atM}) => type === 'step' && atM !== null) : [];
  }

  /** Updates the outlines. A dragged outline is drawn under the pointer. */
  update(): void {
    for (const pane of this.host.panes) {
      const {x = 0, z = 0} = pane.view.locate(pane.view.selectedAvatar) ?? {};
      const upcoming = this.upcomingLandings(pane);
      const last = upcoming.at(-1);
      let from = last ? [last.atM[0], last.atM[2]] : [x, z];
      const queued = this.queuedFootprints(pane).map(({atM, headingRad, requestId}) => {
        const isDragged = this.dragged?.pane === pane && this.dragged.requestId === requestId;
        const at = isDragged ? this.dragged!.atM : atM!;
        const heading = headingRad ?? Math.atan2(at[0] - from[0]!, at[2] - from[1]!);
        from = [at[0], at[2]];
        return {atM: at, headingRad: heading};
      });
      if (this.nearestReachable && performance.now() > this.nearestReachable.untilMs) {
        this.nearestReachable = null;
      }
      const nearest = this.nearestReachable?.pane === pane ? [this.nearestReachable] : [];
      pane.view.showPlannedFootprints([...upcoming, ...queued, ...nearest]);
    }
  }

  /**
   * If there is a queued step's outline at this point of the page, starts a drag and returns true.
   */
  grab(x: number, y: number): boolean {
    const selection = this.host.selection();
    const pane = this.host.paneAt(x, y);
    if (!pane || !selection) return false;
    const {view} = pane;
    for (const {atM, requestId} of this.queuedFootprints(pane)) {
      const at = atM!;
      const onPage = view.projectToPage([at[0], view.terrain.heightAt(at[0], at[2]), at[2]]);
      if (!onPage || Math.hypot(onPage.x - x, onPage.y - y) > grabPx) continue;
      this.dragged = {pane, avatar: selection.avatar, requestId, atM: at, moved: false};
      return true;
    }
    return false;
  }

  drag(x: number, y: number): void {
    const at = this.dragged?.pane.view.terrainPointAt(x, y);
    if (!at) return;
    this.dragged!.atM = at;
    this.dragged!.moved = true;
    this.update();
  }

  /** Ends the drag without moving the step. */
  cancelDrag(): void {
    this.dragged = null;
    this.update();
  }

  /**
   * Moves the dragged step. The protocol cannot change a queued request, so this clears the queue
   * and requests all its movements again.
   */
  async drop(): Promise<void> {
    const dragged = this.dragged;
    this.dragged = null;
    if (!dragged?.moved) return;
    const {pane: {world}, avatar, requestId, atM} = dragged;
    try {
      const {queue, queueSize} = await world.inspect(avatar);
      if (!queue.some((item) => item.requestId === requestId)) {
        this.host.notify('Too late: the step has already started.');
        return;
      }
      // The server reports only the first 16 requests, so the others would be lost.
      if (queueSize > queue.length) {
        this.host.notify('The queue is too long to move a footprint.');
        return;
      }
      const items = queue.map((item): MovementRequest => {
        const {type, foot, lengthM, heightM, turnRad, seconds, waypointsM} = item;
        const target = item.requestId === requestId ? atM : item.atM;
        return {
          avatar, requestId: item.requestId, type, foot, lengthM, heightM, turnRad, seconds,
          waypointsM,
          ...(target === null ? {} : {atM: target}),
          ...(item.exactOnly ? {exactOnly: true} : {}),
          ...(item.allowNearest ? {allowNearest: true} : {}),
          ...(item.sideM === null ? {} : {sideM: item.sideM}),
          ...(item.headingRad === null ? {} : {headingRad: item.headingRad}),
          ...(item.speedMPerS === null ? {} : {speedMPerS: item.speedMPerS}),
        };
      });
      await world.cancel([avatar]);
      const reply = await world.request(items);
      this.host.notify(reply.ok ? `Moved the footprint to ${pointText(atM)}.` :
        `Refused: ${reply.items[0]?.text || reply.text}`);
    } catch {
      this.host.notify('The server did not report the state of that avatar.');
    }
  }
}
