// The page: connects, shows worlds side by side, and wires controls to them.

import * as THREE from 'three';

import {button, h, icon, press, setText} from './dom.js';
import {DrivePanel} from './panels/drive.js';
import {FiguresPanel} from './panels/figures_panel.js';
import {Inspector} from './panels/inspector.js';
import {Transport} from './panels/transport.js';
import {ViewPanel} from './panels/view_panel.js';
import {Playback} from './playback.js';
import type {Span} from './playback.js';
import {makeRenderer} from './renderer.js';
import type {RendererInfo} from './renderer.js';
import {Orbit, listenToPointers} from './scene/camera.js';
import {Overlay} from './scene/overlay.js';
import {WorldView, projected} from './scene/world_view.js';
import type {ViewOptions} from './scene/world_view.js';
import {Client} from './sdk.js';
import type {MovementRequest, PoseMode, Subscription, World} from './sdk.js';
import {applyTheme, makeColours, preferredTheme, rememberTheme} from './theme.js';
import type {ThemeName} from './theme.js';
import {Wander} from './wander.js';

const mostViews = 4;
/** With software rendering a crowd larger than this is drawn by lines. */
const softwareBodies = 24;
const slowFrameMs = 55;
const wanderersAtFirst = 8;

interface Shown {
  readonly world: World;
  readonly view: WorldView;
  subscription: Subscription | null;
  wander: Wander | null;
  readonly ours: Set<number>;
}

interface Info {
  version?: string;
  worlds?: {name: string; avatars?: number}[];
}

export interface AppOptions {
  readonly host: string;
  readonly secure: boolean;
}

type PanelName = 'drive' | 'view' | 'inspect' | 'figures';

export class App {
  readonly client: Client;
  readonly playback = new Playback();
  readonly shown: Shown[] = [];
  framesDrawn = 0;
  frameMs = 0;
  firstFigureMs = 0;
  /** The time that the last frame shows; a seek shows in the next one. */
  drawnTimeS = 0;

  private readonly canvas: HTMLCanvasElement;
  private readonly renderer: THREE.WebGLRenderer;
  private readonly colours = makeColours();
  private theme: ThemeName;
  private readonly orbit = new Orbit();
  private framing = true;
  private figuresMadeRoom = false;
  private readonly options: ViewOptions;
  private figureChoice: 'auto' | 'bodies' | 'lines' = 'auto';
  private slow = 0;
  private mode: PoseMode = 'quantised';
  private worldNames: string[] = [];
  private chosen: {shown: Shown; avatar: number} | null = null;
  private chosenMs = 0;
  private active: Shown | null = null;
  private everybody = false;
  private lastMs = 0;
  private infoTimer = 0;

  private readonly overlay: Overlay;
  private readonly transport: Transport;
  private readonly drive: DrivePanel;
  private readonly inspector: Inspector;
  private readonly figures: FiguresPanel;
  private readonly viewPanel: ViewPanel;
  private readonly panels = new Map<PanelName, {element: HTMLElement; toggle: HTMLButtonElement}>();
  private readonly chips = h('div', {class: 'chips', role: 'group', 'aria-label': 'Worlds shown'});
  private readonly status = h('span', {class: 'status', role: 'status'});
  private readonly notice = h('div', {class: 'notice', role: 'alert'});
  private readonly noticeText = h('p', {});
  private readonly emptyCard = h('div', {class: 'card'});
  private readonly left = h('div', {class: 'column left'});
  private readonly right = h('div', {class: 'column right'});
  private readonly helpDialog = h('dialog', {class: 'help', 'aria-labelledby': 'help-title'});
  private readonly top: HTMLElement;
  private readonly bottom: HTMLElement;
  private readonly frameButton: HTMLButtonElement;
  private readonly followButton: HTMLButtonElement;
  private readonly themeButton: HTMLButtonElement;
  private readonly tools: HTMLElement;

