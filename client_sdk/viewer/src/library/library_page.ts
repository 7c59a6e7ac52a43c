// The library page: shows which parameters a library's groups of examples cover and how accurately,
// and synthesizes the step for any parameters.

import {Slider, button, degrees, h, icon, setPressed, setText} from '../dom.js';
import type {RendererInfo} from '../renderer.js';
import {applyTheme, makeColours, preferredTheme, rememberTheme} from '../theme.js';
import type {ThemeName} from '../theme.js';
import {genericTime} from '../timeline.js';
import {LatestRequest} from './library_client.js';
import type {
  Clip, Group, GroupEntry, LibraryClient, LibraryEntry, Step, Summary,
} from './library_client.js';
import {ParameterPlane, parameterLabel, scaleColour} from './parameter_plane.js';
import {StepPreview} from './step_preview.js';

/** Number of cells per side of the error map. */
const mapCells = 48;
/** Pause at the end of the movement, before it repeats. */
const loopPauseS = 0.45;

/** A request for a step with parameters `p`, from a group of the library with this hash. */
interface StepRequest {
  readonly hash: string;
  readonly group: number;
  readonly p: readonly number[];
  readonly corrected: boolean;
}
/**
 * A request for an error map over the parameters with indices `x` and `y`. The others have the
 * values in `p`.
 */
interface ErrorMapRequest extends StepRequest {
  readonly x: number;
  readonly y: number;
}

export class LibraryPage {
  libraries: readonly LibraryEntry[] = [];
  library: LibraryEntry | null = null;
  group: Group | null = null;
  groupIndex = 0;
  /** Parameters of the step that was requested last. */
  requested: number[] = [];
  step: Step | null = null;
  readonly plane: ParameterPlane;
  readonly preview: StepPreview;
  /** Number of steps received, for browser tests. */
  stepsShown = 0;
  private playing = true;
  private timeS = 0;
  private speed = 1;
  private lastMs = 0;
  private theme: ThemeName;
  /** Number of requested examples. It identifies outdated responses, which are ignored. */
  private exampleRequest = 0;
  private readonly colours = makeColours();
  private readonly librarySelect = h('select', {id: 'library', 'aria-label': 'Library'});
  private readonly groupSelect = h('select', {id: 'group', 'aria-label': 'Group'});
  private readonly xSelect = h('select', {id: 'axis-x', 'aria-label': 'Horizontal axis'});
  private readonly ySelect = h('select', {id: 'axis-y', 'aria-label': 'Vertical axis'});
  private readonly mapSelect = h('select', {id: 'map', 'aria-label': 'Error map'},
    h('option', {value: 'uncorrected'}, 'Errors without correction'),
    h('option', {value: 'corrected'}, 'Errors with correction'),
    h('option', {value: 'none'}, 'No error map'));
  private readonly corrected = h('input', {type: 'checkbox', id: 'corrected', checked: true});
  private readonly sliders = h('div', {class: 'sliders'});
  private readonly valueTable = h('table', {class: 'parameters'});
  private readonly resultText = h('p', {class: 'movement', role: 'status'});
  private readonly exampleText = h('p', {class: 'hint'});
  private readonly legend = h('canvas',
    {class: 'legend', 'aria-hidden': 'true', width: 128, height: 1});
  private readonly legendText = h('span', {class: 'hint'});
  /** Describes what the library can do. It is collapsed, so that the parameters have more room. */
  private readonly summaryArea = h('details', {class: 'library-summary', id: 'summary'});
  private readonly message = h('div', {class: 'notice', role: 'alert'});
  private readonly scrub = h('input', {
    type: 'range', id: 'time', min: 0, max: 1, step: 0.001, value: 0, 'aria-label': 'Time'});
  private readonly timeText = h('span', {class: 'delay'});
  private readonly playButton: HTMLButtonElement;
  private readonly themeButton = button(
    'Switch theme', {icon: 'sun', text: false, class: 'round'}, () => {
      this.setTheme(this.theme === 'dark' ? 'light' : 'dark');
      rememberTheme(this.theme);
    });
  private readonly captions =
    [h('span', {class: 'name'}, 'Synthesized'), h('span', {class: 'name'})];
  private readonly sliderByParameter = new Map<number, Slider>();
  private readonly steps: LatestRequest<StepRequest>;
  private readonly maps: LatestRequest<ErrorMapRequest>;

