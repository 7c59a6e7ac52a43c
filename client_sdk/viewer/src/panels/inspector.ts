// The inspector: the selected avatar's movement with its parameters, examples and weights, and its
// base frame, queue and joints.

import {degrees, h, pointText, setText, svg} from '../dom.js';
import type {AvatarState, MovementState, QueuedRequest, World} from '../sdk.js';
import {genericTime, stateAt} from '../timeline.js';

/** Interval at which the state is requested from the server. */
const requestIntervalMs = 200;
/** Time for which states are kept for playback; slightly longer than the recording. */
const historyS = 22;

const movementNames: Readonly<Record<string, string>> = {
  stepLeft: 'Step, left foot', stepRight: 'Step, right foot', jump: 'Jump', stand: 'Stand',
  step: 'Step',
};
const parameterNames: Readonly<Record<string, string>> = {
  startX: 'Start sideways', startY: 'Start height', startZ: 'Start forward',
  endX: 'End sideways', endY: 'End height', endZ: 'End forward', turn: 'Turn',
  length: 'Length', height: 'Height',
};

function parameterText(name: string, value: number): string {
  return name === 'turn' ? `${(value * 180 / Math.PI).toFixed(1)}°` : `${value.toFixed(3)} m`;
}

export class Inspector {
  readonly element: HTMLElement;
  /** The state that the panel shows; null if none is known. */
  state: AvatarState | null = null;
  /** True if the scene shows joint names at the selected avatar. */
  labels = false;

  private world: World | null = null;
  private avatar = 0;
  private states: AvatarState[] = [];
  private requestedMs = -1e9;
  private requestPending = false;
  private errorText = '';
  /** Identifies the movement that the plots show. */
  private shownMovement = '';

  private readonly title = h('h3', {});
  private readonly movement = h('p', {class: 'movement'});
  private readonly timeline = svg('svg', {
    class: 'timeline', viewBox: '0 0 280 46', role: 'img',
    'aria-label': 'Timeline of the movement'});
  private readonly parameters = h('table', {class: 'parameters'});
  private readonly scatter = svg('svg', {class: 'scatter', viewBox: '0 0 280 150', role: 'img'});
  private readonly axes = h('div', {class: 'axes'});
  private readonly bars = svg('svg', {class: 'bars', viewBox: '0 0 280 60', role: 'img'});
  private readonly barsText = h('p', {class: 'hint'});
  private readonly base = h('p', {});
  private readonly queue = h('ol', {class: 'queue'});
  private readonly queueTitle = h('h4', {}, 'Queue');
  private readonly joints = h('ul', {class: 'joints'});
  private readonly jointsTitle = h('summary', {}, 'Joints');
  private readonly empty = h('p', {class: 'hint'},
    'Click an avatar, or press N to select the next one.');
  private readonly content: HTMLElement;
  private readonly moving: HTMLElement;
  private readonly blended: HTMLElement;
  private axisNames = '';
  private axisX = 0;
  private axisY = 1;
  private playhead: SVGElement | null = null;
  private playheadText: SVGElement | null = null;

  constructor(actions: {onFollow: () => void; onDeselect: () => void}) {
    const labels = h('input', {type: 'checkbox', id: 'joint-labels'});
    labels.addEventListener('change', () => (this.labels = labels.checked));
    const follow = h('button', {type: 'button', class: 'small'}, 'Follow');
    follow.addEventListener('click', actions.onFollow);
    const deselect = h('button', {type: 'button', class: 'small'}, 'Deselect');
    deselect.addEventListener('click', actions.onDeselect);
    this.blended = h('div', {}, h('h4', {}, 'Parameters'), this.parameters,
      h('h4', {}, 'Examples in parameter space'), this.axes, this.scatter,
      h('h4', {}, 'Weights'), this.bars, this.barsText);
    this.moving = h('div', {}, this.timeline, this.blended);
    this.content = h('div', {class: 'inspector'},
      h('div', {class: 'row'}, this.title, follow, deselect), this.movement, this.moving,
      h('h4', {}, 'Base frame'), this.base, this.queueTitle, this.queue,
      h('label', {class: 'check', for: 'joint-labels'}, labels, 'Show joint names'),
      h('details', {}, this.jointsTitle, this.joints));
    this.element = h('div', {class: 'panel-body'}, this.empty, this.content);
    this.content.hidden = true;
  }

