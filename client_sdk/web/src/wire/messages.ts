/**
 * Validated messages as plain objects. 64-bit integers are `bigint` if they may exceed 2^53.
 */
import type {
  AvatarState, EndSite, Leg, PoseDetail, PoseMode, QueuedRequest, Role, Terrain, Vec3, WorldEvent
} from '../types';
import type {CompactCodec} from './compact_codec';

export interface Hello {
  type: 'Hello';
  protocolMin: number;
  protocolMax: number;
  clientName: string;
  authToken: string;
  resumeToken: Uint8Array;
  lastEventsNumber: bigint;
}
export interface JoinWorld {
  type: 'JoinWorld';
  seq: bigint;
  name: string;
  role: Role;
}
export interface LeaveWorld {
  type: 'LeaveWorld';
  seq: bigint;
  world: number;
}
export interface SpawnEntry {
  avatar: number;
  positionM: Vec3;
  headingRad: number;
}
export interface Spawn {
  type: 'Spawn';
  seq: bigint;
  world: number;
  items: SpawnEntry[];
}
export interface Remove {
  type: 'Remove';
  seq: bigint;
  world: number;
  avatars: Uint32Array;
}
export interface Request {
  type: 'Request';
  seq: bigint;
  world: number;
  items: QueuedRequest[];
}
export interface CancelQueue {
  type: 'CancelQueue';
  seq: bigint;
  world: number;
  avatars: Uint32Array;
}
export interface Observe {
  type: 'Observe';
  seq: bigint;
  world: number;
  subscription: number;
  mode: PoseMode | 'movement';
  avatars: Uint32Array;
  everyNTicks: number;
  withEvents: boolean;
  region: RegionEntry | null;
  replace: boolean;
  detail: PoseDetail;
}
export interface RegionEntry {
  x: number;
  z: number;
  radiusM: number;
  leaveM: number | null;
  rings: {toM: number; everyNTicks: number}[];
  /** Detail of each ring. Empty: all rings have the detail of the Observe message. */
  ringDetails: PoseDetail[];
}
export interface StopObserving {
  type: 'StopObserving';
  seq: bigint;
  subscription: number;
}
export interface Ping {
  type: 'Ping';
  nonce: bigint;
  timeS: number;
}
export interface InspectAvatar {
  type: 'InspectAvatar';
  nonce: bigint;
  world: number;
  avatar: number;
}
export interface Goodbye {
  type: 'Goodbye';
  code: number;
  text: string;
}
export interface ServerLimits {
  maxControlBytes: number;
  maxBulkBytes: number;
  maxItems: number;
  maxAvatarsPerWorld: number;
  maxQueue: number;
  replyMemory: number;
  idleTimeoutS: number;
  resumeWindowS: number;
}
export interface Welcome {
  type: 'Welcome';
  protocol: number;
  session: bigint;
  resumeToken: Uint8Array;
  resumed: boolean;
  lastSeq: bigint;
  tickHz: number;
  serverName: string;
  serverVersion: string;
  limits: ServerLimits;
}
export interface Joint {
  name: string;
  parent: number;
  offsetM: Vec3;
}
export interface WorldInfo {
  type: 'WorldInfo';
  seq: bigint;
  world: number;
  name: string;
  role: Role;
  tick: bigint;
  libraryHash: string;
  joints: Joint[];
  endSites: EndSite[];
  leftLeg: Leg;
  rightLeg: Leg;
  layers: string[];
  /**
   * Encoding of each joint's rotation in compact poses. Empty: the server sends no compact poses.
   */
  rotationCodes: RotationCode[];
  /** Joints in poses of detail `reduced`, ascending. Empty: the server has no such detail. */
  fewerJoints: number[];
}
/** Describes how a joint's rotation is encoded, see protocol/STANDARD.md, "Poses". */
export interface RotationCode {
  /** x, y, z, w. */
  reference: readonly [number, number, number, number];
  low: Vec3;
  step: Vec3;
  bits: Vec3;
  freeBits: number;
  leastW: number;
}
/** Encoding of a batch. Servers send compact batches to clients that requested `quantised`, if they
 * can. */
