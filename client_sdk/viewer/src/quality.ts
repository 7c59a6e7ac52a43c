// Chooses how much detail to draw, from measured frame times or by the user's choice.

export type FigureStyle = 'bodies' | 'lines';
export type QualityChoice = 'auto' | 'high' | 'low';

/** Drawing options of one quality level. */
export interface QualityLevel {
  readonly style: FigureStyle;
  /** Resolution along each axis, relative to full resolution. */
  readonly scale: number;
  /** True if bodies cast shadows. Otherwise each avatar has soft blobs on the ground. */
  readonly shadows: boolean;
  /** Bodies with fewer faces and lighting per vertex instead of per pixel. */
  readonly coarse: boolean;
  /** No shadow blobs beneath the feet, and stick figures with half as many lines. */
  readonly simplified: boolean;
  /** Maximum number of footprints drawn. */
  readonly maxFootprints: number;
}

export const maxFootprints = 6000;

const fineDetail = {scale: 1, shadows: true, coarse: false, simplified: false, maxFootprints};
const coarseDetail =
  {scale: 0.8, shadows: false, coarse: true, simplified: false, maxFootprints: 2000};
const minimalDetail =
  {scale: 0.6, shadows: false, coarse: true, simplified: true, maxFootprints: 1500};

/** Quality levels, sorted from the finest to the cheapest. */
const hardwareLevels: readonly QualityLevel[] = [
  {style: 'bodies', ...fineDetail},
  {style: 'bodies', ...fineDetail, scale: 0.8},
  {style: 'bodies', ...coarseDetail},
  {style: 'bodies', ...minimalDetail},
  {style: 'lines', ...coarseDetail},
  {style: 'lines', ...minimalDetail},
  {style: 'lines', ...minimalDetail, scale: 0.5, maxFootprints: 500},
];
/**
 * With a software renderer, a lower resolution does not help: scaling the image up costs as much as
 * it saves.
 */
const softwareLevels: readonly QualityLevel[] =
  hardwareLevels.map((level) => ({...level, scale: 1}));
export const levelCount = hardwareLevels.length;

/** Desired time per frame. A software renderer cannot reach the rate of a GPU. */
const targetFrameMs = {software: 40, hardware: 19};
const windowMs = 1000;
const minFramesPerWindow = 4;
/** Quality is lowered after this number of slow measuring windows in a row. */
const slowWindowsToLower = 2;
/**
 * A finer level is tried again after this time without slow frames. The wait doubles each time that
 * level is too slow.
 */
const firstRetryMs = 8000;
const longestRetryMs = 240_000;

/**
 * With at most this number of avatars, a software renderer spends most of its time on the rest of
 * the page. Lines would not be faster then, so level 3 (bodies) is the coarsest.
 */
const smallCrowd = 24;
const coarsestForSmallCrowd = 3;

/**
 * Returns the level at which automatic selection starts with a software renderer. It never selects
 * a finer level.
 */
export function initialSoftwareLevel(avatars: number): number {
  return avatars <= 3 ? 1 : avatars <= smallCrowd ? 2 : avatars <= 120 ? 4 : 5;
}


/** Chooses the quality level. Call `onFrame` for every frame. */
export class Quality {
  choice: QualityChoice = 'auto';
  private level_ = 0;
  private finestLevel = 0;
  private coarsestLevel = levelCount - 1;
  private windowStartMs = -1;
  private windowFrames = 0;
  private slowWindows = 0;
  private fastMs = 0;
  private retryMs = firstRetryMs;
  private retriedLevel = -1;
  private slowFrameMs = 0;
  private loweringFailed = false;

  private readonly targetMs: number;

  /** `minFrameMs` is the shortest frame time that a frame rate limit allows; 0 without a limit. */
  constructor(private readonly software: boolean, minFrameMs = 0) {
    this.targetMs = Math.max(
      software ? targetFrameMs.software : targetFrameMs.hardware, 1.1 * minFrameMs);
  }

  get level(): number {
    return this.choice === 'high' ? 0 : this.choice === 'low' ? levelCount - 1 : this.level_;
  }
  get settings(): QualityLevel {
    return (this.software ? softwareLevels : hardwareLevels)[this.level]!;
  }
  /** True if the level was chosen automatically and is not the finest. */
  get lowered(): boolean {
    return this.choice === 'auto' && this.level_ > 0;
  }

  /** Call once per frame, with a monotonic clock and the number of avatars drawn. */
  onFrame(nowMs: number, avatars: number): void {
    const finest = this.software ? initialSoftwareLevel(avatars) : 0;
    if (finest !== this.finestLevel) {
      // The size of the crowd has changed so much that another initial level applies.
      this.finestLevel = finest;
      this.coarsestLevel =
        this.software && avatars <= smallCrowd ? coarsestForSmallCrowd : levelCount - 1;
      this.level_ = finest;
      this.reset(nowMs);
      return;
    }
    if (this.choice !== 'auto') {
      this.windowStartMs = -1;
      return;
    }
    if (this.windowStartMs < 0) {
      this.reset(nowMs);
      return;
    }
    ++this.windowFrames;
    const spanMs = nowMs - this.windowStartMs;
    if (spanMs < windowMs || this.windowFrames < minFramesPerWindow) return;
    // Browsers draw background tabs rarely or never, so long windows are not evaluated.
    if (spanMs < 6 * windowMs) this.evaluateWindow(spanMs / this.windowFrames, spanMs);
    this.windowStartMs = nowMs;
    this.windowFrames = 0;
  }

  private evaluateWindow(frameMs: number, spanMs: number): void {
    if (this.loweringFailed) return;
    this.slowWindows = frameMs > this.targetMs * 1.2 ? this.slowWindows + 1 : 0;
    if (this.slowWindows >= slowWindowsToLower) {
      if (this.level_ === this.coarsestLevel) {
        // Lower levels did not make frames faster: the display is slow, or the browser saves power.
        if (frameMs > 0.8 * this.slowFrameMs) {
          this.level_ = this.finestLevel;
          this.loweringFailed = true;
        }
        return;
      }
      if (this.level_ === this.finestLevel) this.slowFrameMs = frameMs;
      if (this.retriedLevel === this.level_) {
        this.retryMs = Math.min(longestRetryMs, this.retryMs * 2);
      }
      ++this.level_;
      this.slowWindows = 0;
      this.fastMs = 0;
      return;
    }
    this.fastMs = frameMs < this.targetMs ? this.fastMs + spanMs : 0;
    if (this.fastMs >= this.retryMs && this.level_ > this.finestLevel) {
      --this.level_;
      this.retriedLevel = this.level_;
      this.fastMs = 0;
    }
  }

  private reset(nowMs: number): void {
    this.windowStartMs = nowMs;
    this.windowFrames = 0;
    this.slowWindows = 0;
    this.fastMs = 0;
    this.retryMs = firstRetryMs;
    this.retriedLevel = -1;
    this.slowFrameMs = 0;
    this.loweringFailed = false;
  }
}
