import {ByteBuffer, Encoding} from 'flatbuffers';
import {tableNumbers} from '../../generated/layout';
import * as wire from '../../generated/wire';
import type {
  CurrentMovement, EndSite, Foot, Interrupt, Landing, Leg, MovementKind, MovementType,
  ParameterName, Parameters, PlayingLayer, PoseDetail, PoseMode, QueuedRequest, Role, Terrain,
  TerrainBox, Vec3, WorldEvent, WorldEventType
} from '../types';
import {frameHeaderBytes, isBulk, readFrameHeader, type MessageName, type Sender} from './frame';
import {
  maxAuthTokenBytes, maxBatchParts, maxCrowdTables, maxEndSites, maxEveryNTicks,
  maxFewTables, maxInspectedRequests, maxItems, maxJoints, maxKeytimes, maxLandings, maxLayerNames,
  maxLibraryBytes, maxNameBytes, maxParameters, maxPieceBytes, maxPlayingLayers, maxRateRings,
  maxReasonBytes, maxRecordBytes, maxResumeTokenBytes, maxTerrainBoxes, maxTerrainColumns,
  maxTextBytes, maxWaypoints, maxWeights, minResumeTokenBytes
} from '../../generated/limits';
import {Malformed} from './malformed';
import type {
  Joint, LayerEntry, Message, RegionEntry, ReplyEntry, RotationCode, SpawnEntry
} from './messages';
import {checkFewerJoints, checkRotationCodes} from './compact_codec';
import {compactPoseBytes, poseBytes} from './pose_codec';
import {readName, readText} from './text';
import {verify} from './verify';

/** Texts are read as bytes, so that they can be checked before they become strings. */
const asBytes = Encoding.UTF8_BYTES;

export const roles: readonly Role[] = ['controller', 'observer'];
export const poseModes =
    ['full', 'quantised', 'movement', 'compact', 'compactFewer', 'compactRoot'] as const;
export const poseDetails: readonly PoseDetail[] = ['all', 'reduced', 'root'];
/** Modes that a client can request. */
const observedModes = poseModes.slice(0, 3) as (PoseMode | 'movement')[];
export const movementTypes: readonly MovementType[] = ['step', 'jump', 'stand', 'walk'];
export const interrupts: readonly Interrupt[] = ['none', 'afterMovement', 'now'];
export const footChoices: readonly (Foot | 'auto')[] = ['auto', 'left', 'right'];
const feet: readonly Foot[] = ['left', 'right'];
export const movementKinds: readonly MovementKind[] = ['stepLeft', 'stepRight', 'jump', 'stand'];
export const eventTypes: readonly WorldEventType[] = [
  'accepted', 'started', 'footStrike', 'finished', 'idle', 'rejected', 'spawned', 'removed',
  'entered', 'left'
];
export const parameterNames: readonly ParameterName[] = [
  'startX', 'startY', 'startZ', 'endX', 'endY', 'endZ', 'turn', 'length', 'height'
];

/**
 * Decodes a frame and checks it against protocol/STANDARD.md: first its structure, then the meaning
 * of its fields. The poses of a batch are checked later, by PoseReader.
 * @throws Malformed the frame is invalid; no other error is thrown
 */
export function decodeFrame(frame: ArrayBuffer, sender: Sender): Message {
  const name = readFrameHeader(new DataView(frame), sender);
  const payload = new DataView(frame, frameHeaderBytes);
  if (!verify(payload, tableNumbers[name], isBulk(name) ? maxCrowdTables : maxFewTables)) {
    throw new Malformed('is not a well-formed FlatBuffers message', name);
  }
  return decoders[name](new ByteBuffer(new Uint8Array(frame, frameHeaderBytes)));
}

// ---- Checks of fields.

function finite(value: number, field: string, index = -1): number {
  if (!Number.isFinite(value)) throw new Malformed('is not finite', field, index);
  return value;
}

function notNegative(value: number, field: string): number {
  if (finite(value, field) < 0) throw new Malformed('is negative', field);
  return value;
}

function id<T extends number | bigint>(value: T, field: string, index = -1): T {
  if (value == 0) throw new Malformed('is zero', field, index);
  return value;
}

function below(value: bigint, most: bigint, field: string): number {
  if (value > most) throw new Malformed('is too large', field);
  return Number(value);
}

function known<T>(values: readonly T[], value: number, field: string, index = -1): T {
  const found = values[value];
  if (found === undefined) throw new Malformed(`enumerator ${value} is unknown`, field, index);
  return found;
}

function count(length: number, min: number, max: number, field: string): number {
  if (length < min) throw new Malformed('list is empty', field);
  if (length > max) throw new Malformed(`list of ${length} is too long`, field);
  return length;
}

function avatarList(list: Uint32Array | null, min: number, field: string): Uint32Array {
  const avatars = list ?? new Uint32Array(0);
  count(avatars.length, min, maxItems, field);
  for (let i = 0; i < avatars.length; ++i) id(avatars[i]!, field, i);
  return avatars;
}

