// A plot of two parameters of a group. It shows the error map, examples and pseudoexamples as
// points, and the requested parameters as a cross that the user can drag.

import {h} from '../dom.js';
import type {ErrorMap, Group, Parameter} from './library_client.js';

/**
 * Colours from dark blue to yellow with increasing lightness, so that people with colour blindness
 * can read the map. They follow the cividis colour map.
 */
const colourScale: readonly [number, number, number][] = [
  [0, 34, 78], [33, 59, 110], [76, 84, 108], [108, 110, 114], [143, 138, 119], [184, 169, 105],
  [228, 203, 76], [254, 232, 56],
];

/** Returns red, green and blue, 0 to 255, for a value of 0 (dark) to 1 (light). */
export function scaleColour(share: number): [number, number, number] {
  const at = Math.max(0, Math.min(1, share)) * (colourScale.length - 1);
  const i = Math.min(colourScale.length - 2, Math.floor(at));
  const f = at - i;
  const [a, b] = [colourScale[i]!, colourScale[i + 1]!];
  const mix = (k: 0 | 1 | 2): number => Math.round(a[k] + f * (b[k] - a[k]));
  return [mix(0), mix(1), mix(2)];
}

const margin = {left: 46, right: 14, top: 12, bottom: 38};

export class ParameterPlane {
  readonly element: HTMLCanvasElement;
  group: Group | null = null;
  map: ErrorMap | null = null;
  /** Indices of the parameters on the axes. */
  x = 0;
  y = 1;
  requested: number[] = [];
  /** Parameters after clamping by the server. */
  applied: readonly number[] = [];
  /** Index of the selected example; -1 if there is none. */
  selectedExample = -1;
  /** Error in millimetres at the end of the colour scale. */
  topMm = 1;
  private dragging = false;

  constructor(private readonly actions: {
    /** Called when the user has moved the cross to these values of the two parameters. */
    onMove(x: number, y: number): void;
    /** Called when the user has clicked the site with this index. */
    onSelect(site: number): void;
  }) {
    this.element = h('canvas', {
      class: 'plane', tabindex: 0, role: 'application', 'aria-label':
        'Parameters of the group. Drag the cross or move it with the arrow keys. Click a point ' +
        'to play that example.'});
    this.element.addEventListener('pointerdown', (e) => this.down(e));
    this.element.addEventListener('pointermove', (e) => {
      if (this.dragging) this.drag(e);
    });
    for (const name of ['pointerup', 'pointercancel'] as const) {
      this.element.addEventListener(name, () => (this.dragging = false));
    }
    this.element.addEventListener('keydown', (e) => this.key(e));
  }

  /** Returns the range of an axis: the range of the examples, extended by 10 % at each end. */
  range(axis: 'x' | 'y'): [number, number] {
    const index = axis === 'x' ? this.x : this.y;
    const parameter = this.group?.parameters[index];
    return parameter ? this.rangeOf(parameter) : [0, 1];
  }
  rangeOf({min, max}: Parameter): [number, number] {
    const margin = 0.1 * (max - min) || 0.05;
    return [min - margin, max + margin];
  }
  /** Returns whether both axes show the same parameter. */
  get isOneDimensional(): boolean {
    return this.x === this.y;
  }

  /** Returns the position of parameters in CSS pixels within the canvas. */
  toPixels(p: readonly number[]): {x: number; y: number} {
    const {width, height} = this.plotSize();
    const [x0, x1] = this.range('x');
    const [y0, y1] = this.range('y');
    return {
      x: margin.left + (p[this.x]! - x0) / (x1 - x0) * width,
      y: this.isOneDimensional ? margin.top + height / 2 :
        margin.top + (1 - (p[this.y]! - y0) / (y1 - y0)) * height,
    };
  }

