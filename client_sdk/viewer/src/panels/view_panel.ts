// How things are shown: bodies or lines, what is marked, and how poses travel.

import {h, setText} from '../dom.js';
import type {FigureStyle, QualityChoice} from '../quality.js';
import type {Cost, Stream} from '../pose_stream.js';
import {formatBytes} from './plot.js';

type Choice = 'auto' | FigureStyle;
type Mark = 'shadows' | 'prints' | 'plants';

export class ViewPanel {
  readonly element: HTMLElement;
  private readonly auto = h('p', {class: 'hint'});
  private readonly marks = new Map<Mark, HTMLInputElement>();
  private readonly detail: HTMLFieldSetElement;
  private readonly costs = h('tbody');

  constructor(
    actions: {
      figures(choice: Choice): void; quality(choice: QualityChoice): void; stream(change: Partial<Stream>): void;
      toggle(name: Mark, on: boolean): void;
    }, now: {figures: Choice; quality: QualityChoice; stream: Stream}) {
    this.detail = radios('Joints', 'detail', [['all', 'All'], ['fewer', 'Fewer'], ['root', 'Root only']],
      now.stream.detail, (value) => actions.stream({detail: value as Stream['detail']}));
    this.element = h('div', {class: 'panel-body'},
      radios('Figures', 'figures', [['auto', 'Automatic'], ['bodies', 'Bodies'], ['lines', 'Lines']],
        now.figures, (value) => actions.figures(value as Choice)),
      radios('Quality', 'quality', [['auto', 'Automatic'], ['high', 'High'], ['low', 'Low']],
        now.quality, (value) => actions.quality(value as QualityChoice)),
      this.auto,
      this.check('shadows', 'Shadows', actions), this.check('prints', 'Footprints', actions),
      this.check('plants', 'Planted feet', actions),
      radios('Poses travel', 'mode', [['quantised', 'Quantised'], ['full', 'Full']], now.stream.mode,
        (value) => actions.stream({mode: value as Stream['mode']})),
      this.detail,
      radios('Rate', 'rate', [['1', 'Whole'], ['2', 'Half'], ['4', 'Quarter']],
        String(now.stream.everyNTicks),
        (value) => actions.stream({everyNTicks: Number(value) as Stream['everyNTicks']})),
      h('table', {class: 'costs'},
        h('caption', {}, 'Bytes of poses, each way that was on'),
        h('thead', {}, h('tr', {}, h('th', {scope: 'col'}, 'Sent as'), h('th', {scope: 'col'}, 'a pose'),
          h('th', {scope: 'col'}, 'a second'))), this.costs));
  }

  set(name: Mark, on: boolean): void {
    this.marks.get(name)!.checked = on;
  }
  /** Whether there is a choice: the server knows of it, and poses are quantised. */
  setDetail(on: boolean): void {
    this.detail.disabled = !on;
  }
  setCosts(costs: readonly Cost[]): void {
    this.costs.replaceChildren(...costs.map(({name, now, bytesAPose, bytesPerS}) => h('tr',
      {'aria-current': now && 'true'}, h('th', {scope: 'row'}, name), h('td', {}, `${bytesAPose.toFixed(0)} B`),
      h('td', {}, formatBytes(bytesPerS)))));
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
  onChange: (value: string) => void): HTMLFieldSetElement {
  const group = h('fieldset', {class: 'segments'}, h('legend', {}, legend));
  for (const [id, label] of options) {
    const input = h('input', {type: 'radio', name, id: `${name}-${id}`, value: id, checked: id === value});
    input.addEventListener('change', () => onChange(id));
    group.append(input, h('label', {for: `${name}-${id}`}, label));
  }
  return group;
}
