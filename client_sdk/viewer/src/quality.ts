// How finely things are drawn: from how long frames take, unless somebody says it.

export type FigureStyle = 'bodies' | 'lines';
export type QualityChoice = 'auto' | 'high' | 'low';

/** What one level of quality draws. */
export interface Detail {
  readonly style: FigureStyle;
  /** Share of the page's own resolution, along each axis. */
  readonly scale: number;
  /** Shadows of bodies; else soft blobs only. */
  readonly shadows: boolean;
  /** Tubes of few sides, lit once a vertex. */
  readonly coarse: boolean;
  /** One blob beneath the body and none beneath each foot, half the lines. */
  readonly simple: boolean;
  /** Footprints kept at most. */
  readonly prints: number;
}

export const mostPrints = 6000;

const fine = {scale: 1, shadows: true, coarse: false, simple: false, prints: mostPrints};
const plain = {scale: 0.8, shadows: false, coarse: true, simple: false, prints: 2000};
const least = {scale: 0.6, shadows: false, coarse: true, simple: true, prints: 1500};

/** From the finest on; each is cheaper than the one before. */
const hardwareLevels: readonly Detail[] = [
  {style: 'bodies', ...fine},
  {style: 'bodies', ...fine, scale: 0.8},
  {style: 'bodies', ...plain},
  {style: 'bodies', ...least},
  {style: 'lines', ...plain},
  {style: 'lines', ...least},
  {style: 'lines', ...least, scale: 0.5, prints: 500},
];
/** To a processor fewer pixels are no relief: what it saves in drawing goes into enlarging them. */
const softwareLevels: readonly Detail[] = hardwareLevels.map((level) => ({...level, scale: 1}));
export const levelCount = hardwareLevels.length;

/** Frames are wanted this often; a graphics card manages more than a processor. */
const wantedMs = {software: 40, hardware: 19};
const windowMs = 1000;
const fewestFrames = 4;
/** Slow windows in a row before a level is given up. */
const slowWindows = 2;
/** A finer level is tried after this long, and twice as long each time it proves too slow. */
const firstRetryMs = 8000;
const longestRetryMs = 240_000;

/** Where a crowd of this size starts when a processor draws. */
export function softwareLevel(avatars: number): number {
  return avatars <= 3 ? 1 : avatars <= fewAvatars ? 2 : avatars <= 120 ? 4 : 5;
}

/** With few figures the rest of the page takes a processor's time: lines would be no relief. */
const fewAvatars = 24;
const leastForFew = 3;

/** Chooses the level; tell it of every frame. */
export class Quality {
  choice: QualityChoice = 'auto';
  private level_ = 0;
  private finest = 0;
  private coarsest = levelCount - 1;
  private startMs = -1;
  private frames = 0;
  private slow = 0;
  private calmMs = 0;
  private retryMs = firstRetryMs;
  private tried = -1;
  private slowAtMs = 0;
  private vain = false;

  private readonly wantedMs: number;

  /** `leastMs` is what a frame takes at least, because no more are asked for. */
  constructor(private readonly software: boolean, leastMs = 0) {
    this.wantedMs = Math.max(software ? wantedMs.software : wantedMs.hardware, 1.1 * leastMs);
  }

  get level(): number {
    return this.choice === 'high' ? 0 : this.choice === 'low' ? levelCount - 1 : this.level_;
  }
  get detail(): Detail {
    return (this.software ? softwareLevels : hardwareLevels)[this.level]!;
  }
  /** Whether it draws less than it could, by its own choice. */
  get lowered(): boolean {
    return this.choice === 'auto' && this.level_ > 0;
  }

  /** Once a frame; `nowMs` is a clock, `avatars` how many there are to draw. */
  frame(nowMs: number, avatars: number): void {
    const finest = this.software ? softwareLevel(avatars) : 0;
    if (finest !== this.finest) {
      // Another crowd: judged anew from where such a crowd starts.
      this.finest = finest;
      this.coarsest = this.software && avatars <= fewAvatars ? leastForFew : levelCount - 1;
      this.level_ = finest;
      this.forget(nowMs);
      return;
    }
    if (this.choice !== 'auto') {
      this.startMs = -1;
      return;
    }
    if (this.startMs < 0) {
      this.forget(nowMs);
      return;
    }
    ++this.frames;
    const spanMs = nowMs - this.startMs;
    if (spanMs < windowMs || this.frames < fewestFrames) return;
    // A page in the background is drawn rarely or never: that says nothing.
    if (spanMs < 6 * windowMs) this.judge(spanMs / this.frames, spanMs);
    this.startMs = nowMs;
    this.frames = 0;
  }

  private judge(frameMs: number, spanMs: number): void {
    if (this.vain) return;
    this.slow = frameMs > this.wantedMs * 1.2 ? this.slow + 1 : 0;
    if (this.slow >= slowWindows) {
      if (this.level_ === this.coarsest) {
        // What is drawn was not what took the time: a slow display, or a browser that saves power.
        if (frameMs > 0.8 * this.slowAtMs) {
          this.level_ = this.finest;
          this.vain = true;
        }
        return;
      }
      if (this.level_ === this.finest) this.slowAtMs = frameMs;
      if (this.tried === this.level_) this.retryMs = Math.min(longestRetryMs, this.retryMs * 2);
      ++this.level_;
      this.slow = 0;
      this.calmMs = 0;
      return;
    }
    this.calmMs = frameMs < this.wantedMs ? this.calmMs + spanMs : 0;
    if (this.calmMs >= this.retryMs && this.level_ > this.finest) {
      --this.level_;
      this.tried = this.level_;
      this.calmMs = 0;
    }
  }

  private forget(nowMs: number): void {
    this.startMs = nowMs;
    this.frames = 0;
    this.slow = 0;
    this.calmMs = 0;
    this.retryMs = firstRetryMs;
    this.tried = -1;
    this.slowAtMs = 0;
    this.vain = false;
  }
}
