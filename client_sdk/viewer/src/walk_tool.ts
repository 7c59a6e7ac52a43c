// Walks to places: clicked on the ground, dragged for the heading, marked there until they end.

import {nextRequestId} from './request_ids.js';
import type {Vec3, WorldEvent} from './sdk.js';
import type {Chosen, Shown} from './world_pane.js';
import type {FootprintHost} from './footprint_tool.js';
import type {GoalMark} from './scene/world_view.js';

/** What the tool needs of the page. */
export interface WalkHost extends FootprintHost {
  /** A walk that is asked for now, to be looked at and changed by hand. */
  showGoal(atM: Vec3, headingRad: number | null): void;
}

interface Goal {
  readonly atM: Vec3;
  /** Null: not chosen. */
  readonly headingRad: number | null;
  readonly waypointsM: readonly Vec3[];
}

/** A walk that this page has asked for. */
interface Walk extends Goal {
  readonly shown: Shown;
  readonly avatar: number;
  readonly requestId: bigint;
  accepted: boolean;
  askedMs: number;
  /** How often in a row it waited no more when asked. */
  missed: number;
}

const mostWaypoints = 64;
/** Walks whose ends are waited for; of more the oldest are marked no longer. */
const mostWalks = 64;
/** A press that moves less has no heading; in CSS pixels. */
const dragPx = 8;
/** A finger that rests so long means a place to pass. */
const restMs = 600;
/** Nearer goals keep the heading there is. */
const nearM = 0.5;
/** Whether a walk still waits is asked so often: somebody else may have cancelled it. */
const askEveryMs = 500;
/** Its end may have been told by then: answers overtake events. */
const mostMissed = 3;

export class WalkTool {
  sending = false;
  private readonly walks: Walk[] = [];
  /** Ended, though what was inspected last may have them yet. */
  private readonly ended: bigint[] = [];
  /** Places to pass, of the walk that is asked for next. */
  private passing: (Chosen & {readonly waypointsM: Vec3[]}) | null = null;
  /** The goal that is held. */
  private held: {
    readonly shown: Shown; readonly atM: Vec3; headingRad: number | null;
    readonly x: number; readonly y: number; readonly touch: boolean;
  } | null = null;

  constructor(private readonly host: WalkHost) {}

  setSending(on: boolean): void {
    this.sending = on;
    if (!on) this.held = this.passing = null;
    this.show();
    if (on) this.host.say(this.host.chosen() ? 'Click where it is to go; drag for the way it looks there.' :
      'Choose a figure, then click where it is to go.');
  }

  // ---- the pointer

  /** Whether a press there is a goal. */
  grab(x: number, y: number, touch: boolean): boolean {
    const shown = this.sending ? this.host.viewAt(x, y) : null;
    if (!shown || this.whom(shown) === 0) return false;
    const atM = shown.view.groundAt(x, y);
    if (atM === null) return false;
    this.held = {shown, atM, headingRad: null, x, y, touch};
    this.show();
    return true;
  }

  drag(x: number, y: number): void {
    const {held} = this;
    if (!held) return;
    const at = held.shown.view.groundAt(x, y);
    if (Math.hypot(x - held.x, y - held.y) < dragPx) held.headingRad = null;
    else if (at) held.headingRad = Math.atan2(at[0] - held.atM[0], at[2] - held.atM[2]);
    this.show();
  }

  drop(heldMs: number): void {
    const {held} = this;
    this.held = null;
    if (!held) return;
    if (held.touch && held.headingRad === null && heldMs > restMs) this.pass(held.shown, held.atM);
    else this.send(held.shown, held.atM, held.headingRad);
  }

  /** Forgets a press, or else the places to pass; false: there was nothing. */
  letGo(): boolean {
    const had = this.held !== null || this.passing !== null;
    if (this.held) this.held = null;
    else this.passing = null;
    this.show();
    return had;
  }

  /** The press that holds a goal is something else after all. */
  release(): void {
    this.held = null;
    this.show();
  }

