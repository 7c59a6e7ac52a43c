/** The smallest offset is searched in the last `bucketCount` buckets of `bucketS` each. */
const bucketCount = 8;
const bucketS = 0.5;
/** Largest rate at which the map approaches the target offset, in seconds per second. */
const slewRate = 0.02;
/** Larger differences from the target offset are corrected at once. */
const snapS = 0.25;
/** Time after the first sample during which smaller offsets are adopted at once. */
const settleS = 1;

/**
 * Maps local time to server time.
 *
 * A message with server time s that arrives at local time l has the offset l - s. This is the
 * difference of the clocks plus the delay of the message. Delays are positive, so the smallest
 * offset of the last 4 s is the best estimate.
 *
 * The map approaches this target by at most 20 ms per second, so that time neither jumps nor runs
 * backwards. There are two exceptions: differences above 0.25 s mean that the clock itself has
 * changed, and in the first second smaller offsets are adopted at once.
 */
export class ClockMap {
  /** Number of the bucket in each slot, counted from local time 0; -1 if the slot is empty. */
  private readonly bucketNumbers = new Float64Array(bucketCount).fill(-1);
  /** Smallest offset of each bucket. */
  private readonly offsets = new Float64Array(bucketCount);
  private isReady = false;
  private firstLocalS = 0;
  /** Local time of the last sample. */
  private atLocalS = 0;
  /** Offset in use at `atLocalS`. */
  private offsetS = 0;
  private targetOffsetS = 0;
  private latenessS = 0;

  /** True after the first sample. */
  get ready(): boolean {
    return this.isReady;
  }

  /** Delay of the last message, relative to the fastest message of the last 4 s. */
  get lastLatenessS(): number {
    return this.latenessS;
  }

  /** Adds a message with server time `serverS` that arrived at `localS`. Local times must not
   * decrease. */
  addSample(localS: number, serverS: number): void {
    const sampleS = localS - serverS;
    const number = Math.floor(localS / bucketS);
    // No delay makes an offset this much smaller, so the clock has changed. A larger offset may
    // belong to a single late message, which the window ignores.
    if (this.isReady && sampleS < this.targetOffsetS - snapS) this.reset();

    const slot = ((number % bucketCount) + bucketCount) % bucketCount;
    if (this.bucketNumbers[slot] !== number || !this.isReady) {
      this.bucketNumbers[slot] = number;
      this.offsets[slot] = sampleS;
    }
    this.offsets[slot] = Math.min(this.offsets[slot]!, sampleS);
    let smallestS = sampleS;
    for (let i = 0; i < bucketCount; ++i) {
      if (this.bucketNumbers[i]! >= 0 && this.bucketNumbers[i]! > number - bucketCount) {
        smallestS = Math.min(smallestS, this.offsets[i]!);
      }
    }

    if (!this.isReady) {
      this.isReady = true;
      this.firstLocalS = localS;
      this.offsetS = smallestS;
    } else {
      this.offsetS = this.offsetAt(localS);
      const settling = localS - this.firstLocalS < settleS;
      if (Math.abs(smallestS - this.offsetS) > snapS || (settling && smallestS < this.offsetS)) {
        this.offsetS = smallestS;
      }
    }
    this.atLocalS = localS;
    this.targetOffsetS = smallestS;
    this.latenessS = sampleS - smallestS;
  }

  /** Returns the server time at `localS`. Valid only if `ready`. */
  serverTimeS(localS: number): number {
    return localS - this.offsetAt(localS);
  }

  /** Forgets all samples. */
  reset(): void {
    this.bucketNumbers.fill(-1);
    this.isReady = false;
    this.latenessS = 0;
  }

  private offsetAt(localS: number): number {
    const maxChangeS = slewRate * Math.max(0, localS - this.atLocalS);
    const differenceS = this.targetOffsetS - this.offsetS;
    return this.offsetS + Math.min(maxChangeS, Math.max(-maxChangeS, differenceS));
  }
}