  constructor(root: HTMLElement, info: RendererInfo, private readonly client: LibraryClient) {
    const showError = (error: Error): void => this.showMessage(error.message);
    this.steps = new LatestRequest((request) => this.fetchStep(request), showError);
    this.maps = new LatestRequest((request) => this.fetchMap(request), showError);
    this.plane = new ParameterPlane({
      onMove: (x, y) => {
        const p = [...this.requested];
        p[this.plane.y] = y;
        p[this.plane.x] = x;
        this.requestStep(p);
      },
      onSelect: (site) => this.selectSite(site),
    });
    const canvas = h('canvas', {class: 'preview', tabindex: 0, role: 'application', 'aria-label':
      '3D view of the synthesized step and the example. Arrow keys orbit, plus and minus zoom.'});
    this.preview = new StepPreview(canvas, info, this.colours);
    this.playButton = button('Pause', {icon: 'pause', key: 'Space', text: false, class: 'round'},
      () => this.setPlaying(!this.playing));
    const speed = h('select', {id: 'speed', 'aria-label': 'Speed'},
      ...[1, 0.5, 0.25].map((v) => h('option', {value: v}, `${v}×`)));
    speed.addEventListener('change', () => (this.speed = Number(speed.value)));
    this.theme = preferredTheme();
    this.message.hidden = true;
    root.replaceChildren(
      h('header', {class: 'library-header'},
        h('h1', {}, 'Library'), this.librarySelect, this.groupSelect,
        h('a', {class: 'link', href: `./${location.search}`}, 'Worlds'), this.themeButton),
      h('div', {class: 'library-layout'},
        h('section', {class: 'parameter-area', 'aria-label': 'Parameters'},
          this.summaryArea,
          h('div', {class: 'axes'}, '→', this.xSelect, '↑', this.ySelect),
          this.plane.element,
          h('div', {class: 'row'}, this.mapSelect, this.legend, this.legendText),
          this.sliders,
          h('div', {class: 'row'},
            h('label', {class: 'check', for: 'corrected'}, this.corrected, 'Correct errors'),
            button('Reset to mean', {class: 'small'},
              () => this.requestStep(this.meanOfExamples()))),
          this.resultText, this.valueTable, this.exampleText),
        h('section', {class: 'preview-area', 'aria-label': 'Movement'}, canvas, ...this.captions,
          h('div', {class: 'playback'}, this.playButton, this.scrub, this.timeText, speed))),
      this.message);
    this.setTheme(this.theme);
    this.librarySelect.addEventListener('change', () => void this.open(
      this.libraries.find(({hash}) => hash === this.librarySelect.value)!));
    this.groupSelect.addEventListener('change', () =>
      void this.openGroup(Number(this.groupSelect.value)));
    for (const [axis, select] of [['x', this.xSelect], ['y', this.ySelect]] as const) {
      select.addEventListener('change', () => {
        this.plane[axis] = Number(select.value);
        this.requestMap();
      });
    }
    this.mapSelect.addEventListener('change', () => this.requestMap());
    this.corrected.addEventListener('change', () => this.requestStep(this.requested));
    this.scrub.addEventListener('input', () => {
      this.setPlaying(false);
      this.timeS = Number(this.scrub.value) * this.preview.durationS;
    });
    document.addEventListener('keydown', (e) => {
      const {target} = e;
      const isControl = target instanceof HTMLInputElement ||
        target instanceof HTMLSelectElement || target instanceof HTMLButtonElement;
      if (e.key !== ' ' || isControl) return;
      e.preventDefault();
      this.setPlaying(!this.playing);
    });
  }

