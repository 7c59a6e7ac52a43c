import type {
  LayerRequest, MovementRequest, Observation, PoseDetail, PoseMode, QueuedRequest, Region, Role,
  SpawnItem, Terrain, Vec3
} from '../types';
import {
  maxEveryNTicks, maxItems, maxNameBytes, maxRateRings, maxTerrainBoxes,
  maxTerrainColumns, maxWaypoints
} from '../../generated/limits';
import {Malformed} from './malformed';
import {enums} from '../../generated/messages';
import type {
  CancelQueue, JoinWorld, LayerItem, Observe, Region as RegionEntry, Remove, Request, SetLayers,
  SetPlanting, SetTerrain, Spawn, TerrainBoxInfo
} from './messages';
import {checkName} from './text';

/**
 * Converts arguments of the public interface to messages. The same checks apply as in the server's
 * decoder. `seq` and `world` are 0; the session sets them. All functions throw Malformed if an
 * argument is invalid.
 */

export const maxAvatarNumber = 0xffff_ffff;
const maxRequestId = 0xffff_ffff_ffff_ffffn;

function finite(value: unknown, field: string, index: number): number {
  if (typeof value !== 'number' || !Number.isFinite(value)) {
    throw new Malformed(`expected a finite number, got ${value}`, field, index);
  }
  return value;
}

function avatarNumber(value: unknown, least: number, field: string, index: number): number {
  if (typeof value !== 'number' || !Number.isInteger(value) || value < least ||
      value > maxAvatarNumber) {
    throw new Malformed(`expected an integer from ${least} to ${maxAvatarNumber}, got ${value}`,
                        field, index);
  }
  return value;
}

function list<T>(items: readonly T[], least: number, field: string): readonly T[] {
  if (items === null || typeof items !== 'object' || typeof items.length !== 'number') {
    throw new Malformed('expected a list', field);
  }
  if (items.length < least) throw new Malformed('expected at least one item', field);
  if (items.length > maxItems) {
    throw new Malformed(`expected at most ${maxItems} items, got ${items.length}`, field);
  }
  return items;
}

function oneOf<T>(values: readonly T[], value: unknown, field: string, index = -1): T {
  if (!values.includes(value as T)) {
    throw new Malformed(`expected one of ${values.join(', ')}, got ${value}`, field, index);
  }
  return value as T;
}

function vector(value: unknown, field: string, index: number): Vec3 {
  const numbers = value as Vec3 | undefined;
  if (!numbers || numbers.length !== 3) {
    throw new Malformed('expected three numbers', field, index);
  }
  return [
    finite(numbers[0], field, index), finite(numbers[1], field, index),
    finite(numbers[2], field, index)
  ];
}

/** Checks the x and z of a point on the ground. */
function place(value: unknown, field: string, index: number): readonly [number, number] {
  const numbers = value as readonly number[] | undefined;
  if (!numbers || numbers.length !== 2) throw new Malformed('expected two numbers', field, index);
  return [finite(numbers[0], field, index), finite(numbers[1], field, index)];
}

function avatarList(avatars: readonly number[], least: number, field: string): Uint32Array {
  list(avatars, least, field);
  return Uint32Array.from(avatars, (avatar, i) => avatarNumber(avatar, 1, field, i));
}

