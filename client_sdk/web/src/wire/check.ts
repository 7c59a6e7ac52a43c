import type {MovementRequest, Observation, QueuedRequest, Role, SpawnItem} from '../types';
import {footChoices, movementTypes, poseModes, roles} from './decode';
import {maxAvatarNumber, maxEveryNTicks, maxItems, maxNameBytes} from './limits';
import {Malformed} from './malformed';
import type {CancelQueue, JoinWorld, Observe, Remove, Request, Spawn} from './messages';
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
    items: list(items, 1, 'items').map((item, i) => {
      const position = item?.positionM;
      if (!position || position.length !== 3) {
        throw new Malformed('is not three numbers', 'positionM', i);
      }
      return {
        avatar: avatarNumber(item.avatar ?? 0, 0, 'avatar', i),
        positionM: [
          finite(position[0], 'positionM', i), finite(position[1], 'positionM', i),
          finite(position[2], 'positionM', i)
        ],
        headingRad: finite(item.headingRad, 'headingRad', i),
      };
    }),
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
      const moves = type !== 'stand';
      return {
        avatar: avatarNumber(item.avatar, 1, 'avatar', i),
        requestId: item.requestId === undefined ? nextId() : requestId(item.requestId, i),
        type,
        foot: step ? oneOf(footChoices, item.foot ?? 'auto', 'foot', i) : 'auto',
        lengthM: moves ? finite(item.lengthM ?? 0, 'lengthM', i) : 0,
        sideM: step && item.sideM !== undefined ? finite(item.sideM, 'sideM', i) : null,
        heightM: moves ? finite(item.heightM ?? 0, 'heightM', i) : 0,
        turnRad: moves ? finite(item.turnRad ?? 0, 'turnRad', i) : 0,
        seconds: moves ? 0 : finite(item.seconds ?? 0, 'seconds', i),
      };
    }),
  };
}

function requestId(value: unknown, index: number): bigint {
  const id = typeof value === 'number' && Number.isSafeInteger(value) ? BigInt(value) : value;
  if (typeof id !== 'bigint' || id < 1n || id > maxRequestId) {
    throw new Malformed('is not a whole number from 1 on, exact as it is', 'requestId', index);
  }
  return id;
}

export function observe(observation: Observation): Observe {
  if (observation === null || typeof observation !== 'object') {
    throw new Malformed('is none', 'observation');
  }
  const everyNTicks = observation.everyNTicks ?? 1;
  if (!Number.isInteger(everyNTicks) || everyNTicks < 1 || everyNTicks > maxEveryNTicks) {
    throw new Malformed('is not 1 to 3600', 'everyNTicks');
  }
  return {
    type: 'Observe',
    seq: 0n,
    world: 0,
    subscription: 0,
    mode: oneOf(poseModes.slice(0, 2), observation.mode, 'mode'),
    avatars: avatarList(observation.avatars ?? [], 0, 'avatars'),
    everyNTicks,
    withEvents: observation.withEvents === true,
  };
}