function resumeToken(bytes: Uint8Array | null, field: string): Uint8Array {
  const length = bytes?.length ?? 0;
  if (length !== 0 && (length < minResumeTokenBytes || length > maxResumeTokenBytes)) {
    throw new Malformed('is not 16 to 64 bytes long', field);
  }
  return new Uint8Array(bytes ?? []);
}

function vector(v: wire.Vec3 | wire.Offset | null, field: string, index = -1): Vec3 {
  if (v === null) return [0, 0, 0];
  return [finite(v.x(), field, index), finite(v.y(), field, index), finite(v.z(), field, index)];
}

function parameters(length: number,
                    get: (i: number, into: wire.ParameterValue) => wire.ParameterValue | null,
                    field: string, index: number): Parameters {
  count(length, 0, maxParameters, field);
  const values: {[name in ParameterName]?: number} = {};
  const value = new wire.ParameterValue();
  for (let p = 0; p < length; ++p) {
    get(p, value);
    const name = known(parameterNames, value.name(), field, index);
    if (name in values) throw new Malformed(`${name} occurs twice`, field, index);
    values[name] = finite(value.value(), field, index);
  }
  return values;
}

// ---- Messages.

function rotationCodes(m: wire.WorldInfo, jointCount: number): RotationCode[] {
  const length = count(m.rotationCodesLength(), 0, maxJoints, 'WorldInfo.rotationCodes');
  const codes = Array.from({length}, (_, j): RotationCode => {
    const code = m.rotationCodes(j)!;
    const q = code.reference()!;
    return {
      reference: [q.x(), q.y(), q.z(), q.w()],
      low: vector(code.low(), 'WorldInfo.rotationCodes', j),
      step: vector(code.step(), 'WorldInfo.rotationCodes', j),
      bits: [code.bitsX(), code.bitsY(), code.bitsZ()],
      freeBits: code.freeBits(),
      leastW: code.leastW(),
    };
  });
  checkRotationCodes(codes, jointCount);
  return codes;
}

function fewerJoints(m: wire.WorldInfo, joints: readonly Joint[]): number[] {
  const length = count(m.fewerJointsLength(), 0, joints.length, 'WorldInfo.fewerJoints');
  if (length > 0 && m.rotationCodesLength() === 0) {
    throw new Malformed('requires rotation codes', 'WorldInfo.fewerJoints');
  }
  const told = Array.from({length}, (_, i) => m.fewerJoints(i)!);
  checkFewerJoints(told, joints.map(({parent}) => parent));
  return told;
}

