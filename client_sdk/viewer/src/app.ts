// The viewer page: connects to the server, shows worlds side by side, and connects the controls to
// them.

import * as THREE from 'three';

import {Appearance} from './appearance.js';
import {AvatarCommands, initialWalkerCount} from './avatar_commands.js';
import type {CommandHost} from './avatar_commands.js';
import {CameraControl} from './camera_control.js';
import {ConnectionStatus} from './connection_status.js';
import {button, h, icon, setPressed} from './dom.js';
import {EmptyWorldCard} from './empty_world_card.js';
import {FootprintTool} from './footprint_tool.js';
import {FrameLimiter} from './frame_limiter.js';
import {makeHelp} from './help.js';
import {keyActions, listenToKeys} from './keyboard.js';
import {CommandPanel} from './panels/command_panel.js';
import type {ClickTool} from './panels/command_panel.js';
import {Inspector} from './panels/inspector.js';
import {PlaybackControls} from './panels/playback_controls.js';
import {SidePanels, isNarrowPage} from './panels/side_panels.js';
import {StatisticsPanel} from './panels/statistics_panel.js';
import {ViewPanel} from './panels/view_panel.js';
import {Playback} from './playback.js';
import type {TimeRange} from './playback.js';
import {StreamCosts, formatBytesPerPose, streamModes, streamName} from './pose_stream.js';
import {levelCount} from './quality.js';
import {makeRenderer} from './renderer.js';
import type {RendererInfo} from './renderer.js';
import {listenToPointers} from './scene/camera.js';
import {Overlay} from './scene/overlay.js';
import {layOutViews} from './scene/view_layout.js';
import {WorldView, projected} from './scene/world_view.js';
import {Client} from './sdk.js';
import {applyTheme, makeColours, preferredTheme, rememberTheme} from './theme.js';
import type {ThemeName} from './theme.js';
import {Toast} from './toast.js';
import {parseUrlOptions} from './url_options.js';
import {WalkTool} from './walk_tool.js';
import type {WalkHost} from './walk_tool.js';
import type {AvatarSelection, WorldPane} from './world_pane.js';
import {WorldPanes} from './world_panes.js';

/** Interval at which the page updates its panels and measures the layout of its elements. */
const panelUpdateIntervalMs = 250;
/** Interval at which the list of worlds is requested from the server. */
const serverInfoIntervalMs = 4000;
/** Part of the recording that the playback slider covers, in seconds. */
const playbackRangeS = 20;
/** The selection ends when its avatar has been missing from the world for this time. */
const selectionTimeoutMs = 3000;
/** Pointer distance, in CSS pixels, within which a click selects an avatar. */
const pickReachPx = 28;

export interface AppOptions {
  /** Host and port of the server, and the path prefix of a proxy, without a slash at its end. */
  readonly host: string;
  /** True if the connection uses TLS. */
  readonly secure: boolean;
}

export class App {
  readonly client: Client;
  readonly playback = new Playback();
  readonly panes: readonly WorldPane[];
  framesDrawn = 0;
  /** Smoothed time between frames. */
  frameMs = 0;
  /** Time at which the first avatars were drawn, in milliseconds after navigation; 0: not yet. */
  firstFigureMs = 0;
  /** Server time that the last frame shows. A seek takes effect with the next frame. */
  drawnTimeS = 0;

  private readonly canvas: HTMLCanvasElement;
  private readonly renderer: THREE.WebGLRenderer;
  private readonly colours = makeColours();
  private theme: ThemeName;
  private readonly worldPanes: WorldPanes;
  private readonly camera: CameraControl;
  private readonly appearance: Appearance;
  private readonly urlOptions = parseUrlOptions(location.search);
  private readonly frameLimiter = new FrameLimiter(this.urlOptions.maxFramesPerS);
  private readonly streamCosts = new StreamCosts();
  /** Size of the scene in CSS pixels. */
  private width = 1;
  private height = 1;
  private lastLayoutMs = -1e9;
  private lastPanelUpdateMs = -1e9;
  private lastFrameMs = 0;
  private selected: AvatarSelection | null = null;
  /** Time for which the selected avatar has not been drawn. */
  private missingMs = 0;
  private lastSelectionCheckMs = 0;
  /** The pane that the user clicked last. If no avatar is selected, its world receives commands. */
  private activePane: WorldPane | null = null;
  /** True if the statistics panel was closed to make room for the inspector. */
  private statisticsClosed = false;

