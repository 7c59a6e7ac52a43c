import type {
  LayerRequest, MovementRequest, Observation, PoseDetail, PoseMode, QueuedRequest, Region, Role, SpawnItem, Terrain, TerrainBox,
  Vec3
} from '../types';
import {footChoices, movementTypes, poseDetails, poseModes, roles, takeovers} from './decode';
import {
  maxAvatarNumber, maxEveryNTicks, maxItems, maxNameBytes, maxRateRings, maxTerrainBoxes, maxTerrainColumns,
  maxWaypoints
} from './limits';
import {Malformed} from './malformed';
import type {
  CancelQueue, JoinWorld, LayerEntry, Observe, RegionEntry, Remove, Request, SetLayers, SetPlanting, SetTerrain, Spawn
} from './messages';
import {checkName} from './text';

/** What callers pass, as messages to send: checked as the receiver would. Numbers that the session
 * gives (seq, world) are still 0. All throw Malformed. */

const maxRequestId = 0xffff_ffff_ffff_ffffn;

function finite(value: unknown, field: string, index: number): number {
  if (typeof value !== 'number' || !Number.isFinite(value)) {
    throw new Malformed('is not a finite number', field, index);
  }
  return value;
}

function avatarNumber(value: unknown, least: number, field: string, index: number): number {
  if (typeof value !== 'number' || !Number.isInteger(value) || value < least ||
      value > maxAvatarNumber) {
    throw new Malformed(`is not a whole number from ${least} to 4294967295`, field, index);
  }
  return value;
}

function list<T>(items: readonly T[], least: number, field: string): readonly T[] {
  if (items === null || typeof items !== 'object' || typeof items.length !== 'number') {
    throw new Malformed('is not a list', field);
  }
  if (items.length < least) throw new Malformed('list is empty', field);
  if (items.length > maxItems) throw new Malformed(`has more than ${maxItems} items`, field);
  return items;
}

function oneOf<T>(values: readonly T[], value: unknown, field: string, index = -1): T {
  if (!values.includes(value as T)) {
    throw new Malformed(`is none of ${values.join(', ')}`, field, index);
  }
  return value as T;
}

function vector(value: unknown, field: string, index: number): Vec3 {
  const numbers = value as Vec3 | undefined;
  if (!numbers || numbers.length !== 3) throw new Malformed('is not three numbers', field, index);
  return [
    finite(numbers[0], field, index), finite(numbers[1], field, index),
    finite(numbers[2], field, index)
  ];
}

/** x and z. */
function place(value: unknown, field: string, index: number): readonly [number, number] {
  const numbers = value as readonly number[] | undefined;
  if (!numbers || numbers.length !== 2) throw new Malformed('is not two numbers', field, index);
  return [finite(numbers[0], field, index), finite(numbers[1], field, index)];
}

function avatarList(avatars: readonly number[], least: number, field: string): Uint32Array {
  list(avatars, least, field);
  return Uint32Array.from(avatars, (avatar, i) => avatarNumber(avatar, 1, field, i));
}

export function joinWorld(name: string, role: Role): JoinWorld {
  checkName(name, maxNameBytes, 'name');
  return {type: 'JoinWorld', seq: 0n, name, role: oneOf(roles, role, 'role')};
}

export function spawn(items: readonly SpawnItem[]): Spawn {
  return {
    type: 'Spawn',
    seq: 0n,
    world: 0,
    items: list(items, 1, 'items').map((item, i) => ({
      avatar: avatarNumber(item?.avatar ?? 0, 0, 'avatar', i),
      positionM: vector(item?.positionM, 'positionM', i),
      headingRad: finite(item.headingRad, 'headingRad', i),
    })),
  };
}

export function remove(avatars: readonly number[]): Remove {
  return {type: 'Remove', seq: 0n, world: 0, avatars: avatarList(avatars, 1, 'avatars')};
}

export function cancelQueue(avatars: readonly number[]): CancelQueue {
  return {type: 'CancelQueue', seq: 0n, world: 0, avatars: avatarList(avatars, 1, 'avatars')};
}

