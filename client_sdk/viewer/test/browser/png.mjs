// Decodes screenshots. Doing it here is faster than in a page that is busy drawing.

import {inflateSync} from 'node:zlib';

const signature = '89504e470d0a1a0a';

/**
 * Returns {width, height, channels, pixels}. Supports 8 bits per channel, RGB or RGBA, without
 * interlacing; throws for other formats.
 */
export function decodePng(bytes) {
  if (bytes.toString('hex', 0, 8) !== signature) throw new Error('not a PNG file');
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
  const [depth, colourType, , , interlaced] = header.subarray(8);
  const channels = {2: 3, 6: 4}[colourType];
  if (depth !== 8 || interlaced !== 0 || !channels) {
    throw new Error(`unsupported PNG: colour type ${colourType}, ${depth} bits per channel`);
  }
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

/** The value that a filter predicts for a byte (PNG specification, Section 9). */
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
    default: throw new Error(`unknown PNG filter ${filter}`);
  }
}