  private readonly overlay: Overlay;
  private readonly playbackControls: PlaybackControls;
  private readonly commandPanel: CommandPanel;
  private readonly commands: AvatarCommands;
  private readonly footprintTool: FootprintTool;
  private readonly walkTool: WalkTool;
  /** The tool whose object the pointer is dragging. */
  private draggingTool: FootprintTool | WalkTool | null = null;
  private readonly inspector: Inspector;
  private readonly statisticsPanel: StatisticsPanel;
  private readonly viewPanel: ViewPanel;
  private readonly sidePanels = new SidePanels(() => this.invalidateLayout());
  private readonly status: ConnectionStatus;
  private readonly toast = new Toast();
  private readonly emptyCard = new EmptyWorldCard(() =>
    void this.commands.spawn(this.commandedPane(), initialWalkerCount, true));
  private readonly helpDialog = makeHelp();
  private readonly top: HTMLElement;
  private readonly bottom: HTMLElement;
  private readonly frameButton: HTMLButtonElement;
  private readonly followButton: HTMLButtonElement;
  private readonly themeButton: HTMLButtonElement;
  private readonly qualityButton: HTMLButtonElement;

  constructor(root: HTMLElement, readonly rendererInfo: RendererInfo, appOptions: AppOptions) {
    const {host, secure} = appOptions;
    const httpUrl = `${secure ? 'https' : 'http'}://${host}`;
    this.appearance =
      new Appearance(rendererInfo, this.urlOptions, this.frameLimiter.intervalMs);
    this.client = new Client({
      url: `${secure ? 'wss' : 'ws'}://${host}/stream`,
      clientName: 'stridewire-viewer',
    });
    this.worldPanes = new WorldPanes(
      this.client, `${httpUrl}/info.json`, this.urlOptions.poseStream, {
        makeView: (world) => new WorldView(world, this.colours, this.appearance.options),
        onOpened: (pane) => this.onPaneOpened(pane),
        onClosing: (pane) => this.onPaneClosing(pane),
        onMovementModeFailed: (reason) => this.notify(
          `Movement mode is not available: ${reason || 'the server has no library'}. ` +
          'The page receives quantised poses instead.'),
      });
    this.panes = this.worldPanes.panes;
    this.camera = new CameraControl(this.panes);
    this.status = new ConnectionStatus(this.client, host, this.panes);
    // Connects before creating the scene, because connecting takes a while.
    this.client.connect();
    void this.worldPanes.fetchServerInfo();
    this.canvas = h('canvas', {
      class: 'scene', tabindex: 0, role: 'application',
      'aria-label': '3D view of the worlds. Arrow keys orbit, plus and minus zoom, N selects the ' +
        'next avatar, question mark lists all keys.'});
    const overlayCanvas = h('canvas', {class: 'overlay', 'aria-hidden': 'true'});
    this.overlay = new Overlay(overlayCanvas);
    this.renderer = makeRenderer(this.canvas, rendererInfo);
    this.theme = preferredTheme();

    const toolHost = this.makeToolHost();
    this.commands = new AvatarCommands(toolHost);
    this.footprintTool = new FootprintTool(toolHost);
    this.walkTool = new WalkTool(toolHost);
    this.playbackControls = new PlaybackControls(this.playback);
    this.commandPanel = this.makeCommandPanel();
    this.inspector = new Inspector({
      onFollow: () => this.toggleFollow(), onDeselect: () => this.select(null, 0)});
    this.statisticsPanel = new StatisticsPanel(
      `${httpUrl}/metrics`, () => this.client.statistics, () => this.describeStatistics());
    this.viewPanel = new ViewPanel({
      figures: (choice) => this.appearance.setFigureStyle(choice),
      quality: (choice) => this.appearance.setQuality(choice),
      stream: (change) =>
        this.worldPanes.setPoseStream({...this.worldPanes.poseStream, ...change}),
      toggle: (name, on) => this.appearance.toggle(name, on),
    }, {
      figures: this.urlOptions.figures, quality: this.urlOptions.quality,
      stream: this.urlOptions.poseStream,
    });

    this.frameButton = button('Frame all', {icon: 'frame', key: 'F', text: false, class: 'round'},
      () => this.camera.frameAll());
    this.followButton = button('Follow the selected avatar',
      {icon: 'follow', key: 'C', text: false, class: 'round'}, () => this.toggleFollow());
    this.themeButton = button('Switch theme', {icon: 'sun', text: false, class: 'round'},
      () => this.setTheme(this.theme === 'dark' ? 'light' : 'dark', true));
    const help = button('Keyboard and mouse', {icon: 'help', key: '?', text: false, class: 'round'},
      () => this.helpDialog.showModal());
    this.sidePanels.add('commands', 'Commands', 'commands', 'left', this.commandPanel.element);
    this.sidePanels.add('view', 'View', 'view', 'left', this.viewPanel.element);
    this.sidePanels.add('inspect', 'Inspect', 'inspect', 'right', this.inspector.element);
    this.sidePanels.add('statistics', 'Statistics', 'plots', 'right', this.statisticsPanel.element);
    this.qualityButton = button('Reduced quality', {class: 'small quality'},
      () => this.sidePanels.setOpen('view', true));
    this.qualityButton.hidden = true;
    this.top = h('header', {class: 'top'},
      h('h1', {}, 'Stridewire'), this.worldPanes.element, this.qualityButton, this.status.element,
      this.sidePanels.toggles,
      h('div', {class: 'corner'},
        h('a', {class: 'link', href: 'library.html', title: 'Explore the motion library'},
          'Library'),
        this.frameButton, this.followButton, this.themeButton, help));
    this.bottom = h('footer', {class: 'bottom'}, this.playbackControls.element);
    root.replaceChildren(this.canvas, overlayCanvas, this.top, this.sidePanels.left,
      this.sidePanels.right, this.emptyCard.element, this.toast.element, this.status.notice,
      this.bottom, this.helpDialog);

    this.setTheme(this.theme, false);
    this.sidePanels.setOpen('commands', !isNarrowPage());
    this.sidePanels.setOpen('statistics', innerWidth >= 1400);
    this.sidePanels.setOpen('view', false);
    this.sidePanels.setOpen('inspect', false);
    this.listenToUser();
    this.listenToClient();
  }

