import type {MovementRequest, Observation, Region} from '../types';
import type {PoseDetail} from '../../generated/messages';
import * as check from './check';
import type {Draft} from './frame';

/**
 * Functions that make messages from those arguments of the public interface that differ from the
 * schema. writeMessage checks the types of the values, and the WebAssembly module their ranges.
 */

/** Checks that an argument is a list of objects, and returns a copy. */
function objects<T extends object>(list: readonly T[], name: string): T[] {
  return check.list(list, new check.Place(name),
                    (entry: T, at) => ({...check.object(entry, at) as T}));
}

/** Calls `nextId` to assign an id to each request without one. */
export function request(items: readonly MovementRequest[], nextId: () => bigint): Draft {
  return {
    type: 'Request',
    items: objects(items, 'items').map(
        (item) => ({...item, requestId: item.requestId ?? nextId()})),
  };
}

export function observe(observation: Observation): Draft {
  check.object(observation, new check.Place('observation'));
  const {detail = 'all', region: asked} = observation;
  return {...observation, type: 'Observe', detail, region: asked ? region(asked, detail) : null};
}

/** `beyond` is the detail of the observation, which applies beyond the rings of the region. */
function region(asked: Region, beyond: PoseDetail): check.Fields {
  check.object(asked, new check.Place('region'));
  const {x, z, ...others} = asked;
  const rings = objects(asked.rings ?? [], 'rings');
  return {
    ...others,
    centreM: [x, z],
    rings,
    ringDetails: rings.some(({detail}) => detail !== undefined)
        ? rings.map(({detail}) => detail ?? beyond) : [],
  };
}
