/**
 * What the package's users see. Units stand in names: metres, seconds, radians. Right-handed, +Y up;
 * heading 0 looks along +Z, turning left is positive; quaternions are unit, x, y, z, w.
 */

/** May command avatars and hears all events of the world, or only watches. */
export type Role = 'controller' | 'observer';
/** `full`: float32, as the server has them. `quantised`: a quarter of it, nothing off by more than 1 mm; from servers
 * of before compact poses 2.5 times smaller. */
export type PoseMode = 'full' | 'quantised';
/** How much of a pose is told. The joints that are not come as the references of the server's codes: about as the
 * library's figures mostly hold them. `fewer`: without those that move nothing by more than 0.12 m (hands, toes, the head).
 * `root`: where the figure is and how it is turned. */
export type PoseDetail = 'all' | 'fewer' | 'root';
export type MovementType = 'step' | 'jump' | 'stand' | 'walk';
/** When a movement begins: after all that is queued; after the one under way, or as soon as feet allow, and
 * then what was queued is dropped. */
export type Takeover = 'none' | 'afterMovement' | 'now';
/** What servers may or may not know of. */
export type Feature = 'inspect' | 'terrain' | 'footprints' | 'walks' | 'takeovers' | 'layers' | 'refusals' |
  'planting' | 'regions' | 'detail';
export type FootChoice = 'auto' | 'left' | 'right';
export type Foot = 'left' | 'right';
export type MovementKind = 'stepLeft' | 'stepRight' | 'jump' | 'stand';
export type WorldEventType = 'accepted' | 'started' | 'footStrike' | 'finished' | 'idle' |
    'rejected' | 'spawned' | 'removed' | 'entered' | 'left';
export type ParameterName = 'startX' | 'startY' | 'startZ' | 'endX' | 'endY' | 'endZ' | 'turn' |
    'length' | 'height';
/** `waiting`: for the next attempt; `greeting`: connected, not welcomed yet; `closed`: refused for
 * good, see `lastError`. */
export type ClientState =
    'idle' | 'waiting' | 'connecting' | 'greeting' | 'ready' | 'closing' | 'closed';
/** `wanted`: will be joined as soon as there is a connection. */
export type WorldState = 'wanted' | 'joining' | 'joined' | 'refused' | 'left';
export type Vec3 = readonly [number, number, number];

/** Metres; `turn` in radians. Moving foot minus fixed foot, in the base frame. */
export type Parameters = {readonly [name in ParameterName]?: number};

/** What came of a command. Commands never throw and their promises are never rejected. */
export interface Reply {
  readonly ok: boolean;
  /** 0 when ok; else by hundred: 1xx the caller, 2xx the data, 3xx the network, 4xx the server. */
  readonly code: number;
  /** The code's name, such as `no_such_avatar`. */
  readonly status: string;
  /** A sentence for people; empty when ok. */
  readonly text: string;
  /** How many items of the command were done. */
  readonly accepted: number;
  /** Of a spawn all, in order; of other commands those that were refused. */
  readonly items: readonly ReplyItem[];
}

export interface ReplyItem {
  /** Position in the command's list. */
  readonly index: number;
  readonly avatar: number;
  readonly requestId: bigint;
  readonly code: number;
  readonly status: string;
  readonly text: string;
}

/** Heights at the corners of a grid, bilinear between them. */
export interface HeightField {
  /** x and z of the first. */
  readonly originM: readonly [number, number];
  readonly cellM: number;
  /** Along x, 2 to 1024. */
  readonly columns: number;
  /** Along z, 2 to 1024. */
  readonly rows: number;
  /** Row by row, x fastest. */
  readonly heightsM: Float32Array;
}

/** A block with upright sides and a flat top. */
export interface TerrainBox {
  /** x and z. */
  readonly minM: readonly [number, number];
  readonly maxM: readonly [number, number];
  readonly heightM: number;
}

/** The ground: the highest of the height field (0 beside it) and the boxes there. */
export interface Terrain {
  readonly heightField: HeightField | null;
  readonly boxes: readonly TerrainBox[];
}

export interface SpawnItem {
  /** Its number in the world, up to 2^32 - 1; absent or 0: the server chooses. */
  avatar?: number;
  positionM: Vec3;
  headingRad: number;
}

