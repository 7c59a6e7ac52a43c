// The walk tool: a click on the ground requests a walk of the selected avatar to that point, and a
// drag also sets the heading at the goal. Goals, headings and waypoints are drawn on the ground
// until the walk ends.

import {pointText} from './dom.js';
import type {FootprintHost} from './footprint_tool.js';
import {nextRequestId} from './request_ids.js';
import type {GoalDecal} from './scene/world_view.js';
import type {Vec3, WorldEvent} from './sdk.js';
import type {AvatarSelection, WorldPane} from './world_pane.js';

/** The parts of the page that the tool uses. */
export interface WalkHost extends FootprintHost {
  /** Copies the goal of a new walk to the fields of the panel, where the user can edit it. */
  showGoal(atM: Vec3, headingRad: number | null): void;
}

interface Goal {
  readonly atM: Vec3;
  /** Heading at the goal; null if the request has none. */
  readonly headingRad: number | null;
  readonly waypointsM: readonly Vec3[];
}

/** A walk that this page has requested and that has not ended. */
interface Walk extends Goal {
  readonly pane: WorldPane;
  readonly avatar: number;
  readonly requestId: bigint;
}

const maxWaypoints = 64;
/** The page tracks at most this number of walks. If there are more, it forgets the oldest. */
const maxWalks = 64;
/** A drag that is shorter than this sets no heading, in CSS pixels. */
const dragPx = 8;
/** A touch that is held longer than this sets a waypoint. */
const longPressMs = 600;
/** If the goal is closer than this, the avatar keeps its heading. */
const minHeadingDistanceM = 0.5;

export class WalkTool {
  /** True if clicks on the ground request walks. */
  active = false;
  private readonly walks: Walk[] = [];
  /** Walks that have ended, although the last inspected queue may still contain them. */
  private readonly endedRequests: bigint[] = [];
  /** Waypoints for the next walk of an avatar. */
  private pendingWaypoints: (AvatarSelection & {readonly waypointsM: Vec3[]}) | null = null;
  /** The press that is choosing a goal and its heading. */
  private press: {
    readonly pane: WorldPane; readonly atM: Vec3; headingRad: number | null;
    readonly x: number; readonly y: number; readonly touch: boolean;
  } | null = null;

  constructor(private readonly host: WalkHost) {}

  setActive(on: boolean): void {
    this.active = on;
    if (!on) this.press = this.pendingWaypoints = null;
    this.update();
    if (!on) return;
    this.host.notify(this.host.selection() ?
      'Click the destination; drag to set the heading there.' :
      'Select an avatar, then click its destination.');
  }

  // ---- pointer

  /** If the press can choose a goal, starts to track it and returns true. */
  grab(x: number, y: number, touch: boolean): boolean {
    const pane = this.active ? this.host.paneAt(x, y) : null;
    if (!pane || this.target(pane) === 0) return false;
    const atM = pane.view.terrainPointAt(x, y);
    if (atM === null) return false;
    this.press = {pane, atM, headingRad: null, x, y, touch};
    this.update();
    return true;
  }

  drag(x: number, y: number): void {
    const {press} = this;
    if (!press) return;
    const at = press.pane.view.terrainPointAt(x, y);
    if (Math.hypot(x - press.x, y - press.y) < dragPx) press.headingRad = null;
    else if (at) press.headingRad = Math.atan2(at[0] - press.atM[0], at[2] - press.atM[2]);
    this.update();
  }

  drop(pressedMs: number): void {
    const {press} = this;
    this.press = null;
    if (!press) return;
    if (press.touch && press.headingRad === null && pressedMs > longPressMs) {
      this.addWaypoint(press.pane, press.atM);
    } else {
      this.send(press.pane, press.atM, press.headingRad);
    }
  }

  /** Discards the press, or else the waypoints. Returns false if there was nothing to discard. */
  discardInput(): boolean {
    const had = this.press !== null || this.pendingWaypoints !== null;
    if (this.press) this.press = null;
    else this.pendingWaypoints = null;
    this.update();
    return had;
  }

