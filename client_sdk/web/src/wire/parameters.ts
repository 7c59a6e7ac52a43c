import {enums} from '../../generated/messages';
import type {ParameterName, Parameters} from '../types';

/** Returns value and number of each parameter, as in the struct ParameterValue. */
export function parameterList(parameters: unknown): [value: number, name: number][] {
  return Object.entries(parameters as Parameters).map(
      ([name, value]) => [value, enums.ParameterName.indexOf(name as ParameterName)]);
}
