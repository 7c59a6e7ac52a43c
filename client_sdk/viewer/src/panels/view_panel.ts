// The view panel: how avatars are drawn, which decals are shown, and the stream mode.

import {h, setText} from '../dom.js';
import type {FigureStyle, QualityChoice} from '../quality.js';
import {formatBytesPerPose, streamModes} from '../pose_stream.js';
import type {StreamCost, PoseStream} from '../pose_stream.js';
import {formatBytes} from './plot.js';

type FigureChoice = 'auto' | FigureStyle;
type Toggle = 'shadows' | 'footprints' | 'plantedFeet';

interface ViewActions {
  figures(choice: FigureChoice): void;
  quality(choice: QualityChoice): void;
  stream(change: Partial<PoseStream>): void;
  toggle(name: Toggle, on: boolean): void;
}

export class ViewPanel {
  readonly element: HTMLElement;
  private readonly qualityText = h('p', {class: 'hint'});
  private readonly streamText = h('p', {class: 'hint', id: 'stream-mode'});
  private readonly modeChoice: HTMLFieldSetElement;
  private readonly checkboxes = new Map<Toggle, HTMLInputElement>();
  private readonly detailChoice: HTMLFieldSetElement;
  private readonly costs = h('tbody');

  /** `initial` contains the values that the controls show initially. */
  constructor(actions: ViewActions, initial: {
    figures: FigureChoice; quality: QualityChoice; stream: PoseStream;
  }) {
    this.modeChoice = radios('Stream mode', 'mode',
      Object.entries(streamModes).map(([mode, {label}]) => [mode, label]), initial.stream.mode,
      (value) => actions.stream({mode: value as PoseStream['mode']}));
    this.detailChoice = radios(
      'Joints', 'detail', [['all', 'All'], ['reduced', 'Reduced'], ['root', 'Root only']],
      initial.stream.detail, (value) => actions.stream({detail: value as PoseStream['detail']}));
    this.element = h('div', {class: 'panel-body'},
      radios('Draw avatars as', 'figures',
        [['auto', 'Automatic'], ['bodies', 'Bodies'], ['lines', 'Lines']],
        initial.figures, (value) => actions.figures(value as FigureChoice)),
      radios('Quality', 'quality', [['auto', 'Automatic'], ['high', 'High'], ['low', 'Low']],
        initial.quality, (value) => actions.quality(value as QualityChoice)),
      this.qualityText,
      this.check('shadows', 'Shadows', actions), this.check('footprints', 'Footprints', actions),
      this.check('plantedFeet', 'Planted feet', actions),
      this.modeChoice, this.streamText, this.detailChoice,
      radios('Pose rate', 'rate', [['1', 'Full'], ['2', 'Half'], ['4', 'Quarter']],
        String(initial.stream.everyNTicks),
        (value) => actions.stream({everyNTicks: Number(value) as PoseStream['everyNTicks']})),
      h('table', {class: 'costs'},
        h('caption', {}, 'Measured cost of the modes used'),
        h('thead', {}, h('tr', {}, h('th', {scope: 'col'}, 'Mode'),
          h('th', {scope: 'col'}, 'Per pose'), h('th', {scope: 'col'}, 'Per second'))),
        this.costs));
  }

  setChecked(name: Toggle, on: boolean): void {
    this.checkboxes.get(name)!.checked = on;
  }
  /** Shows the current stream mode, and an explanation of it. */
  setStreamMode(mode: PoseStream['mode'], text: string): void {
    const input = this.modeChoice.querySelector<HTMLInputElement>(`#mode-${mode}`)!;
    input.checked = true;
    setText(this.streamText, text);
  }
  /**
   * Enables or disables the choice of joints, which requires quantised poses and a server that
   * supports it.
   */
  setDetailEnabled(on: boolean): void {
    this.detailChoice.disabled = !on;
  }
  setCosts(costs: readonly StreamCost[]): void {
    this.costs.replaceChildren(...costs.map(({name, active, bytesPerPose, bytesPerS}) => h('tr',
      {'aria-current': active && 'true'}, h('th', {scope: 'row'}, name),
      h('td', {}, `${formatBytesPerPose(bytesPerPose)} B`), h('td', {}, formatBytes(bytesPerS)))));
  }
  /** Text beneath the choice of quality. */
  setQualityText(text: string): void {
    setText(this.qualityText, text);
  }

  private check(name: Toggle, label: string, actions: ViewActions): HTMLElement {
    const input = h('input', {type: 'checkbox', id: `view-${name}`, checked: true});
    input.addEventListener('change', () => actions.toggle(name, input.checked));
    this.checkboxes.set(name, input);
    return h('label', {class: 'check', for: `view-${name}`}, input, label);
  }
}

/** A group of radio buttons. `options` are pairs of value and label. */
function radios(
  legend: string, name: string, options: [string, string][], value: string,
  onChange: (value: string) => void): HTMLFieldSetElement {
  const group = h('fieldset', {class: 'segments'}, h('legend', {}, legend));
  for (const [id, label] of options) {
    const input = h('input',
      {type: 'radio', name, id: `${name}-${id}`, value: id, checked: id === value});
    input.addEventListener('change', () => onChange(id));
    group.append(input, h('label', {for: `${name}-${id}`}, label));
  }
  return group;
}