  setAvatar(world: World | null, avatar: number): void {
    if (world === this.world && avatar === this.avatar) return;
    this.world = world;
    this.avatar = avatar;
    this.states = [];
    this.state = null;
    this.shownMovement = '';
    this.errorText = '';
    this.requestedMs = -1e9;
    this.content.hidden = avatar === 0;
    this.empty.hidden = avatar !== 0;
    if (!world || avatar === 0) return;
    setText(this.title, `Avatar ${avatar} · ${world.name}`);
    const skeleton = world.skeleton;
    this.joints.replaceChildren(
      ...(skeleton ? skeleton.names.map((name) => h('li', {}, name)) : []));
    setText(this.jointsTitle, `${skeleton?.jointCount ?? 0} joints`);
  }

  /**
   * Call once per frame. Requests the state from the server at intervals, and shows the state at
   * `timeS`, or the newest one if playback is live.
   */
  update(nowMs: number, timeS: number, live: boolean, ready: boolean, visible: boolean): void {
    const world = this.world;
    if (!world || this.avatar === 0) return;
    if (ready && !this.requestPending && nowMs - this.requestedMs > requestIntervalMs) {
      this.requestPending = true;
      this.requestedMs = nowMs;
      const avatar = this.avatar;
      void world.inspect(avatar).then((state) => {
        if (avatar !== this.avatar || world !== this.world) return;
        this.states.push(state);
        while (this.states[0]!.timeS < state.timeS - historyS) this.states.shift();
      }, () => {
        this.errorText = 'The server did not report this avatar.';
      }).finally(() => {
        this.requestPending = false;
      });
    }
    const state = live ? this.states[this.states.length - 1] ?? null : stateAt(this.states, timeS);
    if (state !== this.state) {
      this.state = state;
      this.show(state);
    } else if (!state && this.movement.textContent === '') {
      setText(this.movement, this.errorText || 'Loading…');
    }
    if (visible) this.movePlayhead(timeS);
  }

  private show(state: AvatarState | null): void {
    if (!state) {
      setText(this.movement, this.errorText);
      this.moving.hidden = true;
      return;
    }
    const p = state.basePositionM;
    setText(this.base, `x ${p[0]!.toFixed(2)} m, z ${p[2]!.toFixed(2)} m` +
      (Math.abs(p[1]!) > 0.005 ? `, height ${p[1]!.toFixed(2)} m` : '') +
      `, heading ${degrees(Math.atan2(
        Math.sin(state.baseHeadingRad), Math.cos(state.baseHeadingRad)))}`);
    setText(this.queueTitle, `Queue (${state.queueSize === 0 ? 'empty' : state.queueSize})`);
    const items = state.queue.map((item) => h('li', {}, queueText(item)));
    const unlisted = state.queueSize - items.length;
    if (unlisted > 0) items.push(h('li', {}, `${unlisted} more`));
    this.queue.replaceChildren(...items);
    const movement = state.movement;
    this.moving.hidden = movement === null;
    if (!movement) {
      setText(this.movement, 'Standing');
      return;
    }
    setText(this.movement, `${movementNames[movement.kind] ?? movement.kind}, ` +
      `${(movement.endTimeS - movement.startTimeS).toFixed(2)} s` +
      (movement.extrapolated ? ', extrapolated' : '') + (movement.clamped ? ', clamped' : ''));
    const shape = `${movement.kind}/${movement.group}/${movement.startTimeS}`;
    if (shape === this.shownMovement) return;
    this.shownMovement = shape;
    // A requested stand is not blended from examples.
    this.blended.hidden = movement.weights.length === 0;
    this.showParameters(movement);
    this.showTimeline(movement);
    this.showAxes(movement);
    this.showScatter(movement);
    this.showBars(movement);
  }

  private showParameters(movement: MovementState): void {
    const requested = movement.requested as Readonly<Record<string, number>>;
    const applied = movement.applied as Readonly<Record<string, number>>;
    const rows = [...new Set([...Object.keys(requested), ...Object.keys(applied)])].map((name) =>
      h('tr', {}, h('th', {scope: 'row'}, parameterNames[name] ?? name),
        h('td', {}, requested[name] === undefined ? '–' : parameterText(name, requested[name]!)),
        h('td', {}, applied[name] === undefined ? '–' : parameterText(name, applied[name]!))));
    this.parameters.replaceChildren(
      h('thead', {}, h('tr', {}, h('th', {}), h('th', {scope: 'col'}, 'Requested'),
        h('th', {scope: 'col'}, 'Applied'))),
      h('tbody', {}, ...rows));
    this.parameters.hidden = rows.length === 0;
  }

