/** Draws at most so many frames a second, and no fewer on average, however often the display asks. */
export class FrameCap {
  /** Between two frames, on average; 0: every frame that the display asks for is drawn. */
  readonly leastMs: number;
  private dueMs = 0;

  constructor(framesPerS: number) {
    this.leastMs = 1000 / framesPerS;
  }

  /** Once for each frame the display asks for: whether to draw it. */
  draws(nowMs: number): boolean {
    if (nowMs < this.dueMs) return false;
    // Frames that a pause kept from being drawn are not made good.
    const late = nowMs - this.dueMs > 2 * this.leastMs;
    this.dueMs = (late ? nowMs : this.dueMs) + this.leastMs;
    return true;
  }
}
