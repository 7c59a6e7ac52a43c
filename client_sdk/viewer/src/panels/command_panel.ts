// Commands: steps, jumps, standing, avatars come and go.

import {Slider, button, h, press, setText} from '../dom.js';
import type {MovementRequest, Vec3} from '../sdk.js';
import type {TerrainName} from '../terrain_surface.js';

/** What a click on the ground is. */
export type GroundTool = 'feet' | 'walk';

export interface DriveActions {
  /** Sends movements to whoever is driven. */
  request(make: (avatar: number) => MovementRequest): void;
  spawn(count: number): void;
  remove(): void;
  cancel(): void;
  wander(): void;
  everybody(on: boolean): void;
  /** Clicks on the ground ask for this from now on. */
  tool(tool: GroundTool | null): void;
  /** To x, z, past which the next walk is to come first. */
  pass(x: number, z: number): void;
  /** Heading null: the way it comes. */
  walk(x: number, z: number, headingRad: number | null): void;
  ground(name: TerrainName): void;
  /** Begins with a layer, or ends it. */
  layer(name: string): void;
  /** Plants feet, or no more. */
  planting(): void;
}

const grounds: readonly (readonly [TerrainName, string])[] = [
  ['flat', 'Flat'], ['stairs', 'Stairs'], ['ramp', 'Ramp'], ['stones', 'Slabs'], ['hills', 'Hills']];

export class DrivePanel {
  readonly element: HTMLElement;
  private readonly target = h('p', {class: 'target', 'aria-live': 'polite'});
  private readonly message = h('p', {class: 'message', role: 'status'});
  private readonly length = new Slider('step-length', 'Step length', 0, 0.9, 0.01, 0.6,
    (v) => `${v.toFixed(2)} m`);
  private readonly turn = new Slider('turn', 'Turn', -60, 60, 1, 0,
    (v) => v === 0 ? 'straight' : `${Math.abs(v)}° ${v > 0 ? 'left' : 'right'}`);
  private readonly jumpLength = new Slider('jump-length', 'Jump by', 0.2, 2, 0.05, 0.9,
    (v) => `${v.toFixed(2)} m`);
  private readonly seconds = new Slider('stand-seconds', 'Stand for', 0.2, 5, 0.1, 1,
    (v) => `${v.toFixed(1)} s`);
  private readonly wanderButton: HTMLButtonElement;
  private readonly one: HTMLButtonElement[] = [];
  private readonly tools: Readonly<Record<GroundTool, HTMLButtonElement>>;
  private readonly toolsRow: HTMLElement;
  private readonly exact = h('input', {type: 'checkbox', id: 'drive-must'});
  private readonly exactRow: HTMLElement;
  private canRefuse = false;
  private readonly walkX = h('input', {type: 'number', id: 'walk-x', step: 'any', value: '0'});
  private readonly walkZ = h('input', {type: 'number', id: 'walk-z', step: 'any', value: '2'});
  private readonly walkHeading = h('input',
    {type: 'number', id: 'walk-heading', step: 'any', placeholder: 'any'});
  private readonly walkRow: HTMLElement;
  private readonly planting: HTMLButtonElement;
  private readonly layerButtons = new Map<string, HTMLButtonElement>();
  private readonly layers = h('div', {class: 'buttons three'});
  private readonly layersRow = h('div', {class: 'tool-row layers', role: 'group', 'aria-label': 'While it moves'},
    h('span', {}, 'While it moves'), this.layers);
  private readonly ground = h('select', {id: 'drive-ground'});
  private readonly groundRow: HTMLElement;
  private messageUntil = 0;
  /** What a click on the ground is now. */
  tool: GroundTool | null = null;

