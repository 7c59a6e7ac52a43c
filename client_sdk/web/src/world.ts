import {Listeners} from './listeners';
import {detailOf} from './pose_flags';
import type {WorldRecording} from './recording';
import type {Command, Session} from './session';
import type {
  AvatarState, CrowdPose, LayerRequest, MovementRequest, Observation, Pose, PoseDetail, PoseKind, PoseMode, Recording, Reply,
  Role, Skeleton, SpawnItem, Subscription, Terrain, World, WorldListeners, WorldState
} from './types';
import * as check from './wire/check';
import {CompactCodec} from './wire/compact_codec';
import type {BatchMode, Observe, SpawnEntry, WorldInfo} from './wire/messages';
import type {WorldView} from './world_view';

/** A subscription as it is wanted. */
export interface Wanted {
  readonly message: Observe;
  /** Its command waits to be sent. */
  unsent: boolean;
}

/** A world as its callers see it, and what its session knows of it. */
export class WorldHandle implements World {
  state: WorldState = 'wanted';
  skeleton: Skeleton | null = null;
  libraryHash = '';
  layers: readonly string[] = [];
  /** Of compact poses, if the server tells them. */
  codecs: Partial<Record<BatchMode, CompactCodec>> = {};
  terrain: Terrain | null = null;
  readonly joined: Promise<Reply>;

  // The session's part.
  readonly listeners = new Listeners<WorldListeners>();
  /** The server's number of it; 0: not known. */
  serverId = 0;
  answerJoin: ((reply: Reply) => void) | null = null;
  unsent: Command[] = [];
  readonly subscriptions = new Map<number, Wanted>();
  /** Ours, and where they are. */
  readonly spawned = new Map<number, SpawnEntry>();
  toldDroppedBatches = 0;
  toldDroppedEvents = 0;
  /** Of the view, whose avatars listeners know. */
  toldVersion = 0;
  toldTerrain: Terrain | null = null;

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

  setPlanting(avatars: readonly number[], on: boolean): Promise<Reply> {
    return this.session.command(this, () => check.setPlanting(avatars, on));
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
    this.session.noteSampled(this, timeS);
    return this.view.sample(avatar, timeS, out);
  }

  sampleAll(timeS: number, out: CrowdPose): number {
    this.session.noteSampled(this, timeS);
    return this.view.sampleAll(timeS, out);
  }

  /** What the server says of it. Another figure than before clears the poses. */
  describe(info: WorldInfo): void {
    const skeleton = toSkeleton(info);
    if (this.skeleton === null || !sameFigure(this.skeleton, skeleton)) {
      this.view.reset(skeleton.jointCount);
      this.record.clear();
      this.skeleton = skeleton;
    }
    this.libraryHash = info.libraryHash;
    this.layers = info.layers;
    const {rotationCodes: codes, fewerJoints} = info;
    this.codecs = codes.length === 0 ? {} : {
      compact: new CompactCodec(codes),
      compactRoot: new CompactCodec(codes, [0]),
      ...(fewerJoints.length > 0 ? {compactFewer: new CompactCodec(codes, fewerJoints)} : {}),
    };
  }

  /** Nothing of it is known any more. */
  forget(): void {
    this.serverId = 0;
    this.toldDroppedBatches = 0;
    this.toldDroppedEvents = 0;
    this.view.reset(0);
    this.view.breakOff();
    this.record.clear();
    this.skeleton = null;
    this.libraryHash = '';
    this.layers = [];
    this.codecs = {};
    this.terrain = null;
  }

  /** Poses of whom are kept follows from what is observed. */
  updateFilter(): void {
    const wanted = new Set<number>();
    for (const {message} of this.subscriptions.values()) {
      if (message.avatars.length === 0) return this.view.setFilter(null);
      for (const avatar of message.avatars) wanted.add(avatar);
    }
    this.view.setFilter(wanted.size === 0 ? null : wanted);
  }

  /** The rate asked for; 0: none of this mode. */
  everyNTicks(batchMode: BatchMode): number {
    const mode: PoseMode = batchMode === 'full' ? 'full' : 'quantised';
    const detail = detailOf(batchMode);
    let every = 0;
    const add = (of: PoseDetail | undefined, n: number): void => {
      if (of === detail) every = every === 0 ? n : Math.min(every, n);
    };
    for (const {message} of this.subscriptions.values()) {
      if (message.mode !== mode) continue;
      add(message.detail, message.everyNTicks);
      message.region?.ringDetails.forEach((of, i) => add(of, message.region!.rings[i]!.everyNTicks));
    }
    return every;
  }
}

function toSkeleton(info: WorldInfo): Skeleton {
  const jointCount = info.joints.length;
  const offsetsM = new Float32Array(3 * jointCount);
  info.joints.forEach((joint, j) => offsetsM.set(joint.offsetM, 3 * j));
  return {
    jointCount,
    names: info.joints.map((joint) => joint.name),
    parents: Int16Array.from(info.joints, (joint) => joint.parent),
    offsetsM,
    endSites: info.endSites,
    leftLeg: info.leftLeg,
    rightLeg: info.rightLeg,
  };
}

function sameFigure(a: Skeleton, b: Skeleton): boolean {
  const plain = (s: Skeleton): string =>
      JSON.stringify([s.names, [...s.parents], [...s.offsetsM], s.endSites, s.leftLeg, s.rightLeg]);
  return plain(a) === plain(b);
}
