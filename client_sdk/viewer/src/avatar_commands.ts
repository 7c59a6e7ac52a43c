// Sends the commands of the command panel and of keys to the selected avatar, or to all avatars of
// a world.

import {RandomWalkers} from './random_walkers.js';
import {makeSampleTerrain} from './sample_terrains.js';
import type {SampleTerrainName} from './sample_terrains.js';
import type {AvatarState, MovementRequest, Reply, World} from './sdk.js';
import type {AvatarSelection, WorldPane} from './world_pane.js';

/** The parts of the page that commands use. */
export interface CommandHost {
  selection(): AvatarSelection | null;
  /** The pane of the world that receives commands, if any. */
  commandedPane(): WorldPane | null;
  /** Selects an avatar; 0 clears the selection. */
  select(pane: WorldPane | null, avatar: number): void;
  /** Moves the camera so that all avatars are in view. */
  frameAllAvatars(): void;
  /** Returns to the live view if the user was looking at the recording. */
  goLive(): void;
  /** Shows a message to the user. */
  notify(text: string): void;
  /** Called when the page clears the queues of these avatars. */
  onCancelled(pane: WorldPane, avatars: readonly number[]): void;
  /** Clears the panel's choice of terrain, because the world may have none of the samples. */
  resetTerrainChoice(): void;
}

/** Number of avatars spawned into an empty world. */
export const initialWalkerCount = 8;

/** States that the server sent before a toggle may arrive this long after the toggle's reply. */
const staleStateMs = 1000;

export class AvatarCommands {
  /** True if commands go to all avatars of the world instead of the selected one. */
  allAvatars = false;
  /** The world whose terrain this page is changing. */
  private terrainRequestedFor: World | null = null;
  private terrainChoiceWorld: World | null = null;
  /**
   * Layers that are playing, according to the commands of this page and the states that the server
   * reports. Each entry is "avatar layer".
   */
  private readonly playingLayers = new WeakMap<World, Set<string>>();
  /** Avatars whose foot planting is disabled, from the same sources. */
  private readonly unplantedAvatars = new WeakMap<World, Set<number>>();
  /**
   * Number of toggles whose effect reported states may not contain yet. While it is above 0, the
   * page ignores reported states.
   */
  private recentToggles = 0;

  constructor(private readonly host: CommandHost) {}

  /** The avatars that receive commands. */
  targets(): number[] {
    const pane = this.host.commandedPane();
    if (!pane) return [];
    if (this.allAvatars) return [...pane.world.avatars()];
    const selection = this.host.selection();
    if (selection) return [selection.avatar];
    return pane.world.avatars().length === 1 ? [...pane.world.avatars()] : [];
  }

  /** Requests a movement for each target. */
  request(make: (avatar: number) => MovementRequest): void {
    const to = this.addressees();
    if (!to) return;
    const {pane, avatars} = to;
    this.host.goLive();
    void pane.world.request(avatars.map(make)).then((reply) => {
      if (!reply.ok) this.notifyRefused(reply);
      else if (avatars.length === 1) this.host.notify('Movement queued.');
      else this.host.notify(`Movements queued for ${avatars.length} avatars.`);
    });
  }

  setTerrain(name: SampleTerrainName): void {
    const pane = this.host.commandedPane();
    if (!pane) return;
    this.terrainRequestedFor = pane.world;
    void pane.world.setTerrain(makeSampleTerrain(name)).then((reply) => {
      if (reply.ok) {
        this.host.notify(`Changed the terrain of ${pane.world.name}.`);
        return;
      }
      this.host.notify(`Refused: ${reply.text}`);
      this.terrainRequestedFor = null;
      this.host.resetTerrainChoice();
    });
  }

  /** Resets the panel's choice of terrain, unless this page has changed the terrain itself. */
  onTerrainChanged(world: World): void {
    if (this.terrainRequestedFor !== world) this.host.resetTerrainChoice();
    this.terrainRequestedFor = null;
  }

  /**
   * Must be called with the world that receives commands whenever this world may have changed. If
   * it has, resets the panel's choice of terrain.
   */
  setTerrainChoiceWorld(world: World): void {
    if (world === this.terrainChoiceWorld) return;
    this.terrainChoiceWorld = world;
    this.host.resetTerrainChoice();
  }

