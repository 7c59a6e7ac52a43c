import {Builder} from 'flatbuffers';
import * as wire from '../../generated/wire';
import {footChoices, interrupts, movementTypes, poseDetails, poseModes, roles} from './decode';
import {makeFrame, maxPayloadBytes} from './frame';
import {maxBulkBytes, maxControlBytes} from '../../generated/limits';
import {Malformed} from './malformed';
import type {Terrain} from '../types';
import type {ClientMessage, RegionEntry} from './messages';

/** Encodes valid messages as frames. The constructor takes the size limits of the server. */
export class Encoder {
  private readonly builder = new Builder(1024);

  constructor(private readonly controlBytes = maxControlBytes,
              private readonly bulkBytes = maxBulkBytes) {}

  /** @throws Malformed the message exceeds the limit of the server */
  encode(message: ClientMessage): ArrayBuffer {
    const b = this.builder;
    b.clear();
    b.finish(build(b, message));
    const bytes = b.asUint8Array();
    if (bytes.length > maxPayloadBytes(message.type, this.controlBytes, this.bulkBytes)) {
      throw new Malformed(`${bytes.length} bytes exceed the limit of the server`, message.type);
    }
    return makeFrame(message.type, bytes);
  }
}

function buildTerrain(b: Builder, terrain: Terrain): number {
  const from = terrain.heightField;
  let field = 0;
  if (from !== null) {
    const heights = wire.HeightField.createHeightsMVector(b, from.heightsM);
    wire.HeightField.startHeightField(b);
    wire.HeightField.addOriginM(b, wire.GroundPoint.createGroundPoint(b, ...from.originM));
    wire.HeightField.addCellM(b, from.cellM);
    wire.HeightField.addColumns(b, from.columns);
    wire.HeightField.addRows(b, from.rows);
    wire.HeightField.addHeightsM(b, heights);
    field = wire.HeightField.endHeightField(b);
  }
  wire.Terrain.startBoxesVector(b, terrain.boxes.length);
  // FlatBuffers vectors are written from back to front.
  for (let i = terrain.boxes.length - 1; i >= 0; --i) {
    const {minM, maxM, heightM} = terrain.boxes[i]!;
    wire.TerrainBox.createTerrainBox(b, ...minM, ...maxM, heightM);
  }
  const boxes = b.endVector();
  wire.Terrain.startTerrain(b);
  if (field !== 0) wire.Terrain.addHeightField(b, field);
  wire.Terrain.addBoxes(b, boxes);
  return wire.Terrain.endTerrain(b);
}

function buildRegion(b: Builder, region: RegionEntry): number {
  wire.Region.startRingsVector(b, region.rings.length);
  // FlatBuffers vectors are written from back to front.
  for (let i = region.rings.length - 1; i >= 0; --i) {
    wire.RateRing.createRateRing(b, region.rings[i]!.toM, region.rings[i]!.everyNTicks);
  }
  const rings = b.endVector();
  const details = region.ringDetails.length === 0 ? 0 : wire.Region.createRingDetailsVector(
      b, region.ringDetails.map((detail) => poseDetails.indexOf(detail)));
  wire.Region.startRegion(b);
  wire.Region.addCentreM(b, wire.GroundPoint.createGroundPoint(b, region.x, region.z));
  wire.Region.addRadiusM(b, region.radiusM);
  if (region.leaveM !== null) wire.Region.addLeaveM(b, region.leaveM);
  wire.Region.addRings(b, rings);
  if (details !== 0) wire.Region.addRingDetails(b, details);
  return wire.Region.endRegion(b);
}

