/** How long to wait before the next attempt: `firstS`, doubled with every attempt up to `longestS`,
 * each shortened at random by up to `jitter` of itself, so that the clients of a server that went
 * away do not all come back in the same instant. */
export class Backoff {
  static readonly firstS = 0.1;
  static readonly longestS = 5;
  static readonly jitter = 0.5;

  private waitS = Backoff.firstS;
  private random: number;

  constructor(seed: number) {
    this.random = seed >>> 0;
  }

  /** In [(1 - jitter) d, d]. */
  next(): number {
    const waitS = this.waitS;
    this.waitS = Math.min(2 * waitS, Backoff.longestS);
    return waitS * (1 - Backoff.jitter * this.uniform());
  }

  /** An attempt has succeeded. */
  reset(): void {
    this.waitS = Backoff.firstS;
  }

  /** SplitMix32, [0, 1). */
  private uniform(): number {
    this.random = (this.random + 0x9e3779b9) >>> 0;
    let z = this.random;
    z = Math.imul(z ^ (z >>> 16), 0x21f0aaad);
    z = Math.imul(z ^ (z >>> 15), 0x735a2d97);
    return ((z ^ (z >>> 15)) >>> 0) / 0x1_0000_0000;
  }
}
