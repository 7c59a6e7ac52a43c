// Playback controls: pause, speed, a slider over the recording, and a button to go live.

import {button, h, icon, setText} from '../dom.js';
import type {Playback, TimeRange} from '../playback.js';

const rates = [1, 0.5, 0.25, 0.1];

export class PlaybackControls {
  readonly element: HTMLElement;
  private readonly playButton: HTMLButtonElement;
  private readonly rate: HTMLSelectElement;
  private readonly scrub: HTMLInputElement;
  private readonly liveButton: HTMLButtonElement;
  private readonly delayText = h('span', {class: 'delay'});
  /** Summary of the state that the controls show. They are updated only if it changes. */
  private shownState = '';
  private range: TimeRange | null = null;

  constructor(private readonly playback: Playback) {
    this.playButton = button('Pause', {icon: 'pause', key: 'Space', text: false, class: 'round'},
      () => this.toggle());
    this.rate = h('select', {'aria-label': 'Speed', title: 'Speed ([ and ])'});
    for (const rate of rates) {
      const label = rate === 1 ? '1×' : `1/${Math.round(1 / rate)}×`;
      this.rate.append(h('option', {value: rate}, label));
    }
    this.rate.addEventListener('change', () => playback.setRate(Number(this.rate.value)));
    this.scrub = h('input', {
      type: 'range', id: 'scrub', min: -20, max: 0, step: 0.01, value: 0,
      'aria-label': 'Time relative to live, in seconds'});
    this.scrub.addEventListener('input', () => {
      if (!this.range) return;
      const back = Number(this.scrub.value);
      if (back > -0.05) playback.goLive();
      else {
        playback.paused = true;
        playback.seek(this.range.lastS + back);
      }
    });
    this.liveButton = button('Live', {key: 'L', class: 'live'}, () => playback.goLive());
    this.element = h('div', {class: 'playback', role: 'group', 'aria-label': 'Playback'},
      this.playButton, this.rate, this.scrub, this.delayText, this.liveButton);
  }

  toggle(): void {
    this.playback.toggle();
  }
  changeSpeed(steps: number): void {
    const i = Math.max(0, rates.findIndex((rate) => rate <= this.playback.rate + 1e-6));
    this.playback.setRate(rates[Math.min(rates.length - 1, Math.max(0, i - steps))]!);
  }
  stepTime(seconds: number): void {
    this.playback.pause();
    this.playback.seek(this.playback.timeS + seconds);
  }

  /** `range` contains the times that can be shown. It ends at the time that a live view shows. */
  update(range: TimeRange | null): void {
    this.range = range;
    const {playback} = this;
    // While live, the slider stays at its end, even if the newest pose is late.
    const back = range && !playback.live ? playback.timeS - range.lastS : 0;
    const state = `${playback.paused}/${playback.rate}/${playback.live}/${back.toFixed(2)}/` +
      `${range ? (range.lastS - range.firstS).toFixed(0) : ''}`;
    if (state === this.shownState) return;
    this.shownState = state;
    const label = playback.paused ? 'Play' : 'Pause';
    if (this.playButton.getAttribute('aria-label') !== label) {
      this.playButton.setAttribute('aria-label', label);
      this.playButton.title = `${label} (Space)`;
      this.playButton.replaceChildren(icon(playback.paused ? 'play' : 'pause'));
    }
    const rate = String(playback.rate);
    if (this.rate.value !== rate) this.rate.value = rate;
    this.scrub.disabled = range === null;
    const lengthS = range ? Math.min(20, Math.max(0.1, range.lastS - range.firstS)) : 0;
    const first = range ? (-lengthS).toFixed(2) : '';
    if (range && this.scrub.min !== first) this.scrub.min = first;
    const value = back.toFixed(2);
    if (this.scrub.value !== value) this.scrub.value = value;
    const text = playback.live ? 'live' : `−${Math.max(0, -back).toFixed(1)} s`;
    setText(this.delayText, playback.live ? '' : text);
    this.scrub.setAttribute('aria-valuetext', text);
    this.liveButton.disabled = playback.live;
  }
}
