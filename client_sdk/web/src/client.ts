import {defaultLibraryCache} from './library_cache';
import {native} from './native';
import {Session} from './session';
import {defaultOptions} from './session_options';
import {Status} from './status';
import type {
  ClientListeners, ClientOptions, ClientState, Statistics, WebSocketLike
} from './client_types';
import type {Role, World} from './types';

/**
 * Maximum interval of timers. Browsers delay timers of hidden pages, so long ones are not reliable.
 */
const maxTimerMs = 500;
/** Maximum number of addresses, as in the C API. */
const maxAddresses = 16;
/** While the socket has at least this many unsent bytes, it receives no further output. */
const maxBufferedBytes = 1 << 20;

/**
 * A connection to a server.
 *
 * After `connect`, the client reconnects automatically until `close` is called or the server
 * refuses it. The first attempt after a failure follows within 0.1 s. The delay doubles up to 5 s,
 * and each delay is shortened at random by up to half. If there are several addresses, the client
 * tries them in order, and waits only after all of them have failed or after a lost connection.
 *
 * While there is no connection, new commands wait. After a reconnect, the server usually still has
 * the session. The client then resends all unanswered commands, and the server executes each of
 * them once. If the server was restarted or the interruption was too long, the session is lost. The
 * client then joins its worlds and starts its subscriptions again. If it had sent a command for
 * avatars or terrain and the server had not answered it, the command fails with `session_lost`.
 *
 * Only the constructor throws, and promises of commands never reject, unless the WebAssembly module
 * has stopped because of an internal error.
 */
export class Client {
  private readonly session: Session;
  private readonly now: () => number;
  private readonly webSocket: new (url: string) => WebSocketLike;
  private readonly urls: readonly string[];
  private socket: WebSocketLike | null = null;
  /** Number of the connection for which the socket was opened. */
  private socketNumber = 0;
  private timer: ReturnType<typeof setTimeout> | null = null;
  private timerAtS = Infinity;
  private working = false;

  /**
   * Creates a client that is not connected yet.
   * @throws Error WebAssembly or its SIMD instructions are missing, or the browser cannot compile
   *     the module
   * @throws RangeError an option is out of range
   * @throws SyntaxError a URL does not start with ws:// or wss://
   * @throws TypeError an option has the wrong type, a URL is invalid, there is no WebSocket class,
   *     or the machine is big-endian
   */
  constructor(options: ClientOptions) {
    if (new Uint8Array(new Uint16Array([1]).buffer)[0] !== 1) {
      throw new TypeError('big-endian machines are not supported');
    }
    const {url, webSocket, now, ...others} = options;
    const given = Object.fromEntries(
        Object.entries(others).filter(([, value]) => value !== undefined));
    this.urls = typeof url === 'string' ? [url] : [...url];
    if (this.urls.length < 1 || this.urls.length > maxAddresses) {
      throw new RangeError(`url: expected 1 to ${maxAddresses} addresses, got ${this.urls.length}`);
    }
    for (const each of this.urls) {
      const {protocol} = new URL(each);
      if (protocol !== 'ws:' && protocol !== 'wss:') {
        throw new SyntaxError(`url: expected ws://... or wss://..., got ${each}`);
      }
    }
    const socketClass = webSocket ?? globalThis.WebSocket;
    if (socketClass === undefined) {
      throw new TypeError(
          'webSocket: this environment has no WebSocket; pass that of the package ws');
    }
    this.webSocket = socketClass;
    this.now = now ?? (() => performance.now());
    this.session = new Session(
        {...defaultOptions, seed: Math.floor(Math.random() * 2 ** 32),
         libraryCache: defaultLibraryCache(), ...given},
        () => performance.now());
    this.session.wake = () => this.work();
    this.session.socketBytes = () => this.socket?.bufferedAmount ?? 0;
  }

  get state(): ClientState {
    return this.session.state;
  }

  /** Reason why a connection last failed or was lost; empty if none has since `connect`. */
  get lastError(): string {
    return this.session.lastError;
  }

  /** Ticks per second of the server; 60 before the first connection. */
  get tickHz(): number {
    return native().call.tick_hz(this.session.client);
  }

  get statistics(): Statistics {
    return this.session.statistics(this.nowS());
  }

  /**
   * Estimates the current server time; null until the first message with a server time. The
   * estimate lags by the smallest delay of recent messages. It is the time stamp of a pose that
   * arrives now with this smallest delay.
   */
  serverTimeS(): number | null {
    return known(native().call.server_time(this.session.client, this.nowS()));
  }