/** A clip of the library over what an avatar does; legs do what they do without. */
export interface LayerRequest {
  readonly avatar: number;
  /** One of World.layers. */
  readonly layer: string;
  /** Eases it out and ends it; weight and speed then mean nothing. */
  readonly off?: boolean;
  /** Above 0, up to 1 (the default). */
  readonly weight?: number;
  /** How long weight and speed take to get there, 0 to 10; 0.3. */
  readonly blendS?: number;
  /** 0.1 to 4; 1: as recorded. */
  readonly speed?: number;
}

/** A movement to do. Numbers that a type does not have are ignored; absent ones are 0. */
export interface MovementRequest {
  avatar: number;
  /** Not 0; comes back in events. Absent: the client counts, from 1. */
  requestId?: number | bigint;
  type: MovementType;
  /** Step. `auto` (default): the other foot than last time. */
  foot?: FootChoice;
  /** Step: where the ball of the foot lands, in the world; then length, side, height and turn are
   * ignored. Refused (`unsupported`) by a server that knows no footprints. Walk: where it ends, on the
   * ground; needed. Its steps carry its id in events; then `finished` of kind `stand` says that it has
   * arrived, `rejected` why it goes no further. */
  atM?: Vec3;
  /** Step with `atM`: where the foot looks. Absent: the server chooses. Walk: the heading at its end. */
  headingRad?: number;
  /** Step, only with `atM`: when it is out of reach as the step is about to start, it is `rejected` with the
   * nearest place in reach, instead of landing there. Refused (`unsupported`) by a server that knows no refusals. */
  mustBeMet?: boolean;
  /** Walk: places to pass, at most 64. */
  waypointsM?: readonly Vec3[];
  /** Walk: 0.05 to 5, as near as the library's steps come. Absent: as is comfortable. */
  speedMPerS?: number;
  /** Absent: none. Another is refused (`unsupported`) by a server that knows no takeovers. */
  takeover?: Takeover;
  /** Step: forward distance between the feet at its end. Jump. */
  lengthM?: number;
  /** Step: sideways, towards the moving foot's side. Absent: as the library has it. */
  sideM?: number;
  /** Step, jump. */
  heightM?: number;
  /** Step, jump. */
  turnRad?: number;
  /** Stand. */
  seconds?: number;
}

/** A movement that waits in an avatar's queue. */
export interface QueuedRequest {
  readonly avatar: number;
  readonly requestId: bigint;
  readonly type: MovementType;
  readonly foot: FootChoice;
  /** Null: no walk, nor a step to a place. */
  readonly atM: Vec3 | null;
  /** Null: the server chooses. */
  readonly headingRad: number | null;
  readonly lengthM: number;
  /** Null: as the library has it. */
  readonly sideM: number | null;
  readonly heightM: number;
  readonly turnRad: number;
  readonly seconds: number;
  readonly waypointsM: readonly Vec3[];
  /** Null: as is comfortable. */
  readonly speedMPerS: number | null;
  readonly takeover: Takeover;
  readonly mustBeMet: boolean;
}

/** What an avatar does: the answer to `World.inspect`. */
export interface AvatarState {
  readonly avatar: number;
  readonly tick: number;
  /** On the server's clock. */
  readonly timeS: number;
  readonly basePositionM: Vec3;
  readonly baseHeadingRad: number;
  /** Null: just standing. */
  readonly movement: CurrentMovement | null;
  /** How many requests wait ... */
  readonly queueSize: number;
  /** ... and the first 16 of them. */
  readonly queue: readonly QueuedRequest[];
  /** Feet are not planted, as `World.setPlanting` left it. */
  readonly plantingOff: boolean;
  /** Those in play, later ones over earlier; at most four. */
  readonly layers: readonly PlayingLayer[];
}

export interface PlayingLayer {
  /** One of World.layers. */
  readonly layer: string;
  /** Now. */
  readonly weight: number;
  /** In its clip. */
  readonly timeS: number;
  readonly speed: number;
  /** On its way out. */
  readonly ending: boolean;
}

/** Where a foot of a movement under way is about to stand. */
export interface Landing {
  readonly foot: Foot;
  /** Of its ball, on the ground. */
  readonly positionM: Vec3;
  readonly headingRad: number;
}

