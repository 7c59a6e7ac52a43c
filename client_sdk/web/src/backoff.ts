/**
 * Delays between connection attempts. The first delay is `firstS`, and each one is twice as long as
 * the one before, up to `longestS`. Each delay is shortened at random by a fraction of up to
 * `jitter`, so that the clients of a restarted server do not reconnect all at once.
 */
export class Backoff {
  static readonly firstS = 0.1;
  static readonly longestS = 5;
  static readonly jitter = 0.5;

  private waitS = Backoff.firstS;
  private random: number;

  constructor(seed: number) {
    this.random = seed >>> 0;
  }

  /** Returns the next delay in seconds, in [(1 - jitter) d, d] for the unshortened delay d. */
  next(): number {
    const waitS = this.waitS;
    this.waitS = Math.min(2 * waitS, Backoff.longestS);
    return waitS * (1 - Backoff.jitter * this.uniform());
  }

  /** Starts again with `firstS`, after a successful attempt. */
  reset(): void {
    this.waitS = Backoff.firstS;
  }

  /** Returns a random number in [0, 1) (SplitMix32). */
  private uniform(): number {
    this.random = (this.random + 0x9e3779b9) >>> 0;
    let z = this.random;
    z = Math.imul(z ^ (z >>> 16), 0x21f0aaad);
    z = Math.imul(z ^ (z >>> 15), 0x735a2d97);
    return ((z ^ (z >>> 15)) >>> 0) / 0x1_0000_0000;
  }
}
