// Avatars that walk by themselves: whoever runs out of things to do is given a few steps, a turn
// towards home when far away, now and then a jump or a rest.

import type {MovementRequest, World, WorldEvent} from './sdk.js';

const homeRadiusM = 4;
const stepsAtOnce = 4;
const rewalkAfterMs = 400;

export class Wander {
  private readonly walkers = new Map<number, {pending: number; askedMs: number}>();
  private readonly unsubscribe: () => void;

  constructor(
    private readonly world: World, private readonly onRefused: (text: string) => void,
    private readonly random: () => number = Math.random) {
    this.unsubscribe = world.on('event', (event) => this.onEvent(event));
  }

  get size(): number {
    return this.walkers.size;
  }
  has(avatar: number): boolean {
    return this.walkers.has(avatar);
  }

  add(avatar: number, x = 0, z = 0, headingRad = 0): void {
    if (this.walkers.has(avatar)) return;
    this.walkers.set(avatar, {pending: 0, askedMs: -1e9});
    this.walk(avatar, x, z, headingRad);
  }

  drop(avatar: number): void {
    this.walkers.delete(avatar);
  }
  stop(): void {
    this.walkers.clear();
  }
  dispose(): void {
    this.stop();
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
    if (walker.pending <= 1 && now - walker.askedMs > rewalkAfterMs &&
        (event.type === 'finished' || event.type === 'idle')) {
      this.walk(event.avatar, event.basePositionM[0]!, event.basePositionM[2]!,
        event.baseHeadingRad);
    }
  }

  private walk(avatar: number, x: number, z: number, headingRad: number): void {
    const walker = this.walkers.get(avatar)!;
    const items = movements(avatar, x, z, headingRad, this.random);
    walker.pending += items.length;
    walker.askedMs = performance.now();
    void this.world.request(items).then((reply) => {
      if (reply.ok) return;
      this.walkers.delete(avatar);
      this.onRefused(reply.items[0]?.text ?? reply.text);
    });
  }
}

/** The next few movements of a wanderer whose base frame is at x, z and looks along the heading. */
export function movements(
  avatar: number, x: number, z: number, headingRad: number, random: () => number): MovementRequest[] {
  const dice = random();
  if (dice < 0.08) return [{avatar, type: 'stand', seconds: 0.6 + random() * 1.2}];
  const away = Math.hypot(x, z);
  // The angle from where it looks to where home is, left positive.
  let home = Math.atan2(-x, -z) - headingRad;
  home = Math.atan2(Math.sin(home), Math.cos(home));
  const turn = away > homeRadiusM ? Math.max(-0.35, Math.min(0.35, home / stepsAtOnce)) :
    (random() - 0.5) * 0.5;
  const items: MovementRequest[] = [];
  for (let i = 0; i < stepsAtOnce; ++i) {
    items.push({avatar, type: 'step', foot: 'auto', lengthM: 0.45 + random() * 0.25, turnRad: turn});
  }
  if (dice > 0.93 && away < homeRadiusM) {
    items.push({avatar, type: 'jump', lengthM: 0.75 + random() * 0.3, turnRad: 0});
  }
  return items;
}