/** `nextId` gives the number of a request that has none. */
export function request(items: readonly MovementRequest[], nextId: () => bigint): Request {
  return {
    type: 'Request',
    seq: 0n,
    world: 0,
    items: list(items, 1, 'items').map((item, i): QueuedRequest => {
      if (item === null || typeof item !== 'object') throw new Malformed('is none', 'items', i);
      const type = oneOf(movementTypes, item.type, 'type', i);
      const step = type === 'step';
      const walk = type === 'walk';
      const at = walk || (step && item.atM !== undefined) ? vector(item.atM, 'atM', i) : null;
      const moves = type !== 'stand' && at === null;
      const mustBeMet = item.mustBeMet ?? false;
      if (typeof mustBeMet !== 'boolean') throw new Malformed('is neither true nor false', 'mustBeMet', i);
      if (mustBeMet && !(step && at !== null)) {
        throw new Malformed('has a meaning only for a step with atM', 'mustBeMet', i);
      }
      return {
        avatar: avatarNumber(item.avatar, 1, 'avatar', i),
        requestId: item.requestId === undefined ? nextId() : requestId(item.requestId, i),
        type,
        foot: step ? oneOf(footChoices, item.foot ?? 'auto', 'foot', i) : 'auto',
        atM: at,
        headingRad: at !== null && (walk || item.headingRad !== undefined)
            ? finite(item.headingRad, 'headingRad', i) : null,
        lengthM: moves ? finite(item.lengthM ?? 0, 'lengthM', i) : 0,
        sideM: step && moves && item.sideM !== undefined ? finite(item.sideM, 'sideM', i) : null,
        heightM: moves ? finite(item.heightM ?? 0, 'heightM', i) : 0,
        turnRad: moves ? finite(item.turnRad ?? 0, 'turnRad', i) : 0,
        seconds: type === 'stand' ? finite(item.seconds ?? 0, 'seconds', i) : 0,
        waypointsM: walk ? waypoints(item.waypointsM ?? [], i) : [],
        speedMPerS: walk && item.speedMPerS !== undefined
            ? finite(item.speedMPerS, 'speedMPerS', i) : null,
        takeover: oneOf(takeovers, item.takeover ?? 'none', 'takeover', i),
        mustBeMet,
      };
    }),
  };
}

function waypoints(places: readonly Vec3[], index: number): readonly Vec3[] {
  if (!Array.isArray(places) || places.length > maxWaypoints) {
    throw new Malformed('is not a list of up to 64 places', 'waypointsM', index);
  }
  return places.map((place: Vec3) => vector(place, 'waypointsM', index));
}

function requestId(value: unknown, index: number): bigint {
  const id = typeof value === 'number' && Number.isSafeInteger(value) ? BigInt(value) : value;
  if (typeof id !== 'bigint' || id < 1n || id > maxRequestId) {
    throw new Malformed('is not a whole number from 1 on, exact as it is', 'requestId', index);
  }
  return id;
}

/** A copy: what the caller does with its arrays later changes nothing. */
export function setTerrain(terrain: Terrain | null): SetTerrain {
  const message: SetTerrain = {type: 'SetTerrain', seq: 0n, world: 0, terrain: null};
  if (terrain === null) return message;
  if (typeof terrain !== 'object') throw new Malformed('is none', 'terrain');
  const from = terrain.heightField ?? null;
  let heightField = null;
  if (from !== null) {
    const {columns, rows, heightsM} = from;
    for (const samples of [columns, rows]) {
      if (!Number.isInteger(samples) || samples < 2 || samples > maxTerrainColumns) {
        throw new Malformed('is not 2 to 1024', 'columns, rows');
      }
    }
    if (heightsM?.length !== columns * rows) throw new Malformed('is not one a sample', 'heightsM');
    const cellM = finite(from.cellM, 'cellM', -1);
    if (!(cellM > 0)) throw new Malformed('is not above 0', 'cellM');
    const copy = Float32Array.from(heightsM);
    copy.forEach((height, h) => finite(height, 'heightsM', h));
    heightField = {originM: place(from.originM, 'originM', -1), cellM, columns, rows, heightsM: copy};
  }
  const boxes = terrain.boxes ?? [];
  if (boxes.length > maxTerrainBoxes) throw new Malformed('has more than 65536', 'boxes');
  message.terrain = {
    heightField,
    boxes: Array.from(boxes, (box, b): TerrainBox => {
      const minM = place(box?.minM, 'boxes.minM', b);
      const maxM = place(box?.maxM, 'boxes.maxM', b);
      if (!(minM[0] < maxM[0] && minM[1] < maxM[1])) {
        throw new Malformed('is not above minM', 'boxes.maxM', b);
      }
      return {minM, maxM, heightM: finite(box.heightM, 'boxes.heightM', b)};
    }),
  };
  return message;
}

