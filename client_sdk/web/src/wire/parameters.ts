import type {ParameterName, Parameters} from '../types';

export const parameterNames: readonly ParameterName[] = [
  'startX', 'startY', 'startZ', 'endX', 'endY', 'endZ', 'turn', 'length', 'height'
];

interface ParameterValue {
  readonly name: number;
  readonly value: number;
}

/** Converts a list of parameters to an object. */
export function parametersOf(list: readonly ParameterValue[]): Parameters {
  return Object.fromEntries(list.map(({name, value}) => [parameterNames[name], value]));
}

/** The reverse of parametersOf. */
export function parameterList(parameters: Parameters): ParameterValue[] {
  return Object.entries(parameters).map(
      ([name, value]) => ({name: parameterNames.indexOf(name as ParameterName), value}));
}
