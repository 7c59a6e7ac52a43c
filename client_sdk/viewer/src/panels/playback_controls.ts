// Pause, slow motion, and the way back through what was recorded.

import {button, h, icon, setText} from '../dom.js';
import type {Playback, Span} from '../playback.js';

const rates = [1, 0.5, 0.25, 0.1];

export class Transport {
  readonly element: HTMLElement;
  private readonly play: HTMLButtonElement;
  private readonly rate: HTMLSelectElement;
  private readonly scrub: HTMLInputElement;
  private readonly liveButton: HTMLButtonElement;
  private readonly behind = h('span', {class: 'behind'});
  private shown = '';
  private span: Span | null = null;

  constructor(private readonly playback: Playback) {
    this.play = button('Pause', {icon: 'pause', key: 'Space', text: false, class: 'round'},
      () => this.toggle());
    this.rate = h('select', {'aria-label': 'Speed', title: 'Speed ([ and ])'});
    for (const rate of rates) {
      this.rate.append(h('option', {value: rate}, rate === 1 ? '1×' : `1/${Math.round(1 / rate)}×`));
    }
    this.rate.addEventListener('change', () => playback.setRate(Number(this.rate.value)));
    this.scrub = h('input', {
      type: 'range', id: 'scrub', min: -20, max: 0, step: 0.01, value: 0,
      'aria-label': 'Seconds before now'});
    this.scrub.addEventListener('input', () => {
      if (!this.span) return;
      const back = Number(this.scrub.value);
      if (back > -0.05) playback.goLive();
      else {
        playback.paused = true;
        playback.seek(this.span.lastS + back);
      }
    });
    this.liveButton = button('Live', {key: 'L', class: 'live'}, () => playback.goLive());
    this.element = h('div', {class: 'transport', role: 'group', 'aria-label': 'Playback'},
      this.play, this.rate, this.scrub, this.behind, this.liveButton);
  }

  toggle(): void {
    this.playback.toggle();
  }
  faster(steps: number): void {
    const i = Math.max(0, rates.findIndex((rate) => rate <= this.playback.rate + 1e-6));
    this.playback.setRate(rates[Math.min(rates.length - 1, Math.max(0, i - steps))]!);
  }
  nudge(seconds: number): void {
    this.playback.pause();
    this.playback.seek(this.playback.timeS + seconds);
  }

  /** `span`: what can be shown, its end being what a live view shows. */
  show(span: Span | null): void {
    this.span = span;
    const {playback} = this;
    // Live is at the end, however late the newest pose comes.
    const back = span && !playback.live ? playback.timeS - span.lastS : 0;
    const state = `${playback.paused}/${playback.rate}/${playback.live}/${back.toFixed(2)}/` +
      `${span ? (span.lastS - span.firstS).toFixed(0) : ''}`;
    if (state === this.shown) return;
    this.shown = state;
    const label = playback.paused ? 'Play' : 'Pause';
    if (this.play.getAttribute('aria-label') !== label) {
      this.play.setAttribute('aria-label', label);
      this.play.title = `${label} (Space)`;
      this.play.replaceChildren(icon(playback.paused ? 'play' : 'pause'));
    }
    const rate = String(playback.rate);
    if (this.rate.value !== rate) this.rate.value = rate;
    this.scrub.disabled = span === null;
    const first = span ? (-Math.min(20, Math.max(0.1, span.lastS - span.firstS))).toFixed(2) : '';
    if (span && this.scrub.min !== first) this.scrub.min = first;
    const value = back.toFixed(2);
    if (this.scrub.value !== value) this.scrub.value = value;
    const text = playback.live ? 'live' : `−${Math.max(0, -back).toFixed(1)} s`;
    setText(this.behind, playback.live ? '' : text);
    this.scrub.setAttribute('aria-valuetext', text);
    this.liveButton.disabled = playback.live;
  }
}
