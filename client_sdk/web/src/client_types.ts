/** Public types for the connection of a client to a server. */
import type {NativeStatistics} from '../generated/native';

/**
 * State of a client's connection.
 * - `idle`: never connected, or closed by `Client.close`.
 * - `waiting`: the next connection attempt is scheduled.
 * - `connecting`: the WebSocket is being opened.
 * - `handshake`: the WebSocket is open, and the server has not accepted the session yet.
 * - `ready`: the session is running.
 * - `closing`: `Client.close` was called, and the last messages are being sent.
 * - `closed`: the server refused the client, which does not try again; see `Client.lastError`.
 */
export type ClientState =
    'idle' | 'waiting' | 'connecting' | 'handshake' | 'ready' | 'closing' | 'closed';

/**
 * The part of the WebSocket interface that the client uses. Browsers and the package `ws` implement
 * it. Listener arguments are `any` because these implementations declare different event types.
 */
export interface WebSocketLike {
  /** The client sets it to `arraybuffer`. */
  binaryType: string;
  /** State of the connection; 1 if it is open. */
  readonly readyState: number;
  /** Bytes that have not been sent yet. */
  readonly bufferedAmount: number;
  onopen: ((event: any) => void) | null;
  onmessage: ((event: any) => void) | null;
  onclose: ((event: any) => void) | null;
  onerror: ((event: any) => void) | null;
  send(data: ArrayBuffer): void;
  close(): void;
}

/**
 * Keeps the files of motion libraries, so that the client need not fetch them again. The client
 * checks the hash of each file. If a promise rejects, or `load` takes longer than 5 s, the client
 * continues without the cache.
 */
export interface LibraryCache {
  /** Returns the file of a library; null if the cache does not contain it. `hash` has 32
   * hexadecimal digits. */
  load(hash: string): Promise<Uint8Array | null>;
  /** Stores the file of a library. It replaces a file of the same hash, which may be damaged. */
  store(hash: string, file: Uint8Array): Promise<void>;
}

/** Options of a client. Only `url` is required. */
export interface ClientOptions {
  /** Address of the server, `ws://host:port/stream` or `wss://host:port/stream`, or a list of 1 to
   * 16 addresses of servers that offer the same worlds. The client tries the addresses in order.
   * After a lost connection it first tries the address to which it was connected, because a session
   * continues only on the same server. */
  url: string | readonly string[];
  /** Name of this client for the server's log, 1 to 64 bytes. Default `stridewire-web`. */
  clientName?: string;
  /** Token for servers that require one, at most 4096 bytes. Default empty. */
  authToken?: string;
  /** WebSocket class to use. Default: the global class. In Node.js, pass the class of the package
   * `ws`. */
  webSocket?: new (url: string) => WebSocketLike;
  /** Delay of `Client.renderTimeS` behind server time in seconds, at most 60. If it is negative,
   * which is the default, the delay adapts to the connection. */
  renderDelayS?: number;
  /** A clock in milliseconds that never runs backwards. Default: `performance.now`. */
  now?: () => number;
  /**
   * True: if the session is lost, the client spawns its avatars again, at their last known
   * positions. Default false.
   */
  respawn?: boolean;
  /** Limit of unanswered commands, 1 to 2^20. Further ones fail with `commands_full`.
   * Default 4096. */
  maxCommands?: number;
  /** Received poses to keep per avatar for interpolation, 4 to 4096. Default 32. */
  poseHistory?: number;
  /**
   * Memory limit for all these poses, in bytes. Poses of avatars that do not fit are dropped and
   * counted in `Statistics.posesRefused`. Default 256 MiB.
   */
  maxPoseBytes?: number;
  /** Length of `World.recording` in seconds, 0 to 3600. 0 disables recording. Default 20. */
  recordingS?: number;
  /** Memory limit in bytes of the poses in one world's recording. Default 192 MiB. */
  maxRecordingBytes?: number;
  /** Maximum number of events in one world's recording, 1 to 2^24. Default 65536. */
  maxRecordedEvents?: number;
  /**
   * Cache for the motion libraries of movement mode. `null`: no cache. Default: IndexedDB, shared
   * by all clients of the page's origin, or no cache where IndexedDB is missing. It keeps at most
   * 16 libraries with at most 64 MiB in total, and removes the least recently used ones.
   */
  libraryCache?: LibraryCache | null;
  /** Time limit for opening the WebSocket, and again for the handshake, 0.1 to 600. Default 5. */
  connectTimeoutS?: number;
  /**
   * Time between pings, 0.05 to 600. The client shortens it to a third of the server's idle timeout
   * if necessary. Default 1.
   */
  pingIntervalS?: number;
  /** Seed for the random part of reconnect delays, 0 to 2^32 - 1. Default: random. */
  seed?: number;
}

/** Arguments of the listeners that `Client.on` accepts. */
export interface ClientListeners {
  /** Called when `Client.state` has changed. */
  state: (state: ClientState) => void;
  /**
   * Called when the session is ready. If `resumed`, the previous session continues; otherwise a new
   * one has begun.
   */
  connected: (resumed: boolean) => void;
  /**
   * Called when the server no longer has the previous session. The client joins its worlds and
   * starts its subscriptions again. If it had sent a command for avatars or terrain and the server
   * had not answered it, the command fails with `session_lost`.
   */
  sessionLost: () => void;
  /**
   * Called with a message from the server for the user. Also reports commands of the client itself
   * that failed after a lost session.
   */
  notice: (code: number, text: string) => void;
  /**
   * Called when a connection attempt has failed or the connection was lost. The client tries again
   * unless its state is `closed`.
   */
  error: (code: number, text: string) => void;
}

/**
 * Counters since the client was created, and current measurements. `bufferedBytes` also contains
 * recordings and what the socket has not sent yet.
 */
export interface Statistics extends NativeStatistics {
  /** Bytes of pose messages, headers included. */
  poseBytesReceived: number;
  /** Bytes of motion libraries that the client has fetched from the server. */
  libraryBytesReceived: number;
  framesReceived: number;
  /** Events that the server dropped because the client read too slowly. */
  eventsDropped: number;
  /** Received frames that were malformed. Each one ended its connection. */
  invalidFrames: number;
  /** Connections that became ready after the first one. */
  reconnects: number;
  /** Smoothed time from the sampled time to the newest received pose. Negative if samples are newer
   * than all poses, so that poses are extrapolated or held. */
  interpolationDelayS: number;
  /** Mean time in nanoseconds to decode and store a pose. */
  decodeNsPerPose: number;
}