  constructor(root: HTMLElement, readonly rendererInfo: RendererInfo, readonly appOptions: AppOptions) {
    const query = new URLSearchParams(location.search);
    const figures = query.get('figures');
    if (figures === 'bodies' || figures === 'lines') this.figureChoice = figures;
    if (query.get('mode') === 'full') this.mode = 'full';
    this.options = {
      style: this.figureChoice === 'lines' ? 'lines' : 'bodies', shadows: true, prints: true,
      plants: true, plainGround: rendererInfo.software,
    };
    this.client = new Client({
      url: `${appOptions.secure ? 'wss' : 'ws'}://${appOptions.host}/stream`,
      clientName: 'stridewire-viewer',
    });
    // The network is slow to begin with: let it work while the scene is made.
    this.client.connect();
    void this.learn();
    this.canvas = h('canvas', {
      class: 'scene', tabindex: 0, role: 'application',
      'aria-label': 'The worlds. Arrow keys orbit, plus and minus zoom, N chooses the next figure, ' +
        'question mark lists all keys.'});
    const overlayCanvas = h('canvas', {class: 'overlay', 'aria-hidden': 'true'});
    this.overlay = new Overlay(overlayCanvas);
    this.renderer = makeRenderer(this.canvas, rendererInfo);
    this.theme = preferredTheme();

    this.transport = new Transport(this.playback);
    this.drive = new DrivePanel({
      request: (make) => this.request(make),
      spawn: (count) => void this.spawn(this.driven(), count, false),
      remove: () => this.remove(),
      cancel: () => this.cancel(),
      wander: () => this.toggleWander(),
      everybody: (on) => (this.everybody = on),
    });
    this.inspector = new Inspector({
      onLabels: () => {}, onFollow: () => this.toggleFollow(), onClose: () => this.choose(null, 0)});
    this.figures = new FiguresPanel(
      `${appOptions.secure ? 'https' : 'http'}://${appOptions.host}/metrics`,
      () => this.client.statistics, () => this.describe());
    this.viewPanel = new ViewPanel({
      figures: (choice) => this.chooseFigures(choice),
      mode: (mode) => this.setMode(mode),
      toggle: (name, on) => (this.options[name] = on),
    }, this.figureChoice, this.mode);

    this.frameButton = button('Frame all', {icon: 'frame', key: 'F', text: false, class: 'round'},
      () => this.frameAll());
    this.followButton = button('Follow the chosen one', {icon: 'follow', key: 'C', text: false,
      class: 'round'}, () => this.toggleFollow());
    this.themeButton = button('Dark or light', {icon: 'sun', text: false, class: 'round'},
      () => this.setTheme(this.theme === 'dark' ? 'light' : 'dark', true));
    const help = button('Keys and help', {icon: 'help', key: '?', text: false, class: 'round'},
      () => this.helpDialog.showModal());
    this.tools = h('nav', {class: 'tools', 'aria-label': 'Panels'});
    this.addPanel('drive', 'Drive', 'drive', this.left, this.drive.element);
    this.addPanel('view', 'View', 'view', this.left, this.viewPanel.element);
    this.addPanel('inspect', 'Inspect', 'inspect', this.right, this.inspector.element);
    this.addPanel('figures', 'Figures', 'plots', this.right, this.figures.element);
    this.top = h('header', {class: 'top'},
      h('h1', {}, 'Stridewire'), this.chips, this.status, this.tools,
      h('div', {class: 'corner'},
        h('a', {class: 'link', href: '/library.html', title: 'What the libraries span'}, 'Library'),
        this.frameButton, this.followButton, this.themeButton, help));
    this.bottom = h('footer', {class: 'bottom'}, this.transport.element);
    this.notice.append(this.noticeText);
    this.notice.hidden = true;
    this.emptyCard.hidden = true;
    this.buildHelp();
    root.replaceChildren(this.canvas, overlayCanvas, this.top, this.left, this.right,
      this.emptyCard, this.notice, this.bottom, this.helpDialog);

    this.setTheme(this.theme, false);
    this.setPanel('drive', innerWidth >= 900);
    this.setPanel('figures', innerWidth >= 1400);
    this.setPanel('view', false);
    this.setPanel('inspect', false);
    this.listen();
    this.client.on('state', () => this.showConnection());
    this.client.on('notice', (_code: number, text: string) => this.drive.say(text));
    this.client.on('error', () => this.showConnection());
    this.client.on('sessionLost', () => {
      for (const shown of this.shown) {
        shown.wander?.stop();
        shown.ours.clear();
      }
    });
  }

  start(): void {
    const asked = new URLSearchParams(location.search).getAll('world').filter((name) => name !== '');
    for (const name of asked.slice(0, mostViews)) this.show(name);
    this.showConnection();
    this.infoTimer = window.setInterval(() => void this.learn(), 4000);
    requestAnimationFrame((ms) => this.frame(ms));
  }

  stop(): void {
    clearInterval(this.infoTimer);
    this.client.close();
  }

  // ---- worlds