  private showTimeline(movement: MovementState): void {
    const keys = movement.keytimesS;
    const span = Math.max(movement.endTimeS - movement.startTimeS, 1e-6);
    const x = (t: number): number => 8 + Math.min(1, Math.max(0, t / span)) * 264;
    const parts: SVGElement[] = [svg('line', {class: 'axis', x1: 8, y1: 20, x2: 272, y2: 20})];
    if (movement.easeOutS > 0) {
      const width = x(movement.easeOutS) - 8;
      parts.push(svg('rect', {class: 'ease', x: 8, y: 16, width, height: 8}));
    }
    let right = -100;
    for (let i = 0; i < keys.length; ++i) {
      parts.push(svg('line', {class: 'key', x1: x(keys[i]!), y1: 12, x2: x(keys[i]!), y2: 28}));
      if (x(keys[i]!) - right > 13) {
        parts.push(svg('text', {class: 'key-text', x: x(keys[i]!), y: 42}, String(i)));
        right = x(keys[i]!);
      }
    }
    this.playhead = svg('path', {class: 'playhead', d: 'M0 3v28M-4 3h8l-4 6z'});
    this.playheadText = svg('text', {class: 'playhead-text', x: 0, y: 9});
    this.timeline.replaceChildren(...parts, this.playhead, this.playheadText);
  }

  private movePlayhead(timeS: number): void {
    const movement = this.state?.movement;
    if (!movement || !this.playhead || !this.playheadText) return;
    const t = timeS - movement.startTimeS;
    const span = Math.max(movement.endTimeS - movement.startTimeS, 1e-6);
    const x = 8 + Math.min(1, Math.max(0, t / span)) * 264;
    this.playhead.setAttribute('transform', `translate(${x.toFixed(1)} 0)`);
    const text = genericTime(movement.keytimesS, t).toFixed(2);
    const left = x > 150;
    this.playheadText.setAttribute('x', (x + (left ? -7 : 7)).toFixed(1));
    this.playheadText.setAttribute('text-anchor', left ? 'end' : 'start');
    setText(this.playheadText, `generic time ${text}`);
  }

  /**
   * Lets the user choose the two parameters of the scatter plot. Initially they are the main
   * parameter (end forward, or length) and the one with the widest range.
   */
  private showAxes(movement: MovementState): void {
    const names = movement.parameterNames as readonly string[];
    const n = names.length;
    // The user's choice stays while the parameters are the same.
    if (names.join() === this.axisNames) return;
    this.axisNames = names.join();
    const count = n > 0 ? Math.floor(movement.exampleParameters.length / n) : 0;
    const spread = names.map((name, k) => {
      let low = Infinity;
      let high = -Infinity;
      for (let i = 0; i < count; ++i) {
        low = Math.min(low, movement.exampleParameters[i * n + k]!);
        high = Math.max(high, movement.exampleParameters[i * n + k]!);
      }
      return {k, spread: high - low, main: name === 'endZ' || name === 'length' ? 1 : 0};
    }).sort((a, b) => b.main - a.main || b.spread - a.spread);
    this.axisX = spread[0]?.k ?? 0;
    this.axisY = spread[1]?.k ?? this.axisX;
    this.axes.replaceChildren();
    if (n < 2) return;
    const select = (label: string, value: number, set: (k: number) => void): HTMLElement => {
      const element = h('select', {'aria-label': label});
      names.forEach((name, k) => {
        const option = h('option', {value: k}, parameterNames[name] ?? name);
        option.selected = k === value;
        element.append(option);
      });
      element.addEventListener('change', () => {
        set(Number(element.value));
        if (this.state?.movement) this.showScatter(this.state.movement);
      });
      return element;
    };
    this.axes.append('→ ', select('Horizontal axis', this.axisX, (k) => (this.axisX = k)),
      ' ↑ ', select('Vertical axis', this.axisY, (k) => (this.axisY = k)));
  }