  start(): void {
    for (const name of this.urlOptions.worlds) this.worldPanes.open(name);
    this.status.update();
    setInterval(() => void this.worldPanes.fetchServerInfo(), serverInfoIntervalMs);
    requestAnimationFrame((ms) => this.frame(ms));
  }

  private makeToolHost(): CommandHost & WalkHost {
    return {
      panes: this.panes,
      selection: () => this.selected,
      commandedPane: () => this.commandedPane(),
      select: (pane, avatar) => this.select(pane, avatar),
      frameAllAvatars: () => (this.camera.framesAll = true),
      live: () => this.playback.live && this.client.state === 'ready',
      goLive: () => this.playback.goLive(),
      inspected: () => this.inspector.state,
      exactOnly: () => this.commandPanel.exactOnly,
      paneAt: (x, y) => this.paneAt(x, y),
      targets: () => this.commands.targets(),
      notify: (text) => this.notify(text),
      resetTerrainChoice: () => this.commandPanel.resetTerrainChoice(),
      onCancelled: (pane, avatars) => this.walkTool.onCancelled(pane, avatars),
      showGoal: (atM, headingRad) => this.commandPanel.setGoalFields(atM, headingRad),
    };
  }

  private makeCommandPanel(): CommandPanel {
    const {commands} = this;
    return new CommandPanel({
      request: (make) => commands.request(make),
      spawn: (count) => void commands.spawn(this.commandedPane(), count, false),
      remove: () => commands.remove(),
      cancel: () => commands.cancel(),
      toggleRandomWalk: () => commands.toggleRandomWalk(),
      setAllAvatars: (on) => (commands.allAvatars = on),
      setTool: (tool) => this.setTool(tool),
      addWaypoint: (x, z) => {
        const pane = this.commandedPane();
        if (pane) this.walkTool.addWaypoint(pane, [x, pane.view.terrain.heightAt(x, z), z]);
      },
      walkTo: (x, z, headingRad) => {
        const pane = this.commandedPane();
        if (pane) this.walkTool.send(pane, [x, pane.view.terrain.heightAt(x, z), z], headingRad);
      },
      setTerrain: (name) => commands.setTerrain(name),
      toggleLayer: (name) => commands.toggleLayer(name),
      togglePlanting: () => commands.togglePlanting(),
    });
  }