const decoders: {readonly [name in MessageName]: (bytes: ByteBuffer) => Message} = {
  Hello(bytes) {
    const m = wire.Hello.getRootAsHello(bytes);
    const protocolMin = m.protocolMin();
    const protocolMax = m.protocolMax();
    if (protocolMin < 1 || protocolMin > protocolMax) {
      throw new Malformed('versions are not 1 <= min <= max', 'Hello.protocolMin');
    }
    return {
      type: 'Hello',
      protocolMin,
      protocolMax,
      clientName: name(m.clientName(asBytes), 'Hello.clientName'),
      authToken: text(m.authToken(asBytes), maxAuthTokenBytes, 'Hello.authToken'),
      resumeToken: resumeToken(m.resumeTokenArray(), 'Hello.resumeToken'),
      lastEventsNumber: m.lastEventsNumber(),
    };
  },

  JoinWorld(bytes) {
    const m = wire.JoinWorld.getRootAsJoinWorld(bytes);
    return {
      type: 'JoinWorld',
      seq: id(m.seq(), 'JoinWorld.seq'),
      name: name(m.name(asBytes), 'JoinWorld.name'),
      role: known(roles, m.role(), 'JoinWorld.role'),
    };
  },

  LeaveWorld(bytes) {
    const m = wire.LeaveWorld.getRootAsLeaveWorld(bytes);
    return {
      type: 'LeaveWorld',
      seq: id(m.seq(), 'LeaveWorld.seq'),
      world: id(m.world(), 'LeaveWorld.world'),
    };
  },

  Spawn(bytes) {
    const m = wire.Spawn.getRootAsSpawn(bytes);
    const items: SpawnEntry[] = [];
    const length = count(m.itemsLength(), 1, maxItems, 'Spawn.items');
    const item = new wire.SpawnItem();
    for (let i = 0; i < length; ++i) {
      m.items(i, item);
      items.push({
        avatar: item.avatar(),
        positionM: vector(item.positionM(), 'Spawn.positionM', i),
        headingRad: finite(item.headingRad(), 'Spawn.headingRad', i),
      });
    }
    return {
      type: 'Spawn', seq: id(m.seq(), 'Spawn.seq'), world: id(m.world(), 'Spawn.world'), items
    };
  },

  Remove(bytes) {
    const m = wire.Remove.getRootAsRemove(bytes);
    return {
      type: 'Remove',
      seq: id(m.seq(), 'Remove.seq'),
      world: id(m.world(), 'Remove.world'),
      avatars: avatarList(m.avatarsArray(), 1, 'Remove.avatars'),
    };
  },

  Request(bytes) {
    const m = wire.Request.getRootAsRequest(bytes);
    const items: QueuedRequest[] = [];
    const length = count(m.itemsLength(), 1, maxItems, 'Request.items');
    const item = new wire.RequestItem();
    for (let i = 0; i < length; ++i) {
      m.items(i, item);
      items.push(request(item, i));
    }
    return {
      type: 'Request',
      seq: id(m.seq(), 'Request.seq'),
      world: id(m.world(), 'Request.world'),
      items,
    };
  },

  CancelQueue(bytes) {
    const m = wire.CancelQueue.getRootAsCancelQueue(bytes);
    return {
      type: 'CancelQueue',
      seq: id(m.seq(), 'CancelQueue.seq'),
      world: id(m.world(), 'CancelQueue.world'),
      avatars: avatarList(m.avatarsArray(), 1, 'CancelQueue.avatars'),
    };
  },

  Observe(bytes) {
    const m = wire.Observe.getRootAsObserve(bytes);
    const avatars = avatarList(m.avatarsArray(), 0, 'Observe.avatars');
    const inRegion = region(m.region());
    if (inRegion !== null && avatars.length > 0) {
      throw new Malformed('must be empty beside a region', 'Observe.avatars');
    }
    if (inRegion === null && m.replace()) {
      throw new Malformed('requires a region', 'Observe.replace');
    }
    const mode = known(observedModes, m.mode(), 'Observe.mode');
    const detail = known(poseDetails, m.detail(), 'Observe.detail');
    if (detail !== 'all' && mode !== 'quantised') {
      throw new Malformed('requires mode quantised', 'Observe.detail');
    }
    if (inRegion !== null && inRegion.ringDetails.length > 0 && mode !== 'quantised') {
      throw new Malformed('requires mode quantised', 'Region.ringDetails');
    }
    return {
      type: 'Observe',
      seq: id(m.seq(), 'Observe.seq'),
      world: id(m.world(), 'Observe.world'),
      subscription: id(m.subscription(), 'Observe.subscription'),
      mode,
      avatars,
      everyNTicks: everyNTicks(m.everyNTicks(), 'Observe.everyNTicks'),
      withEvents: m.withEvents(),
      region: inRegion,
      replace: m.replace(),
      detail,
    };
  },

  StopObserving(bytes) {
    const m = wire.StopObserving.getRootAsStopObserving(bytes);
    return {
      type: 'StopObserving',
      seq: id(m.seq(), 'StopObserving.seq'),
      subscription: id(m.subscription(), 'StopObserving.subscription'),
    };
  },

  Ping(bytes) {
    const m = wire.Ping.getRootAsPing(bytes);
    return {type: 'Ping', nonce: m.nonce(), timeS: finite(m.timeS(), 'Ping.timeS')};
  },

  InspectAvatar(bytes) {
    const m = wire.InspectAvatar.getRootAsInspectAvatar(bytes);
    return {
      type: 'InspectAvatar',
      nonce: m.nonce(),
      world: id(m.world(), 'InspectAvatar.world'),
      avatar: id(m.avatar(), 'InspectAvatar.avatar'),
    };
  },

  Goodbye(bytes) {
    const m = wire.Goodbye.getRootAsGoodbye(bytes);
    return {
      type: 'Goodbye', code: m.code(), text: text(m.text(asBytes), maxTextBytes, 'Goodbye.text')
    };
  },

  Welcome(bytes) {
    const m = wire.Welcome.getRootAsWelcome(bytes);
    const limits = m.limits();
    const tickHz = m.tickHz();
    if (!(finite(tickHz, 'Welcome.tickHz') > 0)) {
      throw new Malformed('is not above 0', 'Welcome.tickHz');
    }
    return {
      type: 'Welcome',
      protocol: id(m.protocol(), 'Welcome.protocol'),
      session: id(m.session(), 'Welcome.session'),
      resumeToken: resumeToken(m.resumeTokenArray(), 'Welcome.resumeToken'),
      resumed: m.resumed(),
      lastSeq: m.lastSeq(),
      tickHz,
      serverName: text(m.serverName(asBytes), maxNameBytes, 'Welcome.serverName'),
      serverVersion: text(m.serverVersion(asBytes), maxNameBytes, 'Welcome.serverVersion'),
      limits: {
        maxControlBytes: limits?.maxControlBytes() ?? 0,
        maxBulkBytes: limits?.maxBulkBytes() ?? 0,
        maxItems: limits?.maxItems() ?? 0,
        maxAvatarsPerWorld: limits?.maxAvatarsPerWorld() ?? 0,
        maxQueue: limits?.maxQueue() ?? 0,
        replyMemory: limits?.replyMemory() ?? 0,
        idleTimeoutS: notNegative(limits?.idleTimeoutS() ?? 0, 'Welcome.limits.idleTimeoutS'),
        resumeWindowS: notNegative(limits?.resumeWindowS() ?? 0, 'Welcome.limits.resumeWindowS'),
      },
    };
  },

  WorldInfo(bytes) {
    const m = wire.WorldInfo.getRootAsWorldInfo(bytes);
    const skeleton = m.skeleton();
    const jointCount =
        count(skeleton?.jointsLength() ?? 0, 1, maxJoints, 'WorldInfo.skeleton.joints');
    const joints: Joint[] = [];
    const names = new Set<string>();
    const joint = new wire.Joint();
    for (let j = 0; j < jointCount; ++j) {
      skeleton!.joints(j, joint);
      const jointName = name(joint.name(asBytes), 'WorldInfo.joint.name', j);
      if (names.has(jointName)) {
        throw new Malformed('occurs twice', 'WorldInfo.joint.name', j);
      }
      names.add(jointName);
      const parent = joint.parent();
      if (j === 0 ? parent !== -1 : parent < 0 || parent >= j) {
        throw new Malformed('does not precede the joint', 'WorldInfo.joint.parent', j);
      }
      const offsetM = vector(joint.offsetM(), 'WorldInfo.joint.offsetM', j);
      joints.push({name: jointName, parent, offsetM});
    }
    const endSites: EndSite[] = [];
    const endSite = new wire.EndSite();
    const endSiteCount =
        count(skeleton!.endSitesLength(), 0, maxEndSites, 'WorldInfo.skeleton.endSites');
    for (let e = 0; e < endSiteCount; ++e) {
      skeleton!.endSites(e, endSite);
      if (endSite.joint() >= jointCount) {
        throw new Malformed('is not a joint', 'WorldInfo.endSite.joint', e);
      }
      endSites.push({
        joint: endSite.joint(),
        offsetM: vector(endSite.offsetM(), 'WorldInfo.endSite.offsetM', e),
      });
    }
    return {
      type: 'WorldInfo',
      seq: m.seq(),
      world: id(m.world(), 'WorldInfo.world'),
      name: name(m.name(asBytes), 'WorldInfo.name'),
      role: known(roles, m.role(), 'WorldInfo.role'),
      tick: m.tick(),
      libraryHash: text(m.libraryHash(asBytes), maxNameBytes, 'WorldInfo.libraryHash'),
      joints,
      endSites,
      leftLeg: leg(skeleton!.leftLeg(), jointCount),
      rightLeg: leg(skeleton!.rightLeg(), jointCount),
      layers: Array.from(
          {length: count(m.layersLength(), 0, maxLayerNames, 'WorldInfo.layers')},
          (_, l) => name(m.layers(l)!.name(asBytes), 'WorldInfo.layers', l)),
      rotationCodes: rotationCodes(m, jointCount),
      fewerJoints: fewerJoints(m, joints),
    };
  },

  Reply(bytes) {
    const m = wire.Reply.getRootAsReply(bytes);
    const items: ReplyEntry[] = [];
    const length = count(m.itemsLength(), 0, maxItems, 'Reply.items');
    const item = new wire.ReplyItem();
    for (let i = 0; i < length; ++i) {
      m.items(i, item);
      if (item.index() >= maxItems) {
        throw new Malformed('exceeds the number of items of a command', 'Reply.item.index', i);
      }
      items.push({
        index: item.index(),
        avatar: item.avatar(),
        requestId: item.requestId(),
        code: item.code(),
        text: text(item.text(asBytes), maxReasonBytes, 'Reply.item.text', i),
      });
    }
    return {
      type: 'Reply',
      seq: id(m.seq(), 'Reply.seq'),
      code: m.code(),
      text: text(m.text(asBytes), maxTextBytes, 'Reply.text'),
      accepted: m.accepted(),
      items,
    };
  },

  PoseBatch(bytes) {
    const m = wire.PoseBatch.getRootAsPoseBatch(bytes);
    const part = m.part();
    const parts = m.parts();
    if (parts < 1 || parts > maxBatchParts || part >= parts) {
      throw new Malformed('is not below parts, or parts is not 1 to 1024', 'PoseBatch.part');
    }
    const mode = known(poseModes, m.mode(), 'PoseBatch.mode');
    if (mode === 'movement') throw new Malformed('is not a mode of poses', 'PoseBatch.mode');
    const jointCount = m.jointCount();
    if (jointCount < 1 || jointCount > maxJoints) {
      throw new Malformed('is not 1 to 256', 'PoseBatch.jointCount');
    }
    const avatars = avatarList(m.avatarsArray(), 0, 'PoseBatch.avatars');
    const flags = m.flagsArray() ?? new Uint8Array(0);
    if (flags.length !== avatars.length) {
      throw new Malformed('is not one per avatar', 'PoseBatch.flags');
    }
    const poses = m.posesArray() ?? new Uint8Array(0);
    const isCompact = mode !== 'full' && mode !== 'quantised';
    const compactBytes = isCompact ? compactPoseBytes(flags, poses.length, jointCount) : 0;
    if (isCompact ? compactBytes < 0
                  : poses.length !== avatars.length * poseBytes(mode, jointCount)) {
      throw new Malformed('is not one per avatar', 'PoseBatch.poses');
    }
    return {
      type: 'PoseBatch',
      world: id(m.world(), 'PoseBatch.world'),
      shard: m.shard(),
      part,
      parts,
      tick: Number(m.tick()),
      serverTimeS: finite(m.serverTimeS(), 'PoseBatch.serverTimeS'),
      mode,
      jointCount,
      avatars,
      flags,
      poses,
      partial: m.partial(),
      codec: null,
    };
  },

  Events(bytes) {
    const m = wire.Events.getRootAsEvents(bytes);
    const events: WorldEvent[] = [];
    const length = count(m.eventsLength(), 1, maxItems, 'Events.events');
    const event = new wire.Event();
    for (let i = 0; i < length; ++i) {
      m.events(i, event);
      const type = known(eventTypes, event.type(), 'Event.type', i);
      const group = event.group();
      if (group < -1) throw new Malformed('is below -1', 'Event.group', i);
      const foot = event.foot();
      if (foot > 1) throw new Malformed(`enumerator ${foot} is unknown`, 'Event.foot', i);
      events.push({
        type,
        avatar: id(event.avatar(), 'Event.avatar', i),
        requestId: event.requestId(),
        tick: Number(event.tick()),
        timeS: finite(event.timeS(), 'Event.timeS', i),
        kind: known(movementKinds, event.kind(), 'Event.kind', i),
        group,
        requested: parameters(event.requestedLength(), (p, into) => event.requested(p, into),
                              'Event.requested', i),
        applied: parameters(event.appliedLength(), (p, into) => event.applied(p, into),
                            'Event.applied', i),
        extrapolated: event.extrapolated(),
        clamped: event.clamped(),
        cutShort: event.cutShort(),
        foot: type !== 'footStrike' ? null : foot === 0 ? 'left' : 'right',
        positionM: vector(event.positionM(), 'Event.positionM', i),
        basePositionM: vector(event.basePositionM(), 'Event.basePositionM', i),
        baseHeadingRad: finite(event.baseHeadingRad(), 'Event.baseHeadingRad', i),
        code: event.code(),
        reason: text(event.reason(asBytes), maxReasonBytes, 'Event.reason', i),
      });
    }
    return {
      type: 'Events',
      world: id(m.world(), 'Events.world'),
      number: m.number(),
      tick: m.tick(),
      events,
    };
  },

  Lagging(bytes) {
    const m = wire.Lagging.getRootAsLagging(bytes);
    return {
      type: 'Lagging',
      world: id(m.world(), 'Lagging.world'),
      droppedBatches: Number(m.droppedBatches()),
      droppedEvents: Number(m.droppedEvents()),
    };
  },

  Error(bytes) {
    const m = wire.Error.getRootAsError(bytes);
    return {
      type: 'Error',
      code: m.code(),
      text: text(m.text(asBytes), maxTextBytes, 'Error.text'),
      fatal: m.fatal(),
      seq: m.seq(),
    };
  },

  Pong(bytes) {
    const m = wire.Pong.getRootAsPong(bytes);
    return {
      type: 'Pong',
      nonce: m.nonce(),
      timeS: finite(m.timeS(), 'Pong.timeS'),
      serverTimeS: finite(m.serverTimeS(), 'Pong.serverTimeS'),
      tick: m.tick(),
    };
  },

  AvatarState(bytes) {
    const m = wire.AvatarState.getRootAsAvatarState(bytes);
    const queueSize = m.queueSize();
    const length = count(m.queueLength(), 0, maxInspectedRequests, 'AvatarState.queue');
    if (length > queueSize) {
      throw new Malformed('has more requests than queueSize', 'AvatarState.queue');
    }
    const queue: QueuedRequest[] = [];
    const item = new wire.RequestItem();
    for (let i = 0; i < length; ++i) {
      m.queue(i, item);
      queue.push(request(item, i));
    }
    const layers: PlayingLayer[] = [];
    for (let l = 0; l < count(m.layersLength(), 0, maxPlayingLayers, 'AvatarState.layers'); ++l) {
      const layer = m.layers(l)!;
      layers.push({
        layer: name(layer.layer(asBytes), 'AvatarState.layers.layer', l),
        weight: finite(layer.weight(), 'AvatarState.layers.weight', l),
        timeS: finite(layer.timeS(), 'AvatarState.layers.timeS', l),
        speed: finite(layer.speed(), 'AvatarState.layers.speed', l),
        ending: layer.ending(),
      });
    }
    const current = m.movement();
    return {
      type: 'AvatarState',
      nonce: m.nonce(),
      world: id(m.world(), 'AvatarState.world'),
      code: m.code(),
      text: text(m.text(asBytes), maxReasonBytes, 'AvatarState.text'),
      state: {
        avatar: id(m.avatar(), 'AvatarState.avatar'),
        tick: Number(m.tick()),
        timeS: finite(m.serverTimeS(), 'AvatarState.serverTimeS'),
        basePositionM: vector(m.basePositionM(), 'AvatarState.basePositionM'),
        baseHeadingRad: finite(m.baseHeadingRad(), 'AvatarState.baseHeadingRad'),
        movement: current === null ? null : movement(current),
        queueSize,
        queue,
        plantingEnabled: !m.plantingOff(),
        layers,
      },
    };
  },

  SetTerrain(bytes) {
    const m = wire.SetTerrain.getRootAsSetTerrain(bytes);
    return {
      type: 'SetTerrain',
      seq: id(m.seq(), 'SetTerrain.seq'),
      world: id(m.world(), 'SetTerrain.world'),
      terrain: terrain(m.terrain()),
    };
  },

  SetLayers(bytes) {
    const m = wire.SetLayers.getRootAsSetLayers(bytes);
    const length = count(m.itemsLength(), 1, maxItems, 'SetLayers.items');
    const items: LayerEntry[] = [];
    const item = new wire.LayerItem();
    for (let i = 0; i < length; ++i) {
      m.items(i, item);
      items.push({
        avatar: id(item.avatar(), 'SetLayers.avatar', i),
        layer: name(item.layer(asBytes), 'SetLayers.layer', i),
        off: item.off(),
        weight: finite(item.weight(), 'SetLayers.weight', i),
        blendS: finite(item.blendS(), 'SetLayers.blendS', i),
        speed: finite(item.speed(), 'SetLayers.speed', i),
      });
    }
    return {
      type: 'SetLayers',
      seq: id(m.seq(), 'SetLayers.seq'),
      world: id(m.world(), 'SetLayers.world'),
      items,
    };
  },

  SetPlanting(bytes) {
    const m = wire.SetPlanting.getRootAsSetPlanting(bytes);
    return {
      type: 'SetPlanting',
      seq: id(m.seq(), 'SetPlanting.seq'),
      world: id(m.world(), 'SetPlanting.world'),
      avatars: avatarList(m.avatarsArray(), 1, 'SetPlanting.avatars'),
      off: m.off(),
    };
  },

  WorldTerrain(bytes) {
    const m = wire.WorldTerrain.getRootAsWorldTerrain(bytes);
    return {
      type: 'WorldTerrain',
      world: id(m.world(), 'WorldTerrain.world'),
      terrain: terrain(m.terrain()),
    };
  },

  FetchLibrary(bytes) {
    const m = wire.FetchLibrary.getRootAsFetchLibrary(bytes);
    const length = m.length();
    if (length < 1 || length > maxPieceBytes) {
      throw new Malformed('is not 1 to 1048576', 'FetchLibrary.length');
    }
    return {
      type: 'FetchLibrary',
      nonce: m.nonce(),
      hash: name(m.hash(asBytes), 'FetchLibrary.hash'),
      offset: below(m.offset(), BigInt(maxLibraryBytes) - 1n, 'FetchLibrary.offset'),
      length,
    };
  },

  Movements(bytes) {
    const m = wire.Movements.getRootAsMovements(bytes);
    const part = m.part();
    const parts = m.parts();
    if (parts < 1 || parts > maxBatchParts || part >= parts) {
      throw new Malformed('is not below parts, or parts is not 1 to 1024', 'Movements.part');
    }
    const avatars = avatarList(m.avatarsArray(), 0, 'Movements.avatars');
    const flags = m.flagsArray() ?? new Uint8Array(0);
    if (flags.length !== avatars.length) {
      throw new Malformed('is not one per avatar', 'Movements.flags');
    }
    const ends = m.endsArray() ?? new Uint32Array(0);
    if (ends.length !== avatars.length) {
      throw new Malformed('is not one per avatar', 'Movements.ends');
    }
    const records = m.recordsArray() ?? new Uint8Array(0);
    let before = 0;
    ends.forEach((end, i) => {
      if (end < before || end - before > maxRecordBytes) {
        throw new Malformed('is descending, or the record is too long', 'Movements.ends', i);
      }
      before = end;
    });
    if (before !== records.length) {
      throw new Malformed('does not end with the last record', 'Movements.records');
    }
    return {
      type: 'Movements',
      world: id(m.world(), 'Movements.world'),
      shard: m.shard(),
      part,
      parts,
      moreSteps: m.moreSteps(),
      step: m.step(),
      tick: Number(m.tick()),
      serverTimeS: finite(m.serverTimeS(), 'Movements.serverTimeS'),
      states: m.states(),
      avatars,
      flags,
      ends,
      records,
    };
  },

  LibraryPiece(bytes) {
    const m = wire.LibraryPiece.getRootAsLibraryPiece(bytes);
    const piece = m.bytesArray() ?? new Uint8Array(0);
    count(piece.length, 0, maxPieceBytes, 'LibraryPiece.bytes');
    const totalBytes = below(m.totalBytes(), BigInt(maxLibraryBytes), 'LibraryPiece.totalBytes');
    const offset = below(m.offset(), BigInt(totalBytes), 'LibraryPiece.offset');
    if (piece.length > totalBytes - offset) {
      throw new Malformed('exceeds totalBytes', 'LibraryPiece.bytes');
    }
    return {
      type: 'LibraryPiece',
      nonce: m.nonce(),
      code: m.code(),
      text: text(m.text(asBytes), maxReasonBytes, 'LibraryPiece.text'),
      hash: text(m.hash(asBytes), maxNameBytes, 'LibraryPiece.hash'),
      totalBytes,
      offset,
      bytes: piece,
    };
  },
};

