/**
 * Limits the frame rate. The mean rate is the requested rate, unless the display's refresh rate is
 * lower. The refresh rate need not be a multiple of the requested rate.
 */
export class FrameLimiter {
  /** Mean time between two drawn frames in milliseconds; 0 without a limit. */
  readonly intervalMs: number;
  private dueMs = 0;

  /** If `framesPerS` is Infinity, the rate is not limited. */
  constructor(framesPerS: number) {
    this.intervalMs = 1000 / framesPerS;
  }

  /** Call once per animation frame. Returns whether to draw it. */
  shouldDraw(nowMs: number): boolean {
    if (nowMs < this.dueMs) return false;
    // After a pause, missed frames are not drawn later.
    const late = nowMs - this.dueMs > 2 * this.intervalMs;
    this.dueMs = (late ? nowMs : this.dueMs) + this.intervalMs;
    return true;
  }
}
