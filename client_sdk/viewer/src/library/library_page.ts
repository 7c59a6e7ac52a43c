// The animator's page: what a library's groups span, how well, and the step of any parameters at once.

import {Slider, button, degrees, h, press, setText} from '../dom.js';
import type {RendererInfo} from '../renderer.js';
import {applyTheme, makeColours, preferredTheme, rememberTheme} from '../theme.js';
import type {ThemeName} from '../theme.js';
import {genericTime} from '../timeline.js';
import {Latest} from './library_client.js';
import type {Clip, Group, GroupEntry, LibraryEntry, LibrarySource, Step} from './library_client.js';
import {ParameterPlane, label, scaleColour} from './parameter_plane.js';
import {StepStage} from './step_preview.js';

const mapCells = 48;
/** Between one showing of the movement and the next. */
const restS = 0.45;

interface Wish {
  readonly hash: string;
  readonly group: number;
  readonly p: readonly number[];
  readonly corrected: boolean;
}
interface MapWish extends Wish {
  readonly x: number;
  readonly y: number;
}

export class LibraryPage {
  libraries: readonly LibraryEntry[] = [];
  library: LibraryEntry | null = null;
  group: Group | null = null;
  groupIndex = 0;
  wanted: number[] = [];
  step: Step | null = null;
  example = -1;
  readonly plane: ParameterPlane;
  readonly stage: StepStage;
  stepsShown = 0;
  private playing = true;
  private timeS = 0;
  private speed = 1;
  private lastMs = 0;
  private theme: ThemeName;
  private exampleNumber = 0;  // of the choice whose frames are waited for
  private readonly colours = makeColours();
  private readonly librarySelect = h('select', {id: 'library', 'aria-label': 'Library'});
  private readonly groupSelect = h('select', {id: 'group', 'aria-label': 'Group'});
  private readonly xSelect = h('select', {id: 'axis-x', 'aria-label': 'Parameter to the right'});
  private readonly ySelect = h('select', {id: 'axis-y', 'aria-label': 'Parameter upwards'});
  private readonly mapSelect = h('select', {id: 'map', 'aria-label': 'Errors shown'},
    h('option', {value: 'plain'}, 'errors without correction'),
    h('option', {value: 'corrected'}, 'errors with correction'),
    h('option', {value: 'none'}, 'no errors'));
  private readonly corrected = h('input', {type: 'checkbox', id: 'corrected', checked: true});
  private readonly sliders = h('div', {class: 'sliders'});
  private readonly facts = h('table', {class: 'parameters'});
  private readonly verdict = h('p', {class: 'movement', role: 'status'});
  private readonly exampleText = h('p', {class: 'hint'});
  private readonly legend = h('canvas', {class: 'legend', 'aria-hidden': 'true', width: 128, height: 1});
  private readonly legendText = h('span', {class: 'hint'});
  private readonly message = h('div', {class: 'notice', role: 'alert'});
  private readonly scrub = h('input', {type: 'range', id: 'time', min: 0, max: 1, step: 0.001, value: 0,
    'aria-label': 'Generic time'});
  private readonly timeText = h('span', {class: 'behind'});
  private readonly playButton: HTMLButtonElement;
  private readonly names = [h('span', {class: 'name'}, 'synthesized'), h('span', {class: 'name'})];
  private readonly sliderOf = new Map<number, Slider>();
  private readonly steps: Latest<Wish>;
  private readonly maps: Latest<MapWish>;