function build(b: Builder, m: ClientMessage): number {
  switch (m.type) {
    case 'Hello': {
      const name = b.createString(m.clientName);
      const auth = b.createString(m.authToken);
      const token = wire.Hello.createResumeTokenVector(b, m.resumeToken);
      return wire.Hello.createHello(b, m.protocolMin, m.protocolMax, name, auth, token,
                                    m.lastEventsNumber);
    }
    case 'JoinWorld':
      return wire.JoinWorld.createJoinWorld(b, m.seq, b.createString(m.name),
                                            roles.indexOf(m.role));
    case 'LeaveWorld': return wire.LeaveWorld.createLeaveWorld(b, m.seq, m.world);
    case 'Spawn': {
      const items = m.items.map((item) => {
        wire.SpawnItem.startSpawnItem(b);
        wire.SpawnItem.addAvatar(b, item.avatar);
        const [x, y, z] = item.positionM;
        wire.SpawnItem.addPositionM(b, wire.Vec3.createVec3(b, x, y, z));
        wire.SpawnItem.addHeadingRad(b, item.headingRad);
        return wire.SpawnItem.endSpawnItem(b);
      });
      return wire.Spawn.createSpawn(b, m.seq, m.world, wire.Spawn.createItemsVector(b, items));
    }
    case 'Remove':
      return wire.Remove.createRemove(b, m.seq, m.world,
                                      wire.Remove.createAvatarsVector(b, m.avatars));
    case 'Request': {
      const items = m.items.map((item) => {
        let waypoints = 0;
        if (item.waypointsM.length > 0) {
          wire.RequestItem.startWaypointsMVector(b, item.waypointsM.length);
          for (const [x, y, z] of [...item.waypointsM].reverse()) wire.Vec3.createVec3(b, x, y, z);
          waypoints = b.endVector();
        }
        wire.RequestItem.startRequestItem(b);
        wire.RequestItem.addAvatar(b, item.avatar);
        wire.RequestItem.addRequestId(b, item.requestId);
        wire.RequestItem.addType(b, movementTypes.indexOf(item.type));
        wire.RequestItem.addFoot(b, footChoices.indexOf(item.foot));
        wire.RequestItem.addLengthM(b, item.lengthM);
        if (item.sideM !== null) {
          // Writes values that equal the default, because a side of 0 differs from an absent one.
          b.forceDefaults(true);
          wire.RequestItem.addSideM(b, item.sideM);
          b.forceDefaults(false);
        }
        wire.RequestItem.addHeightM(b, item.heightM);
        wire.RequestItem.addTurnRad(b, item.turnRad);
        wire.RequestItem.addSeconds(b, item.seconds);
        if (item.atM !== null) {
          const [x, y, z] = item.atM;
          wire.RequestItem.addAtM(b, wire.Vec3.createVec3(b, x, y, z));
          if (item.headingRad !== null) {
            b.forceDefaults(true);
            wire.RequestItem.addHeadingRad(b, item.headingRad);
            b.forceDefaults(false);
          }
        }
        if (waypoints !== 0) wire.RequestItem.addWaypointsM(b, waypoints);
        if (item.speedMPerS !== null) {
          b.forceDefaults(true);
          wire.RequestItem.addSpeedMS(b, item.speedMPerS);
          b.forceDefaults(false);
        }
        wire.RequestItem.addTakeover(b, interrupts.indexOf(item.interrupt));
        wire.RequestItem.addMustBeMet(b, item.exactOnly);
        return wire.RequestItem.endRequestItem(b);
      });
      return wire.Request.createRequest(b, m.seq, m.world,
                                        wire.Request.createItemsVector(b, items));
    }
    case 'CancelQueue':
      return wire.CancelQueue.createCancelQueue(
          b, m.seq, m.world, wire.CancelQueue.createAvatarsVector(b, m.avatars));
    case 'Observe': {
      const avatars = wire.Observe.createAvatarsVector(b, m.avatars);
      const region = m.region === null ? 0 : buildRegion(b, m.region);
      wire.Observe.startObserve(b);
      wire.Observe.addSeq(b, m.seq);
      wire.Observe.addWorld(b, m.world);
      wire.Observe.addSubscription(b, m.subscription);
      wire.Observe.addMode(b, poseModes.indexOf(m.mode));
      wire.Observe.addAvatars(b, avatars);
      wire.Observe.addEveryNTicks(b, m.everyNTicks);
      wire.Observe.addWithEvents(b, m.withEvents);
      if (region !== 0) wire.Observe.addRegion(b, region);
      wire.Observe.addReplace(b, m.replace);
      wire.Observe.addDetail(b, poseDetails.indexOf(m.detail));
      return wire.Observe.endObserve(b);
    }
    case 'SetTerrain': {
      const terrain = m.terrain === null ? 0 : buildTerrain(b, m.terrain);
      wire.SetTerrain.startSetTerrain(b);
      wire.SetTerrain.addSeq(b, m.seq);
      wire.SetTerrain.addWorld(b, m.world);
      if (terrain !== 0) wire.SetTerrain.addTerrain(b, terrain);
      return wire.SetTerrain.endSetTerrain(b);
    }
    case 'SetLayers': {
      const items = m.items.map((item) => {
        const layer = b.createSharedString(item.layer);
        return wire.LayerItem.createLayerItem(b, item.avatar, layer, item.off, item.weight,
                                              item.blendS, item.speed);
      });
      return wire.SetLayers.createSetLayers(b, m.seq, m.world,
                                            wire.SetLayers.createItemsVector(b, items));
    }
    case 'SetPlanting':
      return wire.SetPlanting.createSetPlanting(
          b, m.seq, m.world, wire.SetPlanting.createAvatarsVector(b, m.avatars), m.off);
    case 'StopObserving':
      return wire.StopObserving.createStopObserving(b, m.seq, m.subscription);
    case 'Ping': return wire.Ping.createPing(b, m.nonce, m.timeS);
    case 'InspectAvatar':
      return wire.InspectAvatar.createInspectAvatar(b, m.nonce, m.world, m.avatar);
    case 'FetchLibrary':
      return wire.FetchLibrary.createFetchLibrary(
          b, m.nonce, b.createString(m.hash), BigInt(m.offset), m.length);
    case 'Goodbye': return wire.Goodbye.createGoodbye(b, m.code, b.createString(m.text));
  }
}