  /** Asks the server which worlds there are. */
  private async learn(): Promise<void> {
    try {
      const scheme = this.appOptions.secure ? 'https' : 'http';
      const response = await fetch(`${scheme}://${this.appOptions.host}/info.json`, {cache: 'no-store'});
      if (!response.ok) return;
      const info = await response.json() as Info;
      const worlds = info.worlds ?? [];
      const names = worlds.map((world) => world.name);
      if (this.shown.length === 0) {
        const living = worlds.filter((world) => (world.avatars ?? 0) > 0).map((world) => world.name);
        const first = (living.length > 0 ? living : names).slice(0, 2);
        for (const name of first.length > 0 ? first : ['world']) this.show(name);
      }
      for (const shown of this.shown) if (!names.includes(shown.world.name)) names.push(shown.world.name);
      if (names.join('\n') !== this.worldNames.join('\n')) {
        this.worldNames = names;
        this.showChips();
      }
    } catch {
      // Not there now; the connection's own state says so.
    }
  }

  private show(name: string): void {
    if (this.shown.some((shown) => shown.world.name === name) || this.shown.length >= mostViews) return;
    const world = this.client.joinWorld(name, 'controller');
    const view = new WorldView(world, this.colours, this.options);
    const shown: Shown = {
      world, view, subscription: world.observe({mode: this.mode, withEvents: true}), wander: null,
      ours: new Set()};
    world.on('event', (event) => {
      if (event.type === 'removed') shown.ours.delete(event.avatar);
      if (event.type === 'rejected') this.drive.say(`Avatar ${event.avatar}: ${event.reason}`);
    });
    world.on('state', () => this.showConnection());
    this.shown.push(shown);
    this.active ??= shown;
    if (!this.worldNames.includes(name)) this.worldNames.push(name);
    this.framing = true;
    this.showChips();
  }

  private hide(name: string): void {
    const i = this.shown.findIndex((shown) => shown.world.name === name);
    if (i < 0 || this.shown.length === 1) return;
    const [shown] = this.shown.splice(i, 1);
    if (this.chosen?.shown === shown) this.choose(null, 0);
    if (this.active === shown) this.active = this.shown[0]!;
    shown!.wander?.dispose();
    shown!.view.dispose();
    void shown!.world.leave();
    this.framing = true;
    this.showChips();
  }

  private showChips(): void {
    const query = new URLSearchParams(location.search);
    query.delete('world');
    this.chips.replaceChildren(...this.worldNames.slice(0, 12).map((name) => {
      const on = this.shown.some((shown) => shown.world.name === name);
      if (on) query.append('world', name);
      const chip = h('button', {
        type: 'button', class: 'chip', title: on ? `Hide world ${name}` : `Show world ${name}`}, name);
      press(chip, on);
      chip.addEventListener('click', () => {
        if (on) this.hide(name);
        else this.show(name);
      });
      return chip;
    }));
    if (this.shown.length > 0) history.replaceState(null, '', `?${query.toString()}`);
  }

  private setMode(mode: PoseMode): void {
    if (mode === this.mode) return;
    this.mode = mode;
    for (const shown of this.shown) {
      void shown.subscription?.stop();
      shown.subscription = shown.world.observe({mode, withEvents: true});
    }
  }

  // ---- choosing and driving

  private choose(shown: Shown | null, avatar: number): void {
    for (const each of this.shown) {
      each.view.chosen = each === shown ? avatar : 0;
      if (each.view.following && each.view.chosen) each.view.following = each.view.chosen;
    }
    this.chosen = shown && avatar !== 0 ? {shown, avatar} : null;
    this.chosenMs = performance.now();
    if (shown) this.active = shown;
    this.inspector.choose(this.chosen ? shown!.world : null, avatar);
    this.showDriven();
    if (this.chosen) {
      if (innerWidth >= 900) {
        this.setPanel('inspect', true);
        if (innerHeight < 1000 && this.open('figures')) {
          this.figuresMadeRoom = true;
          this.setPanel('figures', false);
        }
      }
    } else {
      for (const each of this.shown) each.view.following = 0;
      if (innerWidth >= 900) {
        this.setPanel('inspect', false);
        if (this.figuresMadeRoom) this.setPanel('figures', true);
        this.figuresMadeRoom = false;
      }
    }
  }

  private chooseNext(step: number): void {
    const shown = this.chosen?.shown ?? this.active;
    const crowd = shown?.view.crowd;
    if (!shown || !crowd || crowd.count === 0) return;
    const at = this.chosen ? shown.view.indexOf(this.chosen.avatar) : step > 0 ? -1 : 0;
    const next = (at + step + crowd.count) % crowd.count;
    this.choose(shown, crowd.avatars[next]!);
  }