  constructor(root: HTMLElement, info: RendererInfo, private readonly source: LibrarySource) {
    this.steps = new Latest((wish) => this.fetchStep(wish), (error) => this.say(error.message));
    this.maps = new Latest((wish) => this.fetchMap(wish), (error) => this.say(error.message));
    this.plane = new ParameterPlane({
      move: (x, y) => {
        const p = [...this.wanted];
        p[this.plane.y] = y;
        p[this.plane.x] = x;
        this.want(p);
      },
      choose: (site) => this.choose(site),
    });
    const canvas = h('canvas', {class: 'stage', tabindex: 0, role: 'application', 'aria-label':
      'The synthesized movement and the example. Arrow keys orbit, plus and minus zoom.'});
    this.stage = new StepStage(canvas, info, this.colours);
    this.playButton = button('Pause', {icon: 'pause', key: 'Space', text: false, class: 'round'},
      () => this.setPlaying(!this.playing));
    const speed = h('select', {id: 'speed', 'aria-label': 'Speed'},
      ...[1, 0.5, 0.25].map((v) => h('option', {value: v}, `${v}×`)));
    speed.addEventListener('change', () => (this.speed = Number(speed.value)));
    this.theme = preferredTheme();
    const theme = button('Dark or light', {icon: 'sun', text: false, class: 'round'}, () => {
      this.setTheme(this.theme === 'dark' ? 'light' : 'dark');
      rememberTheme(this.theme);
    });
    this.message.hidden = true;
    root.replaceChildren(
      h('header', {class: 'bar'}, h('h1', {}, 'Library'), this.librarySelect, this.groupSelect,
        h('a', {class: 'link', href: `/${location.search}`}, 'Worlds'), theme),
      h('div', {class: 'laboratory'},
        h('section', {class: 'space', 'aria-label': 'Parameters'},
          h('div', {class: 'axes'}, 'Across', this.xSelect, 'up', this.ySelect),
          this.plane.element,
          h('div', {class: 'row'}, this.mapSelect, this.legend, this.legendText),
          this.sliders,
          h('div', {class: 'row'},
            h('label', {class: 'check', for: 'corrected'}, this.corrected, 'Correct the step'),
            button('Middle', {class: 'small'}, () => this.want(this.middle()))),
          this.verdict, this.facts, this.exampleText),
        h('section', {class: 'theatre', 'aria-label': 'Movement'}, canvas, ...this.names,
          h('div', {class: 'transport'}, this.playButton, this.scrub, this.timeText, speed))),
      this.message);
    this.setTheme(this.theme);
    this.librarySelect.addEventListener('change', () => void this.open(
      this.libraries.find(({hash}) => hash === this.librarySelect.value)!));
    this.groupSelect.addEventListener('change', () => void this.openGroup(Number(this.groupSelect.value)));
    for (const [axis, select] of [['x', this.xSelect], ['y', this.ySelect]] as const) {
      select.addEventListener('change', () => {
        this.plane[axis] = Number(select.value);
        this.wantMap();
      });
    }
    this.mapSelect.addEventListener('change', () => this.wantMap());
    this.corrected.addEventListener('change', () => this.want(this.wanted));
    this.scrub.addEventListener('input', () => {
      this.setPlaying(false);
      this.timeS = Number(this.scrub.value) * this.stage.durationS;
    });
    document.addEventListener('keydown', (e) => {
      if (e.key !== ' ' || e.target instanceof HTMLInputElement || e.target instanceof HTMLSelectElement ||
        e.target instanceof HTMLButtonElement) return;
      e.preventDefault();
      this.setPlaying(!this.playing);
    });
  }

  async start(): Promise<void> {
    requestAnimationFrame((ms) => this.frame(ms));
    try {
      this.libraries = await this.source.libraries();
      this.librarySelect.replaceChildren(...this.libraries.map(({name, hash}) =>
        h('option', {value: hash}, name)));
      const asked = new URLSearchParams(location.search).get('library');
      const first = this.libraries.find(({name}) => name === asked) ?? this.libraries[0];
      if (!first) return this.say('The server has no library.');
      await this.open(first);
    } catch (error) {
      this.say((error as Error).message);
    }
  }

  async open(library: LibraryEntry): Promise<void> {
    this.librarySelect.value = library.hash;
    this.library = library;
    try {
      const skeleton = await this.source.skeleton(library.hash);
      if (this.library !== library) return;
      this.stage.setSkeleton(skeleton);
      this.groupSelect.replaceChildren(...library.groups.map((group, i) =>
        h('option', {value: i}, describe(group))));
      await this.openGroup(0);
    } catch (error) {
      this.say((error as Error).message);
    }
  }

