/**
 * Public types for worlds, avatars, commands and poses. Those of the connection are in
 * `client_types.ts`.
 *
 * Names carry their units: M is metres, S is seconds, Rad is radians. The coordinate system is
 * right-handed with +Y up. Heading 0 faces +Z, and turning left is positive. Quaternions have unit
 * length and are stored as x, y, z, w.
 */
import type {RequestItem} from '../generated/messages';

/** A `controller` may send commands and receives all events of the world. An `observer` may only
 * observe. */
export type Role = 'controller' | 'observer';
/**
 * Precision of received poses.
 * - `full`: float32 values, exactly as the server computed them.
 * - `quantised`: about a quarter of the bytes. The error of each joint and end site is at most 1
 *   mm. Poses of older servers have 40 % of the bytes of `full`.
 * - `movement`: the client evaluates movements with the world's motion library, which it fetches
 *   from the server first. The poses are exactly those of the server. A recording stores them with
 *   the precision of `quantised`.
 */
export type PoseMode = 'full' | 'quantised' | 'movement';
/**
 * Selects the joints that a quantised pose contains.
 * - `all`: all joints.
 * - `reduced`: without joints that move no point of the figure by more than 0.12 m, for example
 *   hands, toes and head.
 * - `root`: the root joint only.
 *
 * The client sets an omitted joint to its reference rotation, which is a typical rotation of that
 * joint.
 */
export type PoseDetail = 'all' | 'reduced' | 'root';
/** Type of a requested movement. A walk is carried out as a series of steps. */
export type MovementType = 'step' | 'jump' | 'stand' | 'walk';
/** Kind of a movement that an avatar carries out. */
export type MovementKind = 'stepLeft' | 'stepRight' | 'jump' | 'stand';
/**
 * Determines when a requested movement starts.
 * - `none`: after all queued movements.
 * - `afterMovement`: after the current movement. Clears the queue and ends a stand or walk.
 * - `now`: as soon as the feet allow it. Clears the queue and ends a stand or walk.
 */
export type Interrupt = 'none' | 'afterMovement' | 'now';
export type Foot = 'left' | 'right';
/** `entered` and `left` occur only if a region is observed. They report that an avatar entered the
 * region, or left the region or the world. */
export type WorldEventType = 'accepted' | 'started' | 'footStrike' | 'finished' | 'idle' |
    'rejected' | 'spawned' | 'removed' | 'entered' | 'left';
/**
 * How a request ended.
 * - `none`: the event does not end a request.
 * - `completed`: finished; the movement was played to its end, or the walk has arrived.
 * - `rejected`: rejected; the avatar could not execute the request.
 * - `cancelled`: rejected; `World.cancel` or a teleport dropped it.
 * - `replaced`: rejected or finished; another request dropped it, or cut its movement short.
 * - `removed`: rejected; the avatar was removed.
 */
export type RequestOutcome =
    'none' | 'completed' | 'rejected' | 'cancelled' | 'replaced' | 'removed';
export type ParameterName = 'startX' | 'startY' | 'startZ' | 'endX' | 'endY' | 'endZ' | 'turn' |
    'length' | 'height';
/**
 * State of a world.
 * - `pending`: the client will join the world as soon as it is connected.
 * - `joining`: the client has sent the request to join and waits for the reply.
 * - `joined`: the client receives data and may send commands.
 * - `refused`: the server refused the join.
 * - `left`: `World.leave` was called.
 */
export type WorldState = 'pending' | 'joining' | 'joined' | 'refused' | 'left';
export type Vec3 = readonly [number, number, number];
/** Fields that may be absent. */
type Given<T> = {[name in keyof T]?: NonNullable<T[name]>};

/**
 * Parameters of a movement: `turn` in radians, all others in metres. Positions and distances are
 * those of the moving foot relative to the fixed foot, in the base frame.
 */
export type Parameters = {readonly [name in ParameterName]?: number};

/** Result of a command. Commands never throw, and their promises are never rejected. */
export interface Reply {
  /** True if the command and all of its items were carried out. */
  readonly ok: boolean;
  /**
   * Status code, one of `Status`; 0 if ok. 1xx: the caller, 2xx: data, 3xx: network, 4xx: server.
   * If only some items failed, the code of the first of them; `accepted` counts the others.
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
export interface ReplyItem {
  /** Position of the item in the command's list, from 0. */
  readonly index: number;
  /** Id of the avatar. For a spawn without an id this is the id chosen by the server. */
  readonly avatar: number;
  /** Id of the movement request; 0n for other items. */
  readonly requestId: bigint;
  /** Result of the item, one of `Status`; 0 if the item succeeded. */
  readonly code: number;
  readonly status: string;
  readonly text: string;
}