  /** Discards the press, because it has become another gesture, for example a pinch. */
  cancelDrag(): void {
    this.press = null;
    this.update();
  }

  // ---- goals

  /**
   * Returns the avatar to which walks requested in this pane apply. Returns 0 unless this pane
   * receives commands and exactly one avatar is their target.
   */
  private target(pane: WorldPane): number {
    const avatars = this.host.targets();
    return avatars.length === 1 && this.host.commandedPane() === pane ? avatars[0]! : 0;
  }

  private targetOrNotify(pane: WorldPane): number {
    const avatar = this.target(pane);
    if (avatar === 0) this.host.notify('Select one avatar of this world to send it somewhere.');
    return avatar;
  }

  /** Adds a waypoint to the next walk. */
  addWaypoint(pane: WorldPane, atM: Vec3): void {
    const avatar = this.targetOrNotify(pane);
    if (avatar === 0) return;
    if (this.pendingWaypoints?.pane !== pane || this.pendingWaypoints.avatar !== avatar) {
      this.pendingWaypoints = {pane, avatar, waypointsM: []};
    }
    const {waypointsM} = this.pendingWaypoints;
    if (waypointsM.length >= maxWaypoints) {
      this.host.notify(`A walk can have at most ${maxWaypoints} waypoints.`);
      return;
    }
    waypointsM.push(atM);
    const count = waypointsM.length === 1 ? '1 waypoint' : `${waypointsM.length} waypoints`;
    this.host.notify(`${count} set. Choose the destination next.`);
    this.update();
  }

  /** Clears the avatar's queue and requests a walk. */
  send(pane: WorldPane, atM: Vec3, chosenRad: number | null): void {
    const avatar = this.targetOrNotify(pane);
    if (avatar === 0) return;
    const pending = this.pendingWaypoints;
    this.pendingWaypoints = null;
    const waypointsM =
      pending?.pane === pane && pending.avatar === avatar ? pending.waypointsM : [];
    const headingRad = chosenRad ?? this.defaultHeading(pane, avatar, atM, waypointsM);
    const walk: Walk = {pane, avatar, requestId: nextRequestId(), atM, headingRad, waypointsM};
    this.host.goLive();
    this.host.showGoal(atM, chosenRad);
    this.removeWalks((other) => other.pane === pane && other.avatar === avatar);
    if (this.walks.length === maxWalks) this.walks.shift();
    this.walks.push(walk);
    this.update();
    pane.randomWalkers?.remove(avatar);
    // Both commands are sent without waiting, so that those of two quick clicks cannot interleave.
    void pane.world.cancel([avatar]);
    const {requestId} = walk;
    void pane.world.request([
      {avatar, type: 'walk', requestId, atM, headingRad, waypointsM},
    ]).then((reply) => {
      if (!this.walks.includes(walk)) return;
      if (!reply.ok) this.removeWalks((other) => other === walk);
      this.host.notify(reply.ok ? `Walking to ${pointText(atM)}.` :
        `Refused: ${reply.items[0]?.text || reply.text}`);
    });
  }

  /** Returns the direction of arrival, or the current heading if the goal is very close. */
  private defaultHeading(
    pane: WorldPane, avatar: number, atM: Vec3, waypointsM: readonly Vec3[]): number {
    const location = pane.view.locate(avatar);
    const last = waypointsM.at(-1);
    const [fromX, fromZ] =
      last ? [last[0], last[2]] : [location?.x ?? atM[0], location?.z ?? atM[2]];
    const [x, z] = [atM[0] - fromX, atM[2] - fromZ];
    if (Math.hypot(x, z) > minHeadingDistanceM) return Math.atan2(x, z);
    const state = this.host.inspected();
    return state?.avatar === avatar && this.host.selection()?.pane === pane ? state.baseHeadingRad :
      location?.headingRad ?? 0;
  }

  // ---- ends of walks

