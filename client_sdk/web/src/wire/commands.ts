import type {LayerRequest, MovementRequest, Observation, Region, Terrain} from '../types';
import type {PoseDetail, Region as RegionEntry} from '../../generated/messages';
import {Malformed} from './malformed';
import type {Draft} from './write';

/**
 * Functions that make messages from the arguments of the public interface. writeMessage checks the
 * types of the values, and the WebAssembly module checks their ranges.
 */

/** Checks that an argument is a list, and converts its entries. */
function convert<T, U>(items: readonly T[], field: string, entry: (item: T) => U): U[] {
  if (items === null || typeof items !== 'object' || typeof items.length !== 'number') {
    throw new Malformed(`${field}: expected a list`);
  }
  return Array.from(items, (item, i) => {
    if (item === null || item === undefined) {
      throw new Malformed(`${field}[${i}]: expected an object`);
    }
    return entry(item);
  });
}

/** Calls `nextId` for the id of each request that has none. */
export function request(items: readonly MovementRequest[], nextId: () => bigint): Draft {
  return {
    type: 'Request',
    items: convert(items, 'items', (item) => ({...item, requestId: item.requestId ?? nextId()})),
  };
}

export function setTerrain(terrain: Terrain | null): Draft {
  if (terrain !== null && typeof terrain !== 'object') {
    throw new Malformed('terrain: expected an object or null');
  }
  return {
    type: 'SetTerrain',
    terrain: terrain && {
      heightField: terrain.heightField ?? null,
      boxes: convert(terrain.boxes ?? [], 'boxes', ({minM, maxM, heightM}) =>
          ({minX: minM?.[0], minZ: minM?.[1], maxX: maxM?.[0], maxZ: maxM?.[1], heightM})),
    },
  };
}

export function setLayers(items: readonly LayerRequest[]): Draft {
  return {
    type: 'SetLayers',
    items: convert(items, 'items', ({enabled = true, ...item}) => {
      if (typeof enabled !== 'boolean') {
        throw new Malformed('items.enabled: expected true or false');
      }
      return {...item, fadeOut: !enabled};
    }),
  };
}

export type ObserveDraft = Draft & {
  readonly region: RegionEntry | null;
  readonly detail: PoseDetail;
};

export function observe(observation: Observation): ObserveDraft {
  if (observation === null || typeof observation !== 'object') {
    throw new Malformed('observation: expected an object');
  }
  const {detail = 'all', withEvents} = observation;
  return {
    ...observation,
    type: 'Observe',
    withEvents: withEvents === true,
    region: observation.region === undefined ? null : region(observation.region, detail),
    replace: false,
    detail,
  };
}

/** `beyond` is the detail of the observation, which applies beyond the rings of the region. */
export function region(asked: Region, beyond: PoseDetail): RegionEntry {
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
