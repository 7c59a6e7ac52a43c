import {readFileSync, readdirSync} from 'node:fs';
import {root} from './environment';

export interface Vector {
  name: string;
  frame: ArrayBuffer;
  type: string;
  typeNumber: number;
  fields: {[name: string]: unknown};
}

/** Every frame of protocol/vectors with what it says. */
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
