// What the page's address asks for, see README.md; what it does not understand it leaves as it is.

import type {FigureStyle, QualityChoice} from './quality.js';
import {rates, type Stream} from './pose_stream.js';

export interface Asked {
  readonly figures: 'auto' | FigureStyle;
  readonly stream: Stream;
  readonly quality: QualityChoice;
  /** So many frames a second at most; infinite: as many as the display shows. */
  readonly framesPerS: number;
  readonly worlds: readonly string[];
}

const mostFramesPerS = 240;

export function readAddress(search: string): Asked {
  const query = new URLSearchParams(search);
  const oneOf = <T extends string>(name: string, values: readonly T[], otherwise: T): T =>
    values.find((value) => value === query.get(name)) ?? otherwise;
  const frames = query.get('frames') ?? '';
  const framesPerS = /^\d{1,3}$/.test(frames) ? Number(frames) : 0;
  return {
    figures: oneOf('figures', ['auto', 'bodies', 'lines'], 'auto'),
    stream: {
      mode: oneOf('mode', ['quantised', 'full'], 'quantised'),
      detail: oneOf('detail', ['all', 'fewer', 'root'], 'all'),
      everyNTicks: rates.find((rate) => query.get('every') === String(rate)) ?? 1,
    },
    quality: oneOf('quality', ['auto', 'high', 'low'], 'auto'),
    framesPerS: framesPerS >= 1 && framesPerS <= mostFramesPerS ? framesPerS : Infinity,
    worlds: query.getAll('world').filter((name) => name !== ''),
  };
}
