// Steps to places: clicked on the ground, outlined there while they wait, dragged elsewhere.

import type {Inspector} from './panels/inspector.js';
import {nextRequestId} from './request_ids.js';
import type {MovementRequest, QueuedRequest, Vec3, WorldEvent} from './sdk.js';
import type {Chosen, Shown} from './world_pane.js';

/** What the tool needs of the page. */
export interface FootprintHost {
  readonly shown: readonly Shown[];
  chosen(): Chosen | null;
  /** Whether what is drawn is what is now. */
  live(): boolean;
  inspected(): Inspector['state'];
  /** Whether the server tells where feet are about to land. */
  tellsLandings(): boolean;
  driven(): Shown | null;
  drivenAvatars(): number[];
  /** Whether a step is to land where it is asked to or not to begin. */
  mustBeMet(): boolean;
  viewAt(x: number, y: number): Shown | null;
  goLive(): void;
  say(text: string): void;
}

/** How near to an outline's middle it is grabbed, in CSS pixels. */
const grabPx = 18;
/** Places of steps that are remembered until their feet are there. */
const mostRemembered = 64;
/** How long the nearest in reach of a footprint that was refused is marked. */
const nearestMs = 8000;

export class FootprintTool {
  private placingNow = false;
  /** Where steps lead that have been seen waiting, or were asked for here: a movement under way does not tell. */
  private readonly remembered = new Map<bigint, {readonly atM: Vec3; readonly headingRad: number}>();
  /** The footprint that is dragged to another place. */
  private dragged: {
    readonly shown: Shown; readonly avatar: number; readonly requestId: bigint;
    atM: readonly [number, number, number]; moved: boolean;
  } | null = null;

  /** The nearest in reach of the last that was refused here. */
  private nearest: {readonly shown: Shown; readonly atM: Vec3; readonly headingRad: number; readonly untilMs: number} | null =
    null;
  /** Asked for here, and to be met. */
  private readonly strict = new Set<bigint>();

  constructor(private readonly host: FootprintHost) {}

  /** Whether clicks on the ground are footprints. */
  get placing(): boolean {
    return this.placingNow;
  }

  setPlacing(on: boolean): void {
    this.placingNow = on;
    if (on) this.host.say(this.host.chosen() ? 'Click where the next foot is to land.' :
      'Choose a figure, then click where its next foot is to land.');
  }

  /** Asks the chosen avatar for a step to a place of the page. */
  place(shown: Shown, x: number, y: number): void {
    const atM = shown.view.groundAt(x, y);
    const avatars = this.host.drivenAvatars();
    if (atM === null) return;
    if (avatars.length !== 1 || this.host.driven() !== shown) {
      this.host.say('A footprint is for one: choose a figure of this world.');
      return;
    }
    const avatar = avatars[0]!;
    this.host.goLive();
    const from = shown.view.place(avatar);
    const requestId = nextRequestId();
    this.remember(requestId, atM, from ? Math.atan2(atM[0] - from.x, atM[2] - from.z) : 0);
    this.nearest = null;
    const mustBeMet = this.host.mustBeMet();
    if (mustBeMet) this.strict.add(requestId);
    void shown.world.request([
      {avatar, type: 'step', requestId, foot: 'auto', atM, ...(mustBeMet ? {mustBeMet} : {})},
    ]).then((reply) => {
      const [dx, dz] = [atM[0].toFixed(2), atM[2].toFixed(2)];
      this.host.say(reply.ok ? `Asked for a foot at x ${dx}, z ${dz} m.` :
        `Refused: ${reply.items[0]?.text || reply.text}`);
    });
  }

  /** One that had to be met and is not: the nearest in reach is marked for a while. */
  onEvent(shown: Shown, event: WorldEvent): void {
    if (event.type === 'finished') this.strict.delete(event.requestId);
    if (event.type !== 'rejected' || !this.strict.delete(event.requestId)) return;
    if (event.positionM.every((x) => x === 0)) return;  // None is told, as where feet are not planted.
    // Asked for without a heading: the body's.
    this.nearest = {shown, atM: event.positionM, headingRad: event.baseHeadingRad,
                    untilMs: performance.now() + nearestMs};
    this.show();
  }

  private remember(requestId: bigint, atM: Vec3, headingRad: number): void {
    this.remembered.delete(requestId);
    this.remembered.set(requestId, {atM, headingRad});
    if (this.remembered.size > mostRemembered) this.remembered.delete(this.remembered.keys().next().value!);
  }