/** Type of a text that the generated readers return as bytes. */
type WireText = string | Uint8Array | null;

function text(bytes: WireText, maxBytes: number, field: string, index = -1): string {
  return readText(bytes as Uint8Array | null, maxBytes, field, index);
}

function name(bytes: WireText, field: string, index = -1): string {
  return readName(bytes as Uint8Array | null, maxNameBytes, field, index);
}

function finiteOrNull(value: number | null, field: string, index: number): number | null {
  return value === null ? null : finite(value, field, index);
}

/** Ignores fields that the type of the request does not use. */
function request(item: wire.RequestItem, i: number): QueuedRequest {
  const type = known(movementTypes, item.type(), 'Request.type', i);
  const step = type === 'step';
  const walk = type === 'walk';
  const place = step || walk ? item.atM() : null;
  const moves = type !== 'stand' && place === null;
  if (walk && (place === null || item.headingRad() === null)) {
    throw new Malformed('a walk requires atM and headingRad', 'Request.atM', i);
  }
  const exactOnly = step && item.mustBeMet();
  if (exactOnly && place === null) {
    throw new Malformed('is missing, but mustBeMet is set', 'Request.atM', i);
  }
  const waypointsM: Vec3[] = [];
  const waypoints =
      walk ? count(item.waypointsMLength(), 0, maxWaypoints, 'Request.waypointsM') : 0;
  for (let w = 0; w < waypoints; ++w) {
    waypointsM.push(vector(item.waypointsM(w), 'Request.waypointsM', i));
  }
  return {
    avatar: id(item.avatar(), 'Request.avatar', i),
    requestId: id(item.requestId(), 'Request.requestId', i),
    type,
    foot: step ? known(footChoices, item.foot(), 'Request.foot', i) : 'auto',
    atM: place === null ? null : vector(place, 'Request.atM', i),
    headingRad: place === null ? null : finiteOrNull(item.headingRad(), 'Request.headingRad', i),
    lengthM: moves ? finite(item.lengthM(), 'Request.lengthM', i) : 0,
    sideM: step && moves ? finiteOrNull(item.sideM(), 'Request.sideM', i) : null,
    heightM: moves ? finite(item.heightM(), 'Request.heightM', i) : 0,
    turnRad: moves ? finite(item.turnRad(), 'Request.turnRad', i) : 0,
    seconds: type === 'stand' ? finite(item.seconds(), 'Request.seconds', i) : 0,
    waypointsM,
    speedMPerS: walk ? finiteOrNull(item.speedMS(), 'Request.speedMPerS', i) : null,
    interrupt: known(interrupts, item.takeover(), 'Request.takeover', i),
    exactOnly,
  };
}

