import assert from 'node:assert/strict';
import {test} from 'node:test';

import {listenToPointers} from '../src/scene/camera.js';

/** An element, and what pointers on it came to. */
class Scene extends EventTarget {
  readonly heard: string[] = [];

  constructor() {
    super();
    listenToPointers(this as unknown as HTMLElement, {
      orbit: (dx, dy) => this.heard.push(`orbit ${dx} ${dy}`),
      pan: (dx, dy) => this.heard.push(`pan ${dx} ${dy}`),
      zoom: () => this.heard.push('zoom'),
      click: (x, y, twice) => this.heard.push(`${twice ? 'double ' : ''}click ${x} ${y}`),
    });
  }
  setPointerCapture(): void {}
  getBoundingClientRect(): {left: number; top: number} {
    return {left: 0, top: 0};
  }
  tell(type: string, clientX: number, clientY: number, timeStamp: number, more = {}): void {
    const event = new Event(type);
    const buttons = type === 'pointerup' ? 0 : 1;
    for (const [name, value] of Object.entries({
      pointerId: 1, button: 0, buttons, shiftKey: false, clientX, clientY, timeStamp, ...more})) {
      Object.defineProperty(event, name, {value});
    }
    this.dispatchEvent(event);
  }
}

test('a drag turns the view by all of its way, in however many events it comes', () => {
  for (const stops of [[80], [40, 80], [2, 4, 80], [1, 2, 3, 4, 5, 6, 7, 80]]) {
    const scene = new Scene();
    scene.tell('pointerdown', 100, 50, 0);
    for (const x of stops) scene.tell('pointermove', 100 + x, 50, 10);
    scene.tell('pointerup', 180, 50, 20);
    const turns = scene.heard.map((text) => text.split(' '));
    assert.ok(turns.every(([what, , dy]) => what === 'orbit' && dy === '0'), scene.heard.join());
    assert.equal(turns.reduce((sum, [, dx]) => sum + Number(dx), 0), 80, stops.join());
  }
});

test('a press that hardly moves is a click and turns nothing', () => {
  const scene = new Scene();
  scene.tell('pointerdown', 100, 50, 0);
  // A hand that trembles, however often.
  for (let i = 0; i < 20; ++i) scene.tell('pointermove', 100 + i % 4, 50, 10);
  scene.tell('pointerup', 103, 50, 20);
  assert.deepEqual(scene.heard, ['click 103 50']);
});

test('clicks are told by when they were made', () => {
  const scene = new Scene();
  for (const [down, up] of [[1000, 1050], [1200, 1250], [3000, 3700], [4000, 4010]] as const) {
    scene.tell('pointerdown', 9, 9, down);
    scene.tell('pointerup', 9, 9, up);
  }
  // The third was held.
  assert.deepEqual(scene.heard, ['click 9 9', 'double click 9 9', 'click 9 9']);
});