  // ---- worlds

  private onPaneOpened(pane: WorldPane): void {
    const {world} = pane;
    world.on('event', (event) => {
      if (event.type === 'removed') pane.ownAvatars.delete(event.avatar);
      this.footprintTool.onEvent(pane, event);
      if (!this.walkTool.onEvent(pane, event) && event.outcome === 'rejected') {
        this.notify(`Avatar ${event.avatar}: ${event.reason}`);
      }
    });
    world.on('state', () => this.status.update());
    void world.joined.then((reply) => {
      pane.refusal = reply.ok ? '' : reply.text;
      this.status.update();
    });
    world.on('terrain', () => this.commands.onTerrainChanged(world));
    this.activePane ??= pane;
    this.camera.framesAll = true;
    this.invalidateLayout();
  }

  private onPaneClosing(pane: WorldPane): void {
    if (this.selected?.pane === pane) this.select(null, 0);
    if (this.activePane === pane) this.activePane = this.panes[0]!;
    this.walkTool.clear(pane);
    this.camera.framesAll = true;
    this.invalidateLayout();
  }

  private listenToClient(): void {
    this.client.on('state', () => {
      this.walkTool.update();  // Goals are hidden while there is no connection.
      this.status.update();
    });
    this.client.on('notice', (_code: number, text: string) => this.notify(text));
    this.client.on('error', () => this.status.update());
    this.client.on('sessionLost', () => {
      this.walkTool.clear(null);
      for (const pane of this.panes) {
        pane.randomWalkers?.clear();
        pane.ownAvatars.clear();
      }
    });
  }

  // ---- selection and commands

  /** Selects an avatar; 0 clears the selection. */
  private select(pane: WorldPane | null, avatar: number): void {
    for (const each of this.panes) {
      each.view.selectedAvatar = each === pane ? avatar : 0;
      if (each.view.followedAvatar && each.view.selectedAvatar) {
        each.view.followedAvatar = each.view.selectedAvatar;
      }
    }
    this.selected = pane && avatar !== 0 ? {pane, avatar} : null;
    this.missingMs = 0;
    if (pane) this.activePane = pane;
    this.inspector.setAvatar(this.selected ? pane!.world : null, avatar);
    this.updatePanels();
    if (this.selected) {
      if (!isNarrowPage()) {
        this.sidePanels.setOpen('inspect', true);
        if (innerHeight < 1000 && this.sidePanels.isOpen('statistics')) {
          this.statisticsClosed = true;
          this.sidePanels.setOpen('statistics', false);
        }
      }
    } else {
      this.camera.unfollow();
      if (!isNarrowPage()) {
        this.sidePanels.setOpen('inspect', false);
        if (this.statisticsClosed) this.sidePanels.setOpen('statistics', true);
        this.statisticsClosed = false;
      }
    }
  }