  private removeWalks(matches: (walk: Walk) => boolean): void {
    for (let i = this.walks.length - 1; i >= 0; --i) {
      if (!matches(this.walks[i]!)) continue;
      this.endedRequests.push(this.walks[i]!.requestId);
      this.walks.splice(i, 1);
    }
    if (this.endedRequests.length > maxWalks) {
      this.endedRequests.splice(0, this.endedRequests.length - maxWalks);
    }
  }

  /** Call when the page clears the queues of these avatars. */
  onCancelled(pane: WorldPane, avatars: readonly number[]): void {
    this.removeWalks((walk) => walk.pane === pane && avatars.includes(walk.avatar));
    this.update();
  }

  /**
   * Must be called when a pane closes. `pane` is null if the session is lost, so that the walks of
   * all panes have ended.
   */
  clear(pane: WorldPane | null): void {
    this.removeWalks((walk) => pane === null || walk.pane === pane);
    if (pane === null || this.press?.pane === pane) this.press = null;
    if (pane === null || this.pendingWaypoints?.pane === pane) this.pendingWaypoints = null;
    this.update();
  }

  /** Ends the walk to which the event belongs, if any. Returns true if the user is notified. */
  onEvent(pane: WorldPane, event: WorldEvent): boolean {
    const {type, avatar} = event;
    if (type === 'removed') {
      this.onCancelled(pane, [avatar]);
      if (this.pendingWaypoints?.pane === pane && this.pendingWaypoints.avatar === avatar) {
        this.pendingWaypoints = null;
      }
      return false;
    }
    if (event.outcome === 'none') return false;
    const walk = this.walks.find((each) =>
      each.pane === pane && each.avatar === avatar && each.requestId === event.requestId);
    if (!walk) return false;
    this.removeWalks((each) => each === walk);
    this.update();
    if (event.outcome === 'completed') {
      this.host.notify(`Avatar ${avatar} has arrived.`);
    } else if (event.outcome === 'rejected') {
      this.host.notify(`Avatar ${avatar} stopped: ${event.reason}.`);
    } else {
      return false;  // Another client has cancelled or replaced the walk.
    }
    return true;
  }

  // ---- decals

  /**
   * Returns the goals of this page's walks, and of walks that other clients requested for the
   * inspected avatar.
   */
  private goalsIn(pane: WorldPane): Goal[] {
    if (!this.host.live()) return [];
    const goals: Goal[] = this.walks.filter((walk) => walk.pane === pane);
    const selection = this.host.selection();
    const state = selection?.pane === pane ? this.host.inspected() : null;
    if (state?.avatar !== undefined && state.avatar === selection!.avatar) {
      for (const {type, requestId, atM, headingRad, waypointsM} of state.queue) {
        if (type !== 'walk' || atM === null || this.endedRequests.includes(requestId) ||
            this.walks.some((walk) => walk.requestId === requestId)) continue;
        goals.push({atM, headingRad, waypointsM});
      }
    }
    return goals;
  }

  /** Updates the decals. Must be called several times per second. */
  update(): void {
    const pending = this.pendingWaypoints;
    if (pending && this.target(pending.pane) !== pending.avatar) this.pendingWaypoints = null;
    for (const pane of this.host.panes) {
      const decals: GoalDecal[] = [];
      if (this.pendingWaypoints?.pane === pane) {
        for (const atM of this.pendingWaypoints.waypointsM) {
          decals.push({kind: 'waypoint', atM, headingRad: 0});
        }
      }
      for (const {atM, headingRad, waypointsM} of this.goalsIn(pane)) {
        for (const point of waypointsM) decals.push({kind: 'waypoint', atM: point, headingRad: 0});
        decals.push({kind: 'goal', atM, headingRad: 0});
        if (headingRad !== null) decals.push({kind: 'heading', atM, headingRad});
      }
      if (this.press?.pane === pane) {
        const {atM, headingRad} = this.press;
        decals.push({kind: 'goal', atM, headingRad: 0});
        if (headingRad !== null) decals.push({kind: 'draggedHeading', atM, headingRad});
      }
      pane.view.showGoals(decals);
    }
  }
}