  private driven(): Shown | null {
    return this.chosen?.shown ?? this.active ?? this.shown[0] ?? null;
  }

  private drivenAvatars(): number[] {
    const shown = this.driven();
    if (!shown) return [];
    if (this.everybody) return [...shown.world.avatars()];
    if (this.chosen) return [this.chosen.avatar];
    return shown.world.avatars().length === 1 ? [...shown.world.avatars()] : [];
  }

  private request(make: (avatar: number) => MovementRequest): void {
    const shown = this.driven();
    const avatars = this.drivenAvatars();
    if (!shown || avatars.length === 0) {
      this.drive.say('Click a figure first, or command everybody.');
      return;
    }
    this.playback.goLive();
    void shown.world.request(avatars.map(make)).then((reply) => {
      if (!reply.ok) this.drive.say(`Refused: ${reply.items[0]?.text || reply.text}`);
      else this.drive.say(avatars.length === 1 ? 'Asked for.' : `Asked ${avatars.length} avatars.`);
    });
  }

  private cancel(): void {
    const shown = this.driven();
    const avatars = this.drivenAvatars();
    if (!shown || avatars.length === 0) return;
    for (const avatar of avatars) shown.wander?.drop(avatar);
    void shown.world.cancel(avatars).then((reply) => {
      this.drive.say(reply.ok ? 'Queue cleared.' : `Refused: ${reply.text}`);
    });
  }

  private remove(): void {
    const shown = this.driven();
    const avatars = this.drivenAvatars();
    if (!shown || avatars.length === 0) return;
    void shown.world.remove(avatars).then((reply) => {
      if (!reply.ok) this.drive.say(`Refused: ${reply.items[0]?.text || reply.text}`);
      else if (this.chosen && avatars.includes(this.chosen.avatar)) this.choose(null, 0);
    });
  }

  /** Puts avatars where there is room; they leave when this page does. */
  private async spawn(shown: Shown | null, count: number, wander: boolean): Promise<void> {
    if (!shown) return;
    const centre = shown.view.view.target;
    const already = shown.world.avatars().length;
    const items: {positionM: readonly [number, number, number]; headingRad: number}[] = [];
    for (let i = 0; i < count; ++i) {
      const k = already === 0 ? i : already + i;
      const r = 1.1 * Math.sqrt(k);
      const angle = k * 2.399963;
      items.push({
        positionM: [(already ? centre.x : 0) + r * Math.sin(angle), 0,
          (already ? centre.z : 0) + r * Math.cos(angle)] as const,
        headingRad: count > 1 ? angle : 0,
      });
    }
    const reply = await shown.world.spawn(items);
    if (!reply.ok) {
      this.drive.say(`Refused: ${reply.items.find((item) => item.text)?.text || reply.text}`);
      return;
    }
    for (const item of reply.items) shown.ours.add(item.avatar);
    if (wander) {
      shown.wander ??= new Wander(shown.world, (text) => this.drive.say(`Refused: ${text}`));
      reply.items.forEach((item, i) => {
        const {positionM, headingRad} = items[i]!;
        shown.wander!.add(item.avatar, positionM[0], positionM[2], headingRad);
      });
      this.framing = true;
    } else if (count === 1 && reply.items[0]) {
      this.choose(shown, reply.items[0].avatar);
    }
  }

  private toggleWander(): void {
    const shown = this.driven();
    if (!shown) return;
    if (shown.wander && shown.wander.size > 0) {
      shown.wander.stop();
      return;
    }
    const avatars = this.chosen && !this.everybody ? [this.chosen.avatar] :
      this.everybody || shown.ours.size === 0 ? [...shown.world.avatars()] : [...shown.ours];
    if (avatars.length === 0) {
      void this.spawn(shown, wanderersAtFirst, true);
      return;
    }
    shown.wander ??= new Wander(shown.world, (text) => this.drive.say(`Refused: ${text}`));
    for (const avatar of avatars) {
      const at = shown.view.place(avatar);
      shown.wander.add(avatar, at?.x ?? 0, at?.z ?? 0, at?.headingRad ?? 0);
    }
  }

  // ---- camera

  private frameAll(): void {
    this.framing = true;
    for (const shown of this.shown) shown.view.following = 0;
  }

  private toggleFollow(): void {
    if (!this.chosen) {
      this.chooseNext(1);
      if (!this.chosen) return;
    }
    const {shown, avatar} = this.chosen!;
    const on = shown.view.following !== avatar;
    for (const each of this.shown) each.view.following = 0;
    shown.view.following = on ? avatar : 0;
    if (on) {
      this.framing = false;
      this.orbit.setDistance(5.2);
    }
  }

