import {readFileSync, readdirSync} from 'node:fs';
import {root} from './environment';

export interface Vector {
  name: string;
  frame: ArrayBuffer;
  type: string;
  typeNumber: number;
  fields: {[name: string]: unknown};
}

/** Returns all frames of protocol/vectors with their expected contents. */
export function readVectors(): Vector[] {
  const folder = `${root}protocol/vectors`;
  return readdirSync(folder).filter((file) => file.endsWith('.bin')).sort().map((file) => {
    const bytes = readFileSync(`${folder}/${file}`);
    const json = JSON.parse(readFileSync(`${folder}/${file.replace(/bin$/, 'json')}`, 'utf8'));
    return {
      name: file.replace(/\.bin$/, ''),
      frame: new Uint8Array(bytes).buffer,
      type: json.type,
      typeNumber: json.type_number,
      fields: json.fields,
    };
  });
}

let info: ArrayBuffer | null = null;

/** Returns the WorldInfo frame of the compact poses in the vectors. */
export function vectorInfo(): ArrayBuffer {
  info ??= readVectors().find(({name}) => name === 'world_info_detail')!.frame;
  return info;
}