function movement(m: wire.CurrentMovement): CurrentMovement {
  const field = 'AvatarState.movement';
  const group = m.group();
  if (group < -1) throw new Malformed('is below -1', `${field}.group`);
  const keytimesS = (m.keytimesSArray() ?? new Float64Array(0)).slice(0, maxKeytimes + 1);
  count(keytimesS.length, 0, maxKeytimes, `${field}.keytimesS`);
  for (let k = 0; k < keytimesS.length; ++k) {
    const keytimeS = finite(keytimesS[k]!, `${field}.keytimesS`, k);
    if (k === 0 ? keytimeS !== 0 : keytimeS < keytimesS[k - 1]!) {
      throw new Malformed('is not ascending from 0', `${field}.keytimesS`, k);
    }
  }
  const genericTime = m.genericTime();
  if (!(genericTime >= 0 && genericTime <= Math.max(0, keytimesS.length - 1))) {
    throw new Malformed('is not between 0 and the last keytime', `${field}.genericTime`);
  }
  const names: ParameterName[] = [];
  const length = count(m.parameterNamesLength(), 0, maxParameters, `${field}.parameterNames`);
  for (let p = 0; p < length; ++p) {
    const name = known(parameterNames, m.parameterNames(p)!, `${field}.parameterNames`, p);
    if (names.includes(name)) throw new Malformed('occurs twice', `${field}.parameterNames`, p);
    names.push(name);
  }
  const weights = numbers(m.weightsArray(), maxWeights, `${field}.weights`);
  const sites = numbers(m.sitesArray(), maxWeights * maxParameters, `${field}.sites`);
  if (sites.length !== 0 && sites.length !== weights.length * names.length) {
    throw new Malformed('is not one row per weight', `${field}.sites`);
  }
  const landings: Landing[] = [];
  const landing = new wire.Landing();
  for (let l = 0; l < count(m.landingsLength(), 0, maxLandings, `${field}.landings`); ++l) {
    m.landings(l, landing);
    landings.push({
      foot: known(feet, landing.foot(), `${field}.landings`, l),
      positionM: vector(landing.positionM(), `${field}.landings`, l),
      headingRad: finite(landing.headingRad(), `${field}.landings`, l),
    });
  }
  const startTimeS = finite(m.startedS(), `${field}.startedS`);
  return {
    requestId: m.requestId(),
    kind: known(movementKinds, m.kind(), `${field}.kind`),
    group,
    startTimeS,
    endTimeS: finite(startTimeS + (keytimesS[keytimesS.length - 1] ?? 0), `${field}.keytimesS`),
    keytimesS,
    genericTime,
    easeOutS: notNegative(m.easeOutS(), `${field}.easeOutS`),
    requested: parameters(m.requestedLength(), (p, into) => m.requested(p, into),
                          `${field}.requested`, -1),
    applied: parameters(m.appliedLength(), (p, into) => m.applied(p, into), `${field}.applied`, -1),
    extrapolated: m.extrapolated(),
    clamped: m.clamped(),
    weights,
    parameterNames: names,
    exampleParameters: sites,
    landings,
  };
}

