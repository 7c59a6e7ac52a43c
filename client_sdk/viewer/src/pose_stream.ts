// Options for how the server sends avatars to the page, and the measured size of poses.

import type {PoseDetail, PoseMode, Statistics} from './sdk.js';

export const tickIntervals = [1, 2, 4] as const;

/** Labels and descriptions of the stream modes, for the View panel. */
export const streamModes: {readonly [mode in PoseMode]: {label: string; description: string}} = {
  movement: {
    label: 'Movement',
    description: "The server sends movements, and this page computes the poses with the world's " +
      'motion library.',
  },
  quantised: {label: 'Quantised', description: 'The server sends compressed poses.'},
  full: {label: 'Full', description: 'The server sends uncompressed poses.'},
};

export interface PoseStream {
  readonly mode: PoseMode;
  /** Level of detail of quantised poses. In other modes, poses always contain all joints. */
  readonly detail: PoseDetail;
  /** The page receives, or computes, only the poses of every n-th tick. */
  readonly everyNTicks: (typeof tickIntervals)[number];
}

/** Returns the arguments for `World.observe`. */
export function observationFor({mode, detail, everyNTicks}: PoseStream) {
  return {
    mode, detail: mode === 'quantised' ? detail : 'all' as const, everyNTicks, withEvents: true};
}

/** Returns a name for users, for example "Quantised, root only, ¼ rate". */
export function streamName(stream: PoseStream): string {
  const {mode, detail, everyNTicks} = observationFor(stream);
  return streamModes[mode].label +
    {all: '', reduced: ', reduced joints', root: ', root only'}[detail] +
    {1: '', 2: ', ½ rate', 4: ', ¼ rate'}[everyNTicks];
}

export interface StreamCost {
  readonly name: string;
  /** True for the stream in use. */
  readonly active: boolean;
  readonly bytesPerPose: number;
  readonly bytesPerS: number;
}

/** For example "3.1" or "101". */
export function formatBytesPerPose(bytes: number): string {
  return bytes.toFixed(bytes < 10 ? 1 : 0);
}

/** Time after a change of stream during which poses of the old one may arrive. */
const settleMs = 500;
const windowMs = 1000;

/**
 * Measures the cost of each stream that the user has tried: bytes of poses, including avatar ids
 * and batch headers. A change of the number of avatars discards all measurements, because costs of
 * different crowds cannot be compared.
 */
export class StreamCosts {
  private readonly measured = new Map<string, {bytesPerPose: number; bytesPerS: number}>();
  private current = '';
  private avatars = -1;
  private windowStart: {ms: number; bytes: number; poses: number} | null = null;
  private changedMs = 0;

  /** Call several times per second. Returns whether `costs` has changed. */
  measure(
    ms: number, stream: PoseStream, avatars: number,
    {poseBytesReceived, posesReceived}: Statistics): boolean {
    if (avatars === 0) return false;
    const name = streamName(stream);
    if (avatars !== this.avatars || name !== this.current) {
      if (avatars !== this.avatars) this.measured.clear();
      this.avatars = avatars;
      this.current = name;
      this.changedMs = ms;
      this.windowStart = null;
      return true;
    }
    if (ms - this.changedMs < settleMs) return false;
    const now = {ms, bytes: poseBytesReceived, poses: posesReceived};
    this.windowStart ??= now;
    const start = this.windowStart;
    if (ms - start.ms < windowMs) return false;
    this.windowStart = now;
    if (now.poses === start.poses) return false;
    this.measured.set(name, {
      bytesPerPose: (now.bytes - start.bytes) / (now.poses - start.poses),
      bytesPerS: 1000 * (now.bytes - start.bytes) / (ms - start.ms)});
    return true;
  }

  /** Costs per stream, sorted by bytes per second, the most expensive stream first. */
  get costs(): readonly StreamCost[] {
    return [...this.measured]
      .map(([name, cost]) => ({name, active: name === this.current, ...cost}))
      .sort((a, b) => b.bytesPerS - a.bytesPerS);
  }
}
