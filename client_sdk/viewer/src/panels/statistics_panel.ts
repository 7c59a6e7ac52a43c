// The statistics panel: plots of server and connection metrics, updated live.

import {h, setText} from '../dom.js';
import {meanSince, parseMetrics} from '../prometheus.js';
import type {Statistics} from '../sdk.js';
import {Plot, formatBytes} from './plot.js';

const updateIntervalMs = 500;

export interface LiveStatistics {
  /** Mean duration of a server tick; null until two scrapes of /metrics have succeeded. */
  tickMs: number | null;
  bytesPerS: number;
  interpolationDelayMs: number;
  missedPerS: number;
  framesPerS: number;
}

export class StatisticsPanel {
  readonly element: HTMLElement;
  current: LiveStatistics = {
    tickMs: null, bytesPerS: 0, interpolationDelayMs: 0, missedPerS: 0, framesPerS: 0};
  private readonly tick = new Plot('Server tick', (v) => `${v.toFixed(v < 10 ? 2 : 1)} ms`,
    'Mean duration of a server tick over the last half second (from /metrics)');
  private readonly bytes = new Plot('Received', (v) => `${formatBytes(v)}/s`,
    'Bytes received per second');
  private readonly delay = new Plot('Interpolation delay', (v) => `${v.toFixed(0)} ms`,
    'How far the shown time is behind the newest pose');
  private readonly jitter = new Plot('Jitter', (v) => `${v.toFixed(1)} ms`,
    'Mean lateness of pose messages relative to the fastest message of the last seconds');
  private readonly age = new Plot('Age of newest pose', (v) => `${v.toFixed(0)} ms`,
    'Server time that has passed since the newest pose message');
  private readonly missed = new Plot('Missed poses', (v) => `${v.toFixed(0)}/s`,
    'Poses per second that had not arrived when they were needed, so that they were extrapolated');
  private readonly frames = new Plot('Frame rate', (v) => `${v.toFixed(0)} fps`,
    'Frames drawn per second');
  private readonly summary = h('p', {class: 'hint'});
  private before: {ms: number; bytes: number; missed: number; frames: number} | null = null;
  private metricsBefore: Map<string, number> | null = null;
  private fetching = false;
  private lastMs = 0;

  /** The function `describe` returns the text beneath the plots. */
  constructor(
    private readonly metricsUrl: string, private readonly statistics: () => Statistics,
    private readonly describe: () => string) {
    this.element = h('div', {class: 'panel-body'}, this.tick.element, this.bytes.element,
      this.delay.element, this.jitter.element, this.age.element, this.missed.element,
      this.frames.element, this.summary);
  }

  /** Call once per frame. While the panel is not visible, /metrics is not fetched. */
  update(nowMs: number, framesDrawn: number, visible: boolean): void {
    if (nowMs - this.lastMs < updateIntervalMs) return;
    this.lastMs = nowMs;
    const s = this.statistics();
    const missed = s.heldSamples + s.extrapolatedSamples;
    const now = {ms: nowMs, bytes: s.bytesReceived, missed, frames: framesDrawn};
    if (this.before) {
      const seconds = (now.ms - this.before.ms) / 1000;
      this.current.bytesPerS = (now.bytes - this.before.bytes) / seconds;
      this.current.missedPerS = (now.missed - this.before.missed) / seconds;
      this.current.framesPerS = (now.frames - this.before.frames) / seconds;
      this.current.interpolationDelayMs = s.interpolationDelayS * 1000;
      this.bytes.add(this.current.bytesPerS);
      this.missed.add(this.current.missedPerS);
      this.frames.add(this.current.framesPerS);
      this.delay.add(this.current.interpolationDelayMs);
      this.jitter.add(s.jitterS * 1000);
      this.age.add(s.newestAgeS * 1000);
    }
    this.before = now;
    if (visible) {
      void this.scrape();
      const {tick, bytes, delay, jitter, age, missed, frames} = this;
      for (const plot of [tick, bytes, delay, jitter, age, missed, frames]) plot.draw();
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
          this.current.tickMs = mean * 1000;
          this.tick.add(mean * 1000);
        }
      }
      this.metricsBefore = metrics;
    } catch {
      // No message is shown here, because ConnectionStatus reports that the server is unreachable.
      this.metricsBefore = null;
    } finally {
      this.fetching = false;
    }
  }
}
