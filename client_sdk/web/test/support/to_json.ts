import {enums} from '../../generated/messages';
import type {
  CurrentMovement, LegInfo as Leg, Message, RequestItem as QueuedRequest,
  TerrainInfo as Terrain
} from '../../generated/messages';
import {parameterList} from '../../src/wire/parameters';
import {decodePoses} from '../../src/testing';
import {vectorInfo} from './vectors';
import type {Parameters, Vec3} from '../../src/types';

type Json = unknown;

const u64 = (value: bigint | number): Json => String(value);
const token = (bytes: Uint8Array): Json => Buffer.from(bytes).toString('hex');
const vec3 = (v: Vec3): Json => [...v];

function nonZero(numbers: {[name: string]: number}): {[name: string]: Json} {
  return Object.fromEntries(Object.entries(numbers).filter(([, value]) => value !== 0));
}

function parameters(set: Parameters): Json {
  return parameterList(set);
}

function request(item: QueuedRequest): Json {
  const type = enums.MovementType.indexOf(item.type);
  const common = {avatar: item.avatar, request_id: u64(item.requestId), type,
    interrupt: enums.Interrupt.indexOf(item.interrupt)};
  const near = item.allowNearest || item.exactOnly ? {} : {must_be_near: true};
  switch (item.type) {
    case 'step':
      if (item.atM !== null) {
        return {
          ...common, foot: enums.FootChoice.indexOf(item.foot), at_m: vec3(item.atM),
          heading_rad: item.headingRad, ...(item.exactOnly ? {exact_only: true} : {}), ...near,
        };
      }
      return {
        ...common, foot: enums.FootChoice.indexOf(item.foot), length_m: item.lengthM,
        side_m: item.sideM, height_m: item.heightM, turn_rad: item.turnRad,
        ...(item.exactOnly ? {exact_only: true} : {}), ...near,
      };
    case 'jump':
      return {
        ...common, length_m: item.lengthM, height_m: item.heightM, turn_rad: item.turnRad, ...near,
      };
    case 'stand': return {...common, seconds: item.seconds};
    case 'walk':
      return {
        ...common, at_m: vec3(item.atM!), heading_rad: item.headingRad,
        waypoints_m: item.waypointsM.map(vec3), speed_m_s: item.speedMPerS,
      };
  }
}

function terrain(from: Terrain | null): Json {
  if (from === null) return null;
  const field = from.heightField;
  return {
    height_field: field === null ? null : {
      origin_m: [...field.originM], cell_m: field.cellM, columns: field.columns, rows: field.rows,
      heights_m: [...field.heightsM],
    },
    boxes: from.boxes.map(({minX, minZ, maxX, maxZ, heightM}) => ({
      min_x: minX, min_z: minZ, max_x: maxX, max_z: maxZ, height_m: heightM,
    })),
  };
}

function leg(from: Leg): Json {
  return {
    hip: from.hip, knee: from.knee, ankle: from.ankle, ball: from.ball,
    ball_offset_m: vec3(from.ballOffsetM), toe_tip_offset_m: vec3(from.toeTipOffsetM),
  };
}

function movement(m: CurrentMovement): Json {
  return {
    request_id: u64(m.requestId), kind: enums.MovementKind.indexOf(m.kind), group: m.group,
    started_s: m.startTimeS, keytimes_s: [...m.keytimesS], generic_time: m.genericTime,
    ease_out_s: m.easeOutS, requested: parameters(m.requested), applied: parameters(m.applied),
    extrapolated: m.extrapolated, clamped: m.clamped, weights: [...m.weights],
    parameter_names: [...m.parameterNames],
    sites: [...m.exampleParameters],
    landings: m.landings.map((l) => ({
      foot: l.foot === 'right' ? 1 : 0, position_m: vec3(l.positionM), heading_rad: l.headingRad})),
  };
}