  async openGroup(index: number): Promise<void> {
    const library = this.library!;
    try {
      const group = await this.source.group(library.hash, index);
      if (this.library !== library) return;
      this.groupSelect.value = String(index);
      this.groupIndex = index;
      this.group = group;
    } catch (error) {
      return this.say((error as Error).message);
    }
    const {parameters} = this.group;
    const {plane} = this;
    plane.group = this.group;
    plane.map = null;
    [plane.x, plane.y] = widest(this.group);
    for (const [select, value] of [[this.xSelect, plane.x], [this.ySelect, plane.y]] as const) {
      select.replaceChildren(...parameters.map(({name}, l) => h('option', {value: l}, label(name))));
      select.value = String(value);
    }
    this.sliderOf.clear();
    this.sliders.replaceChildren(...parameters.map((parameter, l) => {
      const grown = 0.1 * (parameter.max - parameter.min) || 0.05;
      const slider = new Slider(`p-${parameter.name}`, label(parameter.name), parameter.min - grown,
        parameter.max + grown, 0.005, 0,
        (value) => parameter.name === 'turn_rad' ? degrees(value) : value.toFixed(2), (value) => {
          const p = [...this.wanted];
          p[l] = value;
          this.want(p);
        });
      slider.input.step = 'any';
      this.sliderOf.set(l, slider);
      return slider.element;
    }));
    this.stage.example = null;
    this.example = plane.example = -1;
    setText(this.exampleText, 'Drag the cross: the step follows. Choose a point to play that example ' +
      'beside the step of the same parameters.');
    this.timeS = 0;
    this.want(this.middle());
  }

  /** Asks for the step of these parameters, and for a map through them. */
  want(p: readonly number[]): void {
    this.wanted = [...p];
    this.plane.wanted = this.wanted;
    for (const [l, slider] of this.sliderOf) slider.value = p[l]!;
    this.steps.want(this.wish());
    this.wantMap();
  }

  /** Plays an example beside the step of its parameters; a pseudoexample has no movement of its own. */
  choose(site: number): void {
    const {group, library} = this;
    const chosen = group?.sites[site];
    if (!group || !library || !chosen) return;
    this.want(chosen.p);
    if (!chosen.is_example) {
      setText(this.exampleText, 'A pseudoexample: a blend of the examples whose parameters are known.');
      return;
    }
    this.example = this.plane.example = site;
    const number = ++this.exampleNumber;
    setText(this.exampleText, `Example ${site}: ${chosen.source ?? ''}${chosen.mirrored ? ', mirrored' : ''}`);
    this.source.example(library.hash, this.groupIndex, site).then((clip: Clip) => {
      if (number !== this.exampleNumber || this.group !== group) return;
      this.stage.example = clip;
      setText(this.names[1]!, `example ${site}`);
    }, (error: Error) => this.say(error.message));
  }

  private wish(): Wish {
    return {
      hash: this.library!.hash, group: this.groupIndex, p: [...this.wanted],
      corrected: this.corrected.checked,
    };
  }

  private wantMap(): void {
    if (this.mapSelect.value === 'none') {
      this.plane.map = null;
      setText(this.legendText, '');
      return;
    }
    this.maps.want({
      ...this.wish(), x: this.plane.x, y: this.plane.y,
      corrected: this.mapSelect.value === 'corrected'});
  }

  private async fetchStep(wish: Wish): Promise<void> {
    const step = await this.source.step(wish.hash, wish.group, wish.p, wish.corrected);
    if (wish.hash !== this.library?.hash || wish.group !== this.groupIndex) return;
    this.message.hidden = true;
    this.step = step;
    this.stage.step = step;
    this.plane.applied = step.applied;
    ++this.stepsShown;
    this.showFacts(step);
  }

  private async fetchMap(wish: MapWish): Promise<void> {
    const map = await this.source.errors(
      wish.hash, wish.group, wish.x, wish.y, wish.p, mapCells, wish.corrected);
    if (wish.hash !== this.library?.hash || wish.group !== this.groupIndex ||
        this.mapSelect.value === 'none') return;
    this.plane.map = map;
    const largest = map.largest_m * 1e3;
    this.plane.topMm = niceTop(largest);
    setText(this.legendText, `0 to ${this.plane.topMm} mm (largest ${largest.toPrecision(2)})`);
    this.drawLegend();
  }