  draw(): void {
    const {element, group} = this;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const {clientWidth, clientHeight} = element;
    if (clientWidth === 0 || !group) return;
    const width = Math.round(clientWidth * ratio);
    const height = Math.round(clientHeight * ratio);
    if (element.width !== width || element.height !== height) {
      element.width = width;
      element.height = height;
    }
    const context = element.getContext('2d')!;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, clientWidth, clientHeight);
    const style = getComputedStyle(element);
    const colour = (name: string): string => style.getPropertyValue(name).trim();
    const plot = this.plotSize();
    this.drawMap(context, plot);
    context.strokeStyle = colour('--border');
    context.lineWidth = 1;
    context.strokeRect(margin.left, margin.top, plot.width, plot.height);
    this.drawAxes(context, plot, colour('--soft'));
    group.sites.forEach((site, i) => {
      const {x, y} = this.toPixels(site.p);
      const selected = i === this.selectedExample;
      context.beginPath();
      if (site.is_example) context.arc(x, y, selected ? 6.5 : 4.5, 0, 2 * Math.PI);
      else {
        context.moveTo(x, y - 6);
        context.lineTo(x + 6, y);
        context.lineTo(x, y + 6);
        context.lineTo(x - 6, y);
        context.closePath();
      }
      context.fillStyle = selected ? '#ffffff' : site.is_example ? '#e8eef7' : '#ffb35c';
      context.fill();
      context.lineWidth = selected ? 3 : 1.5;
      context.strokeStyle = selected ? '#d3303f' : '#101722';
      context.stroke();
    });
    if (this.applied.some((v, l) => Math.abs(v - this.requested[l]!) > 1e-4)) {
      // The server has clamped the parameters: draw a line to the applied ones.
      const from = this.toPixels(this.requested);
      const to = this.toPixels(this.applied);
      context.setLineDash([4, 3]);
      context.beginPath();
      context.moveTo(from.x, from.y);
      context.lineTo(to.x, to.y);
      context.strokeStyle = colour('--text');
      context.lineWidth = 1.5;
      context.stroke();
      context.setLineDash([]);
    }
    this.drawCross(context);
  }

  private drawCross(context: CanvasRenderingContext2D): void {
    if (this.requested.length === 0) return;
    const {x, y} = this.toPixels(this.requested);
    for (const [width, style] of [[5, '#101722'], [2.2, '#ffffff']] as const) {
      context.beginPath();
      context.arc(x, y, 9, 0, 2 * Math.PI);
      for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]] as const) {
        context.moveTo(x + 5 * dx, y + 5 * dy);
        context.lineTo(x + 15 * dx, y + 15 * dy);
      }
      context.lineWidth = width;
      context.strokeStyle = style;
      context.stroke();
    }
  }

  private drawMap(context: CanvasRenderingContext2D, plot: {width: number; height: number}): void {
    const {map} = this;
    if (!map) return;
    const picture = new ImageData(map.cells, map.cells);
    for (let row = 0; row < map.cells; ++row) {
      for (let column = 0; column < map.cells; ++column) {
        const error = map.errors_mm[row * map.cells + column];
        if (error === null || error === undefined) continue;
        const at = ((map.cells - 1 - row) * map.cells + column) * 4;
        const [r, g, b] = scaleColour(error / this.topMm);
        picture.data.set([r, g, b, 255], at);
      }
    }
    const small = new OffscreenCanvas(map.cells, map.cells);
    small.getContext('2d')!.putImageData(picture, 0, 0);
    context.imageSmoothingEnabled = false;
    context.drawImage(small, margin.left, margin.top, plot.width, plot.height);
  }

  private drawAxes(
    context: CanvasRenderingContext2D, plot: {width: number; height: number}, soft: string): void {
    context.fillStyle = soft;
    context.font = '12px system-ui, sans-serif';
    const bottom = margin.top + plot.height;
    const ticks = (axis: 'x' | 'y'): number[] => {
      const [from, to] = this.range(axis);
      const step = [0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1].find((s) => (to - from) / s <= 6) ?? 2;
      const out: number[] = [];
      for (let v = Math.ceil(from / step) * step; v <= to; v += step) out.push(v);
      return out;
    };
    const [x0, x1] = this.range('x');
    const [y0, y1] = this.range('y');
    context.textAlign = 'center';
    context.textBaseline = 'top';
    for (const v of ticks('x')) {
      context.fillText(formatTick(v), margin.left + (v - x0) / (x1 - x0) * plot.width, bottom + 5);
    }
    context.fillText(
      parameterLabel(this.group!.parameters[this.x]!.name), margin.left + plot.width / 2,
      bottom + 21);
    if (this.isOneDimensional) return;
    context.textAlign = 'right';
    context.textBaseline = 'middle';
    for (const v of ticks('y')) {
      context.fillText(
        formatTick(v), margin.left - 6, margin.top + (1 - (v - y0) / (y1 - y0)) * plot.height);
    }
    context.save();
    context.translate(9, margin.top + plot.height / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = 'center';
    context.fillText(parameterLabel(this.group!.parameters[this.y]!.name), 0, 0);
    context.restore();
  }

  private plotSize(): {width: number; height: number} {
    return {
      width: Math.max(1, this.element.clientWidth - margin.left - margin.right),
      height: Math.max(1, this.element.clientHeight - margin.top - margin.bottom),
    };
  }

  private down(event: PointerEvent): void {
    if (!this.group || event.button !== 0) return;
    this.element.focus();
    const [x, y] = this.pointerPosition(event);
    let nearest = -1;
    let reach = 9;
    this.group.sites.forEach((site, i) => {
      const at = this.toPixels(site.p);
      const d = Math.hypot(at.x - x, at.y - y);
      if (d < reach) {
        reach = d;
        nearest = i;
      }
    });
    const cross = this.toPixels(this.requested);
    if (nearest >= 0 && Math.hypot(cross.x - x, cross.y - y) > 9) {
      this.actions.onSelect(nearest);
      return;
    }
    this.dragging = true;
    this.element.setPointerCapture(event.pointerId);
    this.drag(event);
  }

  private drag(event: PointerEvent): void {
    const [px, py] = this.pointerPosition(event);
    const {width, height} = this.plotSize();
    const [x0, x1] = this.range('x');
    const [y0, y1] = this.range('y');
    const clamp = (v: number): number => Math.max(0, Math.min(1, v));
    this.actions.onMove(
      x0 + clamp((px - margin.left) / width) * (x1 - x0),
      y0 + clamp(1 - (py - margin.top) / height) * (y1 - y0));
  }

  private key(event: KeyboardEvent): void {
    const step = {
      ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]}[event.key];
    if (!step || !this.group) return;
    event.preventDefault();
    const [x0, x1] = this.range('x');
    const [y0, y1] = this.range('y');
    const size = event.shiftKey ? 0.1 : 0.02;
    const bound = (v: number, from: number, to: number): number => Math.max(from, Math.min(to, v));
    this.actions.onMove(
      bound(this.requested[this.x]! + step[0]! * size * (x1 - x0), x0, x1),
      bound(this.requested[this.y]! + step[1]! * size * (y1 - y0), y0, y1));
  }

  private pointerPosition(event: PointerEvent): [number, number] {
    const box = this.element.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }
}

const labels: Readonly<Record<string, string>> = {
  start_x_m: 'Start sideways (m)', start_y_m: 'Start height (m)', start_z_m: 'Start forward (m)',
  end_x_m: 'End sideways (m)', end_y_m: 'End height (m)', end_z_m: 'End forward (m)',
  turn_rad: 'Turn (rad)', length_m: 'Length (m)', height_m: 'Height (m)',
};
/** Returns the label of a parameter, with its unit in parentheses. */
export function parameterLabel(name: string): string {
  return labels[name] ?? name;
}

function formatTick(value: number): string {
  return String(Math.round(value * 100) / 100).replace('-', '−');
}