  constructor(private readonly actions: DriveActions) {
    const all = h('input', {type: 'checkbox', id: 'drive-all'});
    all.addEventListener('change', () => actions.everybody(all.checked));
    const make = (label: string, key: string, act: () => void, options: {class?: string} = {}) => {
      const element = button(label, {...options, key}, act);
      this.one.push(element);
      return element;
    };
    this.wanderButton = button('Let them wander', {icon: 'wander', key: 'G', class: 'wide'},
      () => actions.wander());
    this.planting = make('Plant feet', 'K', () => actions.planting());
    this.planting.id = 'drive-planting';
    this.planting.hidden = true;
    this.layers.append(this.planting);
    this.tools = {
      feet: button('Place feet', {key: 'T'}, () => this.toggleTool('feet')),
      walk: button('Send there', {key: 'M'}, () => this.toggleTool('walk')),
    };
    for (const tool of Object.values(this.tools)) {
      tool.hidden = true;
      press(tool, false);
    }
    this.tools.feet.id = 'drive-place';
    this.tools.walk.id = 'drive-walk';
    this.toolsRow = h('div', {class: 'tool-row', role: 'group', 'aria-label': 'Clicks on the ground'},
      h('span', {}, 'Clicks on the ground'),
      h('div', {class: 'buttons two'}, this.tools.feet, this.tools.walk));
    this.exactRow = h('label', {class: 'check', for: this.exact.id, title: 'A foot that cannot land there stays'},
      this.exact, 'There or not at all');
    this.exactRow.hidden = true;
    const field = (input: HTMLInputElement, label: string) => {
      input.addEventListener('keydown', (e) => {
        if (e.key === 'Enter') this.walk();
      });
      return h('div', {}, h('label', {for: input.id}, label), input);
    };
    this.walkRow = h('div', {class: 'walk', role: 'group', 'aria-label': 'Walk to a place'},
      h('div', {class: 'fields'}, field(this.walkX, 'To x, m'), field(this.walkZ, 'z, m'),
        field(this.walkHeading, 'Heading, °')),
      h('div', {class: 'buttons two'},
        make('Pass by', '', () => this.pass()), make('Walk there', '', () => this.walk())));
    this.ground.append(h('option', {value: ''}, 'As it is'),
      ...grounds.map(([name, label]) => h('option', {value: name}, label)));
    this.ground.addEventListener('change', () => {
      if (this.ground.value !== '') actions.ground(this.ground.value as TerrainName);
    });
    this.groundRow = h('div', {class: 'row'},
      h('label', {for: 'drive-ground'}, 'Ground of this world'), this.ground);
    this.toolsRow.hidden = this.walkRow.hidden = this.groundRow.hidden = this.layersRow.hidden = true;
    this.element = h('div', {class: 'panel-body'},
      this.target,
      h('label', {class: 'check', for: 'drive-all'}, all, 'Command everybody here'),
      this.toolsRow, this.exactRow, this.length.element, this.turn.element,
      h('div', {class: 'buttons three'},
        make('Left foot', 'A', () => this.step('left')),
        make('Step', 'W', () => this.step('auto'), {class: 'primary'}),
        make('Right foot', 'D', () => this.step('right'))),
      h('div', {class: 'pair'}, this.jumpLength.element, make('Jump', 'J', () => this.jump())),
      h('div', {class: 'pair'}, this.seconds.element, make('Stand', 'S', () => this.stand())),
      this.walkRow, this.layersRow,
      h('div', {class: 'buttons three'},
        make('Clear queue', 'X', () => actions.cancel()),
        button('Spawn', {key: 'B'}, () => actions.spawn(1)),
        make('Remove', 'Delete', () => actions.remove())),
      this.wanderButton, this.groundRow, this.message);
  }

