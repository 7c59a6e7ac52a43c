// How things are shown: bodies or lines, what is marked, and how poses travel.

import {h, setText} from '../dom.js';
import type {PoseMode} from '../sdk.js';
import type {FigureStyle, QualityChoice} from '../quality.js';

type Choice = 'auto' | FigureStyle;
type Mark = 'shadows' | 'prints' | 'plants';

export class ViewPanel {
  readonly element: HTMLElement;
  private readonly auto = h('p', {class: 'hint'});
  private readonly marks = new Map<Mark, HTMLInputElement>();

  constructor(
    actions: {
      figures(choice: Choice): void; quality(choice: QualityChoice): void; mode(mode: PoseMode): void;
      toggle(name: Mark, on: boolean): void;
    }, now: {figures: Choice; quality: QualityChoice; mode: PoseMode}) {
    this.element = h('div', {class: 'panel-body'},
      radios('Figures', 'figures', [['auto', 'Automatic'], ['bodies', 'Bodies'], ['lines', 'Lines']],
        now.figures, (value) => actions.figures(value as Choice)),
      radios('Quality', 'quality', [['auto', 'Automatic'], ['high', 'High'], ['low', 'Low']],
        now.quality, (value) => actions.quality(value as QualityChoice)),
      this.auto,
      radios('Poses travel', 'mode', [['quantised', 'Quantised'], ['full', 'Full']], now.mode,
        (value) => actions.mode(value as PoseMode)),
      this.check('shadows', 'Shadows', actions), this.check('prints', 'Footprints', actions),
      this.check('plants', 'Planted feet', actions));
  }

  set(name: Mark, on: boolean): void {
    this.marks.get(name)!.checked = on;
  }
  setAuto(text: string): void {
    setText(this.auto, text);
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