  private selectNext(step: number): void {
    const pane = this.selected?.pane ?? this.activePane;
    const crowd = pane?.view.crowd;
    if (!pane || !crowd || crowd.count === 0) return;
    const at = this.selected ? pane.view.indexOf(this.selected.avatar) : step > 0 ? -1 : 0;
    const next = (at + step + crowd.count) % crowd.count;
    this.select(pane, crowd.avatars[next]!);
  }

  private setTool(tool: ClickTool | null): void {
    this.canvas.classList.toggle('placing', tool !== null);
    this.footprintTool.setActive(tool === 'step');
    this.walkTool.setActive(tool === 'walk');
  }

  /** Shows a message in the command panel, or over the scene if that panel is closed. */
  private notify(text: string): void {
    this.commandPanel.showMessage(text);
    this.toast.show(text);
    this.updateToast();
  }

  private updateToast(): void {
    this.toast.update(this.sidePanels.isOpen('commands'));
  }

  /** Returns the pane whose world receives commands. */
  private commandedPane(): WorldPane | null {
    return this.selected?.pane ?? this.activePane ?? this.panes[0] ?? null;
  }

  private toggleFollow(): void {
    if (!this.selected) this.selectNext(1);
    if (this.selected) this.camera.toggleFollow(this.selected);
  }

  // ---- appearance

  private adaptQuality(ms: number, avatars: number): void {
    const {appearance, renderer} = this;
    if (!appearance.adapt(ms, avatars)) return;
    if (Math.abs(appearance.pixelRatio - renderer.getPixelRatio()) > 1e-3) {
      renderer.setPixelRatio(appearance.pixelRatio);
    }
    const what = appearance.describe();
    const why = appearance.loweredReason();
    this.viewPanel.setChecked('shadows', appearance.options.shadows);
    const reduced = why === '' ? '' : ` Quality is reduced, because ${why}.`;
    this.viewPanel.setQualityText(`Drawing ${what}.${reduced}`);
    this.qualityButton.hidden = why === '';
    this.qualityButton.title = `Drawing ${what}, because ${why}. Open the View panel`;
  }

  private setTheme(name: ThemeName, remember: boolean): void {
    this.theme = name;
    const background = applyTheme(name, this.colours);
    this.renderer.setClearColor(background, 1);
    this.overlay.restyle();
    this.themeButton.replaceChildren(icon(name === 'dark' ? 'sun' : 'moon'));
    const label = name === 'dark' ? 'Use light theme' : 'Use dark theme';
    this.themeButton.setAttribute('aria-label', label);
    this.themeButton.title = label;
    for (const {view} of this.panes) view.crowd?.invalidateColours();
    if (remember) rememberTheme(name);
  }

  /** `avatars` is the number of avatars in all panes. */
  private updateEmptyCard(avatars: number): void {
    const world = this.commandedPane()?.world;
    const empty = this.client.state === 'ready' && avatars === 0 && world !== undefined &&
      world.state === 'joined' && world.skeleton !== null;
    this.emptyCard.update(empty ? world.name : null);
  }

  private describeStatistics(): string {
    const s = this.client.statistics;
    const avatars = this.panes.reduce((sum, {view}) => sum + (view.crowd?.count ?? 0), 0);
    const recorded = this.panes.reduce((sum, {world}) => sum + world.recording.bytes, 0);
    const bytesPerPose = s.posesReceived > 0 ? s.poseBytesReceived / s.posesReceived : 0;
    return `${avatars} avatars, ${formatBytesPerPose(bytesPerPose)} bytes per pose ` +
      `(${streamName(this.worldPanes.poseStream)}), ${(recorded / 1e6).toFixed(1)} MB recorded, ` +
      `${s.batchesDropped} batches dropped, ${s.reconnects} reconnects. ` +
      `Rendered ${this.rendererInfo.software ? 'in software' : 'by the GPU'}.`;
  }