  async start(): Promise<void> {
    requestAnimationFrame((ms) => this.frame(ms));
    try {
      this.libraries = await this.client.libraries();
      this.librarySelect.replaceChildren(...this.libraries.map(({name, hash}) =>
        h('option', {value: hash}, name)));
      const requested = new URLSearchParams(location.search).get('library');
      const first = this.libraries.find(({name}) => name === requested) ?? this.libraries[0];
      if (!first) return this.showMessage('The server has no libraries.');
      await this.open(first);
    } catch (error) {
      this.showMessage((error as Error).message);
    }
  }

  async open(library: LibraryEntry): Promise<void> {
    this.librarySelect.value = library.hash;
    this.library = library;
    try {
      const skeleton = await this.client.skeleton(library.hash);
      if (this.library !== library) return;
      this.preview.setSkeleton(skeleton);
      this.groupSelect.replaceChildren(...library.groups.map((group, i) =>
        h('option', {value: i}, groupLabel(group))));
      void this.fetchSummary(library);
      await this.openGroup(0);
    } catch (error) {
      this.showMessage((error as Error).message);
    }
  }

  async openGroup(index: number): Promise<void> {
    const library = this.library!;
    try {
      const group = await this.client.group(library.hash, index);
      if (this.library !== library) return;
      this.groupSelect.value = String(index);
      this.groupIndex = index;
      this.group = group;
    } catch (error) {
      return this.showMessage((error as Error).message);
    }
    const {parameters} = this.group;
    const {plane} = this;
    plane.group = this.group;
    plane.map = null;
    [plane.x, plane.y] = widestParameters(this.group);
    for (const [select, value] of [[this.xSelect, plane.x], [this.ySelect, plane.y]] as const) {
      select.replaceChildren(...parameters.map(({name}, l) =>
        h('option', {value: l}, parameterLabel(name))));
      select.value = String(value);
    }
    this.sliderByParameter.clear();
    this.sliders.replaceChildren(...parameters.map((parameter, l) => {
      const {name} = parameter;
      const [min, max] = plane.rangeOf(parameter);
      const slider = new Slider(`p-${name}`, parameterLabel(name), min, max, 0.005, 0,
        (value) => name === 'turn_rad' ? degrees(value) : value.toFixed(2), (value) => {
          const p = [...this.requested];
          p[l] = value;
          this.requestStep(p);
        });
      slider.input.step = 'any';
      this.sliderByParameter.set(l, slider);
      return slider.element;
    }));
    this.preview.example = null;
    plane.selectedExample = -1;
    setText(this.exampleText, 'Drag the cross to change the parameters. Click a point to play ' +
      'that example beside the synthesized step.');
    this.timeS = 0;
    this.requestStep(this.meanOfExamples());
  }

  /** Requests the step for these parameters, and the error map of the plane through them. */
  requestStep(p: readonly number[]): void {
    this.requested = [...p];
    this.plane.requested = this.requested;
    for (const [l, slider] of this.sliderByParameter) slider.value = p[l]!;
    this.steps.submit(this.stepRequest());
    this.requestMap();
  }

  /**
   * Requests the step for a site's parameters. If the site is an example, also plays the example
   * beside that step. A pseudoexample has no motion.
   */
  selectSite(index: number): void {
    const {group, library} = this;
    const site = group?.sites[index];
    if (!group || !library || !site) return;
    this.requestStep(site.p);
    if (!site.is_example) {
      setText(this.exampleText, 'A pseudoexample: a blend of examples with known parameters.');
      return;
    }
    this.plane.selectedExample = index;
    const number = ++this.exampleRequest;
    setText(this.exampleText,
      `Example ${index}: ${site.source ?? ''}${site.mirrored ? ', mirrored' : ''}`);
    this.client.example(library.hash, this.groupIndex, index).then((clip: Clip) => {
      if (number !== this.exampleRequest || this.group !== group) return;
      this.preview.example = clip;
      setText(this.captions[1]!, `Example ${index}`);
    }, (error: Error) => this.showMessage(error.message));
  }