  /** What the server can do is offered. */
  offer(footprints: boolean, walks: boolean, terrain: boolean, refusals: boolean): void {
    this.canRefuse = refusals;
    this.exactRow.hidden = !refusals || this.tool !== 'feet';
    this.tools.feet.hidden = !footprints;
    this.tools.walk.hidden = this.walkRow.hidden = !walks;
    this.toolsRow.hidden = !footprints && !walks;
    this.groundRow.hidden = !terrain;
    if (this.tool !== null && this.tools[this.tool].hidden) this.toggleTool(this.tool);
  }
  /** Planting can be switched; `on`: their feet are planted. */
  offerPlanting(can: boolean, on: boolean): void {
    this.planting.hidden = !can;
    press(this.planting, on);
    this.layersRow.hidden = !can && this.layerButtons.size === 0;
  }
  /** A button for each layer of the world. */
  offerLayers(names: readonly string[], plays: (name: string) => boolean): void {
    if (names.join(' ') !== [...this.layerButtons.keys()].join(' ')) {
      this.layerButtons.clear();
      for (const name of names) {
        const element = button(name.charAt(0).toUpperCase() + name.slice(1), {},
          () => this.actions.layer(name));
        element.id = `drive-layer-${name}`;
        this.layerButtons.set(name, element);
      }
      this.layers.replaceChildren(this.planting, ...this.layerButtons.values());
      this.layersRow.hidden = this.planting.hidden && names.length === 0;
    }
    for (const [name, element] of this.layerButtons) press(element, plays(name));
  }
  /** Takes it up instead of the other, or lays it down. */
  toggleTool(tool: GroundTool): void {
    if (this.tools[tool].hidden && this.tool !== tool) return;
    this.tool = this.tool === tool ? null : tool;
    for (const name of ['feet', 'walk'] as const) press(this.tools[name], this.tool === name);
    this.exactRow.hidden = !this.canRefuse || this.tool !== 'feet';
    this.actions.tool(this.tool);
  }
  /** A foot that cannot land where it is asked to is not to step at all. */
  get mustBeMet(): boolean {
    return this.canRefuse && this.exact.checked;
  }
  /** A walk was asked for on the ground. */
  showGoal(atM: Vec3, headingRad: number | null): void {
    this.walkX.value = atM[0].toFixed(2);
    this.walkZ.value = atM[2].toFixed(2);
    this.walkHeading.value = headingRad === null ? '' : (headingRad * 180 / Math.PI).toFixed(0);
  }
  private place(): {x: number; z: number} | null {
    const [x, z] = [this.walkX.valueAsNumber, this.walkZ.valueAsNumber];
    if (Number.isFinite(x) && Number.isFinite(z)) return {x, z};
    this.say('A place is x and z in metres.');
    return null;
  }
  private pass(): void {
    const place = this.place();
    if (place) this.actions.pass(place.x, place.z);
  }
  private walk(): void {
    const place = this.place();
    const degreesLeft = this.walkHeading.valueAsNumber;
    if (place) {
      this.actions.walk(
        place.x, place.z, Number.isFinite(degreesLeft) ? degreesLeft * Math.PI / 180 : null);
    }
  }
  /** Somebody gave the world a ground; nobody knows which of ours it is. */
  forgetGround(): void {
    this.ground.value = '';
  }

  step(foot: 'auto' | 'left' | 'right'): void {
    const lengthM = this.length.value;
    const turnRad = this.turn.value * Math.PI / 180;
    this.actions.request((avatar) => ({avatar, type: 'step', foot, lengthM, turnRad}));
  }
  jump(): void {
    const lengthM = this.jumpLength.value;
    const turnRad = this.turn.value * Math.PI / 180;
    this.actions.request((avatar) => ({avatar, type: 'jump', lengthM, turnRad}));
  }
  stand(): void {
    const seconds = this.seconds.value;
    this.actions.request((avatar) => ({avatar, type: 'stand', seconds}));
  }
  nudgeTurn(degreesMore: number): void {
    this.turn.value = this.turn.value + degreesMore;
  }
  nudgeLength(more: number): void {
    this.length.value = this.length.value + more;
  }

  show(target: string, drivable: boolean, wandering: number): void {
    setText(this.target, target);
    for (const element of [...this.one, ...this.layerButtons.values()]) element.disabled = !drivable;
    press(this.wanderButton, wandering > 0);
    const label = this.wanderButton.querySelector('span')!;
    setText(label, wandering > 0 ? `Stop wandering (${wandering})` : 'Let them wander');
    this.wanderButton.setAttribute('aria-label', label.textContent!);
    if (this.messageUntil && performance.now() > this.messageUntil) {
      this.messageUntil = 0;
      setText(this.message, '');
    }
  }

  say(text: string): void {
    setText(this.message, text);
    this.messageUntil = performance.now() + 8000;
  }
}