function everyNTicks(value: number, field: string, index = -1): number {
  if (value < 1 || value > maxEveryNTicks) throw new Malformed('is not 1 to 3600', field, index);
  return value;
}

function region(m: wire.Region | null): RegionEntry | null {
  if (m === null) return null;
  const centre = m.centreM();
  const radiusM = notNegative(m.radiusM(), 'Region.radiusM');
  if (radiusM === 0) throw new Malformed('is not above 0', 'Region.radiusM');
  const leaveM = m.leaveM();
  const rings: RegionEntry['rings'] = [];
  const length = count(m.ringsLength(), 0, maxRateRings, 'Region.rings');
  let beforeM = 0;
  for (let i = 0; i < length; ++i) {
    const ring = m.rings(i)!;
    const toM = finite(ring.toM(), 'RateRing.toM', i);
    if (!(toM > beforeM)) {
      throw new Malformed('is not above that of the previous ring', 'RateRing.toM', i);
    }
    beforeM = toM;
    rings.push({toM, everyNTicks: everyNTicks(ring.everyNTicks(), 'RateRing.everyNTicks', i)});
  }
  const details = count(m.ringDetailsLength(), 0, maxRateRings, 'Region.ringDetails');
  if (details > 0 && details !== length) {
    throw new Malformed('is not one per ring', 'Region.ringDetails');
  }
  const ringDetails = Array.from({length: details}, (_, i) =>
      known(poseDetails, m.ringDetails(i)!, 'Region.ringDetails', i));
  return {
    x: finite(centre?.x() ?? 0, 'Region.centreM'),
    z: finite(centre?.z() ?? 0, 'Region.centreM'),
    radiusM,
    leaveM: leaveM === null ? null : notNegative(leaveM, 'Region.leaveM'),
    rings,
    ringDetails,
  };
}

