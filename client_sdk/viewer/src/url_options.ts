// Options in the page's URL, see README.md. Unknown names and invalid values are ignored.

import type {FigureStyle, QualityChoice} from './quality.js';
import {tickIntervals, type PoseStream} from './pose_stream.js';

export interface UrlOptions {
  readonly figures: 'auto' | FigureStyle;
  readonly poseStream: PoseStream;
  readonly quality: QualityChoice;
  /** Upper limit of drawn frames per second. Infinity: the display's refresh rate. */
  readonly maxFramesPerS: number;
  /** Names of the worlds to show; empty: the page chooses. */
  readonly worlds: readonly string[];
}

const frameRateLimit = 240;

/** `search` is the query string, for example `?world=plaza&frames=30`. */
export function parseUrlOptions(search: string): UrlOptions {
  const query = new URLSearchParams(search);
  const oneOf = <T extends string>(name: string, values: readonly T[], fallback: T): T =>
    values.find((value) => value === query.get(name)) ?? fallback;
  const frames = query.get('frames') ?? '';
  const requestedRate = /^\d{1,3}$/.test(frames) ? Number(frames) : 0;
  return {
    figures: oneOf('figures', ['auto', 'bodies', 'lines'], 'auto'),
    poseStream: {
      mode: oneOf('mode', ['movement', 'quantised', 'full'], 'movement'),
      detail: oneOf('detail', ['all', 'reduced', 'root'], 'all'),
      everyNTicks: tickIntervals.find((interval) => query.get('every') === String(interval)) ?? 1,
    },
    quality: oneOf('quality', ['auto', 'high', 'low'], 'auto'),
    maxFramesPerS:
      requestedRate >= 1 && requestedRate <= frameRateLimit ? requestedRate : Infinity,
    worlds: query.getAll('world').filter((name) => name !== ''),
  };
}
