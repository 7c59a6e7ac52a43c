// What the Drive panel and keys command, and whom: the chosen avatar, or everybody of a world.

import type {AvatarState, MovementRequest, World} from './sdk.js';
import type {Chosen, Shown} from './world_pane.js';
import {makeTerrain} from './terrain_surface.js';
import type {TerrainName} from './terrain_surface.js';
import {Wander} from './random_walkers.js';

/** What it needs of the page. */
export interface DriverHost {
  chosen(): Chosen | null;
  /** The world that commands go to. */
  driven(): Shown | null;
  choose(shown: Shown | null, avatar: number): void;
  /** The camera takes in all of them. */
  reframe(): void;
  goLive(): void;
  say(text: string): void;
  /** They have nothing more to do. */
  cancelled(shown: Shown, avatars: readonly number[]): void;
  /** Whether the server tells what avatars play. */
  tellsLayers(): boolean;
  /** The ground is one that has no name here. */
  forgetGround(): void;
}

export const wanderersAtFirst = 8;

export class Driver {
  everybody = false;
  /** The world whose ground is about to change as we asked. */
  private groundAsked: World | null = null;
  private groundOf: World | null = null;
  /** Layers that this page has started or heard of, "avatar layer". */
  private readonly playing = new WeakMap<World, Set<string>>();
  /** Whose planting this page has switched off, or has heard to be off. */
  private readonly sliding = new WeakMap<World, Set<number>>();

  /** Switches whose outcome the server's word may not have yet. */
  private switching = 0;

  constructor(private readonly host: DriverHost) {}

  /** Whom commands go to. */
  avatars(): number[] {
    const shown = this.host.driven();
    if (!shown) return [];
    if (this.everybody) return [...shown.world.avatars()];
    const chosen = this.host.chosen();
    if (chosen) return [chosen.avatar];
    return shown.world.avatars().length === 1 ? [...shown.world.avatars()] : [];
  }

  request(make: (avatar: number) => MovementRequest): void {
    const shown = this.host.driven();
    const avatars = this.avatars();
    if (!shown || avatars.length === 0) {
      this.host.say('Click a figure first, or command everybody.');
      return;
    }
    this.host.goLive();
    void shown.world.request(avatars.map(make)).then((reply) => {
      if (!reply.ok) this.host.say(`Refused: ${reply.items[0]?.text || reply.text}`);
      else this.host.say(avatars.length === 1 ? 'Asked for.' : `Asked ${avatars.length} avatars.`);
    });
  }

  setGround(name: TerrainName): void {
    const shown = this.host.driven();
    if (!shown) return;
    this.groundAsked = shown.world;
    void shown.world.setTerrain(makeTerrain(name)).then((reply) => {
      this.host.say(reply.ok ? `The ground of ${shown.world.name} is another now.` : `Refused: ${reply.text}`);
      if (reply.ok) return;
      this.groundAsked = null;
      this.host.forgetGround();
    });
  }

  /** A world's ground is another now: ours stays chosen, another's is not known by name. */
  groundChanged(world: World): void {
    if (this.groundAsked !== world) this.host.forgetGround();
    this.groundAsked = null;
  }

  /** The panel speaks of this world's ground from now on. */
  lookAt(world: World): void {
    if (world === this.groundOf) return;
    this.groundOf = world;
    this.host.forgetGround();
  }

  /** Whether all whom commands go to play it, as far as this page knows. */
  plays(layer: string): boolean {
    const shown = this.host.driven();
    const avatars = this.avatars();
    const playing = shown && this.playing.get(shown.world);
    return !!playing && avatars.length > 0 &&
      avatars.every((avatar) => playing.has(`${avatar} ${layer}`));
  }

  /** They begin with it, or end it if all of them play it. */
  toggleLayer(layer: string): void {
    const shown = this.host.driven();
    const avatars = this.avatars();
    if (!shown || avatars.length === 0) {
      this.host.say('Click a figure first, or command everybody.');
      return;
    }
    const {world} = shown;
    const off = this.plays(layer);
    const playing = this.playing.get(world) ?? new Set<string>();
    this.playing.set(world, playing);
    this.host.goLive();
    ++this.switching;
    void world.setLayers(avatars.map((avatar) => ({avatar, layer, off}))).then((reply) => {
      if (!reply.ok || reply.accepted === 0) {
        this.host.say(`Refused: ${reply.items[0]?.text || reply.text}`);
        return;
      }
      const refused = new Set(reply.items.map((item) => item.avatar));
      for (const avatar of avatars) {
        if (off) playing.delete(`${avatar} ${layer}`);
        else if (!refused.has(avatar)) playing.add(`${avatar} ${layer}`);
      }
    }).finally(() => this.settle());
  }

  /** Whether the feet of all whom commands go to are planted, as far as this page knows. */
  plants(): boolean {
    const shown = this.host.driven();
    const sliding = shown && this.sliding.get(shown.world);
    return !sliding || !this.avatars().some((avatar) => sliding.has(avatar));
  }

