import type {LayerRequest, MovementRequest, Observation, Region, Terrain} from '../types';
import type {PoseDetail, Region as RegionEntry} from '../../generated/messages';
import * as check from './check';
import type {Draft} from './frame';

/**
 * Functions that make messages from the arguments of the public interface. writeMessage checks the
 * types of the values, and the WebAssembly module checks their ranges.
 */

/** Checks that an argument is a list of objects, and converts its entries. */
function convert<T, U>(items: readonly T[], field: string, entry: (item: T) => U): U[] {
  return check.list(items, new check.Place(field),
                    (item, at) => entry(check.object(item, at) as T));
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
    throw new check.Malformed('terrain: expected an object or null');
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
    items: convert(items, 'items', ({enabled = true, ...item}) =>
        ({...item, fadeOut: !check.truth(enabled, new check.Place('items.enabled'))})),
  };
}

export type ObserveDraft = Draft & {
  readonly region: RegionEntry | null;
  readonly detail: PoseDetail;
};

export function observe(observation: Observation): ObserveDraft {
  check.object(observation, new check.Place('observation'));
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
  check.object(asked, new check.Place('region'));
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
