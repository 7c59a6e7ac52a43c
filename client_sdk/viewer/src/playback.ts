// Playback determines the server time that the page shows: the live time, or an earlier time in the
// recording. An earlier time stands still or advances, at full speed or in slow motion.

export interface TimeRange {
  readonly firstS: number;
  readonly lastS: number;
}

/** Playback at full speed becomes live when it is less than this time behind the live view. */
const liveMarginS = 0.02;

export class Playback {
  /** Speed, 0.01 to 1. Live playback has speed 1. */
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
   * Advances by `dtS` seconds of real time and returns the server time to show. `renderS` is the
   * time that a live view shows; `recorded` is the range of the recording, or null if it is empty.
   */
  advance(dtS: number, renderS: number, recorded: TimeRange | null): number {
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
  /** Continues from the current time. At full speed, playback becomes live at the live time. */
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