/** A requested stand has no group, keytimes or weights. */
export interface CurrentMovement {
  /** 0n: the avatar's own doing. */
  readonly requestId: bigint;
  readonly kind: MovementKind;
  readonly group: number;
  /** On the server's clock. */
  readonly startTimeS: number;
  /** `startTimeS` and the last keytime. */
  readonly endTimeS: number;
  /** From the movement's start: 0, and growing. */
  readonly keytimesS: Float64Array;
  /** 0 to the number of keytimes less 1. */
  readonly genericTime: number;
  readonly easeS: number;
  readonly requested: Parameters;
  readonly applied: Parameters;
  readonly extrapolated: boolean;
  readonly clamped: boolean;
  /** One an example of the group; they sum to 1. */
  readonly weights: Float32Array;
  readonly parameterNames: readonly ParameterName[];
  /** Parameters of the examples: a row of `parameterNames.length` for each weight, or empty. */
  readonly sites: Float32Array;
  /** Of feet that are not there yet; none while feet are not planted. */
  readonly landings: readonly Landing[];
}

export interface RegionRing {
  toM: number;
  /** 1 to 3600. */
  everyNTicks: number;
  /** As `Observation.detail`. */
  detail?: PoseDetail;
}

/** A circle on the ground; who comes within its radius enters. */
export interface Region {
  /** Its centre. */
  x: number;
  z: number;
  /** Above 0. */
  radiusM: number;
  /** Who is inside leaves when further than radius and this; absent: the server chooses. */
  leaveM?: number;
  /** Within `toM` of the centre poses come every so many ticks and in that detail; beyond the last, and in the detail
   * where a ring names none, as the observation has it. At most 4, growing. */
  rings?: readonly RegionRing[];
}

export interface Observation {
  mode: PoseMode;
  /** Absent or empty: all. Poses of others are not kept. */
  avatars?: readonly number[];
  /** Who is in it instead of a list; 'entered' and 'left' tell who. A region is all that is observed of a world.
   * A recording has of each tick those that were due at it. */
  region?: Region;
  /** 1 (default) to 3600. */
  everyNTicks?: number;
  /** Events of the world, too. Controllers get them anyway. */
  withEvents?: boolean;
  /** 'all' (default); others of quantised poses only, from servers that have them: `Client.serverHas('detail')`. */
  detail?: PoseDetail;
}

export interface Subscription {
  readonly id: number;
  /** The server's answer to it. */
  readonly reply: Promise<Reply>;
  /** Puts another region in the place of the one observed. Who is in both neither leaves nor enters. */
  moveRegion(region: Region): Promise<Reply>;
  stop(): Promise<Reply>;
}

/** Something that happened to an avatar. Fields that a type does not name are 0, empty or null. */
export interface WorldEvent {
  readonly type: WorldEventType;
  readonly avatar: number;
  /** 0n: the avatar's own doing. */
  readonly requestId: bigint;
  readonly tick: number;
  /** On the server's clock, as poses have it. */
  readonly timeS: number;
  /** Started, finished. */
  readonly kind: MovementKind;
  /** Group of the library's examples; -1: none. */
  readonly group: number;
  /** Started. */
  readonly requested: Parameters;
  /** Started. */
  readonly applied: Parameters;
  readonly extrapolated: boolean;
  readonly clamped: boolean;
  /** Finished: another movement took over before its end. */
  readonly cutShort: boolean;
  /** Foot strike. */
  readonly foot: Foot | null;
  /** Foot strike; a step rejected as out of reach: where the nearest footprint is. */
  readonly positionM: Vec3;
  /** Finished, idle, spawned: the new base frame. */
  readonly basePositionM: Vec3;
  readonly baseHeadingRad: number;
  /** Rejected: why, as a code and a sentence. */
  readonly code: number;
  readonly reason: string;
}

export interface EndSite {
  readonly joint: number;
  readonly offsetM: Vec3;
}

/** Joints by index; -1: not known. */
export interface Leg {
  readonly hip: number;
  readonly knee: number;
  readonly ankle: number;
  readonly ball: number;
  readonly ballOffsetM: Vec3;
  readonly toeTipOffsetM: Vec3;
}