  private showFacts(step: Step): void {
    const {parameters} = this.group!;
    const value = (l: number, v: number): string =>
      parameters[l]!.name === 'turn_rad' ? `${(v * 180 / Math.PI).toFixed(2)}°` : v.toFixed(4);
    this.facts.replaceChildren(
      h('tr', {}, h('th', {}, ''), ...['asked', 'applied', 'measured'].map(
        (text) => h('th', {scope: 'col'}, text))),
      ...parameters.map(({name}, l) => h('tr', {}, h('th', {scope: 'row'}, label(name)),
        h('td', {}, value(l, step.requested[l]!)), h('td', {}, value(l, step.applied[l]!)),
        h('td', {}, value(l, step.measured[l]!)))));
    const clamped = step.requested.some((v, l) => Math.abs(v - step.applied[l]!) > 1e-4);
    setText(this.verdict, `${(1e3 * step.error_m).toFixed(2)} mm off` +
      (this.corrected.checked ? ` (${(1e3 * step.uncorrected_error_m).toFixed(2)} uncorrected)` : '') +
      (clamped ? ', clamped to what the examples span' :
        step.extrapolated ? ', outside the examples' : '') +
      `, Σ|w| ${step.weight_sum.toFixed(2)}`);
  }

  private middle(): number[] {
    const {parameters, sites} = this.group!;
    const examples = sites.filter((site) => site.is_example);
    return parameters.map((_, l) => examples.reduce((sum, {p}) => sum + p[l]!, 0) / examples.length);
  }

  private drawLegend(): void {
    const context = this.legend.getContext('2d')!;
    const picture = context.createImageData(128, 1);
    for (let i = 0; i < 128; ++i) picture.data.set([...scaleColour(i / 127), 255], i * 4);
    context.putImageData(picture, 0, 0);
  }

  private setPlaying(on: boolean): void {
    this.playing = on;
    press(this.playButton, !on);
    const text = on ? 'Pause' : 'Play';
    this.playButton.setAttribute('aria-label', text);
    this.playButton.title = `${text} (Space)`;
  }

  private setTheme(name: ThemeName): void {
    this.theme = name;
    this.stage.setBackground(applyTheme(name, this.colours));
  }

  private say(text: string): void {
    this.message.replaceChildren(h('p', {}, text));
    this.message.hidden = false;
  }

  private frame(ms: number): void {
    requestAnimationFrame((next) => this.frame(next));
    const dtS = Math.min(0.1, (ms - this.lastMs) / 1000);
    this.lastMs = ms;
    const duration = this.stage.durationS;
    if (this.playing) {
      this.timeS += dtS * this.speed;
      if (this.timeS > duration + restS) this.timeS = 0;
      this.scrub.value = String(Math.min(1, this.timeS / duration));
    }
    const shownS = Math.min(this.timeS, duration);
    if (this.step) {
      setText(this.timeText, `g ${genericTime(this.step.keytimes_s, shownS).toFixed(2)}`);
    }
    this.stage.draw(shownS, dtS);
    this.plane.draw();
    this.names.forEach((name, i) => {
      const at = this.stage.example ? this.stage.headOf(i) : null;
      name.hidden = at === null;
      if (at) name.style.transform = `translate(${at.x.toFixed(1)}px, ${at.y.toFixed(1)}px) translate(-50%, -100%)`;
    });
  }
}

function describe(group: GroupEntry): string {
  const kinds: Readonly<Record<string, string>> =
    {step_left: 'left step', step_right: 'right step', jump: 'jump'};
  const pseudo = group.pseudoexamples > 0 ? ` + ${group.pseudoexamples}` : '';
  return `${kinds[group.kind] ?? group.kind}, ${group.examples}${pseudo} examples, ` +
    group.parameters.map((name) => label(name).split(',')[0]).join(' · ');
}

/** The two parameters the examples spread most over; the one there is twice, if it is the only one. */
export function widest(group: Group): [number, number] {
  const spread = group.parameters.map(({min, max, name}, l) =>
    ({l, width: (max - min) * (name === 'turn_rad' ? 0.5 : 1)}));
  spread.sort((a, b) => b.width - a.width);
  const pair = spread.slice(0, 2).map(({l}) => l).sort((a, b) => a - b);
  return [pair[0]!, pair[1] ?? pair[0]!];
}

/** A round number of millimetres from the largest error up. */
export function niceTop(largestMm: number): number {
  const power = 10 ** Math.floor(Math.log10(Math.max(largestMm, 1e-3)));
  return [1, 1.5, 2, 3, 5, 7.5, 10].map((k) => k * power).find((v) => v >= largestMm * 0.999)!;
}