function terrain(m: wire.Terrain | null): Terrain | null {
  if (m === null) return null;
  const from = m.heightField();
  let heightField = null;
  if (from !== null) {
    const origin = from.originM();
    const cellM = from.cellM();
    if (!(finite(cellM, 'Terrain.cellM') > 0)) {
      throw new Malformed('is not above 0', 'Terrain.cellM');
    }
    const columns = from.columns();
    const rows = from.rows();
    for (const samples of [columns, rows]) {
      if (samples < 2 || samples > maxTerrainColumns) {
        throw new Malformed('is not 2 to 1024', 'Terrain.columns, rows');
      }
    }
    const heightsM =
        numbers(from.heightsMArray(), maxTerrainColumns * maxTerrainColumns, 'Terrain.heightsM');
    if (heightsM.length !== columns * rows) {
      throw new Malformed('is not one per sample', 'Terrain.heightsM');
    }
    const originM = [
      finite(origin?.x() ?? 0, 'Terrain.originM'), finite(origin?.z() ?? 0, 'Terrain.originM')
    ] as const;
    heightField = {originM, cellM, columns, rows, heightsM};
  }
  const boxes: TerrainBox[] = [];
  const length = count(m.boxesLength(), 0, maxTerrainBoxes, 'Terrain.boxes');
  const box = new wire.TerrainBox();
  for (let b = 0; b < length; ++b) {
    m.boxes(b, box);
    const number = (value: number): number => finite(value, 'Terrain.boxes', b);
    const minM = [number(box.minX()), number(box.minZ())] as const;
    const maxM = [number(box.maxX()), number(box.maxZ())] as const;
    if (!(minM[0] < maxM[0] && minM[1] < maxM[1])) {
      throw new Malformed('max is not above min', 'Terrain.boxes', b);
    }
    boxes.push({minM, maxM, heightM: number(box.heightM())});
  }
  return {heightField, boxes};
}

/** Returns a copy, because the frame is not kept. */
function numbers(list: Float32Array | null, max: number, field: string): Float32Array {
  if (list === null) return new Float32Array(0);
  count(list.length, 0, max, field);
  for (let i = 0; i < list.length; ++i) finite(list[i]!, field, i);
  return list.slice();
}

function leg(from: wire.Leg | null, jointCount: number): Leg {
  const joint = (index: number): number => {
    if (index < -1 || index >= jointCount) throw new Malformed('is not a joint', 'WorldInfo.leg');
    return index;
  };
  return {
    hip: joint(from?.hip() ?? -1),
    knee: joint(from?.knee() ?? -1),
    ankle: joint(from?.ankle() ?? -1),
    ball: joint(from?.ball() ?? -1),
    ballOffsetM: vector(from?.ballOffsetM() ?? null, 'WorldInfo.leg.ballOffsetM'),
    toeTipOffsetM: vector(from?.toeTipOffsetM() ?? null, 'WorldInfo.leg.toeTipOffsetM'),
  };
}