export interface Skeleton {
  readonly jointCount: number;
  readonly names: readonly string[];
  /** -1 for the root, which comes first; else smaller than the joint's own index. */
  readonly parents: Int16Array;
  /** 3 a joint: from its parent, in the parent's frame. */
  readonly offsetsM: Float32Array;
  readonly endSites: readonly EndSite[];
  readonly leftLeg: Leg;
  readonly rightLeg: Leg;
}

/** `interpolated`: between two received poses, or exactly one. `held`: the last pose before that
 * time, with nothing continuous to go on to. `missing`: nothing is known; nothing was written. */
export type PoseKind = 'interpolated' | 'held' | 'missing';

/** Room for one pose, for `World.sample`; make it with `createPose`. */
export interface Pose {
  /** Grown when the figure has more joints. */
  rotations: Float32Array;
  readonly rootM: Float32Array;
  jointCount: number;
  /** Of the received pose at or before the time. */
  tick: number;
  /** Standing, nothing queued. */
  standing: boolean;
  /** With which it was sent. */
  detail: PoseDetail;
  /** Held: how long after its last received pose. */
  heldS: number;
}

/** Bits of `CrowdPose.flags`. */
export const PoseFlag = {
  /** This is a received pose that does not continue the one before it. */
  discontinuity: 1,
  standing: 2,
  /** Not interpolated: nothing continuous came after it. */
  held: 4,
  /** It was sent with the detail 'fewer'. */
  fewerJoints: 8,
  /** It was sent with the detail 'root'. */
  rootOnly: 16,
} as const;

/** Room for the poses of a crowd, for `sampleAll`; make it with `createCrowdPose`. Arrays are only
 * replaced by larger ones; the first `count` avatars in them count, in growing order of number. */
export interface CrowdPose {
  count: number;
  jointCount: number;
  avatars: Uint32Array;
  flags: Uint8Array;
  /** 3 an avatar. */
  rootsM: Float32Array;
  /** 4 * jointCount an avatar; the root's in the world, the others relative to their parent. */
  rotations: Float32Array;
}

export interface Recording {
  /** NaN while empty. */
  readonly firstTimeS: number;
  readonly lastTimeS: number;
  /** Memory of what is kept. */
  readonly bytes: number;
  /** Poses at a time of the server's clock, as `World.sampleAll`. 0 outside what is kept. */
  sampleAll(timeS: number, out: CrowdPose): number;
  /** Events of that time, in order of arrival. */
  events(fromS: number, toS: number): WorldEvent[];
  clear(): void;
}


/** A world joined, or to be joined: lives through reconnects. */
export interface World {
  readonly name: string;
  readonly role: Role;
  readonly state: WorldState;
  /** Null until the server has described it. */
  readonly skeleton: Skeleton | null;
  readonly libraryHash: string;
  /** Names of the library's clips that setLayers plays; empty where the server has no such feature. */
  readonly layers: readonly string[];
  readonly recording: Recording;
  /** The ground; null: flat at 0. Replaced as a whole when it changes. */
  readonly terrain: Terrain | null;
  /** The server's answer to joining, the first time. */
  readonly joined: Promise<Reply>;

  spawn(items: readonly SpawnItem[]): Promise<Reply>;
  remove(avatars: readonly number[]): Promise<Reply>;
  /** Drops what these avatars have not started yet. */
  cancel(avatars: readonly number[]): Promise<Reply>;
  /** Queues movements; an avatar may stand in the list several times. */
  request(items: readonly MovementRequest[]): Promise<Reply>;
  /** Gives the world another ground, for all its avatars; null: flat at 0. */
  setTerrain(terrain: Terrain | null): Promise<Reply>;
  /** Starts or ends layers (see `layers`) over what avatars do; at most four at a time for one. */
  setLayers(items: readonly LayerRequest[]): Promise<Reply>;
  /** Feet stand still where they land (as at first), or are where the examples have them: from the next
   * movement on that each avatar begins. */
  setPlanting(avatars: readonly number[], on: boolean): Promise<Reply>;
  observe(observation: Observation): Subscription;
  /** What an avatar does right now, about a tick later. Rejected with a StridewireError when there is
   * no such avatar, no connection, or a server that does not tell. */
  inspect(avatar: number): Promise<AvatarState>;
  leave(): Promise<Reply>;

  on<K extends keyof WorldListeners>(name: K, listener: WorldListeners[K]): () => void;