  private updateStreamCosts(ms: number, avatars: number): void {
    const {poseStream, fetchesLibrary} = this.worldPanes;
    this.viewPanel.setStreamMode(poseStream.mode, fetchesLibrary ?
      'Fetching the motion library. Until then, the server sends poses.' :
      streamModes[poseStream.mode].description);
    this.status.setStreamMode(streamModes[poseStream.mode].label);
    this.viewPanel.setDetailEnabled(
      poseStream.mode === 'quantised' && this.client.state === 'ready');
    if (this.streamCosts.measure(ms, poseStream, avatars, this.client.statistics)) {
      this.viewPanel.setCosts(this.streamCosts.costs);
    }
  }

  // ---- frame

  private invalidateLayout(): void {
    this.lastLayoutMs = -1e9;
  }

  /** Adapts the scene to the size of the page and of the open panels. */
  private updateLayout(ms: number): void {
    // Reading element sizes may force the browser to compute the layout, so it is done rarely.
    if (ms - this.lastLayoutMs < panelUpdateIntervalMs) return;
    this.lastLayoutMs = ms;
    const width = (this.width = this.canvas.clientWidth);
    const height = (this.height = this.canvas.clientHeight);
    const ratio = this.renderer.getPixelRatio();
    if (this.canvas.width !== Math.floor(width * ratio) ||
        this.canvas.height !== Math.floor(height * ratio)) {
      this.renderer.setSize(width, height, false);
      this.overlay.resize(width, height);
    }
    // Computes the area that panels leave free.
    let [x0, x1, y0, y1] = [0, width, this.top.offsetHeight, height - this.bottom.offsetHeight];
    const {sidePanels} = this;
    if (isNarrowPage()) {
      y1 = Math.min(y1, sidePanels.highestTop());
    } else {
      if (sidePanels.isOpen('commands') || sidePanels.isOpen('view')) {
        x0 = sidePanels.left.offsetWidth + 12;
      }
      if (sidePanels.isOpen('inspect') || sidePanels.isOpen('statistics')) {
        x1 = width - sidePanels.right.offsetWidth - 12;
      }
    }
    if (x1 - x0 < 80) [x0, x1] = [0, width];
    if (y1 - y0 < 80) [y0, y1] = [0, height];
    layOutViews(this.panes.map(({view}) => view), {x0, x1, y0, y1}, width, height);
  }

  /** The times that can be shown, up to `renderS`; null if nothing has been recorded. */
  private playableRange(renderS: number): TimeRange | null {
    let first = Infinity;
    let last = -Infinity;
    for (const {world} of this.panes) {
      const {firstTimeS, lastTimeS} = world.recording;
      if (!Number.isFinite(firstTimeS) || !Number.isFinite(lastTimeS)) continue;
      first = Math.min(first, firstTimeS);
      last = Math.max(last, lastTimeS);
    }
    if (last <= first) return null;
    return {firstS: Math.max(first, renderS - playbackRangeS), lastS: Math.min(last, renderS)};
  }

  private frame(ms: number): void {
    requestAnimationFrame((next) => this.frame(next));
    if (!this.frameLimiter.shouldDraw(ms)) return;
    const maxStepMs = Math.max(100, 1.5 * this.frameLimiter.intervalMs);
    const dtS = Math.min(maxStepMs, Math.max(0, ms - this.lastFrameMs)) / 1000;
    if (this.lastFrameMs > 0) {
      this.frameMs += (Math.min(200, ms - this.lastFrameMs) - this.frameMs) * 0.1;
    }
    this.lastFrameMs = ms;
    this.updateLayout(ms);

    const renderS = this.client.renderTimeS();
    let avatars = 0;
    if (renderS !== null) {
      const range = this.playableRange(renderS);
      const timeS = this.playback.advance(dtS, renderS, range);
      this.drawnTimeS = timeS;
      for (const {view} of this.panes) avatars += view.update(timeS, this.playback.live);
      this.playbackControls.update(range);
      this.inspector.update(ms, timeS, this.playback.live, this.client.state === 'ready',
        this.sidePanels.isOpen('inspect'));
    }
    this.camera.advance(dtS);
    this.draw();
    ++this.framesDrawn;
    if (this.firstFigureMs === 0 && avatars > 0) this.firstFigureMs = performance.now();
    this.adaptQuality(ms, avatars);
    this.statisticsPanel.update(ms, this.framesDrawn, this.sidePanels.isOpen('statistics'));
    this.updateEmptyCard(avatars);
    if (ms - this.lastPanelUpdateMs >= panelUpdateIntervalMs) {
      this.lastPanelUpdateMs = ms;
      this.updatePanels();
      this.updateStreamCosts(ms, avatars);
    }
  }