  private stepRequest(): StepRequest {
    return {
      hash: this.library!.hash, group: this.groupIndex, p: [...this.requested],
      corrected: this.corrected.checked,
    };
  }

  private requestMap(): void {
    if (this.mapSelect.value === 'none') {
      this.plane.map = null;
      setText(this.legendText, '');
      return;
    }
    this.maps.submit({
      ...this.stepRequest(), x: this.plane.x, y: this.plane.y,
      corrected: this.mapSelect.value === 'corrected'});
  }

  private async fetchStep(request: StepRequest): Promise<void> {
    const step = await this.client.step(request.hash, request.group, request.p, request.corrected);
    if (request.hash !== this.library?.hash || request.group !== this.groupIndex) return;
    this.message.hidden = true;
    this.step = step;
    this.preview.step = step;
    this.plane.applied = step.applied;
    ++this.stepsShown;
    this.showValues(step);
  }

  private async fetchSummary(library: LibraryEntry): Promise<void> {
    this.summaryArea.replaceChildren(h('summary', {}, 'Checking the library…'));
    try {
      const summary = await this.client.summary(library.hash);
      if (this.library === library) this.summaryArea.replaceChildren(...summaryNodes(summary));
    } catch (error) {
      if (this.library === library) this.showMessage((error as Error).message);
    }
  }

  private async fetchMap(request: ErrorMapRequest): Promise<void> {
    const map = await this.client.errors(
      request.hash, request.group, request.x, request.y, request.p, mapCells, request.corrected);
    if (request.hash !== this.library?.hash || request.group !== this.groupIndex ||
        this.mapSelect.value === 'none') return;
    this.plane.map = map;
    const largest = map.largest_m * 1e3;
    this.plane.topMm = roundScaleTop(largest);
    setText(this.legendText, `0 to ${this.plane.topMm} mm (largest ${largest.toPrecision(2)} mm)`);
    this.drawLegend();
  }

  private showValues(step: Step): void {
    const {parameters} = this.group!;
    const value = (l: number, v: number): string =>
      parameters[l]!.name === 'turn_rad' ? `${(v * 180 / Math.PI).toFixed(2)}°` : v.toFixed(4);
    this.valueTable.replaceChildren(
      h('tr', {}, h('th', {}, ''), ...['Requested', 'Applied', 'Measured'].map(
        (text) => h('th', {scope: 'col'}, text))),
      ...parameters.map(({name}, l) => h('tr', {}, h('th', {scope: 'row'}, parameterLabel(name)),
        h('td', {}, value(l, step.requested[l]!)), h('td', {}, value(l, step.applied[l]!)),
        h('td', {}, value(l, step.measured[l]!)))));
    const clamped = step.requested.some((v, l) => Math.abs(v - step.applied[l]!) > 1e-4);
    const uncorrectedMm = (1e3 * step.uncorrected_error_m).toFixed(2);
    setText(this.resultText, `Error ${(1e3 * step.error_m).toFixed(2)} mm` +
      (this.corrected.checked ? ` (${uncorrectedMm} mm uncorrected)` : '') +
      (clamped ? ', clamped' : step.extrapolated ? ', extrapolated' : '') +
      `, Σ|w| ${step.weight_sum.toFixed(2)}`);
  }

  private meanOfExamples(): number[] {
    const {parameters, sites} = this.group!;
    const examples = sites.filter((site) => site.is_example);
    return parameters.map((_, l) =>
      examples.reduce((sum, {p}) => sum + p[l]!, 0) / examples.length);
  }

  private drawLegend(): void {
    const context = this.legend.getContext('2d')!;
    const picture = context.createImageData(128, 1);
    for (let i = 0; i < 128; ++i) picture.data.set([...scaleColour(i / 127), 255], i * 4);
    context.putImageData(picture, 0, 0);
  }

  private setPlaying(on: boolean): void {
    this.playing = on;
    setPressed(this.playButton, !on);
    const text = on ? 'Pause' : 'Play';
    this.playButton.setAttribute('aria-label', text);
    this.playButton.title = `${text} (Space)`;
  }