  /** Returns whether all targets play the layer, as far as the page knows. */
  isLayerPlaying(layer: string): boolean {
    const pane = this.host.commandedPane();
    const avatars = this.targets();
    const playing = pane && this.playingLayers.get(pane.world);
    return !!playing && avatars.length > 0 &&
      avatars.every((avatar) => playing.has(`${avatar} ${layer}`));
  }

  /** Stops the layer if all targets play it, and otherwise starts it. */
  toggleLayer(layer: string): void {
    const to = this.addressees();
    if (!to) return;
    const {pane: {world}, avatars} = to;
    const off = this.isLayerPlaying(layer);
    const playing = this.playingLayers.get(world) ?? new Set<string>();
    this.playingLayers.set(world, playing);
    this.host.goLive();
    ++this.recentToggles;
    const commands = avatars.map((avatar) => ({avatar, layer, enabled: !off}));
    void world.setLayers(commands).then((reply) => {
      if (reply.accepted === 0) {
        this.notifyRefused(reply);
        return;
      }
      const refused = new Set(reply.items.map((item) => item.avatar));
      for (const avatar of avatars) {
        if (off) playing.delete(`${avatar} ${layer}`);
        else if (!refused.has(avatar)) playing.add(`${avatar} ${layer}`);
      }
    }).finally(() => this.expireToggle());
  }

  /** Returns whether foot planting is enabled for all targets, as far as the page knows. */
  areFeetPlanted(): boolean {
    const pane = this.host.commandedPane();
    const unplanted = pane && this.unplantedAvatars.get(pane.world);
    return !unplanted || !this.targets().some((avatar) => unplanted.has(avatar));
  }

  /** Call with each state that the server reports. */
  onAvatarState(world: World, {avatar, plantingEnabled, layers}: AvatarState): void {
    if (this.recentToggles > 0) return;
    if (!plantingEnabled) this.unplantedIn(world).add(avatar);
    else this.unplantedAvatars.get(world)?.delete(avatar);
    const playing = this.playingLayers.get(world) ?? new Set<string>();
    this.playingLayers.set(world, playing);
    for (const name of world.layers) {
      const plays = layers.some(({layer, ending}) => layer === name && !ending);
      if (plays) playing.add(`${avatar} ${name}`);
      else playing.delete(`${avatar} ${name}`);
    }
  }

  /** Turns foot planting off if it is on for all targets, and otherwise on. */
  togglePlanting(): void {
    const to = this.addressees();
    if (!to) return;
    const {pane: {world}, avatars} = to;
    const on = !this.areFeetPlanted();
    this.host.goLive();
    ++this.recentToggles;
    void world.setPlanting(avatars, on).then((reply) => {
      if (reply.accepted === 0) {
        this.notifyRefused(reply);
        return;
      }
      this.host.notify(`Foot planting is ${on ? 'on' : 'off'} from the next movement.`);
      const refused = new Set(reply.items.map((item) => item.avatar));
      const unplanted = this.unplantedIn(world);
      for (const avatar of avatars) {
        if (on) unplanted.delete(avatar);
        else if (!refused.has(avatar)) unplanted.add(avatar);
      }
    }).finally(() => this.expireToggle());
  }

  /** Clears the queues of all targets. */
  cancel(): void {
    const pane = this.host.commandedPane();
    const avatars = this.targets();
    if (!pane || avatars.length === 0) return;
    for (const avatar of avatars) pane.randomWalkers?.remove(avatar);
    this.host.onCancelled(pane, avatars);
    void pane.world.cancel(avatars).then((reply) => {
      this.host.notify(reply.ok ? 'Queue cleared.' : `Refused: ${reply.text}`);
    });
  }

  /** Removes all targets from their world. */
  remove(): void {
    const pane = this.host.commandedPane();
    const avatars = this.targets();
    if (!pane || avatars.length === 0) return;
    void pane.world.remove(avatars).then((reply) => {
      if (!reply.ok) this.notifyRefused(reply);
      else if (avatars.includes(this.host.selection()?.avatar ?? 0)) this.host.select(null, 0);
    });
  }

