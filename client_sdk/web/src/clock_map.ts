const buckets = 8;
const bucketS = 0.5;
const slew = 0.02;  // Seconds a second.
const snapS = 0.25;
const settleS = 1;

/**
 * Maps local time to the server's clock.
 *
 * A message stamped with server time s that arrives at local time l says that the offset l - s is
 * the clocks' difference plus its delay. Delay only adds, so the smallest offset of the last 4 s is
 * the best one; the map follows it at no more than 2 %, so that time shown neither jumps nor runs
 * backwards. Differences beyond 0.25 s are another clock, taken at once; so are smaller offsets in
 * the first second.
 */
export class ClockMap {
  private readonly numbers = new Float64Array(buckets).fill(-1);
  private readonly offsets = new Float64Array(buckets);
  private isReady = false;
  private firstLocalS = 0;
  private atLocalS = 0;
  private offsetS = 0;
  private wantedOffsetS = 0;
  private lateS = 0;

  get ready(): boolean {
    return this.isReady;
  }

  /** How much later than the quickest of the last seconds the last message came. */
  get lastLatenessS(): number {
    return this.lateS;
  }

  /** A message stamped `serverS` arrived at `localS`. Local times do not go back. */
  addSample(localS: number, serverS: number): void {
    const sampleS = localS - serverS;
    const number = Math.floor(localS / bucketS);
    // Later by that much is only a late message as long as others are not; a lone one is left to the
    // window. Earlier by that much no delay explains.
    if (this.isReady && sampleS < this.wantedOffsetS - snapS) this.reset();

    const slot = ((number % buckets) + buckets) % buckets;
    if (this.numbers[slot] !== number || !this.isReady) {
      this.numbers[slot] = number;
      this.offsets[slot] = sampleS;
    }
    this.offsets[slot] = Math.min(this.offsets[slot]!, sampleS);
    let smallestS = sampleS;
    for (let i = 0; i < buckets; ++i) {
      if (this.numbers[i]! >= 0 && this.numbers[i]! > number - buckets) {
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
    this.wantedOffsetS = smallestS;
    this.lateS = sampleS - smallestS;
  }

  /** Server time at `localS`; only when ready. */
  serverTimeS(localS: number): number {
    return localS - this.offsetAt(localS);
  }

  reset(): void {
    this.numbers.fill(-1);
    this.isReady = false;
    this.lateS = 0;
  }

  private offsetAt(localS: number): number {
    const mostS = slew * Math.max(0, localS - this.atLocalS);
    const towardsS = this.wantedOffsetS - this.offsetS;
    return this.offsetS + Math.min(mostS, Math.max(-mostS, towardsS));
  }
}