  // ---- goals

  /** Whom a walk in this world is for; 0: it is not clear. */
  private whom(shown: Shown): number {
    const avatars = this.host.drivenAvatars();
    return avatars.length === 1 && this.host.driven() === shown ? avatars[0]! : 0;
  }

  private whomOrSay(shown: Shown): number {
    const avatar = this.whom(shown);
    if (avatar === 0) this.host.say('A walk is for one: choose a figure of this world.');
    return avatar;
  }

  /** A place to pass on the way to the goal that comes. */
  pass(shown: Shown, atM: Vec3): void {
    const avatar = this.whomOrSay(shown);
    if (avatar === 0) return;
    if (this.passing?.shown !== shown || this.passing.avatar !== avatar) {
      this.passing = {shown, avatar, waypointsM: []};
    }
    const {waypointsM} = this.passing;
    if (waypointsM.length >= mostWaypoints) {
      this.host.say(`A walk passes ${mostWaypoints} places at most.`);
      return;
    }
    waypointsM.push(atM);
    this.host.say(`${waypointsM.length === 1 ? 'One place' : `${waypointsM.length} places`} to pass; ` +
      'the goal is next.');
    this.show();
  }

  /** Instead of whatever the avatar still has to do. */
  send(shown: Shown, atM: Vec3, chosenRad: number | null): void {
    const avatar = this.whomOrSay(shown);
    if (avatar === 0) return;
    const {passing} = this;
    this.passing = null;
    const waypointsM = passing?.shown === shown && passing.avatar === avatar ? passing.waypointsM : [];
    const headingRad = chosenRad ?? this.headingFor(shown, avatar, atM, waypointsM);
    const walk: Walk = {
      shown, avatar, requestId: nextRequestId(), atM, headingRad, waypointsM, accepted: false,
      askedMs: performance.now(), missed: 0};
    this.host.goLive();
    this.host.showGoal(atM, chosenRad);
    this.forget((other) => other.shown === shown && other.avatar === avatar);
    if (this.walks.length === mostWalks) this.walks.shift();
    this.walks.push(walk);
    this.show();
    shown.wander?.drop(avatar);
    // One right after the other, so that two goals in a row do not come in between one another.
    void shown.world.cancel([avatar]);
    const {requestId} = walk;
    void shown.world.request([{avatar, type: 'walk', requestId, atM, headingRad, waypointsM}]).then((reply) => {
      walk.accepted = reply.ok;
      if (!this.walks.includes(walk)) return;
      if (!reply.ok) this.forget((other) => other === walk);
      this.host.say(reply.ok ? `Sent to x ${atM[0].toFixed(2)}, z ${atM[2].toFixed(2)} m.` :
        `Refused: ${reply.items[0]?.text || reply.text}`);
    });
  }

  /** The way it comes; where it stands nearly there, the way it looks. */
  private headingFor(shown: Shown, avatar: number, atM: Vec3, waypointsM: readonly Vec3[]): number {
    const place = shown.view.place(avatar);
    const last = waypointsM.at(-1);
    const [fromX, fromZ] = last ? [last[0], last[2]] : [place?.x ?? atM[0], place?.z ?? atM[2]];
    const [x, z] = [atM[0] - fromX, atM[2] - fromZ];
    if (Math.hypot(x, z) > nearM) return Math.atan2(x, z);
    const state = this.host.inspected();
    return state?.avatar === avatar && this.host.chosen()?.shown === shown ? state.baseHeadingRad :
      place?.headingRad ?? 0;
  }

  // ---- their ends

  private forget(gone: (walk: Walk) => boolean): void {
    for (let i = this.walks.length - 1; i >= 0; --i) {
      if (!gone(this.walks[i]!)) continue;
      this.ended.push(this.walks[i]!.requestId);
      this.walks.splice(i, 1);
    }
    if (this.ended.length > mostWalks) this.ended.splice(0, this.ended.length - mostWalks);
  }

