import type {ParameterName, Parameters} from '../types';

export const parameterNames: readonly ParameterName[] = [
  'startX', 'startY', 'startZ', 'endX', 'endY', 'endZ', 'turn', 'length', 'height'
];

/** Returns value and number of each parameter, as in the struct ParameterValue. */
export function parameterList(parameters: unknown): [value: number, name: number][] {
  return Object.entries(parameters as Parameters).map(
      ([name, value]) => [value, parameterNames.indexOf(name as ParameterName)]);
}