/** Grid of ground heights, interpolated bilinearly. */
export interface HeightField {
  /** World x and z of the first sample. */
  readonly originM: readonly [number, number];
  /** Distance between neighbouring samples, 0.01 to 1000. */
  readonly cellM: number;
  /** Number of samples along x, 2 to 1024. */
  readonly columns: number;
  /** Number of samples along z, 2 to 1024. */
  readonly rows: number;
  /** columns * rows heights in [-10000, 10000], row by row; x varies fastest. */
  readonly heightsM: Float32Array;
}

/** Axis-aligned block with vertical sides and a flat top. */
export interface TerrainBox {
  /** Smallest x and z. */
  readonly minM: readonly [number, number];
  /** Largest x and z; each must be greater than in `minM`. */
  readonly maxM: readonly [number, number];
  /** Height of the top, in [-10000, 10000]. */
  readonly heightM: number;
}

/**
 * The ground of a world. Its height at a point is the maximum of the height field and the boxes
 * there. Outside the grid of the height field, and if there is no height field, that height is 0.
 */
export interface Terrain {
  readonly heightField: HeightField | null;
  /** Boxes on the ground, at most 65536. */
  readonly boxes: readonly TerrainBox[];
}

/** An avatar to spawn. */
export interface SpawnItem {
  /** Id of the avatar in its world, 1 to 2^32 - 1. Absent or 0: the server chooses. */
  avatar?: number;
  /** World position of the avatar's base frame. */
  positionM: Vec3;
  headingRad: number;
  /**
   * True: an existing avatar is moved there at once, instead of creating one. It drops its
   * movements and requests, and stands. Requires `avatar`. Default false.
   */
  teleport?: boolean;
}

/**
 * Starts, changes or ends a layer: a clip of the motion library that is blended over an avatar's
 * movements, for example waving. Layers do not change the legs and the root.
 */
export interface LayerRequest {
  readonly avatar: number;
  /** Name of the layer, one of `World.layers`. */
  readonly layer: string;
  /**
   * True starts or changes the layer. False fades it out and ends it; `weight` and `speed` are then
   * ignored. Default true.
   */
  readonly enabled?: boolean;
  /** Weight of the layer, above 0 and at most 1. Default 1. */
  readonly weight?: number;
  /** Time over which weight and speed change, 0 to 10. Default 0.3. */
  readonly blendS?: number;
  /** Playback rate, 0.1 to 4. Default 1, the speed of the recording. */
  readonly speed?: number;
}

/**
 * A movement to add to an avatar's queue. The comments state which types use a field; other types
 * ignore it. Absent numbers are 0 unless stated otherwise.
 *
 * A step or jump is rejected when it is about to start if the motion library would miss its place
 * by more than 0.2 m, or its direction or heading by more than 60 degrees. The event `rejected`
 * contains the nearest one in reach. Smaller errors are visible in `WorldEvent.applied`.
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
export type QueuedRequest = Readonly<RequestItem>;

/** State of an avatar at a tick: the result of `World.inspect`. */
export interface AvatarState {
  readonly avatar: number;
  readonly tick: number;
  /** Server time of the tick. */
  readonly timeS: number;
  /** Base frame: position and heading at the start of the current movement. */
  readonly basePositionM: Vec3;
  readonly baseHeadingRad: number;
  /** The current movement; null if the avatar is idle. */
  readonly movement: CurrentMovement | null;
  /** Number of requests in the queue, without the current movement. */
  readonly queueSize: number;
  /** The first 16 requests of the queue. */
  readonly queue: readonly QueuedRequest[];
  /** True if foot planting is enabled, see `World.setPlanting`. */
  readonly plantingEnabled: boolean;
  /** Active layers, at most four. Later layers are blended over earlier ones. */
  readonly layers: readonly PlayingLayer[];
}

/** A layer that is active on an avatar. */
export interface PlayingLayer {
  /** Name of the layer, one of `World.layers`. */
  readonly layer: string;
  /** Current weight, 0 to 1. */
  readonly weight: number;
  /** Current time in the layer's clip. */
  readonly timeS: number;
  /** Current playback rate; 1 is the speed of the recording. */
  readonly speed: number;
  /** True while the layer fades out. */
  readonly ending: boolean;
}