  private aim(dtS: number): void {
    let nearest = Infinity;
    for (const {view} of this.shown) {
      view.follow();
      view.view.wantScale = 1;
      if (view.following) continue;
      const extent = view.extent();
      if (!extent) continue;
      if (this.framing || !view.framed) {
        view.view.moveTo(extent.x, 0.8, extent.z, !view.framed);
        view.framed = true;
        // Views that are higher than wide see as much sideways as square ones, see ViewCamera.
        const aspect = Math.min(1.7, Math.max(1, view.free.width / Math.max(1, view.free.height)));
        view.wantDistanceM = Math.min(
          110, Math.max(4.4, (extent.radius + 0.7) / (0.384 * aspect) + 0.2 * extent.radius));
        nearest = Math.min(nearest, view.wantDistanceM);
      }
    }
    if (this.framing && nearest < Infinity) {
      this.orbit.setDistance(nearest);
      for (const {view} of this.shown) view.view.wantScale = view.wantDistanceM / nearest;
    }
    this.orbit.advance(dtS);
    for (const {view} of this.shown) view.aim(this.orbit, dtS);
  }

  // ---- appearance

  private chooseFigures(choice: 'auto' | 'bodies' | 'lines'): void {
    this.figureChoice = choice;
    this.slow = 0;
    if (choice !== 'auto') this.options.style = choice;
    else this.options.style = 'bodies';
  }

  /** Lines where bodies would be slow. */
  private adapt(frameMs: number, avatars: number): void {
    this.viewPanel.setAuto(this.options.style);
    if (this.figureChoice !== 'auto') return;
    if (this.rendererInfo.software && avatars > softwareBodies) this.options.style = 'lines';
    this.slow = frameMs > slowFrameMs ? this.slow + 1 : Math.max(0, this.slow - 2);
    if (this.slow > 45) {
      if (this.options.shadows && avatars <= softwareBodies) {
        this.options.shadows = false;
        this.viewPanel.set('shadows', false);
      } else {
        this.options.style = 'lines';
      }
      this.slow = 0;
    }
  }

  private setTheme(name: ThemeName, remember: boolean): void {
    this.theme = name;
    const background = applyTheme(name, this.colours);
    this.renderer.setClearColor(background, 1);
    this.overlay.restyle();
    this.themeButton.replaceChildren(icon(name === 'dark' ? 'sun' : 'moon'));
    const label = name === 'dark' ? 'Light' : 'Dark';
    this.themeButton.setAttribute('aria-label', label);
    this.themeButton.title = label;
    if (remember) rememberTheme(name);
  }

  private addPanel(
    name: PanelName, title: string, iconName: string, column: HTMLElement, body: HTMLElement): void {
    const id = `panel-${name}`;
    const toggle = button(title, {icon: iconName, class: 'tool'}, () => {
      this.setPanel(name, this.panels.get(name)!.element.hidden);
    });
    toggle.setAttribute('aria-controls', id);
    const close = button(`Close ${title}`, {icon: 'close', text: false, class: 'round small'}, () => {
      this.setPanel(name, false);
      toggle.focus();
    });
    const element = h('section', {id, class: `panel ${name}`, 'aria-label': title},
      h('div', {class: 'panel-head'}, h('h2', {}, title), close), body);
    this.panels.set(name, {element, toggle});
    this.tools.append(toggle);
    column.append(element);
  }

  private setPanel(name: PanelName, open: boolean): void {
    const narrow = innerWidth < 900;
    for (const [other, {element, toggle}] of this.panels) {
      if (other === name) element.hidden = !open;
      else if (narrow && open) element.hidden = true;
      toggle.setAttribute('aria-expanded', String(!element.hidden));
    }
  }

  private open(name: PanelName): boolean {
    return !this.panels.get(name)!.element.hidden;
  }

  private showConnection(): void {
    const {state} = this.client;
    const ready = state === 'ready';
    setText(this.status, ready ? `Connected, ${this.client.tickHz.toFixed(0)} Hz` :
      state === 'closed' ? 'Closed' : 'Connecting…');
    this.status.classList.toggle('ready', ready);
    const {host} = this.appOptions;
    let text = '';
    if (state === 'waiting' || (state === 'connecting' && this.client.lastError !== '')) {
      text = `No server answers at ${host}: start one with ./deploy/demo.sh, and this page connects ` +
        'by itself.';
    } else if (state === 'closed') {
      text = `The server let this page go (${this.client.lastError}): reload the page to try again.`;
    } else if (ready) {
      const refused = this.shown.find((shown) => shown.world.state === 'refused');
      if (refused) text = `World ${refused.world.name} cannot be joined here: choose another above.`;
    }
    this.notice.hidden = text === '';
    setText(this.noticeText, text);
  }

