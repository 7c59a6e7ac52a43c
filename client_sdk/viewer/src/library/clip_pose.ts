// Samples poses of a clip, and maps times between clips by generic time.

import type {Clip} from './library_client.js';
import {genericTime} from '../timeline.js';

/** Returns the time in seconds at which a movement reaches a generic time. */
export function timeAtGenericTime(keytimesS: readonly number[], generic: number): number {
  const last = keytimesS.length - 1;
  const i = Math.max(0, Math.min(last - 1, Math.floor(generic)));
  const share = Math.max(0, Math.min(1, generic - i));
  return keytimesS[i]! + share * (keytimesS[i + 1]! - keytimesS[i]!);
}

/** Returns the time in `to` that has the same generic time as `timeS` in `from`. */
export function matchingTime(from: Clip, to: Clip, timeS: number): number {
  if (from.keytimes_s.length !== to.keytimes_s.length) return timeS;
  return timeAtGenericTime(to.keytimes_s, genericTime(from.keytimes_s, timeS));
}

export function durationOf(clip: Clip): number {
  return clip.keytimes_s[clip.keytimes_s.length - 1]!;
}

/**
 * Writes the pose at `timeS` as pose `at` of the arrays: 3 root coordinates, shifted by `offsetX`
 * metres sideways, and `jointCount` quaternions.
 */
export function samplePose(
  clip: Clip, jointCount: number, timeS: number, offsetX: number, rootsM: Float32Array,
  rotations: Float32Array, at: number): void {
  const times = clip.times_s;
  let f = 0;
  while (f + 2 < times.length && times[f + 1]! <= timeS) ++f;
  const span = times[f + 1]! - times[f]!;
  const share = span > 0 ? Math.max(0, Math.min(1, (timeS - times[f]!) / span)) : 1;
  for (let k = 0; k < 3; ++k) {
    const a = clip.roots_m[f * 3 + k]!;
    rootsM[at * 3 + k] = a + share * (clip.roots_m[f * 3 + 3 + k]! - a) + (k === 0 ? offsetX : 0);
  }
  for (let j = 0; j < jointCount; ++j) {
    const a = (f * jointCount + j) * 4;
    const b = a + jointCount * 4;
    const out = (at * jointCount + j) * 4;
    const r = clip.rotations;
    let dot = 0;
    for (let k = 0; k < 4; ++k) dot += r[a + k]! * r[b + k]!;
    const sign = dot < 0 ? -1 : 1;
    let norm = 0;
    for (let k = 0; k < 4; ++k) {
      const value = r[a + k]! + share * (sign * r[b + k]! - r[a + k]!);
      rotations[out + k] = value;
      norm += value * value;
    }
    norm = Math.sqrt(norm) || 1;
    for (let k = 0; k < 4; ++k) rotations[out + k] = rotations[out + k]! / norm;
  }
}
