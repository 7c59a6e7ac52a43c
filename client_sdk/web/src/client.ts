import {Session, defaultOptions} from './session';
import {Status} from './status';
import type {
  ClientListeners, ClientOptions, ClientState, Feature, Role, Statistics, World
} from './types';

/** Between two looks at the clock while connected; also what a browser's hidden page is given. */
const longestWaitMs = 500;

/**
 * A connection to a server, kept up for as long as it is wanted.
 *
 * It connects, and connects again, by itself: 0.1 s after a failure, doubled up to 5 s, each
 * shortened at random by up to half; until the server refuses it for good or `close` is called.
 * Commands given meanwhile wait. If the server still holds the session, commands without an answer
 * are sent again and done once; if it does not (restarted, or away for too long), they are answered
 * `session_lost`, and worlds and subscriptions are asked for again.
 *
 * Nothing is thrown after the constructor, and promises of commands are never rejected.
 */
export class Client {
  private readonly session: Session;
  private readonly now: () => number;
  private readonly webSocket: new(url: string) => WebSocket;
  private readonly url: string;
  private socket: WebSocket | null = null;
  private socketNumber = 0;
  private timer: ReturnType<typeof setTimeout> | null = null;
  private timerAtS = Infinity;
  private working = false;

  /** @throws RangeError, TypeError, SyntaxError: an option makes no sense. */
  constructor(options: ClientOptions) {
    if (new Uint8Array(new Uint16Array([1]).buffer)[0] !== 1) {
      throw new TypeError('poses are read in place, which needs a little-endian machine');
    }
    const {url, webSocket, now, ...others} = options;
    const given = Object.fromEntries(
        Object.entries(others).filter(([, value]) => value !== undefined));
    this.url = url;
    const protocol = new URL(url).protocol;
    if (protocol !== 'ws:' && protocol !== 'wss:') {
      throw new SyntaxError(`url: ${url} does not begin with ws:// or wss://`);
    }
    const socketClass = webSocket ?? globalThis.WebSocket;
    if (socketClass === undefined) {
      throw new TypeError('webSocket: there is none here; pass one, such as that of package ws');
    }
    this.webSocket = socketClass;
    this.now = now ?? (() => performance.now());
    this.session = new Session(
        {...defaultOptions, seed: Math.floor(Math.random() * 2 ** 32), ...given},
        () => performance.now());
    this.session.wake = () => this.work();
    this.session.socketBytes = () => this.socket?.bufferedAmount ?? 0;
  }

  get state(): ClientState {
    return this.session.state;
  }

  /** Why the connection last failed or was lost; empty: it did not. */
  get lastError(): string {
    return this.session.lastError;
  }

  /** Of the server; 60 before it is known. */
  get tickHz(): number {
    return this.session.tickHz;
  }

  get statistics(): Statistics {
    return this.session.statistics();
  }

  /** Time now on the server's clock as poses arrive: the smallest delay of the last seconds is
   * counted as none. Null until the first pose or pong. */
  serverTimeS(): number | null {
    const {clock} = this.session;
    return clock.ready ? clock.serverTimeS(this.nowS()) : null;
  }

  /** The time to show poses at: server time minus `renderDelayS`. Moves evenly, never back but when
   * the clock itself was set anew (a new session, a jump of more than 0.25 s). */
  renderTimeS(): number | null {
    const timeS = this.serverTimeS();
    return timeS === null ? null : timeS - this.session.renderDelayS;
  }

  /** Nothing if it is connected or about to. */
  connect(): void {
    this.session.open(this.nowS());
  }

  /** Ends the session and with it our avatars (but in persistent worlds). Worlds and subscriptions
   * are asked for again at the next `connect`. */
  close(): void {
    this.session.close(this.nowS());
  }

  /** Whether the server we are connected to can do that; false while we are not. */
  serverHas(feature: Feature): boolean {
    return this.session.has(feature);
  }

  /** May be called at any time; the world is joined as soon as there is a connection. A name that is
   * joined already, or is none, gives a world that is refused. */
  joinWorld(name: string, role: Role = 'controller'): World {
    return this.session.joinWorld(name, role);
  }

  on<K extends keyof ClientListeners>(name: K, listener: ClientListeners[K]): () => void {
    return this.session.listeners.on(name, listener);
  }

  private nowS(): number {
    return this.now() / 1000;
  }

  /** Does what the session's state asks for. */
  private work(): void {
    if (this.working) return;
    this.working = true;
    const {session} = this;
    if (this.socket !== null &&
        (!session.needsSocket || session.connectionNumber !== this.socketNumber)) {
      this.dropSocket();
    }
    if (session.connectDue(this.nowS())) {
      session.startConnecting(this.nowS());
      this.openSocket();
    }
    if (this.socket !== null && this.socket.readyState === 1) {
      for (const frame of session.takeOutput()) this.socket.send(frame);
      // A WebSocket that is closed sends first what it was given.
      if (session.state === 'closing') {
        this.dropSocket();
        session.onOutputWritten();
      }
    }
    this.working = false;
    this.setTimer();
  }

  private openSocket(): void {
    const {session} = this;
    const number = session.connectionNumber;
    const lost = (code: number, text: string): void => {
      if (number !== this.socketNumber || this.socket === null) return;
      this.dropSocket();
      session.onLost(code, text, this.nowS());
    };
    let socket: WebSocket;
    try {
      socket = new this.webSocket(this.url);
    } catch (error) {
      const text = error instanceof Error ? error.message : '';
      queueMicrotask(() => session.onLost(Status.connect_failed, text, this.nowS()));
      return;
    }
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    this.socketNumber = number;
    socket.onopen = () => {
      if (number === this.socketNumber) session.onConnected(this.nowS());
    };
    socket.onmessage = ({data}: {data: unknown}) => {
      if (number !== this.socketNumber) return;
      if (data instanceof ArrayBuffer) {
        session.onFrame(data, this.nowS());
      } else {
        session.onInvalid('The server sent a text.', this.nowS());
      }
      if (this.nowS() >= this.timerAtS) this.tick();  // Timers of hidden pages come late.
    };
    socket.onclose = ({reason}: {reason?: string}) => {
      const connected = session.state !== 'connecting';
      lost(connected ? Status.connection_lost : Status.connect_failed, reason ?? '');
    };
    socket.onerror = () => {};  // A close follows, which says as much.
  }

  private dropSocket(): void {
    const socket = this.socket;
    if (socket === null) return;
    this.socket = null;
    socket.onopen = null;
    socket.onmessage = null;
    socket.onclose = null;
    socket.onerror = () => {};
    try {
      socket.close();
    } catch {
      // It was none any more.
    }
  }

  private setTimer(): void {
    const nextS = this.session.nextTimeS;
    if (this.timer !== null && this.timerAtS <= nextS) return;
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = null;
    this.timerAtS = nextS;
    if (nextS === Infinity) return;
    const waitMs = Math.min(Math.max(0, 1000 * nextS - this.now()), longestWaitMs);
    this.timer = setTimeout(() => this.tick(), waitMs);
  }

  private tick(): void {
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = null;
    this.timerAtS = Infinity;
    this.session.advanceTime(this.nowS());
    this.work();
  }
}
