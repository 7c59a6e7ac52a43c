// Avatars that walk at random: whenever an avatar is about to run out of movements, the page
// requests a few steps, and sometimes a jump or a pause. Avatars that are far from the origin turn
// towards it.

import type {MovementRequest, World, WorldEvent} from './sdk.js';

const homeRadiusM = 4;
const stepsPerRequest = 4;
/** Shortest time between two requests for the same avatar. */
const minRequestIntervalMs = 400;

export class RandomWalkers {
  private readonly walkers = new Map<number, {pending: number; requestedMs: number}>();
  private readonly unsubscribe: () => void;

  /** `onRefused` receives the server's reason when it refuses a request. */
  constructor(
    private readonly world: World, private readonly onRefused: (text: string) => void,
    private readonly random: () => number = Math.random) {
    this.unsubscribe = world.on('event', (event) => this.onEvent(event));
  }

  get size(): number {
    return this.walkers.size;
  }

  /**
   * Starts requesting movements for an avatar that stands at `x`, `z` (metres) and faces
   * `headingRad`.
   */
  add(avatar: number, x = 0, z = 0, headingRad = 0): void {
    if (this.walkers.has(avatar)) return;
    this.walkers.set(avatar, {pending: 0, requestedMs: -1e9});
    this.requestMovements(avatar, x, z, headingRad);
  }

  /** Stops requesting movements for the avatar. It still performs those in its queue. */
  remove(avatar: number): void {
    this.walkers.delete(avatar);
  }
  clear(): void {
    this.walkers.clear();
  }
  dispose(): void {
    this.clear();
    this.unsubscribe();
  }

  private onEvent(event: WorldEvent): void {
    const walker = this.walkers.get(event.avatar);
    if (!walker) return;
    if (event.type === 'removed') {
      this.walkers.delete(event.avatar);
    } else if (event.type === 'finished' || event.type === 'rejected') {
      walker.pending = Math.max(0, walker.pending - 1);
    } else if (event.type === 'idle') {
      walker.pending = 0;
    }
    const now = performance.now();
    if (walker.pending <= 1 && now - walker.requestedMs > minRequestIntervalMs &&
        (event.type === 'finished' || event.type === 'idle')) {
      this.requestMovements(event.avatar, event.basePositionM[0]!, event.basePositionM[2]!,
        event.baseHeadingRad);
    }
  }

  private requestMovements(avatar: number, x: number, z: number, headingRad: number): void {
    const walker = this.walkers.get(avatar)!;
    const items = randomMovements(avatar, x, z, headingRad, this.random);
    walker.pending += items.length;
    walker.requestedMs = performance.now();
    void this.world.request(items).then((reply) => {
      if (reply.ok) return;
      this.walkers.delete(avatar);
      this.onRefused(reply.items[0]?.text ?? reply.text);
    });
  }
}

/**
 * Returns movements for an avatar whose base frame is at `x`, `z` (metres) and faces `headingRad`.
 */
export function randomMovements(
  avatar: number, x: number, z: number, headingRad: number,
  random: () => number): MovementRequest[] {
  const dice = random();
  if (dice < 0.08) return [{avatar, type: 'stand', seconds: 0.6 + random() * 1.2}];
  const distanceM = Math.hypot(x, z);
  // Angle from the heading to the direction of the origin, positive to the left.
  let homeRad = Math.atan2(-x, -z) - headingRad;
  homeRad = Math.atan2(Math.sin(homeRad), Math.cos(homeRad));
  const turnRad = distanceM > homeRadiusM ?
    Math.max(-0.35, Math.min(0.35, homeRad / stepsPerRequest)) : (random() - 0.5) * 0.5;
  const items: MovementRequest[] = [];
  for (let i = 0; i < stepsPerRequest; ++i) {
    items.push({avatar, type: 'step', foot: 'auto', lengthM: 0.45 + random() * 0.25, turnRad,
      allowNearest: true});
  }
  if (dice > 0.93 && distanceM < homeRadiusM) {
    items.push({avatar, type: 'jump', lengthM: 0.75 + random() * 0.3, turnRad: 0,
      allowNearest: true});
  }
  return items;
}
