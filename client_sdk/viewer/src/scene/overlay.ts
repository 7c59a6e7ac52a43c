// Text over the scene: names of worlds side by side, the chosen avatar's number, names of joints.

import type {WorldView} from './world_view.js';
import {projected} from './world_view.js';

interface Joint {
  name: string;
  x: number;
  y: number;
}

export class Overlay {
  private readonly context: CanvasRenderingContext2D;
  private width = 0;
  private height = 0;
  private scale = 1;
  private colours = {text: '', halo: '', accent: '', line: ''};
  private dirty = true;

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.context = canvas.getContext('2d')!;
  }

  resize(width: number, height: number): void {
    this.width = width;
    this.height = height;
    this.scale = Math.min(devicePixelRatio || 1, 2);
    this.canvas.width = Math.round(width * this.scale);
    this.canvas.height = Math.round(height * this.scale);
  }

  restyle(): void {
    const style = getComputedStyle(document.documentElement);
    this.colours = {
      text: style.getPropertyValue('--text'), halo: style.getPropertyValue('--halo'),
      accent: style.getPropertyValue('--accent'), line: style.getPropertyValue('--border'),
    };
  }

  draw(shown: readonly {readonly view: WorldView}[], jointNames: boolean): void {
    const chosen = shown.find(({view}) => view.chosen !== 0 && view.indexOf(view.chosen) >= 0)?.view;
    const several = shown.length > 1;
    // A layer the less for the browser to put over the scene while there is nothing to write.
    this.canvas.hidden = !chosen && !several;
    if (!chosen && !several && !this.dirty) return;
    const {context} = this;
    context.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    this.dirty = false;
    if (several) {
      this.dirty = true;
      shown.forEach(({view}, i) => {
        if (i > 0) {
          context.strokeStyle = this.colours.line;
          context.lineWidth = 2;
          context.beginPath();
          if (view.box.x > 0) {
            context.moveTo(view.box.x, 0);
            context.lineTo(view.box.x, this.height);
          } else {
            context.moveTo(0, view.box.y);
            context.lineTo(this.width, view.box.y);
          }
          context.stroke();
        }
        this.text(view.name, view.free.x + view.free.width / 2, view.free.y + 20, '600 14px', 'center',
          this.colours.text);
      });
    }
    if (!chosen?.crowd) return;
    this.dirty = true;
    const crowd = chosen.crowd;
    const i = chosen.indexOf(chosen.chosen);
    const n = crowd.skeleton.jointCount;
    let top = Infinity;
    let topX = 0;
    let low = Infinity;
    let high = -Infinity;
    const joints: Joint[] = [];
    for (let j = 0; j < n; ++j) {
      if (!chosen.project(crowd.positions, (i * n + j) * 3)) continue;
      const {x, y} = projected;
      if (y < top) {
        top = y;
        topX = x;
      }
      low = Math.min(low, x);
      high = Math.max(high, x);
      if (jointNames) joints.push({name: crowd.skeleton.names[j] ?? '', x, y});
    }
    if (jointNames) this.nameJoints(joints, low - 26, high + 26);
    if (top < Infinity) {
      const lift = Math.max(10, (crowd.heightM * 0.13 * chosen.box.height) / (projected.z || 5) * 0.9);
      this.text(`${chosen.chosen}`, topX, top - lift, '600 13px', 'center', this.colours.accent);
    }
  }

  /** Names in a column on either side of the figure, each with a line to its joint. */
  private nameJoints(joints: readonly Joint[], left: number, right: number): void {
    const {context} = this;
    const byX = [...joints].sort((a, b) => a.x - b.x);
    const half = Math.floor(byX.length / 2);
    for (const [column, at, align] of [
      [byX.slice(0, half), left, 'right'], [byX.slice(half), right, 'left']] as const) {
      column.sort((a, b) => a.y - b.y);
      const space = 14;
      const middle = column.reduce((sum, joint) => sum + joint.y, 0) / Math.max(1, column.length);
      let y = middle - (column.length - 1) * space / 2;
      for (const joint of column) {
        context.strokeStyle = this.colours.accent;
        context.globalAlpha = 0.55;
        context.lineWidth = 1;
        context.beginPath();
        context.moveTo(at + (align === 'right' ? 3 : -3), y);
        context.lineTo(joint.x, joint.y);
        context.stroke();
        context.globalAlpha = 1;
        context.fillStyle = this.colours.accent;
        context.beginPath();
        context.arc(joint.x, joint.y, 3, 0, 7);
        context.fill();
        this.text(joint.name, at, y + 4, '12px', align, this.colours.text);
        y += space;
      }
    }
  }

  private text(
    text: string, x: number, y: number, font: string, align: CanvasTextAlign, colour: string): void {
    const {context} = this;
    context.font = `${font} system-ui, sans-serif`;
    context.textAlign = align;
    context.lineWidth = 3;
    context.lineJoin = 'round';
    context.strokeStyle = this.colours.halo;
    context.strokeText(text, x, y);
    context.fillStyle = colour;
    context.fillText(text, x, y);
  }
}
