// Pictures that a browser has taken, pixel by pixel: quicker here than in a page that draws meanwhile.

import {inflateSync} from 'node:zlib';

const signature = '89504e470d0a1a0a';

/** Of 8 bits a channel, not interlaced: {width, height, channels, pixels}. Others throw. */
export function decodePng(bytes) {
  if (bytes.toString('hex', 0, 8) !== signature) throw new Error('no PNG');
  const parts = [];
  let header;
  for (let at = 8; at < bytes.length;) {
    const length = bytes.readUInt32BE(at);
    const type = bytes.toString('latin1', at + 4, at + 8);
    const body = bytes.subarray(at + 8, at + 8 + length);
    if (type === 'IHDR') header = body;
    if (type === 'IDAT') parts.push(body);
    at += 12 + length;
  }
  const [width, height] = [header.readUInt32BE(0), header.readUInt32BE(4)];
  const [depth, kind, , , interlaced] = header.subarray(8);
  const channels = {2: 3, 6: 4}[kind];
  if (depth !== 8 || interlaced !== 0 || !channels) throw new Error(`a PNG of kind ${kind}, ${depth} bits`);
  const lines = inflateSync(Buffer.concat(parts));
  const stride = width * channels;
  const pixels = new Uint8Array(stride * height);
  for (let y = 0; y < height; ++y) {
    const from = y * (stride + 1);
    const to = y * stride;
    const filter = lines[from];
    for (let x = 0; x < stride; ++x) {
      const left = x < channels ? 0 : pixels[to + x - channels];
      const up = y === 0 ? 0 : pixels[to + x - stride];
      const corner = x < channels || y === 0 ? 0 : pixels[to + x - stride - channels];
      pixels[to + x] = lines[from + 1 + x] + predicted(filter, left, up, corner);
    }
  }
  return {width, height, channels, pixels};
}

/** What a filter of the PNG specification, Section 9, takes for a byte from those before it. */
function predicted(filter, left, up, corner) {
  switch (filter) {
    case 0: return 0;
    case 1: return left;
    case 2: return up;
    case 3: return (left + up) >> 1;
    case 4: {
      const p = left + up - corner;
      const [a, b, c] = [Math.abs(p - left), Math.abs(p - up), Math.abs(p - corner)];
      return a <= b && a <= c ? left : b <= c ? up : corner;
    }
    default: throw new Error(`PNG filter ${filter}`);
  }
}