  /**
   * Spawns avatars on a spiral around the origin. If the world already has avatars, the spiral is
   * around the camera's target and starts farther out. The server removes the new avatars when the
   * page closes, unless the world is persistent.
   */
  async spawn(pane: WorldPane | null, count: number, walkRandomly: boolean): Promise<void> {
    if (!pane) return;
    const centre = pane.view.viewCamera.target;
    const already = pane.world.avatars().length;
    const items: {positionM: readonly [number, number, number]; headingRad: number}[] = [];
    for (let i = 0; i < count; ++i) {
      const k = already === 0 ? i : already + i;
      const r = 1.1 * Math.sqrt(k);
      const angle = k * 2.399963;  // The golden angle distributes avatars evenly.
      const x = (already ? centre.x : 0) + r * Math.sin(angle);
      const z = (already ? centre.z : 0) + r * Math.cos(angle);
      items.push({
        positionM: [x, pane.view.terrain.heightAt(x, z), z] as const,
        headingRad: count > 1 ? angle : 0,
      });
    }
    const reply = await pane.world.spawn(items);
    if (!reply.ok) this.host.notify(`Refused: ${reply.text}`);
    if (reply.accepted === 0) return;
    const spawned = reply.items.filter(({code}) => code === 0);
    for (const item of spawned) pane.ownAvatars.add(item.avatar);
    if (walkRandomly) {
      const walkers = this.randomWalkersOf(pane);
      spawned.forEach((item) => {
        const {positionM, headingRad} = items[item.index]!;
        walkers.add(item.avatar, positionM[0], positionM[2], headingRad);
      });
      this.host.frameAllAvatars();
    } else if (count === 1 && reply.items[0]) {
      this.host.select(pane, reply.items[0].avatar);
    }
  }

  /**
   * If avatars of the world walk at random, stops all of them. Otherwise, lets avatars walk at
   * random: all avatars of the world if commands go to all avatars, or else the selected avatar.
   * Without a selection, the avatars that this page has spawned walk, or all avatars if the page
   * has spawned none. If the world is empty, spawns new avatars.
   */
  toggleRandomWalk(): void {
    const pane = this.host.commandedPane();
    if (!pane) return;
    if (pane.randomWalkers && pane.randomWalkers.size > 0) {
      pane.randomWalkers.clear();
      return;
    }
    const selection = this.host.selection();
    const avatars = selection && !this.allAvatars ? [selection.avatar] :
      this.allAvatars || pane.ownAvatars.size === 0 ? [...pane.world.avatars()] :
        [...pane.ownAvatars];
    if (avatars.length === 0) {
      void this.spawn(pane, initialWalkerCount, true);
      return;
    }
    const walkers = this.randomWalkersOf(pane);
    for (const avatar of avatars) {
      const at = pane.view.locate(avatar);
      walkers.add(avatar, at?.x ?? 0, at?.z ?? 0, at?.headingRad ?? 0);
    }
  }

  /**
   * Returns the avatars that receive a command, and their pane. If there are none, notifies the
   * user and returns null.
   */
  private addressees(): {pane: WorldPane; avatars: number[]} | null {
    const pane = this.host.commandedPane();
    const avatars = this.targets();
    if (pane && avatars.length > 0) return {pane, avatars};
    this.host.notify('Select an avatar first, or command all avatars.');
    return null;
  }

  private randomWalkersOf(pane: WorldPane): RandomWalkers {
    pane.randomWalkers ??=
      new RandomWalkers(pane.world, (text) => this.host.notify(`Refused: ${text}`));
    return pane.randomWalkers;
  }

  private unplantedIn(world: World): Set<number> {
    const unplanted = this.unplantedAvatars.get(world) ?? new Set<number>();
    this.unplantedAvatars.set(world, unplanted);
    return unplanted;
  }

  private expireToggle(): void {
    setTimeout(() => --this.recentToggles, staleStateMs);
  }

  private notifyRefused(reply: Reply): void {
    this.host.notify(`Refused: ${reply.items[0]?.text || reply.text}`);
  }
}