/** The planned landing of a foot in the current movement. */
export interface Landing {
  readonly foot: Foot;
  /** World position of the ball of the foot, on the ground. */
  readonly positionM: Vec3;
  readonly headingRad: number;
}

/** The movement that an avatar carries out. A stand has no group, keytimes or weights. */
export interface CurrentMovement {
  /**
   * Id of the request; 0n if the server inserted the movement, for example a step between two
   * requests.
   */
  readonly requestId: bigint;
  readonly kind: MovementKind;
  /** Index of the group of examples in the motion library; -1: none. */
  readonly group: number;
  /** Server time at which the movement started. */
  readonly startTimeS: number;
  /** Server time of the last keytime. */
  readonly endTimeS: number;
  /** Keytimes in seconds from the start of the movement, ascending; the first is 0. */
  readonly keytimesS: Float64Array;
  /** Keytime index plus fraction, 0 to the number of keytimes less 1. */
  readonly genericTime: number;
  /** Duration from the start over which the transition from the previous movement fades out. */
  readonly easeOutS: number;
  /** Parameters as requested. */
  readonly requested: Parameters;
  /** Parameters of the synthesized movement. */
  readonly applied: Parameters;
  /** True if the applied parameters are outside the range of the recorded examples. */
  readonly extrapolated: boolean;
  /** True if the requested parameters are out of reach and were clamped. */
  readonly clamped: boolean;
  /** Blend weights, one per example of the group. They sum to 1. */
  readonly weights: Float32Array;
  /** Names of the columns of `exampleParameters`. */
  readonly parameterNames: readonly ParameterName[];
  /** Parameters of the group's examples: one row of `parameterNames.length` numbers per weight.
   * May be empty. */
  readonly exampleParameters: Float32Array;
  /** Landing positions of feet in the air. Empty if foot planting is disabled. */
  readonly landings: readonly Landing[];
}

/** Rate and detail of poses within a distance from the centre of a region. */
export interface RegionRing {
  /** Distance from the centre up to which the ring applies. It must increase from ring to ring. */
  outerRadiusM: number;
  /** The server sends one pose per this many ticks, 1 to 3600. */
  everyNTicks: number;
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
  /** Unique within the client. */
  readonly id: number;
  /** The server's reply to the observation. */
  readonly reply: Promise<Reply>;
  /** Replaces the observed region. Avatars that are inside both regions neither leave nor enter.
   * Fails with `no_such_subscription` if the subscription has no region. */
  moveRegion(region: Region): Promise<Reply>;
  /** Ends the subscription. */
  stop(): Promise<Reply>;
}

/** Something that happened to an avatar. Fields that the type does not use are 0, empty or null. */
export interface WorldEvent {
  readonly type: WorldEventType;
  readonly avatar: number;
  /**
   * Id of the request; 0n if the event belongs to no request, for example a step that the server
   * inserted.
   */
  readonly requestId: bigint;
  readonly tick: number;
  /** Server time, on the same clock as poses. */
  readonly timeS: number;
  /** Started, finished: the kind of the movement. */
  readonly kind: MovementKind;
  /** Started: index of the group of examples in the motion library; -1: none. */
  readonly group: number;
  /** Started: parameters as requested. */
  readonly requested: Parameters;
  /** Started: parameters of the synthesized movement. */
  readonly applied: Parameters;
  /** Started: the applied parameters are outside the range of the recorded examples. */
  readonly extrapolated: boolean;
  /**
   * Started: the requested parameters are out of reach and were clamped. Accepted: the motion
   * library cannot walk at the requested speed.
   */
  readonly clamped: boolean;
  /** Finished: another request interrupted the movement before its end. */
  readonly cutShort: boolean;
  /** Foot strike: the foot that landed. Rejected step: the foot that should have moved. */
  readonly foot: Foot | null;
  /** Foot strike: where the foot landed. Rejected because it is out of reach: the nearest reachable
   * position. */
  readonly positionM: Vec3;
  /** Finished, idle, spawned: the avatar's new base frame. */
  readonly basePositionM: Vec3;
  readonly baseHeadingRad: number;
  /** Rejected: the cause, one of `Status`. */
  readonly code: number;
  /** Rejected: readable explanation. */
  readonly reason: string;
  /** Rejected because it is out of reach: distance between the requested and the nearest place. */
  readonly missedM: number;
  /** Rejected because it is out of reach: angle between the requested and the nearest direction or
   * heading, the larger one. */
  readonly missedRad: number;
  /** Rejected because it is out of reach: the nearest step or jump, as in `MovementRequest`. */
  readonly nearestLengthM: number;
  readonly nearestSideM: number;
  readonly nearestHeightM: number;
  readonly nearestTurnRad: number;
  /** Heading of the foot at `positionM`; after a jump, of the avatar. */
  readonly nearestHeadingRad: number;
  /** Accepted walk: the walking speed of the library that is nearest to the requested one. End of a
   * walk: its mean speed without the first and the last steps. 0: unknown. */
  readonly speedMPerS: number;
  /** How the request ended. Every accepted request has exactly one event in which it is not `none`,
   * and no event after it. */
  readonly outcome: RequestOutcome;
}

