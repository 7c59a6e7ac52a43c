// The command panel: movements, layers, spawning and removing avatars, and the terrain.

import {Slider, button, h, setPressed, setText} from '../dom.js';
import type {SampleTerrainName} from '../sample_terrains.js';
import type {MovementRequest, Vec3} from '../sdk.js';

/** Tools for clicks on the ground. Each requests a type of movement. */
export type ClickTool = 'step' | 'walk';

export interface CommandActions {
  /** Requests a movement for every avatar that receives commands. */
  request(make: (avatar: number) => MovementRequest): void;
  spawn(count: number): void;
  remove(): void;
  cancel(): void;
  toggleRandomWalk(): void;
  setAllAvatars(on: boolean): void;
  /** Sets the tool for clicks on the ground. Null: clicks select avatars. */
  setTool(tool: ClickTool | null): void;
  addWaypoint(x: number, z: number): void;
  /** Requests a walk. If `headingRad` is null, the avatar keeps the heading it arrives with. */
  walkTo(x: number, z: number, headingRad: number | null): void;
  setTerrain(name: SampleTerrainName): void;
  toggleLayer(name: string): void;
  togglePlanting(): void;
}

/** Time for which a message stays in the panel. */
const messageMs = 8000;

const sampleTerrains: readonly (readonly [SampleTerrainName, string])[] = [
  ['flat', 'Flat'], ['stairs', 'Stairs'], ['ramp', 'Ramp'], ['slabs', 'Slabs'], ['hills', 'Hills']];

export class CommandPanel {
  readonly element: HTMLElement;
  /** The active tool; null if clicks on the ground select avatars. */
  tool: ClickTool | null = null;

  private readonly target = h('p', {class: 'target', 'aria-live': 'polite'});
  private readonly message = h('p', {class: 'message', role: 'status'});
  private readonly length = new Slider('step-length', 'Step length', 0, 0.9, 0.01, 0.6,
    (v) => `${v.toFixed(2)} m`);
  private readonly turn = new Slider('turn', 'Turn', -60, 60, 1, 0,
    (v) => v === 0 ? 'straight' : `${Math.abs(v)}° ${v > 0 ? 'left' : 'right'}`);
  private readonly jumpLength = new Slider('jump-length', 'Jump length', 0.2, 2, 0.05, 0.9,
    (v) => `${v.toFixed(2)} m`);
  private readonly seconds = new Slider('stand-seconds', 'Stand duration', 0.2, 5, 0.1, 1,
    (v) => `${v.toFixed(1)} s`);
  private readonly randomWalkButton: HTMLButtonElement;
  /** Buttons that are disabled while no avatar receives commands. */
  private readonly avatarButtons: HTMLButtonElement[] = [];
  private readonly toolButtons: Readonly<Record<ClickTool, HTMLButtonElement>>;
  private readonly toolRow: HTMLElement;
  private readonly exactOnlyBox = h('input', {type: 'checkbox', id: 'command-exact-only'});
  private readonly exactOnlyRow: HTMLElement;
  private connected = false;
  private readonly walkX = h('input', {type: 'number', id: 'walk-x', step: 'any', value: '0'});
  private readonly walkZ = h('input', {type: 'number', id: 'walk-z', step: 'any', value: '2'});
  private readonly walkHeading = h('input',
    {type: 'number', id: 'walk-heading', step: 'any', placeholder: 'any'});
  private readonly walkRow: HTMLElement;
  private readonly plantingButton: HTMLButtonElement;
  private readonly layerButtons = new Map<string, HTMLButtonElement>();
  private readonly layerGroup = h('div', {class: 'buttons three'});
  private readonly layerRow = h('div',
    {class: 'tool-row layers', role: 'group', 'aria-label': 'While moving'},
    h('span', {}, 'While moving'), this.layerGroup);
  private readonly terrainSelect = h('select', {id: 'command-terrain'});
  private readonly terrainRow: HTMLElement;
  private messageUntilMs = 0;

