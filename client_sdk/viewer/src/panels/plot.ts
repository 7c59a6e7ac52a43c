import {h, setText} from '../dom.js';

/** Number of values for one minute, with two values per second. */
const maxValues = 120;

/**
 * A line plot of the last minute, with the newest value as text. The vertical axis starts at 0 and
 * ends 15 % above the largest value.
 */
export class Plot {
  readonly element: HTMLElement;
  private readonly canvas: HTMLCanvasElement;
  private readonly value: HTMLElement;
  private readonly values: number[] = [];

  constructor(label: string, private readonly format: (value: number) => string, title: string) {
    this.canvas = h('canvas', {class: 'plot-line', 'aria-hidden': 'true'});
    this.value = h('span', {class: 'plot-value'}, '–');
    this.element = h('div', {class: 'plot', title},
      h('div', {class: 'plot-head'}, h('span', {class: 'plot-label'}, label), this.value),
      this.canvas);
  }

  add(value: number): void {
    this.values.push(value);
    if (this.values.length > maxValues) this.values.shift();
    setText(this.value, this.format(value));
  }

  draw(): void {
    const {canvas, values} = this;
    const scale = Math.min(devicePixelRatio || 1, 2);
    const width = Math.round(canvas.clientWidth * scale);
    const height = Math.round(canvas.clientHeight * scale);
    if (width === 0 || height === 0) return;
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    const context = canvas.getContext('2d')!;
    context.clearRect(0, 0, width, height);
    if (values.length < 2) return;
    const style = getComputedStyle(canvas);
    let top = 1e-9;
    for (const value of values) top = Math.max(top, value);
    top *= 1.15;
    const x = (i: number): number => (1 - (values.length - 1 - i) / (maxValues - 1)) * width;
    const y = (v: number): number =>
      height - 1.5 * scale - (Math.max(v, 0) / top) * (height - 3 * scale);
    context.beginPath();
    values.forEach((v, i) => (i === 0 ? context.moveTo(x(i), y(v)) : context.lineTo(x(i), y(v))));
    context.lineWidth = 1.5 * scale;
    context.lineJoin = 'round';
    context.strokeStyle = style.color;
    context.stroke();
    context.lineTo(x(values.length - 1), height);
    context.lineTo(x(0), height);
    context.closePath();
    context.globalAlpha = 0.14;
    context.fillStyle = style.color;
    context.fill();
    context.globalAlpha = 1;
  }
}

/** Formats a number of bytes, for example "4.2 KB". 1 KB is 1000 bytes. */
export function formatBytes(bytes: number): string {
  if (bytes < 1000) return `${bytes.toFixed(0)} B`;
  if (bytes < 1e6) return `${(bytes / 1e3).toFixed(bytes < 1e4 ? 1 : 0)} KB`;
  return `${(bytes / 1e6).toFixed(bytes < 1e7 ? 2 : 1)} MB`;
}