  /** The server has told of one. */
  hear(world: World, {avatar, plantingOff, layers}: AvatarState): void {
    if (this.switching > 0) return;
    if (plantingOff) this.slidingIn(world).add(avatar);
    else this.sliding.get(world)?.delete(avatar);
    if (!this.host.tellsLayers()) return;
    const playing = this.playing.get(world) ?? new Set<string>();
    this.playing.set(world, playing);
    for (const name of world.layers) {
      if (layers.some(({layer, ending}) => layer === name && !ending)) playing.add(`${avatar} ${name}`);
      else playing.delete(`${avatar} ${name}`);
    }
  }

  private slidingIn(world: World): Set<number> {
    const sliding = this.sliding.get(world) ?? new Set<number>();
    this.sliding.set(world, sliding);
    return sliding;
  }

  /** Feet are planted from their next movements on, or no more if all of them are. */
  togglePlanting(): void {
    const shown = this.host.driven();
    const avatars = this.avatars();
    if (!shown || avatars.length === 0) {
      this.host.say('Click a figure first, or command everybody.');
      return;
    }
    const {world} = shown;
    const on = !this.plants();
    this.host.goLive();
    ++this.switching;
    void world.setPlanting(avatars, on).then((reply) => {
      if (!reply.ok || reply.accepted === 0) {
        this.host.say(`Refused: ${reply.items[0]?.text || reply.text}`);
        return;
      }
      this.host.say(on ? 'Feet stand still from the next movement on.' :
        'Feet slide as the examples have them from the next movement on.');
      const refused = new Set(reply.items.map((item) => item.avatar));
      const sliding = this.slidingIn(world);
      for (const avatar of avatars) {
        if (on) sliding.delete(avatar);
        else if (!refused.has(avatar)) sliding.add(avatar);
      }
    }).finally(() => this.settle());
  }

  /** What was asked before a switch and is answered after it does not count. */
  private settle(): void {
    setTimeout(() => --this.switching, 1000);
  }

  cancel(): void {
    const shown = this.host.driven();
    const avatars = this.avatars();
    if (!shown || avatars.length === 0) return;
    for (const avatar of avatars) shown.wander?.drop(avatar);
    this.host.cancelled(shown, avatars);
    void shown.world.cancel(avatars).then((reply) => {
      this.host.say(reply.ok ? 'Queue cleared.' : `Refused: ${reply.text}`);
    });
  }

  remove(): void {
    const shown = this.host.driven();
    const avatars = this.avatars();
    if (!shown || avatars.length === 0) return;
    void shown.world.remove(avatars).then((reply) => {
      if (!reply.ok) this.host.say(`Refused: ${reply.items[0]?.text || reply.text}`);
      else if (avatars.includes(this.host.chosen()?.avatar ?? 0)) this.host.choose(null, 0);
    });
  }

  /** Puts avatars where there is room; they leave when this page does. */
  async spawn(shown: Shown | null, count: number, wander: boolean): Promise<void> {
    if (!shown) return;
    const centre = shown.view.view.target;
    const already = shown.world.avatars().length;
    const items: {positionM: readonly [number, number, number]; headingRad: number}[] = [];
    for (let i = 0; i < count; ++i) {
      const k = already === 0 ? i : already + i;
      const r = 1.1 * Math.sqrt(k);
      const angle = k * 2.399963;
      const x = (already ? centre.x : 0) + r * Math.sin(angle);
      const z = (already ? centre.z : 0) + r * Math.cos(angle);
      items.push({
        positionM: [x, shown.view.ground.heightAt(x, z), z] as const,
        headingRad: count > 1 ? angle : 0,
      });
    }
    const reply = await shown.world.spawn(items);
    if (!reply.ok) {
      this.host.say(`Refused: ${reply.items.find((item) => item.text)?.text || reply.text}`);
      return;
    }
    for (const item of reply.items) shown.ours.add(item.avatar);
    if (wander) {
      shown.wander ??= new Wander(shown.world, (text) => this.host.say(`Refused: ${text}`));
      reply.items.forEach((item, i) => {
        const {positionM, headingRad} = items[i]!;
        shown.wander!.add(item.avatar, positionM[0], positionM[2], headingRad);
      });
      this.host.reframe();
    } else if (count === 1 && reply.items[0]) {
      this.host.choose(shown, reply.items[0].avatar);
    }
  }

  toggleWander(): void {
    const shown = this.host.driven();
    if (!shown) return;
    if (shown.wander && shown.wander.size > 0) {
      shown.wander.stop();
      return;
    }
    const chosen = this.host.chosen();
    const avatars = chosen && !this.everybody ? [chosen.avatar] :
      this.everybody || shown.ours.size === 0 ? [...shown.world.avatars()] : [...shown.ours];
    if (avatars.length === 0) {
      void this.spawn(shown, wanderersAtFirst, true);
      return;
    }
    shown.wander ??= new Wander(shown.world, (text) => this.host.say(`Refused: ${text}`));
    for (const avatar of avatars) {
      const at = shown.view.place(avatar);
      shown.wander.add(avatar, at?.x ?? 0, at?.z ?? 0, at?.headingRad ?? 0);
    }
  }
}