export function setLayers(items: readonly LayerRequest[]): SetLayers {
  return {
    type: 'SetLayers',
    seq: 0n,
    world: 0,
    items: list(items, 1, 'items').map((item, i): LayerEntry => {
      if (item === null || typeof item !== 'object') throw new Malformed('is none', 'items', i);
      checkName(item.layer, maxNameBytes, 'layer');
      return {
        avatar: avatarNumber(item.avatar, 1, 'avatar', i),
        layer: item.layer,
        off: item.off === true,
        weight: finite(item.weight ?? 1, 'weight', i),
        blendS: finite(item.blendS ?? 0.3, 'blendS', i),
        speed: finite(item.speed ?? 1, 'speed', i),
      };
    }),
  };
}

export function setPlanting(avatars: readonly number[], on: boolean): SetPlanting {
  if (typeof on !== 'boolean') throw new Malformed('is neither true nor false', 'on');
  return {type: 'SetPlanting', seq: 0n, world: 0, avatars: avatarList(avatars, 1, 'avatars'), off: !on};
}

export function observe(observation: Observation): Observe {
  if (observation === null || typeof observation !== 'object') {
    throw new Malformed('is none', 'observation');
  }
  const everyNTicks = observation.everyNTicks ?? 1;
  if (!Number.isInteger(everyNTicks) || everyNTicks < 1 || everyNTicks > maxEveryNTicks) {
    throw new Malformed('is not 1 to 3600', 'everyNTicks');
  }
  const mode = oneOf(poseModes.slice(0, 2) as PoseMode[], observation.mode, 'mode');
  const detail = oneOf(poseDetails, observation.detail ?? 'all', 'detail');
  if (detail !== 'all' && mode !== 'quantised') throw new Malformed('is of quantised poses only', 'detail');
  const inRegion = observation.region === undefined ? null : region(observation.region, mode, detail);
  if (inRegion !== null && (observation.avatars?.length ?? 0) > 0) {
    throw new Malformed('are not needed beside a region', 'avatars');
  }
  return {
    type: 'Observe',
    seq: 0n,
    world: 0,
    subscription: 0,
    mode,
    avatars: avatarList(observation.avatars ?? [], 0, 'avatars'),
    everyNTicks,
    withEvents: observation.withEvents === true,
    region: inRegion,
    replace: false,
    detail,
  };
}

/** A region observed in that mode, and beyond its rings in that detail. */
export function region(asked: Region, mode: Observe['mode'], beyond: PoseDetail): RegionEntry {
  if (asked === null || typeof asked !== 'object') throw new Malformed('is none', 'region');
  const radiusM = finite(asked.radiusM, 'radiusM', -1);
  if (!(radiusM > 0)) throw new Malformed('is not above 0', 'radiusM');
  const leaveM = asked.leaveM === undefined ? null : finite(asked.leaveM, 'leaveM', -1);
  if (leaveM !== null && leaveM < 0) throw new Malformed('is below 0', 'leaveM');
  const rings = asked.rings ?? [];
  if (!Array.isArray(rings) || rings.length > maxRateRings) {
    throw new Malformed('are not a list of up to 4', 'rings');
  }
  let beforeM = 0;
  for (const {toM, everyNTicks} of rings) {
    if (!Number.isFinite(toM) || toM <= beforeM) throw new Malformed('does not grow', 'toM');
    if (!Number.isInteger(everyNTicks) || everyNTicks < 1 || everyNTicks > maxEveryNTicks) {
      throw new Malformed('is not 1 to 3600', 'everyNTicks');
    }
    beforeM = toM;
  }
  const hasDetails = rings.some(({detail}) => detail !== undefined);
  if (hasDetails && mode !== 'quantised') throw new Malformed('is of quantised poses only', 'rings.detail');
  return {
    x: finite(asked.x, 'x', -1),
    z: finite(asked.z, 'z', -1),
    radiusM,
    leaveM,
    rings: rings.map(({toM, everyNTicks}) => ({toM, everyNTicks})),
    ringDetails: hasDetails
        ? rings.map(({detail}, i) => oneOf(poseDetails, detail ?? beyond, 'rings.detail', i)) : [],
  };
}
