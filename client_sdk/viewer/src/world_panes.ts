// The worlds that the page shows side by side, and the buttons that open and close them.

import {h, setPressed} from './dom.js';
import {observationFor, streamName, type PoseStream} from './pose_stream.js';
import type {WorldView} from './scene/world_view.js';
import type {Client, World} from './sdk.js';
import type {WorldPane} from './world_pane.js';

const maxPanes = 4;
/** Buttons are shown for at most this number of worlds. */
const maxButtons = 12;

/** The parts of `/info.json` that the page uses. */
interface ServerInfo {
  worlds?: {name: string; avatars?: number}[];
}

export interface WorldPanesHost {
  makeView(world: World): WorldView;
  onOpened(pane: WorldPane): void;
  /** Called before the pane's view is disposed. */
  onClosing(pane: WorldPane): void;
  /** Called when the page has left movement mode because a world does not support it. */
  onMovementModeFailed(reason: string): void;
}

export class WorldPanes {
  readonly panes: WorldPane[] = [];
  /** The buttons that open and close worlds. */
  readonly element = h('div', {class: 'world-buttons', role: 'group', 'aria-label': 'Worlds'});
  private worldNames: string[] = [];

  constructor(
    private readonly client: Client, private readonly infoUrl: string,
    private stream: PoseStream, private readonly host: WorldPanesHost) {}

  get poseStream(): PoseStream {
    return this.stream;
  }

  /** Opens a world, unless it is open already or `maxPanes` worlds are. */
  open(name: string): void {
    if (this.panes.some((pane) => pane.world.name === name)) return;
    if (this.panes.length >= maxPanes) return;
    const world = this.client.joinWorld(name, 'controller');
    const pane: WorldPane = {
      world, view: this.host.makeView(world), subscription: null, subscribed: false,
      randomWalkers: null, ownAvatars: new Set(), refusal: ''};
    this.subscribe(pane);
    this.panes.push(pane);
    if (!this.worldNames.includes(name)) this.worldNames.push(name);
    this.host.onOpened(pane);
    this.updateButtons();
  }

  /** Closes a world, unless it is the only one. */
  close(name: string): void {
    const i = this.panes.findIndex((pane) => pane.world.name === name);
    if (i < 0 || this.panes.length === 1) return;
    const pane = this.panes.splice(i, 1)[0]!;
    this.host.onClosing(pane);
    pane.randomWalkers?.dispose();
    pane.view.dispose();
    void pane.world.leave();
    this.updateButtons();
  }

  /**
   * Requests the list of worlds from the server. If no pane is open yet, opens the first two worlds
   * that have avatars, or else the first two, or else a new world.
   */
  async fetchServerInfo(): Promise<void> {
    try {
      const response = await fetch(this.infoUrl, {cache: 'no-store'});
      if (!response.ok) return;
      const info = await response.json() as ServerInfo;
      const worlds = info.worlds ?? [];
      const names = worlds.map((world) => world.name);
      if (this.panes.length === 0) {
        const populated = worlds.filter((world) => (world.avatars ?? 0) > 0).map(({name}) => name);
        const first = (populated.length > 0 ? populated : names).slice(0, 2);
        for (const name of first.length > 0 ? first : ['world']) this.open(name);
      }
      for (const {world} of this.panes) if (!names.includes(world.name)) names.push(world.name);
      if (names.join('\n') !== this.worldNames.join('\n')) {
        this.worldNames = names;
        this.updateButtons();
      }
    } catch {
      // No message is shown here, because ConnectionStatus reports that the server is unreachable.
    }
  }

  /**
   * True while a world in movement mode waits for its motion library and for the server's reply.
   * Until then, it shows the poses of its previous subscription, or quantised poses.
   */
  get fetchesLibrary(): boolean {
    return this.stream.mode === 'movement' && this.panes.some((pane) => !pane.subscribed);
  }

  /** Changes how the server sends the avatars of all open worlds. */
  setPoseStream(stream: PoseStream): void {
    const before = streamName(this.stream);
    this.stream = stream;
    if (streamName(stream) === before) return;
    for (const pane of this.panes) {
      this.subscribe(pane);
    }
  }

  private subscribe(pane: WorldPane): void {
    const {world, subscription: old} = pane;
    const {mode} = this.stream;
    // Until the client has the motion library, it delays the subscription and all later commands.
    const interim = old === null && mode === 'movement' ?
      world.observe(observationFor({...this.stream, mode: 'quantised', detail: 'all'})) : old;
    const subscription = pane.subscription = world.observe(observationFor(this.stream));
    pane.subscribed = false;
    // The new subscription exists before the old one stops, so that poses arrive without a gap.
    void interim?.stop();
    void subscription.reply.then(({ok, status, text}) => {
      if (pane.subscription !== subscription) return;
      pane.subscribed = ok;
      if (ok || mode !== 'movement') return;
      if (!['unsupported', 'version_mismatch', 'malformed'].includes(status)) return;
      this.setPoseStream({...this.stream, mode: 'quantised'});
      this.host.onMovementModeFailed(text);
    });
  }

  /** Updates the buttons, and writes the open worlds to the page's URL. */
  private updateButtons(): void {
    const query = new URLSearchParams(location.search);
    query.delete('world');
    this.element.replaceChildren(...this.worldNames.slice(0, maxButtons).map((name) => {
      const on = this.panes.some((pane) => pane.world.name === name);
      if (on) query.append('world', name);
      const element = h('button', {
        type: 'button', class: 'world-button',
        title: on ? `Hide world ${name}` : `Show world ${name}`,
      }, name);
      setPressed(element, on);
      element.addEventListener('click', () => {
        if (on) this.close(name);
        else this.open(name);
      });
      return element;
    }));
    if (this.panes.length > 0) history.replaceState(null, '', `?${query.toString()}`);
  }
}
