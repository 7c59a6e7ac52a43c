// Commands: steps, jumps, standing, avatars come and go.

import {Slider, button, h, press, setText} from '../dom.js';
import type {MovementRequest} from '../sdk.js';

export interface DriveActions {
  /** Sends movements to whoever is driven. */
  request(make: (avatar: number) => MovementRequest): void;
  spawn(count: number): void;
  remove(): void;
  cancel(): void;
  wander(): void;
  everybody(on: boolean): void;
}

export class DrivePanel {
  readonly element: HTMLElement;
  private readonly target = h('p', {class: 'target', 'aria-live': 'polite'});
  private readonly message = h('p', {class: 'message', role: 'status'});
  private readonly length = new Slider('step-length', 'Step length', 0, 0.9, 0.01, 0.6,
    (v) => `${v.toFixed(2)} m`);
  private readonly turn = new Slider('turn', 'Turn', -60, 60, 1, 0,
    (v) => v === 0 ? 'straight' : `${Math.abs(v)}° ${v > 0 ? 'left' : 'right'}`);
  private readonly jumpLength = new Slider('jump-length', 'Jump by', 0.2, 2, 0.05, 0.9,
    (v) => `${v.toFixed(2)} m`);
  private readonly seconds = new Slider('stand-seconds', 'Stand for', 0.2, 5, 0.1, 1,
    (v) => `${v.toFixed(1)} s`);
  private readonly wanderButton: HTMLButtonElement;
  private readonly one: HTMLButtonElement[] = [];
  private messageUntil = 0;

  constructor(private readonly actions: DriveActions) {
    const all = h('input', {type: 'checkbox', id: 'drive-all'});
    all.addEventListener('change', () => actions.everybody(all.checked));
    const make = (label: string, key: string, act: () => void, options: {class?: string} = {}) => {
      const element = button(label, {...options, key}, act);
      this.one.push(element);
      return element;
    };
    this.wanderButton = button('Let them wander', {icon: 'wander', key: 'G', class: 'wide'},
      () => actions.wander());
    this.element = h('div', {class: 'panel-body'},
      this.target,
      h('label', {class: 'check', for: 'drive-all'}, all, 'Command everybody here'),
      this.length.element, this.turn.element,
      h('div', {class: 'buttons three'},
        make('Left foot', 'A', () => this.step('left')),
        make('Step', 'W', () => this.step('auto'), {class: 'primary'}),
        make('Right foot', 'D', () => this.step('right'))),
      h('div', {class: 'pair'}, this.jumpLength.element, make('Jump', 'J', () => this.jump())),
      h('div', {class: 'pair'}, this.seconds.element, make('Stand', 'S', () => this.stand())),
      h('div', {class: 'buttons three'},
        make('Clear queue', 'X', () => actions.cancel()),
        button('Spawn', {key: 'B'}, () => actions.spawn(1)),
        make('Remove', 'Delete', () => actions.remove())),
      this.wanderButton, this.message);
  }

  step(foot: 'auto' | 'left' | 'right'): void {
    const lengthM = this.length.value;
    const turnRad = this.turn.value * Math.PI / 180;
    this.actions.request((avatar) => ({avatar, type: 'step', foot, lengthM, turnRad}));
  }
  jump(): void {
    const lengthM = this.jumpLength.value;
    const turnRad = this.turn.value * Math.PI / 180;
    this.actions.request((avatar) => ({avatar, type: 'jump', lengthM, turnRad}));
  }
  stand(): void {
    const seconds = this.seconds.value;
    this.actions.request((avatar) => ({avatar, type: 'stand', seconds}));
  }
  nudgeTurn(degreesMore: number): void {
    this.turn.value = this.turn.value + degreesMore;
  }
  nudgeLength(more: number): void {
    this.length.value = this.length.value + more;
  }

  show(target: string, drivable: boolean, wandering: number): void {
    setText(this.target, target);
    for (const element of this.one) element.disabled = !drivable;
    press(this.wanderButton, wandering > 0);
    const label = this.wanderButton.querySelector('span')!;
    setText(label, wandering > 0 ? `Stop wandering (${wandering})` : 'Let them wander');
    this.wanderButton.setAttribute('aria-label', label.textContent!);
    if (this.messageUntil && performance.now() > this.messageUntil) {
      this.messageUntil = 0;
      setText(this.message, '');
    }
  }

  say(text: string): void {
    setText(this.message, text);
    this.messageUntil = performance.now() + 8000;
  }
}