  /** Avatars whose poses arrive, in growing order. The array is replaced when the set changes. */
  avatars(): Uint32Array;
  /** Pose of an avatar at a time of the server's clock (`Client.renderTimeS`). */
  sample(avatar: number, timeS: number, out: Pose): PoseKind;
  /** Poses of all avatars seen; returns their number. No garbage once `out` is large enough. */
  sampleAll(timeS: number, out: CrowdPose): number;
}

export interface WorldListeners {
  /** Something happened to an avatar. */
  event: (event: WorldEvent) => void;
  /** The set of avatars seen has changed. */
  avatars: (avatars: Uint32Array) => void;
  /** `terrain` has changed. */
  terrain: (terrain: Terrain | null) => void;
  /** `state` or `skeleton` has changed. */
  state: (state: WorldState) => void;
  /** We read too slowly: totals since joining. */
  lagging: (droppedBatches: number, droppedEvents: number) => void;
}

export interface ClientListeners {
  state: (state: ClientState) => void;
  /** Welcomed; `resumed`: the session went on, else a new one has begun. */
  connected: (resumed: boolean) => void;
  /** The server knows nothing of us any more: commands are answered `session_lost`, worlds and
   * subscriptions are asked for again. */
  sessionLost: () => void;
  /** Something the server has to say, or a command of our own after a lost session that failed. */
  notice: (code: number, text: string) => void;
  /** The connection failed or was lost; `state` tells whether attempts follow. */
  error: (code: number, text: string) => void;
}

export interface ClientOptions {
  /** `ws://host:port/stream` */
  url: string;
  /** 1 to 64 bytes. */
  clientName?: string;
  authToken?: string;
  /** Default: the global one. */
  webSocket?: new(url: string) => WebSocket;
  /** How far behind the server's time poses are shown: 0.1 s. */
  renderDelayS?: number;
  /** A clock in milliseconds that does not go back; default: performance.now. */
  now?: () => number;
  /** After a lost session put our avatars where they last were: false. */
  respawn?: boolean;
  /** Commands without an answer: 4096. */
  maxCommands?: number;
  /** Poses kept of an avatar to interpolate between: 32. */
  poseHistory?: number;
  /** Memory for them, of all worlds: 256 MiB. */
  maxPoseBytes?: number;
  /** What `World.recording` keeps: 20 s, 0 turns it off. */
  recordingS?: number;
  /** ... and at most, of one world: 192 MiB. */
  maxRecordingBytes?: number;
  /** Events a recording keeps: 65,536. */
  maxRecordedEvents?: number;
  connectTimeoutS?: number;
  pingIntervalS?: number;
  /** Seed of the back-off's jitter; default: random. */
  seed?: number;
}

/** Counted since the client was made. */
export interface Statistics {
  bytesReceived: number;
  /** Of them those of poses, with their numbers and headers. */
  poseBytesReceived: number;
  bytesSent: number;
  framesReceived: number;
  batchesReceived: number;
  posesReceived: number;
  /** For there was no memory left for that avatar, or its tick was old. */
  posesRefused: number;
  /** Batches that did not come, by gaps in the ticks of a shard. */
  batchesMissing: number;
  /** By the server, because we read too slowly, as it told. */
  batchesDropped: number;
  eventsDropped: number;
  eventsReceived: number;
  /** Frames that were refused; each ends its connection. */
  invalidFrames: number;
  commandsSent: number;
  commandsResent: number;
  /** Without an answer now. */
  commandsWaiting: number;
  connects: number;
  resumes: number;
  /** Connections after the first. */
  reconnects: number;
  connectFailures: number;
  /** Smallest round trip of the last pings; 0 before the first. */
  rttS: number;
  /** How much later than the quickest of the last seconds batches arrive: mean of the last, and
   * the worst of the last 4 s. */
  jitterS: number;
  worstJitterS: number;
  /** How far what is shown lies behind the newest pose's time, smoothed; below 0: nothing newer has
   * come, figures are held. */
  interpolationDelayS: number;
  /** Poses sampled beyond the newest received one, so held. */
  posesMissed: number;
  /** Mean, with the frame's checks, since the start. */
  decodeNsPerPose: number;
  /** Memory of poses, recordings and commands now. */
  bufferedBytes: number;
}
