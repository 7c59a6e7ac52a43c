/**
 * Public types for worlds, avatars, commands and poses. Those of the connection are in
 * `client_types.ts`.
 *
 * Names carry their units: M is metres, S is seconds, Rad is radians. The coordinate system is
 * right-handed with +Y up. Heading 0 faces +Z, and turning left is positive. Quaternions have unit
 * length and are stored as x, y, z, w.
 */
import type * as messages from '../generated/messages';
import type {
  EndSite, Foot, Leg, MovementType, ParameterName, RequestItem, Role, Terrain
} from '../generated/messages';

export type {
  EndSite, EventType as WorldEventType, Foot, HeightField, Interrupt, Landing, Leg, MovementKind,
  MovementType, ParameterName, PlayingLayer, RequestOutcome, Role, Terrain, TerrainBox
} from '../generated/messages';
/**
 * Precision of received poses.
 * - `full`: float32 values, exactly as the server computed them.
 * - `quantised`: about a quarter of the bytes. With detail `all`, the error of each joint and end
 *   site is at most 1 mm.
 * - `movement`: the client evaluates movements with the world's motion library, which it fetches
 *   from the server first. The poses are exactly those of the server. A recording stores them with
 *   at least the precision of `quantised`.
 */
export type PoseMode = 'full' | 'quantised' | 'movement';
/**
 * Selects the joints that a quantised pose contains.
 * - `all`: all joints.
 * - `reduced`: omits joints whose omission moves no point of the figure by more than 0.12 m, for
 *   example hands, toes and head.
 * - `root`: the root joint only.
 *
 * The client sets an omitted joint to its reference rotation, which is a typical rotation of that
 * joint.
 */
export type PoseDetail = 'all' | 'reduced' | 'root';
/**
 * State of a world.
 * - `pending`: the client will join the world as soon as it is connected.
 * - `joining`: the client has sent the request to join and waits for the reply.
 * - `joined`: the client receives data and may send commands.
 * - `refused`: the server refused the join, or `joinWorld` failed.
 * - `left`: `World.leave` was called.
 */
export type WorldState = 'pending' | 'joining' | 'joined' | 'refused' | 'left';
export type Vec3 = readonly [number, number, number];
/** Fields that may be absent. */
type Given<T> = {[name in keyof T]?: NonNullable<T[name]>};
/** The fields `K` may be absent. */
type Optional<T, K extends keyof T> = Omit<T, K> & {[name in K]?: T[name]};

/**
 * Parameters of a movement: `turn` in radians, all others in metres. Those that begin with `start`
 * or `end` are positions of the moving foot relative to the fixed foot, before and after a step.
 * `length` and `height` are those of a jump.
 */
export type Parameters = {readonly [name in ParameterName]?: number};

/**
 * Result of a command. Commands never throw. Their promises reject only if the WebAssembly module
 * has stopped because of an internal error.
 */
export interface Reply {
  /** True if the command and all of its items were carried out. */
  readonly ok: boolean;
  /**
   * Status code, one of `Status`; 0 if ok. 1xx: the caller, 2xx: data, 3xx: network, 4xx: server.
   * If the server accepted the command but refused some of its items: the code of the first
   * refused item.
   */
  readonly code: number;
  /** Name of the code, for example `no_such_avatar`. */
  readonly status: string;
  /** Readable explanation; empty if ok. */
  readonly text: string;
  /** Number of items that succeeded. */
  readonly accepted: number;
  /**
   * Results of the items. For a spawn: of all items, in order. For other commands: of the items
   * that failed.
   */
  readonly items: readonly ReplyItem[];
}

/** Result of one item of a command. */
export interface ReplyItem extends messages.ReplyItem {
  /** Name of `code`, for example `no_such_avatar`. */
  readonly status: string;
}

/** An avatar to spawn. `teleport` requires `avatar`. */
export type SpawnItem = Optional<messages.SpawnItem, 'avatar' | 'teleport'>;

/**
 * Starts, changes or ends a layer: a clip of the motion library that is blended over an avatar's
 * movements, for example waving. Layers change neither the legs nor the root. By default,
 * `enabled` is true, `weight` and `speed` are 1, and `blendS` is 0.3.
 */