  private showScatter(movement: MovementState): void {
    const names = movement.parameterNames as readonly string[];
    const n = names.length;
    const count = n > 0 ? Math.floor(movement.exampleParameters.length / n) : 0;
    this.scatter.replaceChildren();
    if (count === 0) return;
    const applied = movement.applied as Readonly<Record<string, number>>;
    const at = names.map((name) => applied[name] ?? 0);
    const flat = this.axisX === this.axisY;
    const xs: number[] = [];
    const ys: number[] = [];
    for (let i = 0; i < count; ++i) {
      xs.push(movement.exampleParameters[i * n + this.axisX]!);
      ys.push(flat ? 0 : movement.exampleParameters[i * n + this.axisY]!);
    }
    const px = at[this.axisX]!;
    const py = flat ? 0 : at[this.axisY]!;
    const scale = (values: number[], p: number, from: number, to: number) => {
      const low = Math.min(p, ...values);
      const high = Math.max(p, ...values);
      const span = Math.max(high - low, 1e-6);
      return (v: number): number => high - low < 1e-9 ? (from + to) / 2 :
        from + ((v - low) / span) * (to - from);
    };
    const x = scale(xs, px, 18, 262);
    const y = scale(ys, py, 122, 18);
    const parts: SVGElement[] =
      [svg('rect', {class: 'frame', x: 4, y: 4, width: 272, height: 132})];
    for (let i = 0; i < count; ++i) {
      const w = movement.weights[i] ?? 0;
      const r = 2 + Math.sqrt(Math.min(1, Math.abs(w))) * 10;
      const dot = svg('circle', {
        class: w < 0 ? 'site negative' : Math.abs(w) < 0.01 ? 'site idle' : 'site',
        cx: x(xs[i]!).toFixed(1), cy: y(ys[i]!).toFixed(1), r: r.toFixed(1)});
      dot.append(svg('title', {}, `Example ${i}: weight ${w.toFixed(3)}`));
      parts.push(dot);
    }
    const cx = x(px);
    const cy = y(py);
    parts.push(svg('path', {class: 'applied-cross', d:
      `M${cx - 7} ${cy}h14M${cx} ${cy - 7}v14`}));
    const range = (values: number[], k: number): string =>
      `${parameterText(names[k]!, Math.min(...values))} … ` +
      parameterText(names[k]!, Math.max(...values));
    parts.push(svg('text', {class: 'axis-text', x: 140, y: 147}, range(xs, this.axisX)));
    this.scatter.replaceChildren(...parts);
    this.scatter.setAttribute('aria-label', `${count} examples. The cross marks the applied ` +
      'parameters; larger dots have larger weights.');
  }

  private showBars(movement: MovementState): void {
    const n = movement.weights.length;
    const parts: SVGElement[] = [];
    let low = 0;
    let high = 1e-6;
    for (let i = 0; i < n; ++i) {
      low = Math.min(low, movement.weights[i]!);
      high = Math.max(high, movement.weights[i]!);
    }
    const span = high - low;
    const zero = 4 + (high / span) * 52;
    const width = 272 / Math.max(1, n);
    const order: number[] = [];
    for (let i = 0; i < n; ++i) {
      const w = movement.weights[i]!;
      order.push(i);
      const tall = Math.max(Math.abs(w) / span * 52, 0.75);
      const bar = svg('rect', {
        class: w < 0 ? 'bar negative' : 'bar', x: (4 + i * width).toFixed(2),
        y: (w < 0 ? zero : zero - tall).toFixed(2), width: Math.max(1, width * 0.78).toFixed(2),
        height: tall.toFixed(2)});
      bar.append(svg('title', {}, `Example ${i}: weight ${w.toFixed(3)}`));
      parts.push(bar);
    }
    parts.push(svg('line', {class: 'axis', x1: 4, y1: zero, x2: 276, y2: zero}));
    this.bars.replaceChildren(...parts);
    order.sort((a, b) => Math.abs(movement.weights[b]!) - Math.abs(movement.weights[a]!));
    const text =
      order.slice(0, 4).map((i) => `#${i} ${movement.weights[i]!.toFixed(2)}`).join(', ');
    setText(this.barsText, n === 0 ? 'No examples' : `${n} examples; largest weights: ${text}`);
    this.bars.setAttribute('aria-label', `Weights of ${n} examples; largest: ${text}`);
  }
}

/** Formats a request, for example "Step, left foot, 0.60 m" or "Walk to x 1.00 m, z 2.00 m". */
function queueText(item: QueuedRequest): string {
  if (item.type === 'stand') return `Stand, ${item.seconds.toFixed(1)} s`;
  if (item.type === 'walk') return `Walk to ${pointText(item.atM!)}`;
  const foot = item.foot !== 'auto' ? `, ${item.foot} foot` : '';
  const exact = item.exactOnly ? ', exact' : '';
  if (item.atM) return `Step${foot} to ${pointText(item.atM)}${exact}`;
  const turn = item.turnRad ? `, turn ${degrees(item.turnRad)}` : '';
  const type = item.type === 'jump' ? 'Jump' : 'Step';
  return `${type}${foot}, ${item.lengthM.toFixed(2)} m${turn}${exact}`;
}