/** Converts a message to the JSON of protocol/vectors, which uses the names of the schema. */
export function toJson(m: Message, frame: ArrayBuffer): {[name: string]: Json} {
  switch (m.type) {
    case 'Hello':
      return {
        protocol_min: m.protocolMin, protocol_max: m.protocolMax, client_name: m.clientName,
        auth_token: m.authToken, resume_token: token(m.resumeToken),
        last_events_number: u64(m.lastEventsNumber),
      };
    case 'JoinWorld': return {seq: u64(m.seq), name: m.name, role: enums.Role.indexOf(m.role)};
    case 'LeaveWorld': return {seq: u64(m.seq), world: m.world};
    case 'Spawn':
      return {
        seq: u64(m.seq), world: m.world,
        items: m.items.map((item) => ({
          avatar: item.avatar, position_m: vec3(item.positionM), heading_rad: item.headingRad,
          ...(item.teleport ? {teleport: true} : {}),
        })),
      };
    case 'Remove':
    case 'CancelQueue': return {seq: u64(m.seq), world: m.world, avatars: [...m.avatars]};
    case 'Request': return {seq: u64(m.seq), world: m.world, items: m.items.map(request)};
    case 'Observe':
      return {
        seq: u64(m.seq), world: m.world, subscription: m.subscription,
        mode: enums.PoseMode.indexOf(m.mode), avatars: [...m.avatars], every_n_ticks: m.everyNTicks,
        with_events: m.withEvents,
        ...(m.detail === 'all' ? {} : {detail: enums.PoseDetail.indexOf(m.detail)}),
        ...(m.region === null ? {} : {
          region: {
            centre_m: {x: m.region.centreM[0], z: m.region.centreM[1]}, radius_m: m.region.radiusM,
            leave_m: m.region.leaveM,
            rings: m.region.rings.map(({toM, everyNTicks}) => (
                {to_m: toM, every_n_ticks: everyNTicks})),
            ...(m.region.ringDetails.length === 0 ? {} : {
              ring_details: m.region.ringDetails.map((detail) => enums.PoseDetail.indexOf(detail)),
            }),
          },
          replace: m.replace,
        }),
      };
    case 'StopObserving': return {seq: u64(m.seq), subscription: m.subscription};
    case 'Ping': return {nonce: u64(m.nonce), time_s: m.timeS};
    case 'InspectAvatar': return {nonce: u64(m.nonce), world: m.world, avatar: m.avatar};
    case 'FetchLibrary':
      return {nonce: u64(m.nonce), hash: m.hash, offset: u64(m.offset), length: m.length};
    case 'LibraryPiece':
      return {
        nonce: u64(m.nonce), code: m.code, text: m.text, hash: m.hash,
        total_bytes: u64(m.totalBytes), offset: u64(m.offset), bytes: token(m.bytes),
      };
    case 'Movements':
      return {
        world: m.world, shard: m.shard, part: m.part, parts: m.parts, more_steps: m.moreSteps,
        step: u64(m.step), tick: u64(m.tick), server_time_s: m.serverTimeS, states: m.states,
        avatars: [...m.avatars], flags: [...m.flags], ends: [...m.ends], records: token(m.records),
      };
    case 'Goodbye': return {code: m.code, text: m.text};
    case 'Welcome':
      return {
        protocol: m.protocol, session: u64(m.session),
        resume_token: token(m.resumeToken), resumed: m.resumed, last_seq: u64(m.lastSeq),
        tick_hz: m.tickHz, server_name: m.serverName, server_version: m.serverVersion,
        limits: {
          max_control_bytes: m.limits.maxControlBytes, max_bulk_bytes: m.limits.maxBulkBytes,
          max_items: m.limits.maxItems, max_avatars_per_world: m.limits.maxAvatarsPerWorld,
          max_queue: m.limits.maxQueue, reply_memory: m.limits.replyMemory,
          idle_timeout_s: m.limits.idleTimeoutS, resume_window_s: m.limits.resumeWindowS,
        },
      };
    case 'WorldInfo':
      return {
        seq: u64(m.seq), world: m.world, name: m.name, role: enums.Role.indexOf(m.role),
        tick: u64(m.tick), library_hash: m.libraryHash,
        skeleton: {
          joints: m.skeleton.joints.map((joint) => ({
            name: joint.name, parent: joint.parent, offset_m: vec3(joint.offsetM)
          })),
          end_sites: m.skeleton.endSites.map((site) => ({
            joint: site.joint, offset_m: vec3(site.offsetM)
          })),
          left_leg: leg(m.skeleton.leftLeg), right_leg: leg(m.skeleton.rightLeg),
        },
        layers: [...m.layers],
        rotation_quantizations: m.rotationQuantizations.map((code) => ({
          reference: [...code.reference], low: vec3(code.low), step: vec3(code.step),
          bits: [code.bitsX, code.bitsY, code.bitsZ], smallest_three_bits: code.smallestThreeBits,
          least_w: code.leastW,
        })),
        ...(m.reducedJoints.length === 0 ? {} : {reduced_joints: [...m.reducedJoints]}),
      };
    case 'Reply':
      return {
        seq: u64(m.seq), code: m.code, text: m.text, accepted: m.accepted,
        items: m.items.map((item) => ({
          index: item.index, avatar: item.avatar, request_id: u64(item.requestId),
          code: item.code, text: item.text,
        })),
      };
    case 'PoseBatch': {
      const decoded = decodePoses(frame, vectorInfo());
      return {
        world: m.world, shard: m.shard, part: m.part, parts: m.parts, tick: u64(m.tick),
        server_time_s: m.serverTimeS, mode: enums.PoseMode.indexOf(m.mode),
        joint_count: m.jointCount,
        ...(m.partial ? {partial: true} : {}),
        poses: [...m.avatars].map((avatar, i) => ({
          avatar, flags: m.flags[i],
          root_position_m: [...decoded.rootsM.subarray(3 * i, 3 * i + 3)],
          rotations: Array.from({length: m.jointCount}, (_, j) => {
            const at = 4 * (i * m.jointCount + j);
            return [...decoded.rotations.subarray(at, at + 4)];
          }),
        })),
      };
    }
    case 'Events':
      return {
        world: m.world, number: u64(m.number), tick: u64(m.tick),
        events: m.events.map((e) => ({
          type: enums.EventType.indexOf(e.type), avatar: e.avatar, request_id: u64(e.requestId),
          kind: enums.MovementKind.indexOf(e.kind), group: e.group, tick: u64(e.tick),
          time_s: e.timeS, requested: parameters(e.requested), applied: parameters(e.applied),
          extrapolated: e.extrapolated, clamped: e.clamped, cut_short: e.cutShort,
          foot: e.foot === 'right' ? 1 : 0,
          position_m: vec3(e.positionM), base_position_m: vec3(e.basePositionM),
          base_heading_rad: e.baseHeadingRad, code: e.code, reason: e.reason,
          ...nonZero({
            missed_m: e.missedM, missed_rad: e.missedRad, nearest_length_m: e.nearestLengthM,
            nearest_side_m: e.nearestSideM, nearest_height_m: e.nearestHeightM,
            nearest_turn_rad: e.nearestTurnRad, nearest_heading_rad: e.nearestHeadingRad,
            speed_m_s: e.speedMPerS, outcome: enums.RequestOutcome.indexOf(e.outcome),
          }),
        })),
      };
    case 'Lagging':
      return {
        world: m.world, dropped_batches: u64(m.droppedBatches),
        dropped_events: u64(m.droppedEvents),
      };
    case 'Error': return {code: m.code, text: m.text, fatal: m.fatal, seq: u64(m.seq)};
    case 'Pong':
      return {
        nonce: u64(m.nonce), time_s: m.timeS, server_time_s: m.serverTimeS, tick: u64(m.tick)
      };
    case 'SetTerrain':
      return {seq: u64(m.seq), world: m.world, terrain: terrain(m.terrain)};
    case 'SetLayers':
      return {
        seq: u64(m.seq), world: m.world,
        items: m.items.map((item) => ({
          avatar: item.avatar, layer: item.layer, fade_out: item.fadeOut, weight: item.weight,
          blend_s: item.blendS, speed: item.speed,
        })),
      };
    case 'SetPlanting':
      return {seq: u64(m.seq), world: m.world, avatars: [...m.avatars], disabled: !m.enabled};
    case 'WorldTerrain': return {world: m.world, terrain: terrain(m.terrain)};
    case 'AvatarState': {
      const state = m;
      return {
        nonce: u64(m.nonce), world: m.world, avatar: state.avatar, code: m.code, text: m.text,
        tick: u64(state.tick), server_time_s: state.timeS,
        base_position_m: vec3(state.basePositionM), base_heading_rad: state.baseHeadingRad,
        movement: state.movement === null ? null : movement(state.movement),
        queue_size: state.queueSize, queue: state.queue.map(request),
        planting_disabled: !state.plantingEnabled,
        layers: state.layers.map((l) => ({
          layer: l.layer, weight: l.weight, time_s: l.timeS, speed: l.speed, ending: l.ending})),
      };
    }
  }
}