export type LayerRequest =
    Optional<messages.LayerItem, 'enabled' | 'weight' | 'blendS' | 'speed'>;

/**
 * A movement to add to an avatar's queue. The comments state which types use a field; other types
 * ignore it. Absent numbers are 0 unless stated otherwise.
 *
 * Unless `allowNearest` is true, a step or jump is rejected when it is about to start if the motion
 * library would miss its place by more than 0.2 m, or its direction or heading by more than 60
 * degrees. The event `rejected` contains the nearest one within reach. Smaller errors are visible
 * in `WorldEvent.applied`.
 */
export interface MovementRequest
    extends Given<Omit<RequestItem, 'avatar' | 'requestId' | 'type'>> {
  avatar: number;
  /** Identifies the request in events, 1 to 2^64 - 1. Absent: the client counts from 1. */
  requestId?: number | bigint;
  type: MovementType;
}

/** A request that waits in an avatar's queue. Fields that its type does not use are 0, empty or
 * null. */
export type QueuedRequest = RequestItem;

/** State of an avatar at a tick: the result of `World.inspect`. */
export interface AvatarState
    extends Omit<messages.AvatarState,
                 'type' | 'nonce' | 'world' | 'code' | 'text' | 'movement'> {
  /** The current movement; null if the avatar is idle. */
  readonly movement: CurrentMovement | null;
}

/** The movement that an avatar carries out. A stand has no group, keytimes or weights. */
export interface CurrentMovement extends Omit<messages.CurrentMovement, 'parameterNames'> {
  /** Server time of the last keytime. */
  readonly endTimeS: number;
  /** Names of the columns of `exampleParameters`. */
  readonly parameterNames: readonly ParameterName[];
}

/** Rate and detail of poses within a distance from the centre of a region. */
export interface RegionRing extends messages.RateRing {
  /** Detail of the poses. Absent: the detail of the observation. Requires mode `quantised`. */
  detail?: PoseDetail;
}

/** A circle on the ground. Avatars enter the region when their root is within its radius. */
export interface Region {
  /** World x of the centre, in metres. */
  x: number;
  /** World z of the centre, in metres. */
  z: number;
  /** Above 0. */
  radiusM: number;
  /** Avatars leave the region at `radiusM + leaveMarginM` from the centre. At least 0. Absent: the
   * server chooses. */
  leaveMarginM?: number;
  /**
   * Rings of the region, at most 4, from the inside out. Beyond the last ring, rate and detail of
   * the observation apply.
   */
  rings?: readonly RegionRing[];
}

/** Describes which poses and events to receive from a world: the argument of `World.observe`. */
export interface Observation {
  mode: PoseMode;
  /** Ids of the avatars to observe. Absent or empty: all avatars of the world. */
  avatars?: readonly number[];
  /**
   * Observes the avatars inside a region instead of a list; `avatars` must then be empty. Events
   * `entered` and `left` report changes. A session that observes a region of a world cannot have
   * other subscriptions to that world.
   */
  region?: Region;
  /** The server sends one pose per this many ticks, 1 to 3600. Default 1. */
  everyNTicks?: number;
  /**
   * True if the client also receives the world's events. Default false; controllers always receive
   * them.
   */
  withEvents?: boolean;
  /** Default `all`. Other values require mode `quantised`. */
  detail?: PoseDetail;
}

/** A running observation. It survives reconnects and lost sessions. */
export interface Subscription {
  /** Unique within the client; 0 if the observation is invalid. */
  readonly id: number;
  /** The server's reply to the observation. */
  readonly reply: Promise<Reply>;
  /** Replaces the observed region. Avatars that are inside both regions neither leave nor enter.
   * Fails with `no_such_subscription` if the subscription has no region. */
  moveRegion(region: Region): Promise<Reply>;
  /** Ends the subscription. */
  stop(): Promise<Reply>;
}

/**
 * Something that happened to an avatar. Ignore fields that the type does not use.
 */
