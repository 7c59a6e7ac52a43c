import {readFileSync, readdirSync} from 'node:fs';
import {CompactCodec} from '../../src/wire/compact_codec';
import type {BatchMode} from '../../src/wire/messages';
import {decodeFrame} from '../../src/wire/decode';
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

const codecs = new Map<BatchMode, CompactCodec>();

/** Returns the codec of the compact poses in the vectors, built from `world_info_detail`. Returns
 * null for other modes. */
export function vectorCodec(mode: BatchMode): CompactCodec | null {
  if (mode === 'full' || mode === 'quantised') return null;
  const known = codecs.get(mode);
  if (known !== undefined) return known;
  const vector = readVectors().find(({name}) => name === 'world_info_detail')!;
  const info = decodeFrame(vector.frame, 'server');
  if (info.type !== 'WorldInfo') throw new Error('world_info_detail is not a WorldInfo');
  const codec = new CompactCodec(info.rotationCodes,
    mode === 'compactFewer' ? info.reducedJoints : mode === 'compactRoot' ? [0] : []);
  codecs.set(mode, codec);
  return codec;
}
