// The time that is shown: live, slower, paused, or further back in what was recorded.

export interface Span {
  readonly firstS: number;
  readonly lastS: number;
}

/** Within this of the newest pose, going at full speed is called live. */
const liveMarginS = 0.02;

export class Playback {
  /** 0 to 1; live only counts at 1. */
  rate = 1;
  paused = false;
  private live_ = true;
  private timeS_ = 0;

  get live(): boolean {
    return this.live_;
  }
  get timeS(): number {
    return this.timeS_;
  }

  /**
   * The time to show, `dtS` after the last. `renderS` is what a live view shows, `recorded` what can
   * be gone back to (null: nothing yet).
   */
  advance(dtS: number, renderS: number, recorded: Span | null): number {
    if (this.live_) {
      this.timeS_ = renderS;
      return this.timeS_;
    }
    if (!this.paused) this.timeS_ += dtS * this.rate;
    if (recorded && recorded.lastS > recorded.firstS) {
      this.timeS_ = Math.max(this.timeS_, recorded.firstS);
    }
    if (this.timeS_ >= renderS - liveMarginS) {
      this.timeS_ = renderS;
      if (!this.paused && this.rate >= 1) this.live_ = true;
    }
    return this.timeS_;
  }

  goLive(): void {
    this.live_ = true;
    this.paused = false;
    this.rate = 1;
  }
  pause(): void {
    this.paused = true;
    this.live_ = false;
  }
  /** Goes on from where it stands. */
  resume(): void {
    this.paused = false;
  }
  toggle(): void {
    if (this.paused) this.resume();
    else this.pause();
  }
  setRate(rate: number): void {
    this.rate = Math.min(1, Math.max(0.01, rate));
    if (this.rate < 1) this.live_ = false;
  }
  seek(timeS: number): void {
    this.timeS_ = timeS;
    this.live_ = false;
  }
}