export interface WorldEvent extends Omit<messages.Event, 'foot'> {
  /** Foot strike: the foot that landed. Rejected step: the foot that should have moved. Otherwise
   * null. */
  readonly foot: Foot | null;
}

/** The skeleton shared by all avatars of a world. */
export interface Skeleton {
  /** 1 to 256. */
  readonly jointCount: number;
  readonly names: readonly string[];
  /** Index of each joint's parent, smaller than the joint's own index; -1 for the root, joint 0. */
  readonly parents: Int16Array;
  /** Three numbers per joint: offset from the parent, in the parent's frame. */
  readonly offsetsM: Float32Array;
  readonly endSites: readonly EndSite[];
  readonly leftLeg: Leg;
  readonly rightLeg: Leg;
}

/**
 * How a sampled pose was obtained.
 * - `interpolated`: from the received poses around the sampled time, or exactly a received one.
 * - `extrapolated`: the next pose has not arrived. The motion continues, and stops after 0.25 s.
 * - `held`: the motion has stopped, because no later pose continues it.
 * - `missing`: no pose is known for that time, and the output is not valid.
 */
export type PoseKind = 'interpolated' | 'extrapolated' | 'held' | 'missing';

/** Output buffer of `World.sample`. Create it with `createPose`. */
export interface Pose {
  /** Four numbers per joint: the root in world space, other joints relative to their parent.
   * Replaced by a larger array if the skeleton has more joints. */
  rotations: Float32Array;
  /** World position of the root. */
  readonly rootM: Float32Array;
  jointCount: number;
  /** Tick of the last received pose at or before the sampled time. */
  tick: number;
  /** True if the avatar stands and its queue is empty. */
  standing: boolean;
  /** Detail in which the server sent the pose. */
  detail: PoseDetail;
  /** If the pose is extrapolated or held: time since the pose of `tick`. Otherwise 0. */
  heldS: number;
  /**
   * Poses with equal segments belong to one continuous motion. If a pose and the one displayed
   * before have different segments, do not blend them. A new segment begins, for example, if the
   * avatar has teleported, the client has reconnected, the render time has jumped, or poses arrived
   * after the extrapolation had ended.
   */
  segment: number;
}

/** Bits of `CrowdPose.flags`. */
export const PoseFlag = {
  /** The last received pose at or before the sampled time does not continue the previous one. */
  discontinuity: 1,
  /** The avatar stands and its queue is empty. */
  standing: 2,
  /** The pose is held instead of interpolated or extrapolated. */
  held: 4,
  /** The server sent the pose with detail `reduced`. */
  reducedJoints: 8,
  /** The server sent the pose with detail `root`. */
  rootOnly: 16,
  /** The pose is extrapolated. */
  extrapolated: 32,
} as const;

/**
 * Output buffer of `sampleAll`. Create it with `createCrowdPose`. Only the first `count` avatars
 * are valid, sorted by ascending id. Arrays that are too small are replaced by larger ones.
 */
export interface CrowdPose {
  /** Number of valid avatars. */
  count: number;
  /** Joints per avatar. */
  jointCount: number;
  /** Id of each avatar. */
  avatars: Uint32Array;
  /** Bits of `PoseFlag` for each avatar. */
  flags: Uint8Array;
  /** Three numbers per avatar: world position of the root. */
  rootsM: Float32Array;
  /** 4 * jointCount numbers per avatar: the root in world space, other joints relative to their
   * parent. */
  rotations: Float32Array;
}

/** The last seconds of a world as received, for replay. */
export interface Recording {
  /** Server time of the oldest recorded pose; NaN if the recording is empty. */
  readonly firstTimeS: number;
  /** Server time of the newest recorded pose; NaN if the recording is empty. */
  readonly lastTimeS: number;
  /** Memory in use. The size of the events is an estimate. */
  readonly bytes: number;
  /**
   * Same as `World.sampleAll`, but from the recording. Returns 0 before the recorded time and more
   * than 2 s after it.
   */
  sampleAll(timeS: number, out: CrowdPose): number;
  /** Returns recorded events with server times in [fromS, toS], in order of arrival. */
  events(fromS: number, toS: number): WorldEvent[];
  clear(): void;
}