  constructor(private readonly actions: CommandActions) {
    const all = h('input', {type: 'checkbox', id: 'command-all'});
    all.addEventListener('change', () => actions.setAllAvatars(all.checked));
    const make = (label: string, key: string, act: () => void, options: {class?: string} = {}) => {
      const element = button(label, {...options, key}, act);
      this.avatarButtons.push(element);
      return element;
    };
    this.randomWalkButton = button('Walk randomly', {icon: 'randomWalk', key: 'G', class: 'wide'},
      () => actions.toggleRandomWalk());
    this.plantingButton = make('Plant feet', 'K', () => actions.togglePlanting());
    this.plantingButton.id = 'command-planting';
    this.plantingButton.hidden = true;
    this.layerGroup.append(this.plantingButton);
    this.toolButtons = {
      step: button('Step there', {key: 'T'}, () => this.toggleTool('step')),
      walk: button('Walk there', {key: 'M'}, () => this.toggleTool('walk')),
    };
    for (const element of Object.values(this.toolButtons)) {
      element.hidden = true;
      setPressed(element, false);
    }
    this.toolButtons.step.id = 'command-step-there';
    this.toolButtons.walk.id = 'command-walk-there';
    this.toolRow = h('div', {class: 'tool-row', role: 'group', 'aria-label': 'Click the ground to'},
      h('span', {}, 'Click the ground to'),
      h('div', {class: 'buttons two'}, this.toolButtons.step, this.toolButtons.walk));
    this.exactOnlyRow = h('label', {class: 'check', for: this.exactOnlyBox.id,
      title: 'The step is rejected if the foot cannot reach the exact point'},
      this.exactOnlyBox, 'Exact placement only');
    this.exactOnlyRow.hidden = true;
    const field = (input: HTMLInputElement, label: string) => {
      input.addEventListener('keydown', (e) => {
        if (e.key === 'Enter') this.startWalk();
      });
      return h('div', {}, h('label', {for: input.id}, label), input);
    };
    this.walkRow = h('div', {class: 'walk', role: 'group', 'aria-label': 'Walk to a point'},
      h('div', {class: 'fields'}, field(this.walkX, 'To x (m)'), field(this.walkZ, 'z (m)'),
        field(this.walkHeading, 'Heading (°)')),
      h('div', {class: 'buttons two'},
        make('Add waypoint', '', () => this.addWaypoint()),
        make('Start walk', '', () => this.startWalk())));
    this.terrainSelect.append(h('option', {value: ''}, 'Current'),
      ...sampleTerrains.map(([name, label]) => h('option', {value: name}, label)));
    this.terrainSelect.addEventListener('change', () => {
      const {value} = this.terrainSelect;
      if (value !== '') actions.setTerrain(value as SampleTerrainName);
    });
    this.terrainRow = h('div', {class: 'row'},
      h('label', {for: 'command-terrain'}, 'Terrain of this world'), this.terrainSelect);
    this.toolRow.hidden = this.walkRow.hidden = true;
    this.terrainRow.hidden = this.layerRow.hidden = true;
    this.element = h('div', {class: 'panel-body'},
      this.target,
      h('label', {class: 'check', for: 'command-all'}, all, 'Command all avatars'),
      this.toolRow, this.exactOnlyRow, this.length.element, this.turn.element,
      h('div', {class: 'buttons three'},
        make('Left foot', 'A', () => this.step('left')),
        make('Step', 'W', () => this.step('auto'), {class: 'primary'}),
        make('Right foot', 'D', () => this.step('right'))),
      h('div', {class: 'pair'}, this.jumpLength.element, make('Jump', 'J', () => this.jump())),
      h('div', {class: 'pair'}, this.seconds.element, make('Stand', 'S', () => this.stand())),
      this.walkRow, this.layerRow,
      h('div', {class: 'buttons three'},
        make('Clear queue', 'X', () => actions.cancel()),
        button('Spawn', {key: 'B'}, () => actions.spawn(1)),
        make('Remove', 'Delete', () => actions.remove())),
      this.randomWalkButton, this.terrainRow, this.message);
  }

