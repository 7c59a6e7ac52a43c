import {Builder} from 'flatbuffers';
import * as wire from '../../generated/wire';
import {enums} from '../../generated/messages';
import {makeFrame} from './frame';
import type {WorldEventType} from '../../src/types';

/** Functions that return the frames of a server. */

function builder(): Builder {
  return new Builder(1024);
}

function finish(b: Builder, name: Parameters<typeof makeFrame>[0], root: number): ArrayBuffer {
  b.finish(root);
  return makeFrame(name, b.asUint8Array());
}

export interface WelcomeFields {
  resumed?: boolean;
  token?: number;
  idleTimeoutS?: number;
  replyMemory?: number;
  maxBulkBytes?: number;
  protocol?: number;
}

export function welcome(fields: WelcomeFields = {}): ArrayBuffer {
  const b = builder();
  const token =
      wire.Welcome.createResumeTokenVector(b, new Uint8Array(16).fill(fields.token ?? 7));
  const text = b.createString('fake');
  const limits = wire.ServerLimits.createServerLimits(
      b, 1 << 20, fields.maxBulkBytes ?? 16 << 20, 65536, 10000, 64, fields.replyMemory ?? 1024,
      fields.idleTimeoutS ?? 30, 60);
  wire.Welcome.startWelcome(b);
  wire.Welcome.addProtocol(b, fields.protocol ?? 1);
  wire.Welcome.addSession(b, 5n);
  wire.Welcome.addResumeToken(b, token);
  wire.Welcome.addResumed(b, fields.resumed ?? false);
  wire.Welcome.addTickHz(b, 60);
  wire.Welcome.addServerName(b, text);
  wire.Welcome.addLimits(b, limits);
  return finish(b, 'Welcome', wire.Welcome.endWelcome(b));
}

export function worldInfo(seq: bigint, world: number, name: string, joints = 2): ArrayBuffer {
  const b = builder();
  const list = Array.from({length: joints}, (_, j) => {
    const jointName = b.createString(`joint${j}`);
    wire.Joint.startJoint(b);
    wire.Joint.addName(b, jointName);
    wire.Joint.addParent(b, j - 1);
    wire.Joint.addOffsetM(b, wire.Offset.createOffset(b, 0, j, 0));
    return wire.Joint.endJoint(b);
  });
  const vector = wire.Skeleton.createJointsVector(b, list);
  wire.Skeleton.startSkeleton(b);
  wire.Skeleton.addJoints(b, vector);
  const skeleton = wire.Skeleton.endSkeleton(b);
  const text = b.createString(name);
  const hash = b.createString('0123');
  wire.WorldInfo.startWorldInfo(b);
  wire.WorldInfo.addSeq(b, seq);
  wire.WorldInfo.addWorld(b, world);
  wire.WorldInfo.addName(b, text);
  wire.WorldInfo.addLibraryHash(b, hash);
  wire.WorldInfo.addSkeleton(b, skeleton);
  return finish(b, 'WorldInfo', wire.WorldInfo.endWorldInfo(b));
}

export interface ItemFields {
  index: number;
  avatar?: number;
  requestId?: bigint;
  code?: number;
  text?: string;
}

export function reply(seq: bigint, code = 0, items: ItemFields[] = [], text = '',
                      accepted = 0): ArrayBuffer {
  const b = builder();
  const list = items.map((item) => wire.ReplyItem.createReplyItem(
      b, item.index, item.avatar ?? 0, item.requestId ?? 0n, item.code ?? 0,
      b.createString(item.text ?? '')));
  const vector = wire.Reply.createItemsVector(b, list);
  return finish(b, 'Reply',
                wire.Reply.createReply(b, seq, code, b.createString(text), accepted, vector));
}

export interface PoseFields {
  avatar: number;
  x: number;
  flags?: number;
  /** Rotation of every joint about +Y. */
  angleRad?: number;
}

export interface BatchFields {
  world?: number;
  shard?: number;
  part?: number;
  parts?: number;
  tick: number;
  timeS?: number;
  joints?: number;
  /** Set for batches of a region. */
  partial?: boolean;
  /** Mode `quantised` instead of `full`. */
  quantised?: boolean;
}

/** Returns a batch in mode `full` or `quantised`. The latter ignores `angleRad`. */
export function poseBatch(fields: BatchFields, poses: PoseFields[]): ArrayBuffer {
  const joints = fields.joints ?? 2;
  const b = builder();
  const numbers = new Float32Array(poses.length * (3 + 4 * joints));
  poses.forEach((pose, i) => {
    const at = i * (3 + 4 * joints);
    numbers.set([pose.x, 1, 0], at);
    const half = (pose.angleRad ?? 0) / 2;
    for (let j = 0; j < joints; ++j) {
      numbers.set([0, Math.sin(half), 0, Math.cos(half)], at + 3 + 4 * j);
    }
  });
  const bytes = wire.PoseBatch.createPosesVector(
      b, fields.quantised === true ? quantisedPoses(poses, joints)
                                   : new Uint8Array(numbers.buffer));
  const flags = wire.PoseBatch.createFlagsVector(b, poses.map((pose) => pose.flags ?? 0));
  const avatars = wire.PoseBatch.createAvatarsVector(b, poses.map((pose) => pose.avatar));
  wire.PoseBatch.startPoseBatch(b);
  wire.PoseBatch.addWorld(b, fields.world ?? 3);
  wire.PoseBatch.addShard(b, fields.shard ?? 0);
  wire.PoseBatch.addPart(b, fields.part ?? 0);
  wire.PoseBatch.addParts(b, fields.parts ?? 1);
  wire.PoseBatch.addTick(b, BigInt(fields.tick));
  wire.PoseBatch.addServerTimeS(b, fields.timeS ?? fields.tick / 60);
  wire.PoseBatch.addMode(
      b, fields.quantised === true ? wire.PoseMode.Quantised : wire.PoseMode.Full);
  wire.PoseBatch.addJointCount(b, joints);
  wire.PoseBatch.addAvatars(b, avatars);
  wire.PoseBatch.addFlags(b, flags);
  wire.PoseBatch.addPoses(b, bytes);
  wire.PoseBatch.addPartial(b, fields.partial === true);
  return finish(b, 'PoseBatch', wire.PoseBatch.endPoseBatch(b));
}