/** Tip of a chain of joints, for example of the head or a toe. */
export interface EndSite {
  /** Index of the joint that the end site belongs to. */
  readonly joint: number;
  /** Position relative to the joint, in the joint's frame. */
  readonly offsetM: Vec3;
}

/** Joints of a leg, as indices into the skeleton; -1: unknown. */
export interface Leg {
  readonly hip: number;
  readonly knee: number;
  readonly ankle: number;
  readonly ball: number;
  /** Ball of the foot, in the frame of the joint `ball`. */
  readonly ballOffsetM: Vec3;
  /** Tip of the toes, in the frame of the joint `ball`. */
  readonly toeTipOffsetM: Vec3;
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
 * Origin of a sampled pose.
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
  /** Tick of the received pose at or before the sampled time. */
  tick: number;
  /** True if the avatar stands and its queue is empty. */
  standing: boolean;
  /** Detail in which the server sent the pose. */
  detail: PoseDetail;
  /** If the pose is extrapolated or held: time since the last received pose. Otherwise 0. */
  heldS: number;
  /** Poses with equal segments belong to one continuous motion. If a pose and the one displayed
   * before have different segments, do not blend them: the avatar has teleported, the client has
   * reconnected, or poses arrived after the extrapolation had ended. */
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
  /** Same as `World.sampleAll`, but from the recording. Returns 0 outside the recorded time. */
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
  /** The ground of the world. Null if it is flat at height 0. A change replaces the object. */
  readonly terrain: Terrain | null;
  /** The server's first reply to joining. */
  readonly joined: Promise<Reply>;

  // Commands wait until the world is joined. They fail with `closed` while the client is `idle` or
  // `closed`, and with `invalid_argument` if an argument is invalid. Lists have 1 to 65536 items.

  spawn(items: readonly SpawnItem[]): Promise<Reply>;
  remove(avatars: readonly number[]): Promise<Reply>;
  /** Clears the queues of these avatars. Current movements continue. */
  cancel(avatars: readonly number[]): Promise<Reply>;
  /** Queues movements. The list may contain several requests per avatar. */
  request(items: readonly MovementRequest[]): Promise<Reply>;
  /** Replaces the terrain of the world for all avatars; null: flat at height 0. Copies the
   * argument. */
  setTerrain(terrain: Terrain | null): Promise<Reply>;
  /** Starts, changes or ends layers, at most four per avatar. */
  setLayers(items: readonly LayerRequest[]): Promise<Reply>;
  /** Enables or disables foot planting from the next movement on. Planted feet do not slide;
   * otherwise feet move as in the examples. Initially enabled. */
  setPlanting(avatars: readonly number[], enabled: boolean): Promise<Reply>;
  /** Starts to receive poses, and events if requested. At most 256 subscriptions per world. */
  observe(observation: Observation): Subscription;
  /**
   * Returns the state of an avatar, about one tick later. Rejects with a `StridewireError` if the
   * avatar does not exist, the client is not connected, the reply takes longer than 10 s, or 64
   * calls are already pending.
   */
  inspect(avatar: number): Promise<AvatarState>;
  /** Leaves the world. The object cannot be used afterwards; join the world again instead. */
  leave(): Promise<Reply>;

  /** Calls `listener` for each event of that name. Returns a function that removes it. */
  on<K extends keyof WorldListeners>(name: K, listener: WorldListeners[K]): () => void;

  /**
   * Returns the ids of the avatars whose poses the client receives, ascending. A change replaces
   * the array.
   */
  avatars(): Uint32Array;
  /** Computes the pose of an avatar at a server time, usually `Client.renderTimeS()`. */
  sample(avatar: number, timeS: number, out: Pose): PoseKind;
  /** Computes the poses of all visible avatars at a server time and returns their number. Allocates
   * nothing once `out` is large enough. */
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
   * totals since joining.
   */
  lagging: (droppedBatches: number, droppedEvents: number) => void;
}
