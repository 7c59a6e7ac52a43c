// How poses travel to the page, and what that costs.

import type {PoseDetail, PoseMode, Statistics} from './sdk.js';

export const rates = [1, 2, 4] as const;

export interface Stream {
  readonly mode: PoseMode;
  /** Of quantised poses; full ones have all joints. */
  readonly detail: PoseDetail;
  readonly everyNTicks: (typeof rates)[number];
}

/** What is asked of the server. */
export function observationOf({mode, detail, everyNTicks}: Stream) {
  return {mode, detail: mode === 'full' ? 'all' as const : detail, everyNTicks, withEvents: true};
}

export function nameOf(stream: Stream): string {
  const {mode, detail, everyNTicks} = observationOf(stream);
  return (mode === 'full' ? 'Full' : 'Quantised') +
    {all: '', fewer: ', fewer', root: ', root'}[detail] +
    {1: '', 2: ', ½ rate', 4: ', ¼ rate'}[everyNTicks];
}

export interface Cost {
  readonly name: string;
  readonly now: boolean;
  readonly bytesAPose: number;
  readonly bytesPerS: number;
}

/** What was under way in another stream has arrived by then. */
const settleMs = 500;
const windowMs = 1000;

/**
 * What streams cost that were on, one after the other: the bytes of poses with their numbers and headers. Of other avatars than
 * there are now nothing is kept, for that could not be compared.
 */
export class StreamCosts {
  private readonly known = new Map<string, {bytesAPose: number; bytesPerS: number}>();
  private current = '';
  private avatars = -1;
  private from: {ms: number; bytes: number; poses: number} | null = null;
  private sinceMs = 0;

  /** Call now and then; true: there is something new. */
  measure(ms: number, stream: Stream, avatars: number, {poseBytesReceived, posesReceived}: Statistics): boolean {
    if (avatars === 0) return false;
    const name = nameOf(stream);
    if (avatars !== this.avatars || name !== this.current) {
      if (avatars !== this.avatars) this.known.clear();
      this.avatars = avatars;
      this.current = name;
      this.sinceMs = ms;
      this.from = null;
      return true;
    }
    if (ms - this.sinceMs < settleMs) return false;
    const now = {ms, bytes: poseBytesReceived, poses: posesReceived};
    this.from ??= now;
    const {from} = this;
    if (ms - from.ms < windowMs) return false;
    this.from = now;
    if (now.poses === from.poses) return false;
    this.known.set(name, {
      bytesAPose: (now.bytes - from.bytes) / (now.poses - from.poses),
      bytesPerS: 1000 * (now.bytes - from.bytes) / (ms - from.ms)});
    return true;
  }

  /** The dearest first. */
  get costs(): readonly Cost[] {
    return [...this.known].map(([name, cost]) => ({name, now: name === this.current, ...cost}))
      .sort((a, b) => b.bytesPerS - a.bytesPerS);
  }
}
