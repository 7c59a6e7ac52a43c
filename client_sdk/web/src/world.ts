import {Listeners} from './listeners';
import {detailOf} from './pose_flags';
import type {WorldRecording} from './recording';
import type {Command, Session} from './session';
import type {
  AvatarState, CrowdPose, LayerRequest, MovementRequest, Observation, Pose, PoseDetail, PoseKind,
  PoseMode, Recording, Reply, Role, Skeleton, SpawnItem, Subscription, Terrain, World,
  WorldListeners, WorldState
} from './types';
import * as check from './wire/check';
import {CompactCodec} from './wire/compact_codec';
import type {BatchMode, Observe, SpawnItem as SpawnEntry, WorldInfo} from './wire/messages';
import type {WorldView} from './world_view';

/** A subscription that the client keeps up across lost sessions. */
export interface ActiveSubscription {
  readonly message: Observe;
  /** True while `message` waits to be sent. */
  unsent: boolean;
}

/** A world, with the state that the session keeps for it. Users see the interface `World` only. */
export class WorldHandle implements World {
  state: WorldState = 'pending';
  skeleton: Skeleton | null = null;
  libraryHash = '';
  layers: readonly string[] = [];
  /** Decoders of compact poses, by mode. Empty if the server sends no compact poses. */
  codecs: Partial<Record<BatchMode, CompactCodec>> = {};
  terrain: Terrain | null = null;
  readonly joined: Promise<Reply>;

  // The fields below belong to the session.
  readonly listeners = new Listeners<WorldListeners>();
  /** The world's number in messages; 0 until the server has sent it. */
  serverId = 0;
  /** Resolves `joined`; null after the first reply. */
  answerJoin: ((reply: Reply) => void) | null = null;
  /** Commands that have not been sent, in order. */
  unsent: Command[] = [];
  /** Subscriptions by number. */
  readonly subscriptions = new Map<number, ActiveSubscription>();
  /** Avatars that this client has spawned, with their last known base frames. */
  readonly spawned = new Map<number, SpawnEntry>();
  /** Total from the last Lagging message. */
  reportedDroppedBatches = 0;
  reportedDroppedEvents = 0;
  /** `view.version` and `terrain` of the last notification to listeners. */
  notifiedVersion = 0;
  notifiedTerrain: Terrain | null = null;

  constructor(private readonly session: Session, readonly name: string, readonly role: Role,
              readonly view: WorldView, readonly record: WorldRecording) {
    this.joined = new Promise((resolve) => this.answerJoin = resolve);
  }

  get recording(): Recording {
    return this.record;
  }

  spawn(items: readonly SpawnItem[]): Promise<Reply> {
    return this.session.command(this, () => check.spawn(items));
  }

  remove(avatars: readonly number[]): Promise<Reply> {
    return this.session.command(this, () => check.remove(avatars));
  }

  cancel(avatars: readonly number[]): Promise<Reply> {
    return this.session.command(this, () => check.cancelQueue(avatars));
  }

  request(items: readonly MovementRequest[]): Promise<Reply> {
    return this.session.command(this, () => check.request(items, () => this.session.nextRequest()));
  }

  setTerrain(terrain: Terrain | null): Promise<Reply> {
    return this.session.command(this, () => check.setTerrain(terrain));
  }

  setLayers(items: readonly LayerRequest[]): Promise<Reply> {
    return this.session.command(this, () => check.setLayers(items));
  }

  setPlanting(avatars: readonly number[], enabled: boolean): Promise<Reply> {
    return this.session.command(this, () => check.setPlanting(avatars, enabled));
  }

  observe(observation: Observation): Subscription {
    return this.session.observe(this, observation);
  }

  inspect(avatar: number): Promise<AvatarState> {
    return this.session.inspect(this, avatar);
  }

  leave(): Promise<Reply> {
    return this.session.leave(this);
  }

  on<K extends keyof WorldListeners>(name: K, listener: WorldListeners[K]): () => void {
    return this.listeners.on(name, listener);
  }

  avatars(): Uint32Array {
    return this.view.avatars();
  }

  sample(avatar: number, timeS: number, out: Pose): PoseKind {
    this.session.recordSample(this, timeS);
    return this.view.sample(avatar, timeS, out);
  }

  sampleAll(timeS: number, out: CrowdPose): number {
    this.session.recordSample(this, timeS);
    return this.view.sampleAll(timeS, out);
  }

  /** Applies a WorldInfo message. A different skeleton clears all poses. */
  setInfo(info: WorldInfo): void {
    const skeleton = toSkeleton(info);
    if (this.skeleton === null || !sameSkeleton(this.skeleton, skeleton)) {
      this.view.reset(skeleton.jointCount);
      this.record.clear();
      this.skeleton = skeleton;
    }
    this.libraryHash = info.libraryHash;
    this.layers = info.layers;
    const {rotationCodes: codes, reducedJoints} = info;
    this.codecs = codes.length === 0 ? {} : {
      compact: new CompactCodec(codes),
      compactRoot: new CompactCodec(codes, [0]),
      ...(reducedJoints.length > 0 ? {compactFewer: new CompactCodec(codes, reducedJoints)} : {}),
    };
  }

  /** Discards everything that the server has sent about the world. Keeps the subscriptions. */
  reset(): void {
    this.serverId = 0;
    this.reportedDroppedBatches = 0;
    this.reportedDroppedEvents = 0;
    this.view.reset(0);
    this.view.startNewEpoch();
    this.record.clear();
    this.skeleton = null;
    this.libraryHash = '';
    this.layers = [];
    this.codecs = {};
    this.terrain = null;
  }

  /** Restricts stored poses to the avatars of the subscriptions. Call it when these change. */
  updateFilter(): void {
    const observed = new Set<number>();
    for (const {message} of this.subscriptions.values()) {
      if (message.avatars.length === 0) return this.view.setFilter(null);
      for (const avatar of message.avatars) observed.add(avatar);
    }
    this.view.setFilter(observed.size === 0 ? null : observed);
  }

  /** Returns the smallest number of ticks per pose that subscriptions request for batches of this
   * mode; 0 if none requests this mode. */
  everyNTicks(batchMode: BatchMode): number {
    const mode: PoseMode = batchMode === 'full' ? 'full' : 'quantised';
    const detail = detailOf(batchMode);
    let smallest = 0;
    const add = (requested: PoseDetail | undefined, n: number): void => {
      if (requested === detail) smallest = smallest === 0 ? n : Math.min(smallest, n);
    };
    for (const {message} of this.subscriptions.values()) {
      if (message.mode !== mode) continue;
      add(message.detail, message.everyNTicks);
      message.region?.ringDetails.forEach(
          (requested, i) => add(requested, message.region!.rings[i]!.everyNTicks));
    }
    return smallest;
  }
}

function toSkeleton({skeleton}: WorldInfo): Skeleton {
  const {joints, endSites, leftLeg, rightLeg} = skeleton;
  const jointCount = joints.length;
  const offsetsM = new Float32Array(3 * jointCount);
  joints.forEach((joint, j) => offsetsM.set(joint.offsetM, 3 * j));
  return {
    jointCount,
    names: joints.map((joint) => joint.name),
    parents: Int16Array.from(joints, (joint) => joint.parent),
    offsetsM,
    endSites,
    leftLeg,
    rightLeg,
  };
}

function sameSkeleton(a: Skeleton, b: Skeleton): boolean {
  const serialise = (s: Skeleton): string =>
      JSON.stringify([s.names, [...s.parents], [...s.offsetsM], s.endSites, s.leftLeg, s.rightLeg]);
  return serialise(a) === serialise(b);
}