  /** Hides the tools and the terrain without a connection. */
  setConnected(connected: boolean): void {
    this.connected = connected;
    this.exactOnlyRow.hidden = !connected || this.tool !== 'step';
    this.toolButtons.step.hidden = !connected;
    this.toolButtons.walk.hidden = this.walkRow.hidden = !connected;
    this.toolRow.hidden = this.terrainRow.hidden = !connected;
    if (this.tool !== null && this.toolButtons[this.tool].hidden) this.toggleTool(this.tool);
  }
  /** `on` is true if foot planting is enabled for all avatars that receive commands. */
  setPlanting(supported: boolean, on: boolean): void {
    this.plantingButton.hidden = !supported;
    setPressed(this.plantingButton, on);
    this.layerRow.hidden = !supported && this.layerButtons.size === 0;
  }
  /** Shows a button for each layer of the world. */
  setLayers(names: readonly string[], isPlaying: (name: string) => boolean): void {
    if (names.join(' ') !== [...this.layerButtons.keys()].join(' ')) {
      this.layerButtons.clear();
      for (const name of names) {
        const element = button(name.charAt(0).toUpperCase() + name.slice(1), {},
          () => this.actions.toggleLayer(name));
        element.id = `command-layer-${name}`;
        this.layerButtons.set(name, element);
      }
      this.layerGroup.replaceChildren(this.plantingButton, ...this.layerButtons.values());
      this.layerRow.hidden = this.plantingButton.hidden && names.length === 0;
    }
    for (const [name, element] of this.layerButtons) setPressed(element, isPlaying(name));
  }
  /** If the tool is active, deactivates it. Otherwise, activates it instead of the other tool. */
  toggleTool(tool: ClickTool): void {
    if (this.toolButtons[tool].hidden && this.tool !== tool) return;
    this.tool = this.tool === tool ? null : tool;
    for (const name of ['step', 'walk'] as const) {
      setPressed(this.toolButtons[name], this.tool === name);
    }
    this.exactOnlyRow.hidden = !this.connected || this.tool !== 'step';
    this.actions.setTool(this.tool);
  }
  /** Returns whether a step is rejected if the foot cannot reach the exact point. */
  get exactOnly(): boolean {
    return this.connected && this.exactOnlyBox.checked;
  }
  /** Copies the goal of a walk to the fields. */
  setGoalFields(atM: Vec3, headingRad: number | null): void {
    this.walkX.value = atM[0].toFixed(2);
    this.walkZ.value = atM[2].toFixed(2);
    this.walkHeading.value = headingRad === null ? '' : (headingRad * 180 / Math.PI).toFixed(0);
  }
  private readGoalFields(): {x: number; z: number} | null {
    const [x, z] = [this.walkX.valueAsNumber, this.walkZ.valueAsNumber];
    if (Number.isFinite(x) && Number.isFinite(z)) return {x, z};
    this.showMessage('Enter x and z in metres.');
    return null;
  }
  private addWaypoint(): void {
    const point = this.readGoalFields();
    if (point) this.actions.addWaypoint(point.x, point.z);
  }
  private startWalk(): void {
    const point = this.readGoalFields();
    const headingDeg = this.walkHeading.valueAsNumber;
    if (!point) return;
    this.actions.walkTo(
      point.x, point.z, Number.isFinite(headingDeg) ? headingDeg * Math.PI / 180 : null);
  }
  /** Clears the choice of terrain, because the world may have none of the sample terrains. */
  resetTerrainChoice(): void {
    this.terrainSelect.value = '';
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
  nudgeLength(metresMore: number): void {
    this.length.value = this.length.value + metresMore;
  }

  /** `target` names the avatars that receive commands; `walkers` of them walk at random. */
  update(target: string, hasTarget: boolean, walkers: number): void {
    setText(this.target, target);
    for (const element of [...this.avatarButtons, ...this.layerButtons.values()]) {
      element.disabled = !hasTarget;
    }
    setPressed(this.randomWalkButton, walkers > 0);
    const label = this.randomWalkButton.querySelector('span')!;
    setText(label, walkers > 0 ? `Stop random walk (${walkers})` : 'Walk randomly');
    this.randomWalkButton.setAttribute('aria-label', label.textContent!);
    if (this.messageUntilMs && performance.now() > this.messageUntilMs) {
      this.messageUntilMs = 0;
      setText(this.message, '');
    }
  }

  showMessage(text: string): void {
    setText(this.message, text);
    this.messageUntilMs = performance.now() + messageMs;
  }
}
