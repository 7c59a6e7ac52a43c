// Two parameters of a group as a plane: the map of errors behind, examples and pseudoexamples as
// points, and the point that is wanted, which can be dragged.

import {h} from '../dom.js';
import type {ErrorMap, Group} from './library_client.js';

/** Dark blue to yellow by lightness, so that it reads without colour vision (after cividis). */
const scale: readonly [number, number, number][] = [
  [0, 34, 78], [33, 59, 110], [76, 84, 108], [108, 110, 114], [143, 138, 119], [184, 169, 105],
  [228, 203, 76], [254, 232, 56],
];

export function scaleColour(share: number): [number, number, number] {
  const at = Math.max(0, Math.min(1, share)) * (scale.length - 1);
  const i = Math.min(scale.length - 2, Math.floor(at));
  const f = at - i;
  return [0, 1, 2].map((k) => Math.round(
    scale[i]![k]! + f * (scale[i + 1]![k]! - scale[i]![k]!))) as [number, number, number];
}

const margin = {left: 46, right: 14, top: 12, bottom: 38};

export class ParameterPlane {
  readonly element: HTMLCanvasElement;
  group: Group | null = null;
  map: ErrorMap | null = null;
  x = 0;
  y = 1;
  wanted: number[] = [];
  applied: readonly number[] = [];
  example = -1;
  /** Errors at the top of the colour scale, mm. */
  topMm = 1;
  private dragging = false;

  constructor(private readonly actions: {
    move(x: number, y: number): void;
    choose(site: number): void;
  }) {
    this.element = h('canvas', {
      class: 'plane', tabindex: 0, role: 'application', 'aria-label':
        'Parameters of the group. Drag the cross, or move it by the arrow keys; click a point to play ' +
        'that example.'});
    this.element.addEventListener('pointerdown', (e) => this.down(e));
    this.element.addEventListener('pointermove', (e) => {
      if (this.dragging) this.drag(e);
    });
    for (const name of ['pointerup', 'pointercancel'] as const) {
      this.element.addEventListener(name, () => (this.dragging = false));
    }
    this.element.addEventListener('keydown', (e) => this.key(e));
  }

  /** What the axes go over: the map's, else the examples and 10 % around them. */
  range(axis: 'x' | 'y'): [number, number] {
    const index = axis === 'x' ? this.x : this.y;
    const parameter = this.group?.parameters[index];
    if (!parameter) return [0, 1];
    const grown = 0.1 * (parameter.max - parameter.min) || 0.05;
    return [parameter.min - grown, parameter.max + grown];
  }
  get flat(): boolean {
    return this.x === this.y;
  }

  /** CSS pixels within the canvas. */
  place(p: readonly number[]): {x: number; y: number} {
    const {width, height} = this.plot();
    const [x0, x1] = this.range('x');
    const [y0, y1] = this.range('y');
    return {
      x: margin.left + (p[this.x]! - x0) / (x1 - x0) * width,
      y: this.flat ? margin.top + height / 2 :
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
    const plot = this.plot();
    this.drawMap(context, plot);
    context.strokeStyle = colour('--border');
    context.lineWidth = 1;
    context.strokeRect(margin.left, margin.top, plot.width, plot.height);
    this.drawAxes(context, plot, colour('--soft'));
    group.sites.forEach((site, i) => {
      const {x, y} = this.place(site.p);
      context.beginPath();
      if (site.is_example) context.arc(x, y, i === this.example ? 6.5 : 4.5, 0, 2 * Math.PI);
      else {
        context.moveTo(x, y - 6);
        context.lineTo(x + 6, y);
        context.lineTo(x, y + 6);
        context.lineTo(x - 6, y);
        context.closePath();
      }
      context.fillStyle = i === this.example ? '#ffffff' : site.is_example ? '#e8eef7' : '#ffb35c';
      context.fill();
      context.lineWidth = i === this.example ? 3 : 1.5;
      context.strokeStyle = i === this.example ? '#d3303f' : '#101722';
      context.stroke();
    });
    if (this.applied.length > 0 && this.applied.some((v, l) => Math.abs(v - this.wanted[l]!) > 1e-4)) {
      // Clamped: what is done instead.
      const from = this.place(this.wanted);
      const to = this.place(this.applied);
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
    if (this.wanted.length === 0) return;
    const {x, y} = this.place(this.wanted);
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
      context.fillText(short(v), margin.left + (v - x0) / (x1 - x0) * plot.width, bottom + 5);
    }
    context.fillText(label(this.group!.parameters[this.x]!.name), margin.left + plot.width / 2, bottom + 21);
    if (this.flat) return;
    context.textAlign = 'right';
    context.textBaseline = 'middle';
    for (const v of ticks('y')) {
      context.fillText(short(v), margin.left - 6, margin.top + (1 - (v - y0) / (y1 - y0)) * plot.height);
    }
    context.save();
    context.translate(9, margin.top + plot.height / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = 'center';
    context.fillText(label(this.group!.parameters[this.y]!.name), 0, 0);
    context.restore();
  }

  private plot(): {width: number; height: number} {
    return {
      width: Math.max(1, this.element.clientWidth - margin.left - margin.right),
      height: Math.max(1, this.element.clientHeight - margin.top - margin.bottom),
    };
  }

  private down(event: PointerEvent): void {
    if (!this.group || event.button !== 0) return;
    this.element.focus();
    const [x, y] = this.where(event);
    let nearest = -1;
    let reach = 9;
    this.group.sites.forEach((site, i) => {
      const at = this.place(site.p);
      const d = Math.hypot(at.x - x, at.y - y);
      if (d < reach) {
        reach = d;
        nearest = i;
      }
    });
    const cross = this.place(this.wanted);
    if (nearest >= 0 && Math.hypot(cross.x - x, cross.y - y) > 9) {
      this.actions.choose(nearest);
      return;
    }
    this.dragging = true;
    this.element.setPointerCapture(event.pointerId);
    this.drag(event);
  }

  private drag(event: PointerEvent): void {
    const [px, py] = this.where(event);
    const {width, height} = this.plot();
    const [x0, x1] = this.range('x');
    const [y0, y1] = this.range('y');
    const clamp = (v: number): number => Math.max(0, Math.min(1, v));
    this.actions.move(
      x0 + clamp((px - margin.left) / width) * (x1 - x0),
      y0 + clamp(1 - (py - margin.top) / height) * (y1 - y0));
  }

  private key(event: KeyboardEvent): void {
    const step = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]}[event.key];
    if (!step || !this.group) return;
    event.preventDefault();
    const [x0, x1] = this.range('x');
    const [y0, y1] = this.range('y');
    const size = event.shiftKey ? 0.1 : 0.02;
    const bound = (v: number, from: number, to: number): number => Math.max(from, Math.min(to, v));
    this.actions.move(
      bound(this.wanted[this.x]! + step[0]! * size * (x1 - x0), x0, x1),
      bound(this.wanted[this.y]! + step[1]! * size * (y1 - y0), y0, y1));
  }

  private where(event: PointerEvent): [number, number] {
    const box = this.element.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }
}

const labels: Readonly<Record<string, string>> = {
  start_x_m: 'start aside, m', start_y_m: 'start up, m', start_z_m: 'start ahead, m',
  end_x_m: 'end aside, m', end_y_m: 'end up, m', end_z_m: 'end ahead, m', turn_rad: 'turn, rad',
  length_m: 'length, m', height_m: 'height, m',
};
/** What a parameter is called on the page. */
export function label(name: string): string {
  return labels[name] ?? name;
}

function short(value: number): string {
  return String(Math.round(value * 100) / 100).replace('-', '−');
}