  /** The footprints that feet of the one looked at are on their way to: as planned, or as asked for where nobody tells. */
  private underWay(shown: Shown): {readonly atM: Vec3; readonly headingRad: number}[] {
    const chosen = this.host.chosen();
    const state = chosen?.shown === shown && this.host.live() ? this.host.inspected() : null;
    if (!state?.movement || state.avatar !== chosen!.avatar) return [];
    if (this.host.tellsLandings()) {
      return state.movement.landings.map(({positionM, headingRad}) => ({atM: positionM, headingRad}));
    }
    const asked = this.remembered.get(state.movement.requestId);
    return asked ? [asked] : [];
  }

  /** Footprints that wait in the queue of the one looked at. */
  private waiting(shown: Shown): QueuedRequest[] {
    const chosen = this.host.chosen();
    const state = chosen?.shown === shown && this.host.live() ? this.host.inspected() : null;
    return state && state.avatar === chosen!.avatar ?
      state.queue.filter(({type, atM}) => type === 'step' && atM !== null) : [];
  }

  /** Marks for them and the one under way; the one that is dragged lies where it is held. */
  show(): void {
    for (const shown of this.host.shown) {
      const {x = 0, z = 0} = shown.view.place(shown.view.chosen) ?? {};
      const next = this.underWay(shown);
      const last = next.at(-1);
      let from = last ? [last.atM[0], last.atM[2]] : [x, z];
      const waiting = this.waiting(shown).map(({atM, headingRad, requestId}) => {
        const held = this.dragged?.shown === shown && this.dragged.requestId === requestId;
        const place = held ? this.dragged!.atM : atM!;
        const heading = headingRad ?? Math.atan2(place[0] - from[0]!, place[2] - from[1]!);
        from = [place[0], place[2]];
        if (!held) this.remember(requestId, place, heading);
        return {atM: place, headingRad: heading};
      });
      if (this.nearest && performance.now() > this.nearest.untilMs) this.nearest = null;
      shown.view.plan([...next, ...waiting, ...(this.nearest?.shown === shown ? [this.nearest] : [])]);
    }
  }

  /** Whether there is one to drag at this place of the page. */
  grab(x: number, y: number): boolean {
    const chosen = this.host.chosen();
    const shown = this.host.viewAt(x, y);
    if (!shown || !chosen) return false;
    for (const {atM, requestId} of this.waiting(shown)) {
      const on = shown.view.onPage([atM![0], shown.view.ground.heightAt(atM![0], atM![2]), atM![2]]);
      if (!on || Math.hypot(on.x - x, on.y - y) > grabPx) continue;
      this.dragged = {shown, avatar: chosen.avatar, requestId, atM: atM!, moved: false};
      return true;
    }
    return false;
  }

  drag(x: number, y: number): void {
    const at = this.dragged?.shown.view.groundAt(x, y);
    if (!at) return;
    this.dragged!.atM = at;
    this.dragged!.moved = true;
    this.show();
  }

  /** It stays where it was. */
  release(): void {
    this.dragged = null;
    this.show();
  }

  /** The queue is asked for once more, with that footprint elsewhere. */
  async drop(): Promise<void> {
    const dragged = this.dragged;
    this.dragged = null;
    if (!dragged?.moved) return;
    const {shown: {world}, avatar, requestId, atM} = dragged;
    try {
      const {queue, queueSize} = await world.inspect(avatar);
      if (!queue.some((item) => item.requestId === requestId)) {
        this.host.say('Too late: that step has begun.');
        return;
      }
      if (queueSize > queue.length) {
        this.host.say('Too many movements wait to change one.');
        return;
      }
      const items = queue.map((item): MovementRequest => {
        const {type, foot, lengthM, heightM, turnRad, seconds, waypointsM} = item;
        const place = item.requestId === requestId ? atM : item.atM;
        return {
          avatar, requestId: item.requestId, type, foot, lengthM, heightM, turnRad, seconds, waypointsM,
          ...(place === null ? {} : {atM: place}),
          ...(item.mustBeMet ? {mustBeMet: true} : {}),
          ...(item.sideM === null ? {} : {sideM: item.sideM}),
          ...(item.headingRad === null ? {} : {headingRad: item.headingRad}),
          ...(item.speedMPerS === null ? {} : {speedMPerS: item.speedMPerS}),
        };
      });
      await world.cancel([avatar]);
      const reply = await world.request(items);
      this.host.say(reply.ok ? `Moved the footprint to x ${atM[0].toFixed(2)}, z ${atM[2].toFixed(2)} m.` :
        `Refused: ${reply.items[0]?.text || reply.text}`);
    } catch {
      this.host.say('The server told nothing about that avatar.');
    }
  }
}