  /** Whatever these avatars still had to do is theirs no more. */
  cancelled(shown: Shown, avatars: readonly number[]): void {
    this.forget((walk) => walk.shown === shown && avatars.includes(walk.avatar));
    this.show();
  }

  /** A world is shown no longer; null: the server knows nothing of us any more. */
  clear(shown: Shown | null): void {
    this.forget((walk) => shown === null || walk.shown === shown);
    if (shown === null || this.held?.shown === shown) this.held = null;
    if (shown === null || this.passing?.shown === shown) this.passing = null;
    this.show();
  }

  /** Whether it was about one of our walks, and has been said. */
  onEvent(shown: Shown, event: WorldEvent): boolean {
    const {type, avatar} = event;
    if (type === 'removed') {
      this.cancelled(shown, [avatar]);
      if (this.passing?.shown === shown && this.passing.avatar === avatar) this.passing = null;
      return false;
    }
    if (type !== 'rejected' && !(type === 'finished' && event.kind === 'stand')) return false;
    const walk = this.walks.find(
      (each) => each.shown === shown && each.avatar === avatar && each.requestId === event.requestId);
    if (!walk) return false;
    this.forget((each) => each === walk);
    this.show();
    this.host.say(type === 'finished' ? `Avatar ${avatar} has arrived.` :
      `Avatar ${avatar} goes no further: ${event.reason}.`);
    return true;
  }

  /** Asks after walks that may have been cancelled by others. */
  private ask(): void {
    const nowMs = performance.now();
    if (!this.host.live()) return;
    for (const walk of this.walks) {
      if (!walk.accepted || nowMs - walk.askedMs < askEveryMs) continue;
      walk.askedMs = nowMs;
      void walk.shown.world.inspect(walk.avatar).then(({queue, queueSize}) => {
        const waits = queueSize > queue.length || queue.some(({requestId}) => requestId === walk.requestId);
        walk.missed = waits ? 0 : walk.missed + 1;
        if (walk.missed < mostMissed) return;
        this.forget((each) => each === walk);
        this.show();
      }, () => {});
    }
  }

  // ---- marks

  /** Of all that is on its way, and of what the one chosen was sent to by others. */
  private goalsOf(shown: Shown): Goal[] {
    if (!this.host.live()) return [];
    const goals: Goal[] = this.walks.filter((walk) => walk.shown === shown);
    const chosen = this.host.chosen();
    const state = chosen?.shown === shown ? this.host.inspected() : null;
    if (state?.avatar !== undefined && state.avatar === chosen!.avatar) {
      for (const {type, requestId, atM, headingRad, waypointsM} of state.queue) {
        if (type !== 'walk' || atM === null || this.ended.includes(requestId) ||
            this.walks.some((walk) => walk.requestId === requestId)) continue;
        goals.push({atM, headingRad, waypointsM});
      }
    }
    return goals;
  }

  /** Often: ends that nobody tells of are found here, too. */
  show(): void {
    this.ask();
    if (this.passing && this.whom(this.passing.shown) !== this.passing.avatar) this.passing = null;
    for (const shown of this.host.shown) {
      const marks: GoalMark[] = [];
      const goals = this.goalsOf(shown);
      if (this.passing?.shown === shown) {
        for (const atM of this.passing.waypointsM) marks.push({kind: 'waypoint', atM, headingRad: 0});
      }
      for (const {atM, headingRad, waypointsM} of goals) {
        for (const point of waypointsM) marks.push({kind: 'waypoint', atM: point, headingRad: 0});
        marks.push({kind: 'goal', atM, headingRad: 0});
        if (headingRad !== null) marks.push({kind: 'heading', atM, headingRad});
      }
      if (this.held?.shown === shown) {
        const {atM, headingRad} = this.held;
        marks.push({kind: 'goal', atM, headingRad: 0});
        if (headingRad !== null) marks.push({kind: 'turning', atM, headingRad});
      }
      shown.view.showGoals(marks);
    }
  }
}
