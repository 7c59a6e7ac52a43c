// The page: connects, shows worlds side by side, and wires controls to them.

import * as THREE from 'three';

import {readAddress} from './url_options.js';
import {Appearance} from './appearance.js';
import {CameraControl} from './camera_control.js';
import {ConnectionStatus} from './connection_status.js';
import {button, h, icon, press, setText} from './dom.js';
import {Driver, wanderersAtFirst} from './avatar_commands.js';
import {FootprintTool} from './footprint_tool.js';
import {FrameCap} from './frame_limiter.js';
import {makeHelp} from './help.js';
import {DrivePanel} from './panels/command_panel.js';
import type {GroundTool} from './panels/command_panel.js';
import {FiguresPanel} from './panels/statistics_panel.js';
import {Inspector} from './panels/inspector.js';
import {SidePanels, narrow} from './panels/side_panels.js';
import {Transport} from './panels/playback_controls.js';
import {ViewPanel} from './panels/view_panel.js';
import {Playback} from './playback.js';
import type {Span} from './playback.js';
import {levelCount} from './quality.js';
import {makeRenderer} from './renderer.js';
import type {RendererInfo} from './renderer.js';
import {listenToPointers} from './scene/camera.js';
import {Overlay} from './scene/overlay.js';
import {shareOut} from './scene/view_layout.js';
import {WorldView, projected} from './scene/world_view.js';
import {Client} from './sdk.js';
import type {Subscription, Vec3, World} from './sdk.js';
import {StreamCosts, nameOf, observationOf, type Stream} from './pose_stream.js';
import type {Chosen, Shown} from './world_pane.js';
import {applyTheme, makeColours, preferredTheme, rememberTheme} from './theme.js';
import type {ThemeName} from './theme.js';
import {WalkTool} from './walk_tool.js';

const mostViews = 4;
/** What is read of the page's elements, and shown by them, changes this often. */
const panelsEveryMs = 250;

interface Info {
  version?: string;
  worlds?: {name: string; avatars?: number}[];
}