  private showEmpty(avatars: number): void {
    const shown = this.driven();
    const empty = this.client.state === 'ready' && avatars === 0 && shown !== null &&
      shown.world.state === 'joined' && shown.world.skeleton !== null;
    if (this.emptyCard.hidden === !empty) return;
    this.emptyCard.hidden = !empty;
    if (!empty) return;
    const go = button('Let them wander', {icon: 'wander', class: 'primary'},
      () => void this.spawn(this.driven(), wanderersAtFirst, true));
    this.emptyCard.replaceChildren(h('h2', {}, 'Nobody is here yet'),
      h('p', {}, `Put ${wanderersAtFirst} avatars into ${shown!.world.name} and let them walk. They leave ` +
        'when this page closes.'), go);
  }

  private describe(): string {
    const s = this.client.statistics;
    const avatars = this.shown.reduce((sum, shown) => sum + (shown.view.crowd?.count ?? 0), 0);
    const recorded = this.shown.reduce((sum, shown) => sum + shown.world.recording.bytes, 0);
    const perPose = s.posesReceived > 0 ? s.bytesReceived / s.posesReceived : 0;
    return `${avatars} avatars, ${perPose.toFixed(0)} bytes a pose (${this.mode}), ` +
      `${(recorded / 1e6).toFixed(1)} MB recorded, ${s.batchesDropped} batches dropped, ` +
      `${s.reconnects} reconnects. Drawn by ${this.rendererInfo.software ? 'software' : 'the graphics card'}.`;
  }

  // ---- frame

  private layOut(): void {
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    const ratio = this.renderer.getPixelRatio();
    if (this.canvas.width !== Math.floor(width * ratio) ||
        this.canvas.height !== Math.floor(height * ratio)) {
      this.renderer.setSize(width, height, false);
      this.overlay.resize(width, height);
    }
    // What panels leave free.
    const narrow = innerWidth < 900;
    let [x0, x1, y0, y1] = [0, width, this.top.offsetHeight, height - this.bottom.offsetHeight];
    if (!narrow) {
      if (this.open('drive') || this.open('view')) x0 = this.left.offsetWidth + 12;
      if (this.open('inspect') || this.open('figures')) x1 = width - this.right.offsetWidth - 12;
    } else {
      for (const {element} of this.panels.values()) {
        if (!element.hidden) y1 = Math.min(y1, element.getBoundingClientRect().top);
      }
    }
    if (x1 - x0 < 80) [x0, x1] = [0, width];
    if (y1 - y0 < 80) [y0, y1] = [0, height];
    const n = this.shown.length;
    const across = x1 - x0 >= y1 - y0;
    this.shown.forEach(({view}, i) => {
      const from = i / n;
      const to = (i + 1) / n;
      if (across) {
        Object.assign(view.free, {
          x: x0 + (x1 - x0) * from, y: y0, width: (x1 - x0) / n, height: y1 - y0});
        const left = i === 0 ? 0 : view.free.x;
        const end = i === n - 1 ? width : x0 + (x1 - x0) * to;
        Object.assign(view.box, {x: left, y: 0, width: end - left, height});
      } else {
        Object.assign(view.free, {
          x: x0, y: y0 + (y1 - y0) * from, width: x1 - x0, height: (y1 - y0) / n});
        const start = i === 0 ? 0 : view.free.y;
        const end = i === n - 1 ? height : y0 + (y1 - y0) * to;
        Object.assign(view.box, {x: 0, y: start, width, height: end - start});
      }
    });
  }

  private span(renderS: number): Span | null {
    let first = Infinity;
    let last = -Infinity;
    for (const {world} of this.shown) {
      const {firstTimeS, lastTimeS} = world.recording;
      if (!Number.isFinite(firstTimeS) || !Number.isFinite(lastTimeS)) continue;
      first = Math.min(first, firstTimeS);
      last = Math.max(last, lastTimeS);
    }
    return last > first ? {firstS: Math.max(first, renderS - 20), lastS: Math.min(last, renderS)} : null;
  }