/** Encodes poses with the root at (x, 1, 0) and without rotations. */
function quantisedPoses(poses: PoseFields[], joints: number): Uint8Array {
  const poseBytes = 12 + 6 * joints;
  const view = new DataView(new ArrayBuffer(poses.length * poseBytes));
  poses.forEach((pose, i) => {
    const at = i * poseBytes;
    view.setInt32(at, Math.round(pose.x * 2 ** 14), true);
    view.setInt32(at + 4, 2 ** 14, true);
    // The identity leaves out its last component, whose index 3 is in the top bits.
    for (let j = 0; j < joints; ++j) {
      [0xc000, 0xc000, 0x4000].forEach(
          (bits, k) => view.setUint16(at + 12 + 6 * j + 2 * k, bits, true));
    }
  });
  return new Uint8Array(view.buffer);
}

export interface EventFields {
  type: WorldEventType;
  avatar: number;
  requestId?: bigint;
  timeS?: number;
  base?: [number, number, number];
}

export function events(number: bigint, list: EventFields[], world = 3): ArrayBuffer {
  const b = builder();
  const offsets = list.map((event) => {
    wire.Event.startEvent(b);
    wire.Event.addType(b, enums.EventType.indexOf(event.type));
    wire.Event.addAvatar(b, event.avatar);
    wire.Event.addRequestId(b, event.requestId ?? 0n);
    wire.Event.addTimeS(b, event.timeS ?? 0);
    const [x, y, z] = event.base ?? [0, 0, 0];
    wire.Event.addBasePositionM(b, wire.Vec3.createVec3(b, x, y, z));
    return wire.Event.endEvent(b);
  });
  const vector = wire.Events.createEventsVector(b, offsets);
  return finish(b, 'Events', wire.Events.createEvents(b, world, number, 1n, vector));
}

/** Returns terrain of boxes of 1 m x 1 m along x with these heights; null: flat. */
export function worldTerrain(heights: number[] | null, world = 3): ArrayBuffer {
  const b = builder();
  let terrain = 0;
  if (heights !== null) {
    wire.Terrain.startBoxesVector(b, heights.length);
    for (let i = heights.length - 1; i >= 0; --i) {
      wire.TerrainBox.createTerrainBox(b, i, 0, i + 1, 1, heights[i]!);
    }
    const boxes = b.endVector();
    wire.Terrain.startTerrain(b);
    wire.Terrain.addBoxes(b, boxes);
    terrain = wire.Terrain.endTerrain(b);
  }
  wire.WorldTerrain.startWorldTerrain(b);
  wire.WorldTerrain.addWorld(b, world);
  if (terrain !== 0) wire.WorldTerrain.addTerrain(b, terrain);
  return finish(b, 'WorldTerrain', wire.WorldTerrain.endWorldTerrain(b));
}

export function lagging(batches: number, dropped: number, world = 3): ArrayBuffer {
  const b = builder();
  return finish(b, 'Lagging', wire.Lagging.createLagging(b, world, BigInt(batches),
                                                         BigInt(dropped)));
}

export function error(code: number, fatal: boolean, text = ''): ArrayBuffer {
  const b = builder();
  return finish(b, 'Error', wire.Error.createError(b, code, b.createString(text), fatal, 0n));
}

export function goodbye(code: number, text = ''): ArrayBuffer {
  const b = builder();
  return finish(b, 'Goodbye', wire.Goodbye.createGoodbye(b, code, b.createString(text)));
}

export function pong(nonce: bigint, timeS: number, serverTimeS: number): ArrayBuffer {
  const b = builder();
  return finish(b, 'Pong', wire.Pong.createPong(b, nonce, timeS, serverTimeS, 1n));
}

export function avatarState(nonce: bigint, avatar: number, code = 0): ArrayBuffer {
  const b = builder();
  const text = b.createString('');
  wire.AvatarState.startAvatarState(b);
  wire.AvatarState.addNonce(b, nonce);
  wire.AvatarState.addWorld(b, 3);
  wire.AvatarState.addAvatar(b, avatar);
  wire.AvatarState.addCode(b, code);
  wire.AvatarState.addText(b, text);
  return finish(b, 'AvatarState', wire.AvatarState.endAvatarState(b));
}
