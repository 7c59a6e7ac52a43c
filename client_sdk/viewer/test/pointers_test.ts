import assert from 'node:assert/strict';
import {test} from 'node:test';

import {listenToPointers} from '../src/scene/camera.js';

/** An element that receives pointer events, and the actions that they caused. */
class Scene extends EventTarget {
  readonly calls: string[] = [];

  constructor() {
    super();
    listenToPointers(this as unknown as HTMLElement, {
      orbit: (dx, dy) => this.calls.push(`orbit ${dx} ${dy}`),
      pan: (dx, dy) => this.calls.push(`pan ${dx} ${dy}`),
      zoom: () => this.calls.push('zoom'),
      click: (x, y, twice) => this.calls.push(`${twice ? 'double ' : ''}click ${x} ${y}`),
    });
  }
  setPointerCapture(): void {}
  getBoundingClientRect(): {left: number; top: number} {
    return {left: 0, top: 0};
  }
  dispatch(type: string, clientX: number, clientY: number, timeStamp: number, more = {}): void {
    const event = new Event(type);
    const buttons = type === 'pointerup' ? 0 : 1;
    for (const [name, value] of Object.entries({
      pointerId: 1, button: 0, buttons, shiftKey: false, clientX, clientY, timeStamp, ...more})) {
      Object.defineProperty(event, name, {value});
    }
    this.dispatchEvent(event);
  }
}

test('a drag orbits by its whole distance, however many events it consists of', () => {
  for (const stops of [[80], [40, 80], [2, 4, 80], [1, 2, 3, 4, 5, 6, 7, 80]]) {
    const scene = new Scene();
    scene.dispatch('pointerdown', 100, 50, 0);
    for (const x of stops) scene.dispatch('pointermove', 100 + x, 50, 10);
    scene.dispatch('pointerup', 180, 50, 20);
    const turns = scene.calls.map((text) => text.split(' '));
    assert.ok(turns.every(([what, , dy]) => what === 'orbit' && dy === '0'), scene.calls.join());
    assert.equal(turns.reduce((sum, [, dx]) => sum + Number(dx), 0), 80, stops.join());
  }
});

test('a press that hardly moves is a click', () => {
  const scene = new Scene();
  scene.dispatch('pointerdown', 100, 50, 0);
  // The pointer trembles.
  for (let i = 0; i < 20; ++i) scene.dispatch('pointermove', 100 + i % 4, 50, 10);
  scene.dispatch('pointerup', 103, 50, 20);
  assert.deepEqual(scene.calls, ['click 103 50']);
});

test('recognises clicks and double clicks by event timestamps', () => {
  const scene = new Scene();
  for (const [down, up] of [[1000, 1050], [1200, 1250], [3000, 3700], [4000, 4010]] as const) {
    scene.dispatch('pointerdown', 9, 9, down);
    scene.dispatch('pointerup', 9, 9, up);
  }
  // The third press was too long for a click.
  assert.deepEqual(scene.calls, ['click 9 9', 'double click 9 9', 'click 9 9']);
});
