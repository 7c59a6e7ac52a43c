// How things are shown: bodies or lines, what is marked, and how poses travel.

import {h, setText} from '../dom.js';
import type {PoseMode} from '../sdk.js';

type Choice = 'auto' | 'bodies' | 'lines';
type Mark = 'shadows' | 'prints' | 'plants';

export class ViewPanel {
  readonly element: HTMLElement;
  private readonly auto = h('p', {class: 'hint'});
  private readonly marks = new Map<Mark, HTMLInputElement>();

  constructor(
    actions: {
      figures(choice: Choice): void; mode(mode: PoseMode): void; toggle(name: Mark, on: boolean): void;
    }, choice: Choice, mode: PoseMode) {
    this.element = h('div', {class: 'panel-body'},
      radios('Figures', 'figures', [['auto', 'Automatic'], ['bodies', 'Bodies'], ['lines', 'Lines']],
        choice, (value) => actions.figures(value as Choice)),
      this.auto,
      radios('Poses travel', 'mode', [['quantised', 'Quantised'], ['full', 'Full']], mode,
        (value) => actions.mode(value as PoseMode)),
      this.check('shadows', 'Shadows', actions), this.check('prints', 'Footprints', actions),
      this.check('plants', 'Planted feet', actions));
  }

  set(name: Mark, on: boolean): void {
    this.marks.get(name)!.checked = on;
  }
  setAuto(style: string): void {
    setText(this.auto, `Drawn as ${style} now.`);
  }

  private check(
    name: Mark, label: string, actions: {toggle(name: Mark, on: boolean): void}): HTMLElement {
    const input = h('input', {type: 'checkbox', id: `view-${name}`, checked: true});
    input.addEventListener('change', () => actions.toggle(name, input.checked));
    this.marks.set(name, input);
    return h('label', {class: 'check', for: `view-${name}`}, input, label);
  }
}

function radios(
  legend: string, name: string, options: [string, string][], value: string,
  onChange: (value: string) => void): HTMLElement {
  const group = h('fieldset', {class: 'segments'}, h('legend', {}, legend));
  for (const [id, label] of options) {
    const input = h('input', {type: 'radio', name, id: `${name}-${id}`, value: id, checked: id === value});
    input.addEventListener('change', () => onChange(id));
    group.append(input, h('label', {for: `${name}-${id}`}, label));
  }
  return group;
}
