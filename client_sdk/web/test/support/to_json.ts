import type {Message} from '../../generated/messages';
import {toFields} from '../../generated/json';
import {decodePoses} from '../../src/testing';
import {vectorInfo} from './vectors';

export type Json = {[name: string]: any};

/** Converts a message to the JSON of protocol/vectors, which uses the names of the schema. */
export function toJson(m: Message, frame: ArrayBuffer): Json {
  const json: Json = toFields[m.type](m as never);
  if (m.type === 'PoseBatch') {
    const {rootsM, rotations} = decodePoses(frame, vectorInfo());
    json.poses = Array.from(m.avatars, (avatar, i) => ({
      avatar, flags: m.flags[i], root_position_m: [...rootsM.subarray(3 * i, 3 * i + 3)],
      rotations: Array.from({length: m.jointCount}, (_joint, j) => {
        const at = 4 * (i * m.jointCount + j);
        return [...rotations.subarray(at, at + 4)];
      }),
    }));
  }
  return json;
}
