// Text over the scene: the names of the worlds, and the id and joint names of the selected avatar.

import type {WorldView} from './world_view.js';
import {projected} from './world_view.js';

/** A joint's name and its position in CSS pixels. */
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

  /** Reads the theme's colours. */
  restyle(): void {
    const style = getComputedStyle(document.documentElement);
    this.colours = {
      text: style.getPropertyValue('--text'), halo: style.getPropertyValue('--halo'),
      accent: style.getPropertyValue('--accent'), line: style.getPropertyValue('--border'),
    };
  }

  draw(panes: readonly {readonly view: WorldView}[], jointNames: boolean): void {
    const selected = panes.find(({view}) => view.indexOf(view.selectedAvatar) >= 0)?.view;
    const several = panes.length > 1;
    // While there is no text, hiding the canvas saves the browser from compositing it.
    this.canvas.hidden = !selected && !several;
    if (!selected && !several && !this.dirty) return;
    const {context} = this;
    context.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    this.dirty = false;
    if (several) {
      this.dirty = true;
      panes.forEach(({view}, i) => {
        if (i > 0) {
          context.strokeStyle = this.colours.line;
          context.lineWidth = 2;
          context.beginPath();
          if (view.viewport.x > 0) {
            context.moveTo(view.viewport.x, 0);
            context.lineTo(view.viewport.x, this.height);
          } else {
            context.moveTo(0, view.viewport.y);
            context.lineTo(this.width, view.viewport.y);
          }
          context.stroke();
        }
        const {freeArea} = view;
        this.drawText(view.name, freeArea.x + freeArea.width / 2, freeArea.y + 20, '600 14px',
          'center', this.colours.text);
      });
    }
    if (!selected?.crowd) return;
    this.dirty = true;
    const crowd = selected.crowd;
    const i = selected.indexOf(selected.selectedAvatar);
    const n = crowd.skeleton.jointCount;
    let top = Infinity;
    let topX = 0;
    let low = Infinity;
    let high = -Infinity;
    const joints: Joint[] = [];
    for (let j = 0; j < n; ++j) {
      if (!selected.project(crowd.positions, (i * n + j) * 3)) continue;
      const {x, y} = projected;
      if (y < top) {
        top = y;
        topX = x;
      }
      low = Math.min(low, x);
      high = Math.max(high, x);
      if (jointNames) joints.push({name: crowd.skeleton.names[j] ?? '', x, y});
    }
    if (jointNames) this.drawJointNames(joints, low - 26, high + 26);
    if (top < Infinity) {
      const heightPx = crowd.heightM * selected.viewport.height / (projected.z || 5);
      const lift = Math.max(10, 0.117 * heightPx);
      this.drawText(`${selected.selectedAvatar}`, topX, top - lift, '600 13px', 'center',
        this.colours.accent);
    }
  }

  /**
   * Draws a column of names on each side of the avatar, with a line from each name to its joint.
   */
  private drawJointNames(joints: readonly Joint[], left: number, right: number): void {
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
        this.drawText(joint.name, at, y + 4, '12px', align, this.colours.text);
        y += space;
      }
    }
  }

  private drawText(
    text: string, x: number, y: number, font: string, align: CanvasTextAlign,
    colour: string): void {
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