  private setTheme(name: ThemeName): void {
    this.theme = name;
    this.preview.setBackground(applyTheme(name, this.colours));
    this.themeButton.replaceChildren(icon(name === 'dark' ? 'sun' : 'moon'));
  }

  private showMessage(text: string): void {
    this.message.replaceChildren(h('p', {}, text));
    this.message.hidden = false;
  }

  private frame(ms: number): void {
    requestAnimationFrame((next) => this.frame(next));
    const dtS = Math.min(0.1, (ms - this.lastMs) / 1000);
    this.lastMs = ms;
    const duration = this.preview.durationS;
    if (this.playing) {
      this.timeS += dtS * this.speed;
      if (this.timeS > duration + loopPauseS) this.timeS = 0;
      this.scrub.value = String(Math.min(1, this.timeS / duration));
    }
    const shownS = Math.min(this.timeS, duration);
    if (this.step) {
      const generic = genericTime(this.step.keytimes_s, shownS);
      setText(this.timeText, `generic time ${generic.toFixed(2)}`);
    }
    this.preview.draw(shownS, dtS);
    this.plane.draw();
    this.captions.forEach((caption, i) => {
      const at = this.preview.example ? this.preview.labelPosition(i) : null;
      caption.hidden = at === null;
      if (!at) return;
      caption.style.transform =
        `translate(${at.x.toFixed(1)}px, ${at.y.toFixed(1)}px) translate(-50%, -100%)`;
    });
  }
}

/** Describes what a library can do, what it lacks, and the results of its self-check. */
export function summaryNodes({summary, self_check: check}: Summary): HTMLElement[] {
  const list = (items: readonly string[]): HTMLElement =>
    h('ul', {}, ...items.map((item) => h('li', {}, item)));
  const nodes = [
    h('summary', {class: check.passed ? 'passed' : 'failed'},
      `What this library can do · ${check.verdict}`),
    list(summary.sentences),
  ];
  if (summary.missing.length > 0) {
    nodes.push(h('h2', {}, 'What is missing'),
      list(summary.missing.map(({what, advice}) => `${what}: ${advice}`)));
  }
  nodes.push(h('h2', {}, 'Self-check'), list(check.checks.map(({title, verdict, text, advice}) =>
    `${title} (${verdict.replace('_', ' ')}): ${text}${advice === null ? '' : ` ${advice}`}`)));
  return nodes;
}

/**
 * Describes a group, for example "Left step: 14 examples + 20 pseudoexamples, end forward, turn".
 */
function groupLabel(group: GroupEntry): string {
  const kinds: Readonly<Record<string, string>> =
    {step_left: 'Left step', step_right: 'Right step', jump: 'Jump'};
  const pseudo = group.pseudoexamples > 0 ? ` + ${group.pseudoexamples} pseudoexamples` : '';
  return `${kinds[group.kind] ?? group.kind}: ${group.examples} examples${pseudo}, ` +
    group.parameters.map((name) => parameterLabel(name).split(' (')[0]!.toLowerCase()).join(' · ');
}

/**
 * Returns the indices of the two parameters with the widest range over the examples, in ascending
 * order. If there is only one parameter, returns its index twice.
 */
export function widestParameters(group: Group): [number, number] {
  // A turn of one radian counts as half a metre.
  const spread = group.parameters.map(({min, max, name}, l) =>
    ({l, width: (max - min) * (name === 'turn_rad' ? 0.5 : 1)}));
  spread.sort((a, b) => b.width - a.width);
  const pair = spread.slice(0, 2).map(({l}) => l).sort((a, b) => a - b);
  return [pair[0]!, pair[1] ?? pair[0]!];
}

/** Returns a round number of millimetres that is not below the largest error. */
export function roundScaleTop(largestMm: number): number {
  const power = 10 ** Math.floor(Math.log10(Math.max(largestMm, 1e-3)));
  return [1, 1.5, 2, 3, 5, 7.5, 10].map((k) => k * power).find((v) => v >= largestMm * 0.999)!;
}
