/**
 * Returns the generic time of a movement `timeS` seconds after its start: the index of the last
 * keytime passed plus the fraction of the way to the next one. Clamped to 0 and the last index.
 */
export function genericTime(keytimesS: ArrayLike<number>, timeS: number): number {
  const last = keytimesS.length - 1;
  if (last < 1 || timeS <= keytimesS[0]!) return 0;
  for (let i = 0; i < last; ++i) {
    if (timeS < keytimesS[i + 1]!) {
      const span = keytimesS[i + 1]! - keytimesS[i]!;
      return i + (span > 0 ? (timeS - keytimesS[i]!) / span : 0);
    }
  }
  return last;
}

/**
 * Returns the last of `states`, which are sorted by time, that is not later than `timeS`. If all
 * are later, returns the first one. If there are none, returns null.
 */
export function stateAt<T extends {readonly timeS: number}>(
  states: readonly T[], timeS: number): T | null {
  let best: T | null = null;
  for (const state of states) {
    if (best === null || state.timeS <= timeS) best = state;
    else break;
  }
  return best;
}