export function joinWorld(name: string, role: Role): JoinWorld {
  checkName(name, maxNameBytes, 'name');
  return {type: 'JoinWorld', seq: 0n, name, role: oneOf(enums.Role, role, 'role')};
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

/** The function `nextId` returns an id for a request that has none. */
export function request(items: readonly MovementRequest[], nextId: () => bigint): Request {
  return {
    type: 'Request',
    seq: 0n,
    world: 0,
    items: list(items, 1, 'items').map((item, i): QueuedRequest => {
      if (item === null || typeof item !== 'object') {
        throw new Malformed('expected an object', 'items', i);
      }
      const type = oneOf(enums.MovementType, item.type, 'type', i);
      const step = type === 'step';
      const walk = type === 'walk';
      const at = walk || (step && item.atM !== undefined) ? vector(item.atM, 'atM', i) : null;
      const moves = type !== 'stand' && at === null;
      const exactOnly = item.exactOnly ?? false;
      const allowNearest = item.allowNearest ?? false;
      if (typeof exactOnly !== 'boolean') {
        throw new Malformed('expected true or false', 'exactOnly', i);
      }
      if (typeof allowNearest !== 'boolean') {
        throw new Malformed('expected true or false', 'allowNearest', i);
      }
      if (exactOnly && (!step || allowNearest)) {
        throw new Malformed('is only allowed for a step without allowNearest', 'exactOnly', i);
      }
      if (allowNearest && !step && type !== 'jump') {
        throw new Malformed('is only allowed for a step or jump', 'allowNearest', i);
      }
      return {
        avatar: avatarNumber(item.avatar, 1, 'avatar', i),
        requestId: item.requestId === undefined ? nextId() : requestId(item.requestId, i),
        type,
        foot: step ? oneOf(enums.FootChoice, item.foot ?? 'auto', 'foot', i) : 'auto',
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
        interrupt: oneOf(enums.Takeover, item.interrupt ?? 'none', 'interrupt', i),
        exactOnly,
        allowNearest,
      };
    }),
  };
}

function waypoints(places: readonly Vec3[], index: number): readonly Vec3[] {
  if (!Array.isArray(places) || places.length > maxWaypoints) {
    throw new Malformed(`expected a list of up to ${maxWaypoints} positions`, 'waypointsM', index);
  }
  return places.map((place: Vec3) => vector(place, 'waypointsM', index));
}

function requestId(value: unknown, index: number): bigint {
  const id = typeof value === 'number' && Number.isSafeInteger(value) ? BigInt(value) : value;
  if (typeof id !== 'bigint' || id < 1n || id > maxRequestId) {
    throw new Malformed('expected a bigint or a safe integer, at least 1', 'requestId', index);
  }
  return id;
}

/** Copies the arrays, so that the caller may change them later. */
export function setTerrain(terrain: Terrain | null): SetTerrain {
  const message: SetTerrain = {type: 'SetTerrain', seq: 0n, world: 0, terrain: null};
  if (terrain === null) return message;
  if (typeof terrain !== 'object') throw new Malformed('expected an object or null', 'terrain');
  const from = terrain.heightField ?? null;
  let heightField = null;
  if (from !== null) {
    const {columns, rows, heightsM} = from;
    for (const samples of [columns, rows]) {
      if (!Number.isInteger(samples) || samples < 2 || samples > maxTerrainColumns) {
        throw new Malformed(`expected 2 to ${maxTerrainColumns}, got ${samples}`, 'columns, rows');
      }
    }
    if (heightsM?.length !== columns * rows) {
      throw new Malformed(`expected ${columns * rows} numbers, got ${heightsM?.length}`,
                          'heightsM');
    }
    const cellM = finite(from.cellM, 'cellM', -1);
    if (!(cellM > 0)) throw new Malformed(`expected a number above 0, got ${cellM}`, 'cellM');
    const copy = Float32Array.from(heightsM);
    copy.forEach((height, h) => finite(height, 'heightsM', h));
    const originM = place(from.originM, 'originM', -1);
    heightField = {originM, cellM, columns, rows, heightsM: copy};
  }
  const boxes = terrain.boxes ?? [];
  if (boxes.length > maxTerrainBoxes) {
    throw new Malformed(`expected at most ${maxTerrainBoxes}, got ${boxes.length}`, 'boxes');
  }
  message.terrain = {
    heightField,
    boxes: Array.from(boxes, (box, b): TerrainBoxInfo => {
      const minM = place(box?.minM, 'boxes.minM', b);
      const maxM = place(box?.maxM, 'boxes.maxM', b);
      if (!(minM[0] < maxM[0] && minM[1] < maxM[1])) {
        throw new Malformed('expected both numbers to be above minM', 'boxes.maxM', b);
      }
      return {
        minX: minM[0], minZ: minM[1], maxX: maxM[0], maxZ: maxM[1],
        heightM: finite(box.heightM, 'boxes.heightM', b),
      };
    }),
  };
  return message;
}

export function setLayers(items: readonly LayerRequest[]): SetLayers {
  return {
    type: 'SetLayers',
    seq: 0n,
    world: 0,
    items: list(items, 1, 'items').map((item, i): LayerItem => {
      if (item === null || typeof item !== 'object') {
        throw new Malformed('expected an object', 'items', i);
      }
      const enabled = item.enabled ?? true;
      if (typeof enabled !== 'boolean') {
        throw new Malformed('expected true or false', 'enabled', i);
      }
      checkName(item.layer, maxNameBytes, 'layer');
      return {
        avatar: avatarNumber(item.avatar, 1, 'avatar', i),
        layer: item.layer,
        fadeOut: !enabled,
        weight: finite(item.weight ?? 1, 'weight', i),
        blendS: finite(item.blendS ?? 0.3, 'blendS', i),
        speed: finite(item.speed ?? 1, 'speed', i),
      };
    }),
  };
}

export function setPlanting(avatars: readonly number[], enabled: boolean): SetPlanting {
  if (typeof enabled !== 'boolean') throw new Malformed('expected true or false', 'enabled');
  return {
    type: 'SetPlanting',
    seq: 0n,
    world: 0,
    avatars: avatarList(avatars, 1, 'avatars'),
    enabled,
  };
}

export function observe(observation: Observation): Observe {
  if (observation === null || typeof observation !== 'object') {
    throw new Malformed('expected an object', 'observation');
  }
  const everyNTicks = tickInterval(observation.everyNTicks ?? 1, 'everyNTicks');
  const mode = oneOf<PoseMode>(['full', 'quantised'], observation.mode, 'mode');
  const detail = oneOf(enums.PoseDetail, observation.detail ?? 'all', 'detail');
  if (detail !== 'all' && mode !== 'quantised') {
    throw new Malformed(`requires mode quantised, got ${mode}`, 'detail');
  }
  const inRegion =
      observation.region === undefined ? null : region(observation.region, mode, detail);
  if (inRegion !== null && (observation.avatars?.length ?? 0) > 0) {
    throw new Malformed('must be empty or absent if a region is given', 'avatars');
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

function tickInterval(value: number, field: string, index = -1): number {
  if (!Number.isInteger(value) || value < 1 || value > maxEveryNTicks) {
    throw new Malformed(`expected an integer from 1 to ${maxEveryNTicks}, got ${value}`, field,
                        index);
  }
  return value;
}

/** `mode` and `beyond` are the mode and the detail of the observation. */
export function region(asked: Region, mode: Observe['mode'], beyond: PoseDetail): RegionEntry {
  if (asked === null || typeof asked !== 'object') {
    throw new Malformed('expected an object', 'region');
  }
  const radiusM = finite(asked.radiusM, 'radiusM', -1);
  if (!(radiusM > 0)) throw new Malformed(`expected a number above 0, got ${radiusM}`, 'radiusM');
  const leaveM =
      asked.leaveMarginM === undefined ? null : finite(asked.leaveMarginM, 'leaveMarginM', -1);
  if (leaveM !== null && leaveM < 0) {
    throw new Malformed(`expected a number of at least 0, got ${leaveM}`, 'leaveMarginM');
  }
  const rings = asked.rings ?? [];
  if (!Array.isArray(rings) || rings.length > maxRateRings) {
    throw new Malformed(`expected a list of up to ${maxRateRings}`, 'rings');
  }
  let previousM = 0;
  rings.forEach(({outerRadiusM, everyNTicks}, i) => {
    if (!Number.isFinite(outerRadiusM) || outerRadiusM <= previousM) {
      throw new Malformed(`expected a number above ${previousM}, got ${outerRadiusM}`,
                          'rings.outerRadiusM', i);
    }
    tickInterval(everyNTicks, 'rings.everyNTicks', i);
    previousM = outerRadiusM;
  });
  const hasDetails = rings.some(({detail}) => detail !== undefined);
  if (hasDetails && mode !== 'quantised') {
    throw new Malformed(`requires mode quantised, got ${mode}`, 'rings.detail');
  }
  return {
    centreM: [finite(asked.x, 'x', -1), finite(asked.z, 'z', -1)],
    radiusM,
    leaveM,
    rings: rings.map(({outerRadiusM, everyNTicks}) => ({toM: outerRadiusM, everyNTicks})),
    ringDetails: hasDetails
        ? rings.map(({detail}, i) =>
            oneOf(enums.PoseDetail, detail ?? beyond, 'rings.detail', i)) : [],
  };
}