/** A world that the client has joined or wants to join. It survives reconnects. */
export interface World {
  readonly name: string;
  readonly role: Role;
  readonly state: WorldState;
  /** The skeleton of the avatars; null until the server has sent it. */
  readonly skeleton: Skeleton | null;
  /** Hash of the world's motion library; empty until the server has sent it. */
  readonly libraryHash: string;
  /** Names of the motion library's layers, for `setLayers`. */
  readonly layers: readonly string[];
  readonly recording: Recording;
  /** The ground of the world. Null if it is flat at height 0. When the terrain changes, a new
   * object replaces this one. */
  readonly terrain: Terrain | null;
  /** The reply to `joinWorld`. It does not change if the client joins again after a reconnect. */
  readonly joined: Promise<Reply>;

  // Commands wait until the world is joined. Except `observe` and `leave`, they fail with `closed`
  // while the client is `idle` or `closed`. They fail with `invalid_argument` if an argument is
  // invalid. Lists have 1 to 65536 items.

  spawn(items: readonly SpawnItem[]): Promise<Reply>;
  remove(avatars: readonly number[]): Promise<Reply>;
  /** Drops the requests of these avatars that have not started. Walks in progress end after their
   * current step. */
  cancel(avatars: readonly number[]): Promise<Reply>;
  /** Queues movements. The list may contain several requests per avatar. */
  request(items: readonly MovementRequest[]): Promise<Reply>;
  /** Replaces the terrain of the world for all avatars; null: flat at height 0. Copies the
   * argument. */
  setTerrain(terrain: Terrain | null): Promise<Reply>;
  /** Starts, changes or ends layers, at most four per avatar. */
  setLayers(items: readonly LayerRequest[]): Promise<Reply>;
  /** Enables or disables foot planting from the next movement on. Planted feet do not slide;
   * otherwise feet move as in the examples. Initially enabled, unless the server is configured
   * otherwise. */
  setPlanting(avatars: readonly number[], enabled: boolean): Promise<Reply>;
  /** Starts to receive poses, and events if requested. At most 256 subscriptions per world. */
  observe(observation: Observation): Subscription;
  /**
   * Returns the state of an avatar, about one tick later. Rejects with a `StridewireError` if the
   * avatar does not exist, the world is not joined, the client is not connected or loses the
   * connection, the reply takes longer than 10 s, or 64 calls are already pending.
   */
  inspect(avatar: number): Promise<AvatarState>;
  /** Leaves the world. The object cannot be used afterwards; join the world again instead. */
  leave(): Promise<Reply>;

  /** Calls `listener` for each event of that name. Returns a function that removes it. */
  on<K extends keyof WorldListeners>(name: K, listener: WorldListeners[K]): () => void;

  /**
   * Returns the ids of the avatars whose poses the client receives, in ascending order. When the
   * set changes, the next call returns a new array.
   */
  avatars(): Uint32Array;
  /** Computes the pose of an avatar at a server time, usually `Client.renderTimeS()`. */
  sample(avatar: number, timeS: number, out: Pose): PoseKind;
  /** Computes the poses of all observed avatars at a server time and returns their number. Omits
   * avatars without a pose at this time. Allocates nothing once `out` is large enough. */
  sampleAll(timeS: number, out: CrowdPose): number;
}

/** Arguments of the listeners that `World.on` accepts. */
export interface WorldListeners {
  /** Called when something has happened to an avatar. */
  event: (event: WorldEvent) => void;
  /** Called when `World.avatars()` has changed. */
  avatars: (avatars: Uint32Array) => void;
  /** Called when `World.terrain` has changed. */
  terrain: (terrain: Terrain | null) => void;
  /** Called when `World.state` or `World.skeleton` has changed. */
  state: (state: WorldState) => void;
  /**
   * Called when the server dropped data because the client reads too slowly. Both numbers are
   * totals since joining. After dropped events, end the observation of a region and observe it
   * again, because reports of avatars that entered or left it may be missing.
   */
  lagging: (droppedBatches: number, droppedEvents: number) => void;
}
