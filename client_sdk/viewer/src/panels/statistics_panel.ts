// Live figures of server and connection.

import {h, setText} from '../dom.js';
import {meanSince, parseMetrics} from '../prometheus.js';
import type {Statistics} from '../sdk.js';
import {Plot, formatBytes} from './plot.js';

const everyMs = 500;

export interface Figures {
  tickMs: number | null;
  bytesPerS: number;
  interpolationDelayMs: number;
  missedPerS: number;
  framesPerS: number;
}

export class FiguresPanel {
  readonly element: HTMLElement;
  figures: Figures = {
    tickMs: null, bytesPerS: 0, interpolationDelayMs: 0, missedPerS: 0, framesPerS: 0};
  private readonly tick = new Plot('Tick', (v) => `${v.toFixed(v < 10 ? 2 : 1)} ms`,
    'What a tick of the server takes, mean of the last half second (from /metrics)');
  private readonly bytes = new Plot('Received', (v) => `${formatBytes(v)}/s`,
    'Bytes that arrive a second');
  private readonly delay = new Plot('Interpolation delay', (v) => `${v.toFixed(0)} ms`,
    'How far what is shown lies behind the newest pose');
  private readonly missed = new Plot('Missed poses', (v) => `${v.toFixed(0)}/s`,
    'Poses that had not come when they were to be shown');
  private readonly frames = new Plot('Frames', (v) => `${v.toFixed(0)}/s`,
    'Frames drawn a second');
  private readonly summary = h('p', {class: 'hint'});
  private before: {ms: number; bytes: number; missed: number; frames: number} | null = null;
  private metricsBefore: Map<string, number> | null = null;
  private fetching = false;
  private lastMs = 0;

  constructor(
    private readonly metricsUrl: string, private readonly statistics: () => Statistics,
    private readonly describe: () => string) {
    this.element = h('div', {class: 'panel-body'}, this.tick.element, this.bytes.element,
      this.delay.element, this.missed.element, this.frames.element, this.summary);
  }

  /** Call once a frame; `visible`: whether anybody looks. */
  update(nowMs: number, framesDrawn: number, visible: boolean): void {
    if (nowMs - this.lastMs < everyMs) return;
    this.lastMs = nowMs;
    const s = this.statistics();
    const now = {ms: nowMs, bytes: s.bytesReceived, missed: s.posesMissed, frames: framesDrawn};
    if (this.before) {
      const seconds = (now.ms - this.before.ms) / 1000;
      this.figures.bytesPerS = (now.bytes - this.before.bytes) / seconds;
      this.figures.missedPerS = (now.missed - this.before.missed) / seconds;
      this.figures.framesPerS = (now.frames - this.before.frames) / seconds;
      this.figures.interpolationDelayMs = s.interpolationDelayS * 1000;
      this.bytes.add(this.figures.bytesPerS);
      this.missed.add(this.figures.missedPerS);
      this.frames.add(this.figures.framesPerS);
      this.delay.add(this.figures.interpolationDelayMs);
    }
    this.before = now;
    if (visible) {
      void this.scrape();
      for (const plot of [this.tick, this.bytes, this.delay, this.missed, this.frames]) plot.draw();
      setText(this.summary, this.describe());
    }
  }

  private async scrape(): Promise<void> {
    if (this.fetching) return;
    this.fetching = true;
    try {
      const response = await fetch(this.metricsUrl, {cache: 'no-store'});
      if (!response.ok) return;
      const metrics = parseMetrics(await response.text());
      if (this.metricsBefore) {
        const mean = meanSince(metrics, this.metricsBefore, 'stridewire_tick_seconds');
        if (mean !== null) {
          this.figures.tickMs = mean * 1000;
          this.tick.add(mean * 1000);
        }
      }
      this.metricsBefore = metrics;
    } catch {
      this.metricsBefore = null;  // No server just now; the page says so elsewhere.
    } finally {
      this.fetching = false;
    }
  }
}