  /**
   * Returns the server time at which to sample poses: `serverTimeS()` minus a delay, which adapts
   * to the connection unless `renderDelayS` is set. It runs at most 5 % faster or slower than the
   * server. It jumps only
   * - in a new session,
   * - if the server's clock has changed by more than 0.25 s,
   * - if all poses of the last second arrived more than 0.25 s too late, or
   * - if, for one second, the delay has been more than 0.5 s longer than necessary.
   *
   * A jump starts a new segment of poses.
   */
  renderTimeS(): number | null {
    return known(native().call.render_time(this.session.client, this.nowS()));
  }

  /** Starts to connect and returns at once. Does nothing if already connected or connecting. */
  connect(): void {
    this.session.open(this.nowS(), this.urls);
  }

  /**
   * Ends the session. The server removes this client's avatars, except in persistent worlds. The
   * next `connect` joins the worlds and starts the subscriptions again.
   */
  close(): void {
    this.session.close(this.nowS());
  }

  /**
   * Joins a world as soon as the client is connected, and returns it at once. If the name is
   * invalid or already joined, if 256 worlds are joined, or if `maxCommands` commands are
   * unanswered, the state of the result is `refused`.
   */
  joinWorld(name: string, role: Role = 'controller'): World {
    return this.session.joinWorld(name, role);
  }

  /** Calls `listener` for each event of that name. Returns a function that removes it. */
  on<K extends keyof ClientListeners>(name: K, listener: ClientListeners[K]): () => void {
    return this.session.listeners.on(name, listener);
  }

  private nowS(): number {
    return this.now() / 1000;
  }

  /** Opens or closes the socket and sends output, as the state of the session requires. */
  private work(): void {
    if (this.working) return;
    this.working = true;
    const {session} = this;
    const {needsSocket, connectionNumber, connectDue} = session.network(this.nowS());
    if (needsSocket === 0 || connectionNumber !== this.socketNumber) this.dropSocket();
    if (connectDue !== 0) {
      session.startConnecting(this.nowS());
      this.openSocket();
    }
    if (this.socket !== null && this.socket.readyState === 1 &&
        this.socket.bufferedAmount < maxBufferedBytes) {
      for (const frame of session.takeOutput()) this.socket.send(frame);
      // A closed WebSocket still sends what it has buffered.
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
    const {connectionNumber, addressIndex} = session.network();
    let socket: WebSocketLike;
    try {
      socket = new this.webSocket(this.urls[addressIndex]!);
    } catch (error) {
      const text = error instanceof Error ? error.message : '';
      queueMicrotask(() => session.onLost(Status.connect_failed, text, this.nowS()));
      return;
    }
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    this.socketNumber = connectionNumber;
    socket.onopen = () => {
      if (socket === this.socket) session.onConnected(this.nowS());
    };
    socket.onmessage = ({data}: {data: unknown}) => {
      if (socket !== this.socket) return;
      if (data instanceof ArrayBuffer) {
        session.onFrames(data, this.nowS());
      } else {
        session.onInvalid('The server sent a text message.', this.nowS());
      }
      if (this.nowS() >= this.timerAtS) this.tick();  // Browsers delay timers of hidden pages.
    };
    socket.onclose = ({reason}: {reason?: string}) => {
      if (socket !== this.socket) return;
      const connected = session.state !== 'connecting';
      this.dropSocket();
      session.onLost(connected ? Status.connection_lost : Status.connect_failed, reason ?? '',
                     this.nowS());
    };
    socket.onerror = () => {};  // A close event follows.
  }

  private dropSocket(): void {
    const {socket} = this;
    this.socket = null;  // The listeners of the old socket then do nothing.
    try {
      socket?.close();
    } catch {
      // The socket was closed already.
    }
  }

  private setTimer(): void {
    const {nextTimeS: nextS} = this.session.network();
    if (this.timer !== null && this.timerAtS <= nextS) return;
    if (this.timer !== null) clearTimeout(this.timer);
    this.timer = null;
    this.timerAtS = nextS;
    if (nextS === Infinity) return;
    const waitMs = Math.min(Math.max(0, 1000 * nextS - this.now()), maxTimerMs);
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

/** The module returns NaN for a time that is not known yet. */
function known(timeS: number): number | null {
  return Number.isNaN(timeS) ? null : timeS;
}