  private frame(ms: number): void {
    requestAnimationFrame((next) => this.frame(next));
    const dtS = Math.min(0.1, Math.max(0, (ms - this.lastMs) / 1000));
    if (this.lastMs > 0) this.frameMs += (Math.min(200, ms - this.lastMs) - this.frameMs) * 0.1;
    this.lastMs = ms;
    this.layOut();

    const renderS = this.client.renderTimeS();
    let avatars = 0;
    if (renderS !== null) {
      const span = this.span(renderS);
      const timeS = this.playback.advance(dtS, renderS, span);
      this.drawnTimeS = timeS;
      for (const {view} of this.shown) avatars += view.update(timeS, this.playback.live);
      this.transport.show(span);
      this.inspector.update(ms, timeS, this.playback.live, this.client.state === 'ready',
        this.open('inspect'));
    }
    this.aim(dtS);
    this.draw();
    ++this.framesDrawn;
    if (this.firstFigureMs === 0 && avatars > 0) this.firstFigureMs = performance.now();
    this.adapt(this.frameMs, avatars);
    this.figures.update(ms, this.framesDrawn, this.open('figures'));
    this.showEmpty(avatars);
    if (this.framesDrawn % 8 === 1) this.showDriven();
  }

  private showDriven(): void {
    if (this.chosen && this.playback.live && performance.now() - this.chosenMs > 3000 &&
        this.chosen.shown.view.indexOf(this.chosen.avatar) < 0) {
      this.choose(null, 0);  // It has left.
      return;
    }
    const avatars = this.drivenAvatars();
    const where = this.driven();
    this.drive.show(
      avatars.length === 0 ? 'Nobody chosen: click a figure.' :
        avatars.length === 1 ? `Avatar ${avatars[0]} of ${where!.world.name}` :
          `All ${avatars.length} avatars of ${where!.world.name}`,
      avatars.length > 0, where?.wander?.size ?? 0);
    press(this.frameButton, this.framing);
    press(this.followButton, this.shown.some((shown) => shown.view.following !== 0));
  }

  private draw(): void {
    const {renderer} = this;
    const height = this.canvas.clientHeight;
    renderer.info.autoReset = false;
    renderer.info.reset();
    renderer.setScissorTest(true);
    if (this.shown.length === 0) {
      renderer.setScissor(0, 0, this.canvas.clientWidth, height);
      renderer.clear();
    }
    for (const {view} of this.shown) {
      const {box} = view;
      renderer.setViewport(box.x, height - box.y - box.height, box.width, box.height);
      renderer.setScissor(box.x, height - box.y - box.height, box.width, box.height);
      renderer.clear();
      renderer.render(view.scene, view.view.camera);
    }
    this.overlay.draw(this.shown.map(({view}) => view), this.inspector.labels);
  }

  // ---- input

  private viewAt(x: number, y: number): Shown | null {
    return this.shown.find(({view: {box}}) => x >= box.x && x < box.x + box.width && y >= box.y &&
      y < box.y + box.height) ?? null;
  }

  private listen(): void {
    listenToPointers(this.canvas, {
      orbit: (dx, dy) => this.orbit.turn(-dx * 0.006, dy * 0.006),
      pan: (dx, dy, x, y) => {
        this.framing = false;
        const shown = this.viewAt(x, y);
        for (const each of this.shown) {
          if (each !== shown && this.shown.length > 1) continue;
          each.view.following = 0;
          const scale = 1 / Math.max(1, each.view.free.height);
          each.view.view.pan(this.orbit, -dx * scale, dy * scale);
        }
      },
      zoom: (factor) => {
        this.framing = false;
        this.orbit.zoom(factor);
      },
      click: (x, y, twice) => {
        const shown = this.viewAt(x, y);
        if (!shown) return;
        this.active = shown;
        const avatar = shown.view.pick(x, y, 28);
        if (twice && avatar !== 0) {
          this.choose(shown, avatar);
          shown.view.following = 0;
          this.toggleFollow();
        } else if (!twice || avatar !== 0) {
          this.choose(avatar === 0 ? null : shown, avatar);
          if (avatar === 0) this.active = shown;
        }
      },
    });
    addEventListener('keydown', (e) => this.key(e));
    addEventListener('resize', () => this.layOut());
    matchMedia('(prefers-color-scheme: light)').addEventListener('change', () =>
      this.setTheme(preferredTheme(), false));
  }