export type BatchMode = PoseMode | CompactMode;
/** Compact encodings for the details `all`, `reduced` and `root`. */
export type CompactMode = 'compact' | 'compactFewer' | 'compactRoot';
export interface ReplyEntry {
  index: number;
  avatar: number;
  requestId: bigint;
  code: number;
  text: string;
}
export interface ReplyMessage {
  type: 'Reply';
  seq: bigint;
  code: number;
  text: string;
  accepted: number;
  items: ReplyEntry[];
}
/** Arrays are views of the frame. `poses` is not validated yet; PoseReader does that. */
export interface PoseBatch {
  type: 'PoseBatch';
  world: number;
  shard: number;
  part: number;
  parts: number;
  tick: number;
  serverTimeS: number;
  mode: BatchMode;
  jointCount: number;
  avatars: Uint32Array;
  flags: Uint8Array;
  poses: Uint8Array;
  /** True for regions: an avatar that is missing in the batch may still exist. */
  partial: boolean;
  /** Decoder for compact poses. decodeFrame sets it to null; the session sets that of the world. */
  codec: CompactCodec | null;
}
export interface Events {
  type: 'Events';
  world: number;
  number: bigint;
  tick: bigint;
  events: WorldEvent[];
}
export interface Lagging {
  type: 'Lagging';
  world: number;
  droppedBatches: number;
  droppedEvents: number;
}
export interface ErrorNotice {
  type: 'Error';
  code: number;
  text: string;
  fatal: boolean;
  seq: bigint;
}
export interface Pong {
  type: 'Pong';
  nonce: bigint;
  timeS: number;
  serverTimeS: number;
  tick: bigint;
}

export interface AvatarStateMessage {
  type: 'AvatarState';
  nonce: bigint;
  world: number;
  code: number;
  text: string;
  state: AvatarState;
}

export interface SetTerrain {
  type: 'SetTerrain';
  seq: bigint;
  world: number;
  terrain: Terrain | null;
}
export interface LayerEntry {
  avatar: number;
  layer: string;
  off: boolean;
  weight: number;
  blendS: number;
  speed: number;
}
export interface SetPlanting {
  type: 'SetPlanting';
  seq: bigint;
  world: number;
  avatars: Uint32Array;
  off: boolean;
}
export interface SetLayers {
  type: 'SetLayers';
  seq: bigint;
  world: number;
  items: LayerEntry[];
}
export interface WorldTerrain {
  type: 'WorldTerrain';
  world: number;
  terrain: Terrain | null;
}

/** Requests a piece of a motion library file. */
export interface FetchLibrary {
  type: 'FetchLibrary';
  nonce: bigint;
  hash: string;
  offset: number;
  length: number;
}
export interface LibraryPiece {
  type: 'LibraryPiece';
  nonce: bigint;
  code: number;
  text: string;
  hash: string;
  totalBytes: number;
  offset: number;
  bytes: Uint8Array;
}
/** Movements of avatars, for clients that evaluate poses themselves. This package does not. */
export interface Movements {
  type: 'Movements';
  world: number;
  shard: number;
  part: number;
  parts: number;
  moreSteps: number;
  step: bigint;
  tick: number;
  serverTimeS: number;
  states: boolean;
  avatars: Uint32Array;
  flags: Uint8Array;
  ends: Uint32Array;
  records: Uint8Array;
}

export type CommandMessage =
    JoinWorld | LeaveWorld | Spawn | Remove | Request | CancelQueue | Observe | StopObserving |
    SetTerrain | SetLayers | SetPlanting;
export type ClientMessage = Hello | CommandMessage | Ping | InspectAvatar | FetchLibrary | Goodbye;
export type ServerMessage =
    Welcome | WorldInfo | ReplyMessage | PoseBatch | Events | Lagging | ErrorNotice | Pong |
    AvatarStateMessage | WorldTerrain | Movements | LibraryPiece | Goodbye;
export type Message = ClientMessage | ServerMessage;