export interface AppOptions {
  readonly host: string;
  readonly secure: boolean;
}

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
  private readonly camera = new CameraControl(this.shown);
  private figuresMadeRoom = false;
  private readonly appearance: Appearance;
  private readonly asked = readAddress(location.search);
  private readonly cap = new FrameCap(this.asked.framesPerS);
  /** Of the scene, in CSS pixels. */
  private width = 1;
  private height = 1;
  private layOutMs = -1e9;
  private drivenMs = -1e9;
  private stream = this.asked.stream;
  private readonly streamCosts = new StreamCosts();
  private worldNames: string[] = [];
  private chosen: Chosen | null = null;
  /** How long the one chosen has not been seen, in frames that were drawn. */
  private unseenMs = 0;
  private lookedMs = 0;
  private active: Shown | null = null;
  private lastMs = 0;
  private infoTimer = 0;

  private readonly overlay: Overlay;
  private readonly transport: Transport;
  private readonly drive: DrivePanel;
  private readonly driver: Driver;
  private readonly footprints: FootprintTool;
  private readonly walks: WalkTool;
  /** What is dragged on the ground. */
  private grabbed: FootprintTool | WalkTool | null = null;
  private readonly inspector: Inspector;
  private readonly figures: FiguresPanel;
  private readonly viewPanel: ViewPanel;
  private readonly panels = new SidePanels(() => (this.layOutMs = -1e9));
  private readonly chips = h('div', {class: 'chips', role: 'group', 'aria-label': 'Worlds shown'});
  private readonly status: ConnectionStatus;
  private readonly toast = h('div', {class: 'toast', role: 'status'});
  private toastUntil = 0;
  private readonly emptyCard = h('div', {class: 'card'});
  private readonly helpDialog = makeHelp();
  private readonly top: HTMLElement;
  private readonly bottom: HTMLElement;
  private readonly frameButton: HTMLButtonElement;
  private readonly followButton: HTMLButtonElement;
  private readonly themeButton: HTMLButtonElement;
  private readonly qualityButton: HTMLButtonElement;

  constructor(root: HTMLElement, readonly rendererInfo: RendererInfo, readonly appOptions: AppOptions) {
    this.appearance = new Appearance(rendererInfo, this.asked, this.cap.leastMs);
    this.client = new Client({
      url: `${appOptions.secure ? 'wss' : 'ws'}://${appOptions.host}/stream`,
      clientName: 'stridewire-viewer',
    });
    this.status = new ConnectionStatus(this.client, appOptions.host, this.shown);
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

    const page = {
      shown: this.shown,
      chosen: () => this.chosen,
      driven: () => this.driven(),
      choose: (shown: Shown | null, avatar: number) => this.choose(shown, avatar),
      reframe: () => (this.camera.framing = true),
      live: () => this.playback.live && this.client.state === 'ready',
      goLive: () => this.playback.goLive(),
      inspected: () => this.inspector.state,
      mustBeMet: () => this.drive.mustBeMet,
      tellsLayers: () => this.client.serverHas('planting'),
      tellsLandings: () => this.client.serverHas('planting'),
      viewAt: (x: number, y: number) => this.viewAt(x, y),
      drivenAvatars: () => this.driver.avatars(),
      say: (text: string) => this.say(text),
      forgetGround: () => this.drive.forgetGround(),
      cancelled: (shown: Shown, avatars: readonly number[]) => this.walks.cancelled(shown, avatars),
      showGoal: (atM: Vec3, headingRad: number | null) => this.drive.showGoal(atM, headingRad),
    };
    this.driver = new Driver(page);
    this.footprints = new FootprintTool(page);
    this.walks = new WalkTool(page);
    this.transport = new Transport(this.playback);
    this.drive = new DrivePanel({
      request: (make) => this.driver.request(make),
      spawn: (count) => void this.driver.spawn(this.driven(), count, false),
      remove: () => this.driver.remove(),
      cancel: () => this.driver.cancel(),
      wander: () => this.driver.toggleWander(),
      everybody: (on) => (this.driver.everybody = on),
      tool: (tool) => this.useTool(tool),
      pass: (x, z) => {
        const shown = this.driven();
        if (shown) this.walks.pass(shown, [x, shown.view.ground.heightAt(x, z), z]);
      },
      walk: (x, z, headingRad) => {
        const shown = this.driven();
        if (shown) this.walks.send(shown, [x, shown.view.ground.heightAt(x, z), z], headingRad);
      },
      ground: (name) => this.driver.setGround(name),
      layer: (name) => this.driver.toggleLayer(name),
      planting: () => this.driver.togglePlanting(),
    });
    this.inspector = new Inspector({
      onLabels: () => {}, onFollow: () => this.toggleFollow(), onClose: () => this.choose(null, 0)});
    this.figures = new FiguresPanel(
      `${appOptions.secure ? 'https' : 'http'}://${appOptions.host}/metrics`,
      () => this.client.statistics, () => this.describe());
    this.viewPanel = new ViewPanel({
      figures: (choice) => this.appearance.chooseFigures(choice),
      quality: (choice) => this.appearance.chooseQuality(choice),
      stream: (change) => this.setStream({...this.stream, ...change}),
      toggle: (name, on) => this.appearance.toggle(name, on),
    }, {figures: this.asked.figures, quality: this.asked.quality, stream: this.stream});

    this.frameButton = button('Frame all', {icon: 'frame', key: 'F', text: false, class: 'round'},
      () => this.camera.frameAll());
    this.followButton = button('Follow the chosen one', {icon: 'follow', key: 'C', text: false,
      class: 'round'}, () => this.toggleFollow());
    this.themeButton = button('Dark or light', {icon: 'sun', text: false, class: 'round'},
      () => this.setTheme(this.theme === 'dark' ? 'light' : 'dark', true));
    const help = button('Keys and help', {icon: 'help', key: '?', text: false, class: 'round'},
      () => this.helpDialog.showModal());
    this.panels.add('drive', 'Drive', 'drive', 'left', this.drive.element);
    this.panels.add('view', 'View', 'view', 'left', this.viewPanel.element);
    this.panels.add('inspect', 'Inspect', 'inspect', 'right', this.inspector.element);
    this.panels.add('figures', 'Figures', 'plots', 'right', this.figures.element);
    this.qualityButton = button('Quality lowered', {class: 'small quality'},
      () => this.panels.set('view', true));
    this.qualityButton.hidden = true;
    this.top = h('header', {class: 'top'},
      h('h1', {}, 'Stridewire'), this.chips, this.qualityButton, this.status.element, this.panels.tools,
      h('div', {class: 'corner'},
        h('a', {class: 'link', href: '/library.html', title: 'What the libraries span'}, 'Library'),
        this.frameButton, this.followButton, this.themeButton, help));
    this.bottom = h('footer', {class: 'bottom'}, this.transport.element);
    this.emptyCard.hidden = this.toast.hidden = true;
    root.replaceChildren(this.canvas, overlayCanvas, this.top, this.panels.left, this.panels.right,
      this.emptyCard, this.toast, this.status.notice, this.bottom, this.helpDialog);

    this.setTheme(this.theme, false);
    this.panels.set('drive', !narrow());
    this.panels.set('figures', innerWidth >= 1400);
    this.panels.set('view', false);
    this.panels.set('inspect', false);
    this.listen();
    this.client.on('state', () => {
      this.walks.show();  // None while we are not connected.
      this.status.show();
    });
    this.client.on('notice', (_code: number, text: string) => this.say(text));
    this.client.on('error', () => this.status.show());
    this.client.on('sessionLost', () => {
      this.walks.clear(null);
      for (const shown of this.shown) {
        shown.wander?.stop();
        shown.ours.clear();
      }
    });
  }

  start(): void {
    for (const name of this.asked.worlds.slice(0, mostViews)) this.show(name);
    this.status.show();
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
    const view = new WorldView(world, this.colours, this.appearance.options);
    const shown: Shown = {
      world, view, subscription: this.observe(world), wander: null,
      ours: new Set()};
    world.on('event', (event) => {
      if (event.type === 'removed') shown.ours.delete(event.avatar);
      this.footprints.onEvent(shown, event);
      if (!this.walks.onEvent(shown, event) && event.type === 'rejected') {
        this.say(`Avatar ${event.avatar}: ${event.reason}`);
      }
    });
    world.on('state', () => this.status.show());
    world.on('terrain', () => this.driver.groundChanged(world));
    this.shown.push(shown);
    this.active ??= shown;
    if (!this.worldNames.includes(name)) this.worldNames.push(name);
    this.camera.framing = true;
    this.layOutMs = -1e9;
    this.showChips();
  }

  private hide(name: string): void {
    const i = this.shown.findIndex((shown) => shown.world.name === name);
    if (i < 0 || this.shown.length === 1) return;
    const [shown] = this.shown.splice(i, 1);
    if (this.chosen?.shown === shown) this.choose(null, 0);
    if (this.active === shown) this.active = this.shown[0]!;
    shown!.wander?.dispose();
    this.walks.clear(shown!);
    shown!.view.dispose();
    void shown!.world.leave();
    this.camera.framing = true;
    this.layOutMs = -1e9;
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

  private setStream(stream: Stream): void {
    const was = nameOf(this.stream);
    this.stream = stream;
    if (nameOf(stream) === was) return;
    for (const shown of this.shown) {
      const before = shown.subscription;
      shown.subscription = this.observe(shown.world);
      void before?.stop();  // Only now: poses go on.
    }
  }

  private observe(world: World): Subscription {
    const observed = world.observe(observationOf(this.stream));
    void observed.reply.then(({status}) => {
      // Asked for in the address, of a server of before.
      if (status === 'unsupported') this.setStream({...this.stream, detail: 'all'});
    });
    return observed;
  }

  private tellStream(ms: number, avatars: number): void {
    this.viewPanel.setDetail(this.stream.mode === 'quantised' && this.client.serverHas('detail'));
    if (this.streamCosts.measure(ms, this.stream, avatars, this.client.statistics)) {
      this.viewPanel.setCosts(this.streamCosts.costs);
    }
  }

  // ---- choosing and driving

  private choose(shown: Shown | null, avatar: number): void {
    for (const each of this.shown) {
      each.view.chosen = each === shown ? avatar : 0;
      if (each.view.following && each.view.chosen) each.view.following = each.view.chosen;
    }
    this.chosen = shown && avatar !== 0 ? {shown, avatar} : null;
    this.unseenMs = 0;
    if (shown) this.active = shown;
    this.inspector.choose(this.chosen ? shown!.world : null, avatar);
    this.showDriven();
    if (this.chosen) {
      if (!narrow()) {
        this.panels.set('inspect', true);
        if (innerHeight < 1000 && this.panels.open('figures')) {
          this.figuresMadeRoom = true;
          this.panels.set('figures', false);
        }
      }
    } else {
      this.camera.unfollow();
      if (!narrow()) {
        this.panels.set('inspect', false);
        if (this.figuresMadeRoom) this.panels.set('figures', true);
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

  private useTool(tool: GroundTool | null): void {
    this.canvas.classList.toggle('placing', tool !== null);
    this.footprints.setPlacing(tool === 'feet');
    this.walks.setSending(tool === 'walk');
  }

  /** In the Drive panel; over the scene where that is closed. */
  private say(text: string): void {
    this.drive.say(text);
    this.toastUntil = performance.now() + 8000;
    setText(this.toast, text);
    this.showToast();
  }

  private showToast(): void {
    this.toast.hidden = performance.now() > this.toastUntil || this.panels.open('drive');
  }

  private driven(): Shown | null {
    return this.chosen?.shown ?? this.active ?? this.shown[0] ?? null;
  }

  // ---- camera

  private toggleFollow(): void {
    if (!this.chosen) this.chooseNext(1);
    if (this.chosen) this.camera.toggleFollow(this.chosen);
  }

  // ---- appearance

  private adapt(ms: number, avatars: number): void {
    const {appearance, renderer} = this;
    if (!appearance.adapt(ms, avatars)) return;
    if (Math.abs(appearance.pixelRatio - renderer.getPixelRatio()) > 1e-3) {
      renderer.setPixelRatio(appearance.pixelRatio);
    }
    const what = appearance.describe();
    const why = appearance.whyLowered();
    this.viewPanel.set('shadows', appearance.options.shadows);
    this.viewPanel.setAuto(`Drawn as ${what} now${why === '' ? '' : `: ${why}`}.`);
    this.qualityButton.hidden = why === '';
    this.qualityButton.title = `Drawn as ${what}, to keep up. Opens the panel where you can choose.`;
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
    for (const {view} of this.shown) view.crowd?.redress();
    if (remember) rememberTheme(name);
  }

  private showEmpty(avatars: number): void {
    const shown = this.driven();
    const empty = this.client.state === 'ready' && avatars === 0 && shown !== null &&
      shown.world.state === 'joined' && shown.world.skeleton !== null;
    if (this.emptyCard.hidden === !empty) return;
    this.emptyCard.hidden = !empty;
    if (!empty) return;
    const go = button('Let them wander', {icon: 'wander', class: 'primary'},
      () => void this.driver.spawn(this.driven(), wanderersAtFirst, true));
    this.emptyCard.replaceChildren(h('h2', {}, 'Nobody is here yet'),
      h('p', {}, `Put ${wanderersAtFirst} avatars into ${shown!.world.name} and let them walk. They leave ` +
        'when this page closes.'), go);
  }

  private describe(): string {
    const s = this.client.statistics;
    const avatars = this.shown.reduce((sum, shown) => sum + (shown.view.crowd?.count ?? 0), 0);
    const recorded = this.shown.reduce((sum, shown) => sum + shown.world.recording.bytes, 0);
    const perPose = s.posesReceived > 0 ? s.poseBytesReceived / s.posesReceived : 0;
    return `${avatars} avatars, ${perPose.toFixed(0)} bytes a pose (${nameOf(this.stream)}), ` +
      `${(recorded / 1e6).toFixed(1)} MB recorded, ${s.batchesDropped} batches dropped, ` +
      `${s.reconnects} reconnects. Drawn by ${this.rendererInfo.software ? 'software' : 'the graphics card'}.`;
  }

  // ---- frame

  private layOut(ms: number): void {
    // Reading where elements lie may make the browser lay them out.
    if (ms - this.layOutMs < panelsEveryMs) return;
    this.layOutMs = ms;
    const width = (this.width = this.canvas.clientWidth);
    const height = (this.height = this.canvas.clientHeight);
    const ratio = this.renderer.getPixelRatio();
    if (this.canvas.width !== Math.floor(width * ratio) ||
        this.canvas.height !== Math.floor(height * ratio)) {
      this.renderer.setSize(width, height, false);
      this.overlay.resize(width, height);
    }
    // What panels leave free.
    let [x0, x1, y0, y1] = [0, width, this.top.offsetHeight, height - this.bottom.offsetHeight];
    if (narrow()) {
      y1 = Math.min(y1, this.panels.highestTop());
    } else {
      if (this.panels.open('drive') || this.panels.open('view')) x0 = this.panels.left.offsetWidth + 12;
      if (this.panels.open('inspect') || this.panels.open('figures')) {
        x1 = width - this.panels.right.offsetWidth - 12;
      }
    }
    if (x1 - x0 < 80) [x0, x1] = [0, width];
    if (y1 - y0 < 80) [y0, y1] = [0, height];
    shareOut(this.shown.map(({view}) => view), {x0, x1, y0, y1}, width, height);
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
    if (!this.cap.draws(ms)) return;
    const dtS = Math.min(Math.max(100, 1.5 * this.cap.leastMs), Math.max(0, ms - this.lastMs)) / 1000;
    if (this.lastMs > 0) this.frameMs += (Math.min(200, ms - this.lastMs) - this.frameMs) * 0.1;
    this.lastMs = ms;
    this.layOut(ms);

    const renderS = this.client.renderTimeS();
    let avatars = 0;
    if (renderS !== null) {
      const span = this.span(renderS);
      const timeS = this.playback.advance(dtS, renderS, span);
      this.drawnTimeS = timeS;
      for (const {view} of this.shown) avatars += view.update(timeS, this.playback.live);
      this.transport.show(span);
      this.inspector.update(ms, timeS, this.playback.live, this.client.state === 'ready',
        this.panels.open('inspect'));
    }
    this.camera.advance(dtS);
    this.draw();
    ++this.framesDrawn;
    if (this.firstFigureMs === 0 && avatars > 0) this.firstFigureMs = performance.now();
    this.adapt(ms, avatars);
    this.figures.update(ms, this.framesDrawn, this.panels.open('figures'));
    this.showEmpty(avatars);
    if (ms - this.drivenMs >= panelsEveryMs) {
      this.drivenMs = ms;
      this.showDriven();
      this.tellStream(ms, avatars);
    }
  }

  private showDriven(): void {
    // A page that was kept from drawing has not looked meanwhile.
    const nowMs = performance.now();
    this.unseenMs += Math.min(2 * panelsEveryMs, nowMs - this.lookedMs);
    this.lookedMs = nowMs;
    if (this.chosen && (!this.playback.live || this.chosen.shown.view.indexOf(this.chosen.avatar) >= 0)) {
      this.unseenMs = 0;
    } else if (this.chosen && this.unseenMs > 3000) {
      this.choose(null, 0);  // It has left.
      return;
    }
    const avatars = this.driver.avatars();
    const where = this.driven();
    this.drive.offer(this.client.serverHas('footprints'), this.client.serverHas('walks'),
      this.client.serverHas('terrain'), this.client.serverHas('refusals'));
    const state = this.playback.live ? this.inspector.state : null;
    if (state && this.chosen && state.avatar === this.chosen.avatar) {
      this.driver.hear(this.chosen.shown.world, state);
    }
    this.drive.offerPlanting(this.client.serverHas('planting'), this.driver.plants());
    this.drive.offerLayers(where?.world.layers ?? [], (layer) => this.driver.plays(layer));
    this.footprints.show();
    this.walks.show();
    this.showToast();
    if (where) this.driver.lookAt(where.world);
    this.drive.show(
      avatars.length === 0 ? 'Nobody chosen: click a figure.' :
        avatars.length === 1 ? `Avatar ${avatars[0]} of ${where!.world.name}` :
          `All ${avatars.length} avatars of ${where!.world.name}`,
      avatars.length > 0, where?.wander?.size ?? 0);
    press(this.frameButton, this.camera.framing);
    press(this.followButton, this.camera.following);
  }

  private draw(): void {
    const {renderer, height} = this;
    renderer.info.autoReset = false;
    renderer.info.reset();
    renderer.setScissorTest(true);
    if (this.shown.length === 0) {
      renderer.setScissor(0, 0, this.width, height);
      renderer.clear();
    }
    for (const {view} of this.shown) {
      const {box} = view;
      renderer.setViewport(box.x, height - box.y - box.height, box.width, box.height);
      renderer.setScissor(box.x, height - box.y - box.height, box.width, box.height);
      renderer.clear();
      renderer.render(view.scene, view.view.camera);
    }
    this.overlay.draw(this.shown, this.inspector.labels);
  }

  // ---- input

  private viewAt(x: number, y: number): Shown | null {
    return this.shown.find(({view: {box}}) => x >= box.x && x < box.x + box.width && y >= box.y &&
      y < box.y + box.height) ?? null;
  }

  private listen(): void {
    listenToPointers(this.canvas, {
      orbit: (dx, dy) => this.camera.orbit.turn(-dx * 0.006, dy * 0.006),
      pan: (dx, dy, x, y) => this.camera.pan(dx, dy, this.viewAt(x, y)),
      zoom: (factor) => this.camera.zoom(factor),
      click: (x, y, twice, shift) => {
        const shown = this.viewAt(x, y);
        if (!shown) return;
        this.active = shown;
        if (this.footprints.placing && this.driver.avatars().length === 1) {
          this.footprints.place(shown, x, y);
          return;
        }
        if (this.walks.sending && this.driver.avatars().length === 1 && this.driven() === shown) {
          const atM = shift ? shown.view.groundAt(x, y) : null;
          if (atM) this.walks.pass(shown, atM);
          return;
        }
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
      grab: (x, y, touch) => {
        this.grabbed = this.footprints.grab(x, y) ? this.footprints : this.walks.grab(x, y, touch) ? this.walks : null;
        return this.grabbed !== null;
      },
      drag: (x, y) => this.grabbed?.drag(x, y),
      drop: (heldMs) => void this.grabbed?.drop(heldMs),
      release: () => this.grabbed?.release(),
    });
    addEventListener('keydown', (e) => this.key(e));
    addEventListener('resize', () => (this.layOutMs = -1e9));
    matchMedia('(prefers-color-scheme: light)').addEventListener('change', () =>
      this.setTheme(preferredTheme(), false));
  }

  private key(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey || this.helpDialog.open) return;
    const target = e.target as HTMLElement;
    const tag = target.tagName;
    if (tag === 'SELECT' || (tag === 'INPUT' && /^(text|number)$/.test((target as HTMLInputElement).type))) return;
    // Sliders, boxes and buttons keep the keys that work them.
    const widget = tag === 'INPUT' || tag === 'BUTTON' || tag === 'SUMMARY';
    if (widget && /^(Arrow|Home|End|Page| |Enter)/.test(e.key)) return;
    const turn = 0.09;
    const keys: Readonly<Record<string, () => void>> = {
      ' ': () => this.transport.toggle(), l: () => this.playback.goLive(),
      '[': () => this.transport.faster(-1), ']': () => this.transport.faster(1),
      ',': () => this.transport.nudge(-1 / 30), '.': () => this.transport.nudge(1 / 30),
      f: () => this.camera.frameAll(), c: () => this.toggleFollow(),
      n: () => this.chooseNext(1), p: () => this.chooseNext(-1),
      Escape: () => {
        if (this.walks.letGo()) return;
        if (this.drive.tool !== null) this.drive.toggleTool(this.drive.tool);
        else this.choose(null, 0);
      },
      w: () => this.drive.step('auto'), a: () => this.drive.step('left'),
      d: () => this.drive.step('right'), j: () => this.drive.jump(), s: () => this.drive.stand(),
      t: () => this.drive.toggleTool('feet'), m: () => this.drive.toggleTool('walk'), q: () => this.drive.nudgeTurn(5), e: () => this.drive.nudgeTurn(-5),
      k: () => this.driver.togglePlanting(),
      r: () => this.drive.nudgeLength(0.05), v: () => this.drive.nudgeLength(-0.05),
      x: () => this.driver.cancel(), b: () => void this.driver.spawn(this.driven(), 1, false),
      Delete: () => this.driver.remove(), g: () => this.driver.toggleWander(),
      ArrowLeft: () => this.camera.orbit.turn(turn, 0), ArrowRight: () => this.camera.orbit.turn(-turn, 0),
      ArrowUp: () => this.camera.orbit.turn(0, turn), ArrowDown: () => this.camera.orbit.turn(0, -turn),
      '+': () => this.camera.zoom(0.9), '=': () => this.camera.zoom(0.9), '-': () => this.camera.zoom(1.1),
      '?': () => this.helpDialog.showModal(),
    };
    const act = keys[e.key.length === 1 ? e.key.toLowerCase() : e.key];
    if (!act) return;
    e.preventDefault();
    act();
  }

  // ---- for tests, see README.md

  get drawInfo(): {
    style: string; level: number; levels: number; scale: number; calls: number; triangles: number; lines: number;
  } {
    const {render} = this.renderer.info;
    const {options, quality} = this.appearance;
    return {
      style: options.style, level: quality.level, levels: levelCount, scale: quality.detail.scale,
      calls: render.calls, triangles: render.triangles, lines: render.lines};
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
