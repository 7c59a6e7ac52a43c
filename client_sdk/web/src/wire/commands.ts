import type {
  LayerRequest, MovementRequest, Observation, Region, Role, SpawnItem, Terrain
} from '../types';
import type {
  CancelQueue, HeightFieldInfo, JoinWorld, Observe, Region as RegionEntry, Remove, Request,
  RequestItem, SetLayers, SetPlanting, SetTerrain, Spawn, TerrainBoxInfo
} from '../../generated/messages';
import {Malformed} from './malformed';

/**
 * Converts arguments of the public interface to messages. writeMessage checks the types of values
 * and the WebAssembly module their ranges. The session sets `seq` and `world`, so the numbers here
 * only have to be valid.
 */

const anySeq = 1n;
const anyWorld = 1;
const maxRequestId = 0xffff_ffff_ffff_ffffn;

/** Checks that an argument is a list, and converts its entries. */
function convert<T, U>(items: readonly T[], field: string, entry: (item: T, i: number) => U): U[] {
  if (items === null || typeof items !== 'object' || typeof items.length !== 'number') {
    throw new Malformed(`${field}: expected a list`);
  }
  return Array.from(items, (item, i) => {
    if (item === null || item === undefined) {
      throw new Malformed(`${field}[${i}]: expected an object`);
    }
    return entry(item, i);
  });
}

const numbers = (list: readonly number[], field: string): Uint32Array =>
    convert(list, field, (number) => number) as never;

export function joinWorld(name: string, role: Role): JoinWorld {
  return {type: 'JoinWorld', seq: anySeq, name, role};
}

export function spawn(items: readonly SpawnItem[]): Spawn {
  return {
    type: 'Spawn', seq: anySeq, world: anyWorld,
    items: convert(items, 'items', ({avatar, positionM, headingRad, teleport}) =>
        ({avatar: avatar ?? 0, positionM, headingRad, teleport: teleport ?? false})),
  };
}

export function remove(avatars: readonly number[]): Remove {
  return {type: 'Remove', seq: anySeq, world: anyWorld, avatars: numbers(avatars, 'avatars')};
}

export function cancelQueue(avatars: readonly number[]): CancelQueue {
  return {type: 'CancelQueue', seq: anySeq, world: anyWorld, avatars: numbers(avatars, 'avatars')};
}

/** The function `nextId` returns an id for a request that has none. */
export function request(items: readonly MovementRequest[], nextId: () => bigint): Request {
  return {
    type: 'Request', seq: anySeq, world: anyWorld,
    items: convert(items, 'items', (item, i) => requestItem(item, i, nextId)),
  };
}

/** Fields that the type of the request does not use are ignored. */
function requestItem(item: MovementRequest, index: number, nextId: () => bigint): RequestItem {
  const {type} = item;
  const step = type === 'step';
  const walk = type === 'walk';
  const at = walk || step ? item.atM ?? null : null;
  const moves = (step || type === 'jump') && at === null;
  const fail = (field: string, what: string): never => {
    throw new Malformed(`items.${field}[${index}]: ${what}`);
  };
  if (walk && at === null) fail('atM', 'expected a destination');
  if (walk && item.headingRad === undefined) fail('headingRad', 'expected a finite number');
  const {exactOnly = false, allowNearest = false} = item;
  if (exactOnly && (!step || allowNearest)) {
    fail('exactOnly', 'is only allowed for a step without allowNearest');
  }
  if (allowNearest && !step && type !== 'jump') {
    fail('allowNearest', 'is only allowed for a step or jump');
  }
  const {requestId} = item;
  const isInteger = typeof requestId === 'bigint' ||
      (typeof requestId === 'number' && Number.isSafeInteger(requestId));
  if (requestId !== undefined && (!isInteger || requestId < 1 || requestId > maxRequestId)) {
    fail('requestId', 'expected a bigint or a safe integer, at least 1');
  }
  return {
    avatar: item.avatar,
    requestId: requestId === undefined ? nextId() : BigInt(requestId),
    type,
    foot: step ? item.foot ?? 'auto' : 'auto',
    atM: at,
    headingRad: at === null ? null : item.headingRad ?? null,
    lengthM: moves ? item.lengthM ?? 0 : 0,
    sideM: step && moves ? item.sideM ?? null : null,
    heightM: moves ? item.heightM ?? 0 : 0,
    turnRad: moves ? item.turnRad ?? 0 : 0,
    seconds: type === 'stand' ? item.seconds ?? 0 : 0,
    waypointsM: walk ? [...item.waypointsM ?? []] : [],
    speedMPerS: walk ? item.speedMPerS ?? null : null,
    interrupt: item.interrupt ?? 'none',
    exactOnly,
    allowNearest,
  };
}

export function setTerrain(terrain: Terrain | null): SetTerrain {
  if (terrain !== null && typeof terrain !== 'object') {
    throw new Malformed('terrain: expected an object or null');
  }
  return {
    type: 'SetTerrain', seq: anySeq, world: anyWorld,
    terrain: terrain && {
      heightField: (terrain.heightField ?? null) as HeightFieldInfo | null,
      boxes: convert(terrain.boxes ?? [], 'boxes', ({minM, maxM, heightM}): TerrainBoxInfo => ({
        minX: minM?.[0], minZ: minM?.[1], maxX: maxM?.[0], maxZ: maxM?.[1], heightM
      })),
    },
  };
}

export function setLayers(items: readonly LayerRequest[]): SetLayers {
  return {
    type: 'SetLayers', seq: anySeq, world: anyWorld,
    items: convert(items, 'items', ({avatar, layer, enabled, weight, blendS, speed}, i) => {
      if (typeof (enabled ?? true) !== 'boolean') {
        throw new Malformed(`items.enabled[${i}]: expected true or false`);
      }
      return {
        avatar, layer, fadeOut: enabled === false, weight: weight ?? 1, blendS: blendS ?? 0.3,
        speed: speed ?? 1,
      };
    }),
  };
}

export function setPlanting(avatars: readonly number[], enabled: boolean): SetPlanting {
  return {
    type: 'SetPlanting', seq: anySeq, world: anyWorld, avatars: numbers(avatars, 'avatars'), enabled
  };
}

export function observe(observation: Observation): Observe {
  if (observation === null || typeof observation !== 'object') {
    throw new Malformed('observation: expected an object');
  }
  const detail = observation.detail ?? 'all';
  return {
    type: 'Observe', seq: anySeq, world: anyWorld, subscription: 1,
    mode: observation.mode,
    avatars: numbers(observation.avatars ?? [], 'avatars'),
    everyNTicks: observation.everyNTicks ?? 1,
    withEvents: observation.withEvents === true,
    region: observation.region === undefined ? null : region(observation.region, detail),
    replace: false,
    detail,
  };
}

/** `beyond` is the detail of the observation. */
export function region(asked: Region, beyond: Observe['detail']): RegionEntry {
  if (asked === null || typeof asked !== 'object') {
    throw new Malformed('region: expected an object');
  }
  const rings = asked.rings ?? [];
  return {
    centreM: [asked.x, asked.z],
    radiusM: asked.radiusM,
    leaveM: asked.leaveMarginM ?? null,
    rings: convert(rings, 'rings', ({outerRadiusM, everyNTicks}) =>
        ({toM: outerRadiusM, everyNTicks})),
    ringDetails: rings.some(({detail}) => detail !== undefined)
        ? rings.map(({detail}) => detail ?? beyond) : [],
  };
}