  private updatePanels(): void {
    if (!this.checkSelection()) return;
    const avatars = this.commands.targets();
    const pane = this.commandedPane();
    const {client, commandPanel, commands} = this;
    const connected = client.state === 'ready';
    commandPanel.setConnected(connected);
    const state = this.playback.live ? this.inspector.state : null;
    if (state && this.selected && state.avatar === this.selected.avatar) {
      commands.onAvatarState(this.selected.pane.world, state);
    }
    commandPanel.setPlanting(connected, commands.areFeetPlanted());
    commandPanel.setLayers(pane?.world.layers ?? [], (layer) => commands.isLayerPlaying(layer));
    this.footprintTool.update();
    this.walkTool.update();
    this.updateToast();
    if (pane) commands.setTerrainChoiceWorld(pane.world);
    commandPanel.update(
      avatars.length === 0 ? 'No avatar selected. Click one.' :
        avatars.length === 1 ? `Avatar ${avatars[0]} of ${pane!.world.name}` :
          `All ${avatars.length} avatars of ${pane!.world.name}`,
      avatars.length > 0, pane?.randomWalkers?.size ?? 0);
    setPressed(this.frameButton, this.camera.framesAll);
    setPressed(this.followButton, this.camera.following);
  }

  /** If the selected avatar has left the world, clears the selection and returns false. */
  private checkSelection(): boolean {
    // A page in the background gets no frames, so each check adds at most two update intervals.
    const nowMs = performance.now();
    this.missingMs += Math.min(2 * panelUpdateIntervalMs, nowMs - this.lastSelectionCheckMs);
    this.lastSelectionCheckMs = nowMs;
    const {selected} = this;
    if (!selected) return true;
    if (!this.playback.live || selected.pane.world.avatars().includes(selected.avatar)) {
      this.missingMs = 0;
    } else if (this.missingMs > selectionTimeoutMs) {
      this.select(null, 0);
      return false;
    }
    return true;
  }

  private draw(): void {
    const {renderer, height} = this;
    renderer.info.autoReset = false;
    renderer.info.reset();
    renderer.setScissorTest(true);
    if (this.panes.length === 0) {
      renderer.setScissor(0, 0, this.width, height);
      renderer.clear();
    }
    for (const {view} of this.panes) {
      const {viewport} = view;
      const bottom = height - viewport.y - viewport.height;
      renderer.setViewport(viewport.x, bottom, viewport.width, viewport.height);
      renderer.setScissor(viewport.x, bottom, viewport.width, viewport.height);
      renderer.clear();
      renderer.render(view.scene, view.viewCamera.camera);
    }
    this.overlay.draw(this.panes, this.inspector.labels);
  }

  // ---- input

  private paneAt(x: number, y: number): WorldPane | null {
    return this.panes.find(({view: {viewport}}) =>
      x >= viewport.x && x < viewport.x + viewport.width &&
      y >= viewport.y && y < viewport.y + viewport.height) ?? null;
  }