  private key(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey || this.helpDialog.open) return;
    const target = e.target as HTMLElement;
    const tag = target.tagName;
    if (tag === 'SELECT' || (tag === 'INPUT' && (target as HTMLInputElement).type === 'text')) return;
    // Sliders, boxes and buttons keep the keys that work them.
    const widget = tag === 'INPUT' || tag === 'BUTTON' || tag === 'SUMMARY';
    if (widget && /^(Arrow|Home|End|Page| |Enter)/.test(e.key)) return;
    const turn = 0.09;
    const keys: Readonly<Record<string, () => void>> = {
      ' ': () => this.transport.toggle(), l: () => this.playback.goLive(),
      '[': () => this.transport.faster(-1), ']': () => this.transport.faster(1),
      ',': () => this.transport.nudge(-1 / 30), '.': () => this.transport.nudge(1 / 30),
      f: () => this.frameAll(), c: () => this.toggleFollow(),
      n: () => this.chooseNext(1), p: () => this.chooseNext(-1),
      Escape: () => this.choose(null, 0),
      w: () => this.drive.step('auto'), a: () => this.drive.step('left'),
      d: () => this.drive.step('right'), j: () => this.drive.jump(), s: () => this.drive.stand(),
      q: () => this.drive.nudgeTurn(5), e: () => this.drive.nudgeTurn(-5),
      r: () => this.drive.nudgeLength(0.05), v: () => this.drive.nudgeLength(-0.05),
      x: () => this.cancel(), b: () => void this.spawn(this.driven(), 1, false),
      Delete: () => this.remove(), g: () => this.toggleWander(),
      ArrowLeft: () => this.orbit.turn(turn, 0), ArrowRight: () => this.orbit.turn(-turn, 0),
      ArrowUp: () => this.orbit.turn(0, turn), ArrowDown: () => this.orbit.turn(0, -turn),
      '+': () => this.zoomBy(0.9), '=': () => this.zoomBy(0.9), '-': () => this.zoomBy(1.1),
      '?': () => this.helpDialog.showModal(),
    };
    const act = keys[e.key.length === 1 ? e.key.toLowerCase() : e.key];
    if (!act) return;
    e.preventDefault();
    act();
  }

  private zoomBy(factor: number): void {
    this.framing = false;
    this.orbit.zoom(factor);
  }

  private buildHelp(): void {
    const rows: [string, string][] = [
      ['Drag, arrow keys', 'orbit'], ['Wheel, pinch, + −', 'zoom'],
      ['Shift or right drag, two fingers', 'move the view'], ['F', 'frame all'],
      ['C, double click', 'follow'], ['Click, N, P', 'choose a figure'], ['Esc', 'deselect'],
      ['Space', 'pause'], ['[ ]', 'slower, faster'], [', .', 'a moment back, on'], ['L', 'live'],
      ['W, A, D', 'step: next foot, left, right'], ['Q, E', 'turn more left, right'],
      ['R, V', 'longer, shorter steps'], ['J', 'jump'], ['S', 'stand'], ['X', 'clear the queue'],
      ['B, Delete', 'spawn, remove'], ['G', 'let them wander'],
    ];
    const close = button('Close', {class: 'primary'}, () => this.helpDialog.close());
    this.helpDialog.append(
      h('h2', {id: 'help-title'}, 'Keys'),
      h('p', {class: 'hint'}, 'Rings mark feet that carry: green the left, orange the right; ' +
        'footprints fade after 14 s. Lines on the ground are a metre apart, strong ones five.'),
      h('dl', {class: 'keys'}, ...rows.flatMap(([key, what]) => [h('dt', {}, key), h('dd', {}, what)])),
      close);
  }

  // ---- for tests, see README.md

  get drawInfo(): {style: string; calls: number; triangles: number; lines: number} {
    const {render} = this.renderer.info;
    return {
      style: this.options.style, calls: render.calls, triangles: render.triangles,
      lines: render.lines};
  }
  get liveFigures(): FiguresPanel['figures'] {
    return this.figures.figures;
  }
  get inspected(): Inspector['state'] {
    return this.inspector.state;
  }
  onPage(world: string, avatar: number): {x: number; y: number} | null {
    const view = this.shown.find((shown) => shown.world.name === world)?.view;
    const i = view?.indexOf(avatar) ?? -1;
    if (!view?.crowd || i < 0) return null;
    if (!view.project(view.crowd.positions, i * view.crowd.skeleton.jointCount * 3)) return null;
    const {x, y} = projected;
    return x >= 0 && y >= 0 && x < this.canvas.clientWidth && y < this.canvas.clientHeight ? {x, y} : null;
  }
  get selection(): {world: string; avatar: number} | null {
    return this.chosen ? {world: this.chosen.shown.world.name, avatar: this.chosen.avatar} : null;
  }
}