  private listenToUser(): void {
    listenToPointers(this.canvas, {
      orbit: (dx, dy) => this.camera.orbit.turn(-dx * 0.006, dy * 0.006),
      pan: (dx, dy, x, y) => this.camera.pan(dx, dy, this.paneAt(x, y)),
      zoom: (factor) => this.camera.zoom(factor),
      click: (x, y, double, shift) => this.onClick(x, y, double, shift),
      grab: (x, y, touch) => {
        this.draggingTool = this.footprintTool.grab(x, y) ? this.footprintTool :
          this.walkTool.grab(x, y, touch) ? this.walkTool : null;
        return this.draggingTool !== null;
      },
      drag: (x, y) => this.draggingTool?.drag(x, y),
      drop: (pressedMs) => void this.draggingTool?.drop(pressedMs),
      cancelDrag: () => this.draggingTool?.cancelDrag(),
    });
    const {camera, commandPanel, commands, playback, playbackControls} = this;
    listenToKeys(keyActions({
      camera, commandPanel, commands, playback, playbackControls,
      selectNext: (step) => this.selectNext(step),
      toggleFollow: () => this.toggleFollow(),
      escape: () => this.escape(),
      spawn: () => void commands.spawn(this.commandedPane(), 1, false),
      showHelp: () => this.helpDialog.showModal(),
    }), () => !this.helpDialog.open);
    addEventListener('resize', () => this.invalidateLayout());
    matchMedia('(prefers-color-scheme: light)').addEventListener('change', () =>
      this.setTheme(preferredTheme(), false));
  }

  /** A click on the scene: uses the active tool, or selects an avatar. */
  private onClick(x: number, y: number, double: boolean, shift: boolean): void {
    const pane = this.paneAt(x, y);
    if (!pane) return;
    this.activePane = pane;
    if (this.footprintTool.active && this.commands.targets().length === 1) {
      this.footprintTool.requestStep(pane, x, y);
      return;
    }
    if (this.walkTool.active && this.commands.targets().length === 1 &&
        this.commandedPane() === pane) {
      // WalkTool.grab has already handled presses on the ground without Shift.
      const atM = shift ? pane.view.terrainPointAt(x, y) : null;
      if (atM) this.walkTool.addWaypoint(pane, atM);
      return;
    }
    const avatar = pane.view.pick(x, y, pickReachPx);
    if (double && avatar !== 0) {
      this.select(pane, avatar);
      pane.view.followedAvatar = 0;
      this.toggleFollow();
    } else if (!double || avatar !== 0) {
      this.select(avatar === 0 ? null : pane, avatar);
      if (avatar === 0) this.activePane = pane;
    }
  }

  private escape(): void {
    const {commandPanel} = this;
    if (this.walkTool.discardInput()) return;
    if (commandPanel.tool !== null) commandPanel.toggleTool(commandPanel.tool);
    else this.select(null, 0);
  }

  // ---- for browser tests, see README.md

  get drawInfo(): {
    style: string; level: number; levels: number; scale: number; calls: number; triangles: number;
    lines: number;
  } {
    const {render} = this.renderer.info;
    const {options, quality} = this.appearance;
    return {
      style: options.style, level: quality.level, levels: levelCount,
      scale: quality.settings.scale, calls: render.calls, triangles: render.triangles,
      lines: render.lines};
  }
  get liveStatistics(): StatisticsPanel['current'] {
    return this.statisticsPanel.current;
  }
  get inspected(): Inspector['state'] {
    return this.inspector.state;
  }
  avatarOnPage(world: string, avatar: number): {x: number; y: number} | null {
    const view = this.panes.find((pane) => pane.world.name === world)?.view;
    const i = view?.indexOf(avatar) ?? -1;
    if (!view?.crowd || i < 0) return null;
    const rootAt = i * view.crowd.skeleton.jointCount * 3;
    if (!view.project(view.crowd.positions, rootAt)) return null;
    const {x, y} = projected;
    const visible =
      x >= 0 && y >= 0 && x < this.canvas.clientWidth && y < this.canvas.clientHeight;
    return visible ? {x, y} : null;
  }
  get selection(): {world: string; avatar: number} | null {
    return this.selected && {
      world: this.selected.pane.world.name, avatar: this.selected.avatar};
  }
}
