import {Backoff} from './backoff';
import type {ClientListeners, ClientOptions, ClientState, Statistics} from './client_types';
import {ClockMap} from './clock_map';
import {StridewireError} from './error';
import {Listeners} from './listeners';
import {WorldRecording} from './recording';
import {Status, statusName, statusText} from './status';
import type {
  AvatarState, Observation, Region, Reply, Role, Subscription, WorldEvent
} from './types';
import * as check from './wire/check';
import {avatarStateOf, eventOf, terrainOf} from './wire/convert';
import {decodeFrame} from './wire/decode';
import {Encoder} from './wire/encode';
import {
  maxAuthTokenBytes, maxBulkBytes, maxControlBytes, maxItems, maxNameBytes, protocolVersion,
  replyCache
} from '../generated/limits';
import {Malformed} from './wire/malformed';
import type {
  AvatarState as AvatarStateMessage, BatchMode, ClientMessage, CommandMessage, ErrorNotice, Events,
  Goodbye, Lagging, Pong, PoseBatch, Reply as ReplyMessage, ServerLimits, SpawnItem as SpawnEntry,
  Welcome, WorldInfo, WorldTerrain
} from './wire/messages';
import {checkName, checkText} from './wire/text';
import {WorldHandle} from './world';
import {WorldView, type PoseBudget, type PoseCounts} from './world_view';

/** Options of the client that the session uses, with defaults filled in. */
export type SessionOptions = Required<Omit<ClientOptions, 'url' | 'webSocket' | 'now'>>;

export const defaultOptions: Omit<SessionOptions, 'seed'> = {
  clientName: 'stridewire-web',
  authToken: '',
  renderDelayS: 0.1,
  respawn: false,
  maxCommands: 4096,
  poseHistory: 32,
  maxPoseBytes: 256 * 2 ** 20,
  recordingS: 20,
  maxRecordingBytes: 192 * 2 ** 20,
  maxRecordedEvents: 65_536,
  connectTimeoutS: 5,
  pingIntervalS: 1,
};

/** While more bytes than this wait to be sent, no further command is encoded. */
const maxOutputBytes = 1 << 20;
const maxWorlds = 256;
const maxSubscriptions = 256;  // Per world.
const maxInspections = 64;
const maxRtts = 16;
/** A connection that was ready for at least this long resets the backoff. */
const stableS = 2;
const goodbyeS = 1;
const inspectTimeoutS = 10;

export interface Command {
  readonly world: WorldHandle;
  readonly message: CommandMessage;
  /**
   * Called with the reply. Null for commands that the session itself sends after a lost session.
   */
  answer: ((reply: Reply) => void) | null;
}

interface Inspection {
  readonly resolve: (state: AvatarState) => void;
  readonly reject: (error: StridewireError) => void;
  readonly deadlineS: number;
}

function makeReply(code: number, text: string, message?: ReplyMessage): Reply {
  return {
    ok: code === 0,
    code,
    status: statusName(code),
    text: text || statusText(code),
    accepted: message?.accepted ?? 0,
    items: (message?.items ?? []).map((item) => ({
      ...item, status: statusName(item.code), text: item.text || statusText(item.code)
    })),
  };
}

/**
 * The client's side of protocol/STATE_MACHINE.md. It has no socket, clock or timer: frames and
 * times are arguments, so that tests can replay any sequence of events.
 *
 *   idle --open--> waiting --startConnecting--> connecting --onConnected--> handshake
 *                    ^  ^                           |                          | Welcome
 *                    |  +---------- failed ---------+                          v
 *                    +------------ lost, or the server ends the session ----- ready --close-->
 *   closed: refused by the server.                                         closing --> idle
 *
 * A command is first in `unsent` of its world, until WorldInfo has arrived and while too many
 * commands are unanswered. After it was sent, it is in `unanswered` in order of seq until its reply
 * arrives. After a lost session, the commands that restore worlds and subscriptions go in front of
 * the unsent ones. Worlds and subscriptions also survive `close`; the next `open` restores them.
 *
 * Listeners and promises are called only after the session has finished processing.
 */
export class Session {
  readonly listeners = new Listeners<ClientListeners>();
  readonly clock = new ClockMap();
  /** Returns the number of bytes that the socket has not sent yet. */
  socketBytes: () => number = () => 0;
  /** Called when there is output to send or the state has changed. */
  wake: () => void = () => {};

  private stateNow: ClientState = 'idle';
  private lastErrorText = '';
  private readonly backoff: Backoff;
  private readonly budget: PoseBudget;
  private readonly counts: PoseCounts =
      {batches: 0, poses: 0, refused: 0, missing: 0, held: 0, decodeMs: 0};
  private readonly worlds = new Set<WorldHandle>();
  private nextSubscription = 1;
  private nextRequestId = 1n;
  private readonly unanswered = new Map<bigint, Command>();
  /** Unanswered commands from this seq on must be sent again; 0: none. */
  private resendFrom = 0n;
  private commandCount = 0;
  private readonly inspections = new Map<bigint, Inspection>();
  private nextNonce = 1n;

  // State of the session.
  private hadSession = false;
  /** Secret for resuming the session; empty if there is no session to resume. */
  private resumeToken: Uint8Array = new Uint8Array(0);
  private nextSeq = 1n;
  private lastEventsNumber = 0n;
  private limits: ServerLimits | null = null;
  private tickHzNow = 60;

  // State of the connection.
  private connection = 0;
  private nextAttemptS = 0;
  private deadlineS = 0;
  private readyS = 0;
  private heardS = 0;
  private nextPingS = 0;
  private encoder = new Encoder();
  private output: ArrayBuffer[] = [];
  private outputBytes = 0;

  private readonly notifications: (() => void)[] = [];
  private notifying = false;
  private readonly rttsS: number[] = [];
  private readonly total = {
    bytesReceived: 0, poseBytesReceived: 0, bytesSent: 0, framesReceived: 0, batchesDropped: 0,
    eventsDropped: 0, eventsReceived: 0, invalidFrames: 0, commandsSent: 0, commandsResent: 0,
    connects: 0, resumes: 0, connectFailures: 0,
  };
  private jitterS = 0;
  private worstJitterS = 0;
  private worstAtS = 0;
  private interpolationDelayS = 0;

  /**
   * @throws RangeError a number among the options is out of range
   * @throws TypeError a text among the options is invalid
   */
  constructor(private readonly options: SessionOptions,
              private readonly precisionNowMs: () => number) {
    checkOptions(options);
    this.backoff = new Backoff(options.seed);
    this.budget = {limitBytes: options.maxPoseBytes, usedBytes: 0};
  }

  // ---- Calls of the user.

  get state(): ClientState {
    return this.stateNow;
  }
  get lastError(): string {
    return this.lastErrorText;
  }
  get tickHz(): number {
    return this.tickHzNow;
  }
  get renderDelayS(): number {
    return this.options.renderDelayS;
  }
  nextRequest(): bigint {
    return this.nextRequestId++;
  }

  /** Starts to connect. Does nothing if already open. */
  open(nowS: number): void {
    if (this.isOpen()) return;
    this.dropConnection();
    this.backoff.reset();
    this.lastErrorText = '';
    this.nextAttemptS = nowS;
    this.setState('waiting');
    this.notify();
  }

  /** Ends the session with Goodbye. Commands without a reply fail with `cancelled`. */
  close(nowS: number): void {
    if (this.stateNow === 'idle' || this.stateNow === 'closing') return;
    const sayGoodbye = this.stateNow === 'ready';
    const connection = this.connection;
    const output = this.output;
    this.failAll(Status.cancelled, '');
    this.forgetSession();
    this.dropConnection();
    if (sayGoodbye) {
      this.connection = connection;
      for (const frame of output) this.push(frame);
      this.send({type: 'Goodbye', code: 0, text: ''});
      this.deadlineS = nowS + goodbyeS;
      this.setState('closing');
    } else {
      this.setState('idle');
    }
    this.notify();
  }

  joinWorld(name: string, role: Role): WorldHandle {
    const view = new WorldView(this.options.poseHistory, this.budget, this.counts,
                               this.precisionNowMs);
    const record =
        new WorldRecording(this.options.recordingS, this.options.maxRecordingBytes,
                           this.options.maxRecordedEvents, (avatar) => view.wants(avatar));
    const world = new WorldHandle(this, name, role, view, record);
    try {
      check.joinWorld(name, role);
      for (const other of this.worlds) {
        if (other.name !== name) continue;
        // A refused world is replaced, so that the user can try again.
        if (other.state === 'refused') {
          this.worlds.delete(other);
        } else {
          throw new StridewireError(Status.already_joined, '');
        }
      }
      if (this.worlds.size >= maxWorlds) {
        throw new StridewireError(Status.limit_reached, 'Too many worlds are joined.');
      }
      this.worlds.add(world);
      this.pump();
    } catch (error) {
      world.state = 'refused';
      this.answerJoin(world, refusal(error));
    }
    this.notify();
    return world;
  }

  /** Queues the command that `make` returns. `make` throws if an argument is invalid. */
  command(world: WorldHandle, make: () => CommandMessage): Promise<Reply> {
    return new Promise((resolve) => {
      try {
        if (!this.isOpen()) throw new StridewireError(Status.closed, '');
        this.enqueue(world, make(), resolve);
        this.pump();
      } catch (error) {
        resolve(refusal(error));
      }
      this.notify();
    });
  }

  observe(world: WorldHandle, observation: Observation): Subscription {
    const id = this.nextSubscription++;
    const reply = new Promise<Reply>((resolve) => {
      try {
        if (world.subscriptions.size >= maxSubscriptions) {
          throw new StridewireError(Status.limit_reached, 'Too many subscriptions to this world.');
        }
        const message = {...check.observe(observation), subscription: id};
        this.enqueue(world, message, resolve);
        world.subscriptions.set(id, {message, unsent: true});
        world.updateFilter();
        this.pump();
      } catch (error) {
        resolve(refusal(error));
      }
      this.notify();
    });
    return {
      id,
      reply,
      moveRegion: (region) => this.moveRegion(world, id, region),
      stop: () => this.stopObserving(world, id),
    };
  }

  private moveRegion(world: WorldHandle, id: number, region: Region): Promise<Reply> {
    return new Promise((resolve) => {
      try {
        const wanted = world.subscriptions.get(id);
        if (wanted === undefined || wanted.message.region === null) {
          throw new StridewireError(Status.no_such_subscription, 'The subscription has no region.');
        }
        const {mode, detail} = wanted.message;
        const entry = check.region(region, mode, detail);
        this.enqueue(world, {...wanted.message, seq: 0n, region: entry, replace: true}, resolve);
        wanted.message.region = entry;
        this.pump();
      } catch (error) {
        resolve(refusal(error));
      }
      this.notify();
    });
  }

  private stopObserving(world: WorldHandle, id: number): Promise<Reply> {
    return new Promise((resolve) => {
      try {
        const wanted = world.subscriptions.get(id);
        if (wanted === undefined) throw new StridewireError(Status.no_such_subscription, '');
        if (wanted.unsent) {
          // The command was never sent, so remove it instead of sending StopObserving.
          const mine = (command: Command): boolean => command.message.type === 'Observe' &&
              command.message.subscription === id;
          for (const command of world.unsent.filter(mine)) {
            this.answer(command, Status.cancelled, 'The subscription was stopped.');
          }
          world.unsent = world.unsent.filter((command) => !mine(command));
          this.later(() => resolve(makeReply(0, '')));
        } else {
          this.enqueue(world, {type: 'StopObserving', seq: 0n, subscription: id}, resolve);
        }
        world.subscriptions.delete(id);
        if (world.subscriptions.size === 0) world.view.clearPoses();
        world.updateFilter();
        this.pump();
      } catch (error) {
        resolve(refusal(error));
      }
      this.notify();
    });
  }

  leave(world: WorldHandle): Promise<Reply> {
    return new Promise((resolve) => {
      try {
        if (!this.worlds.has(world)) throw new StridewireError(Status.not_joined, '');
        if (world.serverId === 0 && world.state === 'pending') {
          this.worlds.delete(world);
          this.failWorld(world, Status.not_joined, 'The world was left.');
          world.reset();
          this.later(() => resolve(makeReply(0, '')));
        } else {
          this.enqueue(world, {type: 'LeaveWorld', seq: 0n, world: 0}, resolve);
        }
        this.setWorldState(world, 'left');
        this.pump();
      } catch (error) {
        resolve(refusal(error));
      }
      this.notify();
    });
  }

  inspect(world: WorldHandle, avatar: number): Promise<AvatarState> {
    return new Promise((resolve, reject) => {
      const refuse = (code: number, text = ''): void => reject(new StridewireError(code, text));
      if (!Number.isInteger(avatar) || avatar < 1 || avatar > check.maxAvatarNumber) {
        return refuse(Status.invalid_argument,
                      `avatar: expected 1 to ${check.maxAvatarNumber}, got ${avatar}`);
      }
      if (this.stateNow !== 'ready' || world.serverId === 0) return refuse(Status.not_ready);
      if (this.inspections.size >= maxInspections) return refuse(Status.commands_full);
      const nonce = this.nextNonce++;
      const deadlineS = this.heardS + inspectTimeoutS;
      this.inspections.set(nonce, {resolve, reject, deadlineS});
      this.send({type: 'InspectAvatar', nonce, world: world.serverId, avatar});
      this.notify();
    });
  }

  statistics(): Statistics {
    const {decodeMs, batches, poses, refused, missing, held} = this.counts;
    let recorded = 0;
    for (const world of this.worlds) recorded += world.record.bytes;
    return {
      ...this.total,
      batchesReceived: batches,
      posesReceived: poses,
      posesRefused: refused,
      batchesMissing: missing,
      commandsWaiting: this.commandCount,
      reconnects: Math.max(0, this.total.connects - 1),
      rttS: this.rttsS.length === 0 ? 0 : Math.min(...this.rttsS),
      jitterS: this.jitterS,
      worstJitterS: this.worstJitterS,
      interpolationDelayS: this.interpolationDelayS,
      heldSamples: held,
      decodeNsPerPose: poses === 0 ? 0 : 1e6 * decodeMs / poses,
      bufferedBytes: this.budget.usedBytes + recorded + this.outputBytes + this.socketBytes(),
    };
  }

  // ---- Calls of the network. Times must not decrease.

  /** Returns true if a connection attempt is due; then call startConnecting. */
  connectDue(nowS: number): boolean {
    return this.stateNow === 'waiting' && nowS >= this.nextAttemptS;
  }

  /** Increases with every connection, to recognise late frames of an old one. */
  get connectionNumber(): number {
    return this.connection;
  }

  /** Returns true if this state needs a socket. If not, the network closes it. */
  get needsSocket(): boolean {
    return this.stateNow === 'connecting' || this.stateNow === 'handshake' ||
        this.stateNow === 'ready' || this.stateNow === 'closing';
  }

  /** Returns the next time at which to call advanceTime or connectDue; Infinity: never. */
  get nextTimeS(): number {
    switch (this.stateNow) {
      case 'waiting': return this.nextAttemptS;
      case 'ready': return Math.min(this.nextPingS, this.heardS + (this.idleTimeoutS || Infinity));
      case 'connecting':
      case 'handshake':
      case 'closing': return this.deadlineS;
      default: return Infinity;
    }
  }

  startConnecting(nowS: number): void {
    this.deadlineS = nowS + this.options.connectTimeoutS;
    ++this.connection;
    this.setState('connecting');
    this.notify();
  }

  onConnected(nowS: number): void {
    if (this.stateNow !== 'connecting') return;
    this.deadlineS = nowS + this.options.connectTimeoutS;
    this.heardS = nowS;
    this.encoder = new Encoder();
    this.clearOutput();
    this.setState('handshake');
    this.send({
      type: 'Hello',
      protocolMin: protocolVersion,
      protocolMax: protocolVersion,
      clientName: this.options.clientName,
      authToken: this.options.authToken,
      resumeToken: this.resumeToken,
      lastEventsNumber: this.resumeToken.length === 0 ? 0n : this.lastEventsNumber,
    });
    this.notify();
  }

  /** Processes a received frame. Never throws, whatever the frame contains. */
  onFrame(frame: ArrayBuffer, nowS: number): void {
    if (this.stateNow !== 'handshake' && this.stateNow !== 'ready') return;
    this.heardS = nowS;
    this.total.bytesReceived += frame.byteLength;
    ++this.total.framesReceived;
    try {
      this.handle(frame, nowS);
    } catch (error) {
      ++this.total.invalidFrames;
      this.breakOff(Status.protocol_error, error instanceof Error ? error.message : '', nowS);
    }
    this.pump();
    this.notify();
  }

  /** Call it if the server sent something other than a binary message. */
  onInvalid(text: string, nowS: number): void {
    if (this.stateNow !== 'handshake' && this.stateNow !== 'ready') return;
    ++this.total.invalidFrames;
    this.breakOff(Status.protocol_error, text, nowS);
    this.notify();
  }

  /** Call it if the connection attempt failed or the connection was lost. */
  onLost(code: number, text: string, nowS: number): void {
    if (this.stateNow === 'closing') {
      this.dropConnection();
      this.setState('idle');
    } else if (this.stateNow === 'connecting' || this.stateNow === 'handshake' ||
               this.stateNow === 'ready') {
      this.breakOff(code, text, nowS);
    }
    this.notify();
  }

  /** Handles timeouts and sends pings. */
  advanceTime(nowS: number): void {
    switch (this.stateNow) {
      case 'connecting':
        if (nowS >= this.deadlineS) {
          this.breakOff(Status.timeout, 'Connecting took too long.', nowS);
        }
        break;
      case 'handshake':
        if (nowS >= this.deadlineS) {
          this.breakOff(Status.timeout, 'The server did not complete the handshake in time.', nowS);
        }
        break;
      case 'ready':
        for (const [nonce, inspection] of this.inspections) {
          if (nowS < inspection.deadlineS) continue;
          this.inspections.delete(nonce);
          this.later(() => inspection.reject(new StridewireError(Status.timeout, '')));
        }
        if (this.idleTimeoutS > 0 && nowS - this.heardS > this.idleTimeoutS) {
          this.breakOff(Status.timeout, 'The server did not respond in time.', nowS);
        } else if (nowS >= this.nextPingS) {
          this.sendPing(nowS);
        }
        break;
      case 'closing':
        if (nowS >= this.deadlineS) {
          this.dropConnection();
          this.setState('idle');
        }
        break;
      default: break;
    }
    this.pump();
    this.notify();
  }

  /** Returns the frames to send and removes them from the output. */
  takeOutput(): ArrayBuffer[] {
    this.pump();
    const output = this.output;
    this.total.bytesSent += this.outputBytes;
    this.clearOutput();
    return output;
  }

  /** Call it when all frames of takeOutput have been passed to the socket. */
  onOutputWritten(): void {
    if (this.stateNow === 'closing' && this.output.length === 0) {
      this.dropConnection();
      this.setState('idle');
      this.notify();
    }
  }

  // ---- Commands.

  private get idleTimeoutS(): number {
    return this.limits?.idleTimeoutS ?? 0;
  }

  private isOpen(): boolean {
    return this.stateNow === 'waiting' || this.stateNow === 'connecting' ||
        this.stateNow === 'handshake' || this.stateNow === 'ready';
  }

  private enqueue(world: WorldHandle, message: CommandMessage,
                  answer: (reply: Reply) => void): void {
    if (!this.worlds.has(world) || world.state === 'refused' || world.state === 'left') {
      throw new StridewireError(Status.not_joined, '');
    }
    if (this.commandCount >= this.options.maxCommands) {
      throw new StridewireError(Status.commands_full, '');
    }
    ++this.commandCount;
    world.unsent.push({world, message, answer});
  }

  private get pending(): number {
    return this.outputBytes + this.socketBytes();
  }

  private maySend(): boolean {
    const memory = Math.min(Math.max(this.limits?.replyMemory ?? 1, 1), replyCache);
    return this.pending < maxOutputBytes && this.unanswered.size < memory;
  }

  /** Encodes the commands that may be sent now. */
  private pump(): void {
    if (this.stateNow !== 'ready') return;

    // Resend the commands that the server may have received already, before any new command.
    while (this.resendFrom !== 0n && this.pending < maxOutputBytes) {
      let next: Command | undefined;
      for (const [seq, command] of this.unanswered) {  // Commands are sent again in order of seq.
        if (seq < this.resendFrom) continue;
        next = command;
        this.resendFrom = seq + 1n;
        break;
      }
      if (next === undefined) {
        this.resendFrom = 0n;
      } else if (this.send(next.message)) {
        // Encoding fails only if the server has lowered its limits since. The server then reports
        // a gap in the sequence.
        ++this.total.commandsResent;
      }
    }
    if (this.resendFrom !== 0n) return;

    for (const world of this.worlds) {
      if (world.state === 'pending' && this.maySend()) {
        this.setWorldState(world, 'joining');
        this.sendCommand({
          world,
          message: {type: 'JoinWorld', seq: 0n, name: world.name, role: world.role},
          answer: null,
        });
      }
      while (world.serverId !== 0 && world.unsent.length > 0 && this.maySend()) {
        this.sendCommand(world.unsent.shift()!);
      }
    }
  }

  private sendCommand(command: Command): void {
    const {message, world} = command;
    message.seq = this.nextSeq;
    if ('world' in message) message.world = world.serverId;
    if (!this.send(message)) {
      // The message exceeds the server's limit. Its seq has not been used.
      if (message.type === 'Observe') {
        world.subscriptions.delete(message.subscription);
        world.updateFilter();
      }
      this.answer(command, Status.limit_reached, this.lastErrorText);
      return;
    }
    ++this.total.commandsSent;
    if (message.type === 'Observe') {
      const wanted = world.subscriptions.get(message.subscription);
      if (wanted !== undefined) wanted.unsent = false;
    }
    this.unanswered.set(this.nextSeq++, command);
  }

  /** Returns false and sets `lastError` if the message exceeds the server's limit. */
  private send(message: ClientMessage): boolean {
    try {
      this.push(this.encoder.encode(message));
      return true;
    } catch (error) {
      if (!(error instanceof Malformed)) throw error;
      this.lastErrorText = error.message;
      return false;
    }
  }

  private push(frame: ArrayBuffer): void {
    this.output.push(frame);
    this.outputBytes += frame.byteLength;
  }

  private sendPing(nowS: number): void {
    if (this.pending < maxOutputBytes) {
      this.send({type: 'Ping', nonce: this.nextNonce++, timeS: nowS});
    }
    const idleS = this.idleTimeoutS;
    this.nextPingS = nowS +
        (idleS > 0 ? Math.min(this.options.pingIntervalS, idleS / 3) : this.options.pingIntervalS);
  }

  /** Completes a command with a reply. */
  private answer(command: Command, code: number, text: string, message?: ReplyMessage): void {
    const {answer} = command;
    if (answer === null) {
      if (code !== 0) {
        this.later(() => this.listeners.emit('notice', code, text || statusText(code)));
      }
      return;
    }
    command.answer = null;
    --this.commandCount;
    const reply = makeReply(code, text, message);
    this.later(() => answer(reply));
  }

  private answerJoin(world: WorldHandle, reply: Reply): void {
    const {answerJoin} = world;
    world.answerJoin = null;
    if (answerJoin !== null) {
      this.later(() => answerJoin(reply));
    } else if (!reply.ok) {
      this.later(() => this.listeners.emit('notice', reply.code, reply.text));
    }
  }

  private failUnsent(world: WorldHandle, code: number, text: string): void {
    const unsent = world.unsent;
    world.unsent = [];
    for (const command of unsent) {
      if (command.answer !== null) this.answer(command, code, text);
    }
  }

  private failWorld(world: WorldHandle, code: number, text: string): void {
    if (world.answerJoin !== null) this.answerJoin(world, makeReply(code, text));
    this.failUnsent(world, code, text);
  }

  private failAll(code: number, text: string): void {
    for (const command of this.unanswered.values()) {
      if (command.answer !== null) this.answer(command, code, text);
    }
    this.unanswered.clear();
    for (const world of this.worlds) this.failWorld(world, code, text);
  }

  // ---- Messages from the server.

  private handle(frame: ArrayBuffer, nowS: number): void {
    const message = decodeFrame(frame, 'server');
    if (message.type === 'Welcome') return this.onWelcome(message, nowS);
    if (message.type === 'Error') return this.onError(message, nowS);
    if (message.type === 'Goodbye') return this.onGoodbye(message, nowS);
    if (this.stateNow !== 'ready') throw new Malformed('arrived before Welcome', message.type);
    switch (message.type) {
      case 'WorldInfo': return this.onWorldInfo(message);
      case 'Reply': return this.onReply(message);
      case 'PoseBatch':
        this.total.poseBytesReceived += frame.byteLength;
        return this.onPoseBatch(message, nowS);
      case 'Events': return this.onEvents(message);
      case 'Lagging': return this.onLagging(message);
      case 'Pong': return this.onPong(message, nowS);
      case 'AvatarState': return this.onAvatarState(message);
      case 'WorldTerrain': return this.onTerrain(message);
      case 'Movements':
      case 'LibraryPiece':
        throw new Malformed('was not requested', message.type);
      default: throw new Malformed('may only be sent by clients', message.type);
    }
  }

  private onWelcome(message: Welcome, nowS: number): void {
    if (this.stateNow !== 'handshake') throw new Malformed('arrived twice', 'Welcome');
    if (message.resumed && this.resumeToken.length === 0) {
      throw new Malformed('resumes a session although none was requested', 'Welcome');
    }
    if (message.protocol !== protocolVersion) {
      return this.closeForGood(Status.version_mismatch,
                               'The server uses another protocol version.');
    }
    this.readyS = nowS;
    this.limits = message.limits;
    this.tickHzNow = message.tickHz;
    this.resumeToken = message.resumeToken;
    this.encoder = new Encoder(message.limits.maxControlBytes || maxControlBytes,
                               message.limits.maxBulkBytes || maxBulkBytes);
    ++this.total.connects;
    this.setState('ready');
    const {resumed} = message;
    this.later(() => this.listeners.emit('connected', resumed));
    if (resumed) {
      ++this.total.resumes;
      for (const seq of this.unanswered.keys()) {
        this.resendFrom = seq;
        break;
      }
      for (const world of this.worlds) world.view.startNewEpoch();
    } else {
      const lost = this.hadSession;
      if (lost) this.later(() => this.listeners.emit('sessionLost'));
      this.restoreSession();
    }
    this.hadSession = true;
    this.sendPing(nowS);
  }

  /** Restores worlds and subscriptions in a new session. */
  private restoreSession(): void {
    this.nextSeq = 1n;
    this.resendFrom = 0n;
    this.lastEventsNumber = 0n;
    this.clock.reset();

    // An unanswered Observe is sent again, and its caller receives the reply to the second one.
    const observing = new Map<number, Command>();
    const unanswered = [...this.unanswered.values()];
    this.unanswered.clear();
    for (const command of unanswered) {
      const {message, world} = command;
      switch (message.type) {
        case 'JoinWorld': break;
        case 'LeaveWorld':
        case 'StopObserving': this.answer(command, Status.ok, ''); break;
        case 'Observe':
          if (message.replace) {  // The subscription already has the new region.
            this.answer(command, Status.ok, '');
            break;
          }
          if (world.subscriptions.has(message.subscription)) {
            observing.set(message.subscription, command);
            break;
          }
          this.answer(command, Status.session_lost, '');
          break;
        default: if (command.answer !== null) this.answer(command, Status.session_lost, '');
      }
    }

    for (const world of [...this.worlds]) {
      if (world.state === 'left') {
        for (const command of world.unsent) {
          if (command.answer === null) continue;
          const leave = command.message.type === 'LeaveWorld';
          this.answer(command, leave ? Status.ok : Status.session_lost, '');
        }
        world.unsent = [];
        this.failWorld(world, Status.session_lost, '');
        world.reset();
        this.worlds.delete(world);
        continue;
      }
      if (world.state === 'refused') continue;
      world.reset();
      this.setWorldState(world, 'pending');
      this.restoreWorld(world, observing);
    }
  }

  /** Puts commands that restore a world's subscriptions and avatars in front of unsent commands. */
  private restoreWorld(world: WorldHandle, observing: ReadonlyMap<number, Command>): void {
    const first: Command[] = [];
    for (const [id, wanted] of world.subscriptions) {
      // The Observe of this subscription is among the unsent commands.
      if (wanted.unsent) continue;
      wanted.unsent = true;
      const asked = observing.get(id);
      first.push({world, message: {...wanted.message}, answer: asked?.answer ?? null});
    }
    // Drops the session's own Spawn commands of an earlier loss. They are added again below.
    world.unsent = world.unsent.filter(
        (command) => command.answer !== null || command.message.type !== 'Spawn');
    if (this.options.respawn) {
      const most = Math.min(Math.max(this.limits?.maxItems || maxItems, 1), maxItems);
      const items = [...world.spawned.values()].map((item) => ({...item}));
      for (let i = 0; i < items.length; i += most) {
        first.push({
          world,
          message: {type: 'Spawn', seq: 0n, world: 0, items: items.slice(i, i + most)},
          answer: null,
        });
      }
    } else {
      world.spawned.clear();
    }
    world.unsent = [...first, ...world.unsent];
  }

  private onWorldInfo(message: WorldInfo): void {
    let world: WorldHandle | undefined;
    if (message.seq !== 0n) {
      const command = this.unanswered.get(message.seq);
      if (command === undefined) return;
      if (command.message.type !== 'JoinWorld') {
        throw new Malformed('belongs to another command', 'WorldInfo');
      }
      world = command.world;
    } else {
      for (const candidate of this.worlds) {
        if (candidate.name === message.name && candidate.state !== 'refused') world = candidate;
      }
    }
    if (world === undefined) return;
    world.serverId = message.world;
    world.setInfo(message);
    const changed = world;
    this.later(() => changed.listeners.emit('state', changed.state));
  }

  private onReply(message: ReplyMessage): void {
    const command = this.unanswered.get(message.seq);
    if (command === undefined) return;  // Ignore a second reply, which may arrive after a resume.
    this.unanswered.delete(message.seq);
    const {world, message: asked} = command;
    if (asked.type === 'JoinWorld') return this.onJoinReply(world, message);
    let {code} = message;
    const done = code === Status.ok;
    switch (asked.type) {
      case 'Spawn':
        if (done) this.onSpawned(world, asked.items, command, message);
        break;
      case 'Remove':
        if (done) {
          const refused = new Set(message.items.map((item) => item.index));
          asked.avatars.forEach((avatar, i) => {
            if (refused.has(i)) return;
            world.spawned.delete(avatar);
            world.view.remove(avatar);
          });
        }
        break;
      case 'Observe':
        if (asked.replace) break;
        if (!done) {
          world.subscriptions.delete(asked.subscription);
          world.updateFilter();
        } else if (world.subscriptions.size === 1) {
          // Older poses belong to a subscription that has ended. The server cannot mark the new
          // ones as discontinuous, because other clients receive the same batch.
          world.view.startNewEpoch();
        }
        break;
      case 'StopObserving':
        // The subscription does not exist, which is what the caller wants.
        if (code === Status.no_such_subscription) code = Status.ok;
        break;
      case 'LeaveWorld':
        this.worlds.delete(world);
        this.failWorld(world, Status.not_joined, 'The world was left.');
        world.reset();
        break;
      default: break;
    }
    this.answer(command, code, message.text, message);
  }

  private onSpawned(world: WorldHandle, items: readonly SpawnEntry[], command: Command,
                    message: ReplyMessage): void {
    for (const item of message.items) {
      const asked = items[item.index];
      if (item.code === Status.ok && asked !== undefined && item.avatar !== 0) {
        if (world.spawned.size < maxItems && !world.spawned.has(item.avatar)) {
          world.spawned.set(item.avatar, {...asked, avatar: item.avatar});
        }
      } else if (command.answer === null && item.code !== Status.avatar_exists) {
        // An avatar may still exist if the server lost only the session. That is not an error.
        this.later(() => this.listeners.emit('notice', item.code,
                                             item.text || statusText(item.code)));
      }
    }
  }

  private onJoinReply(world: WorldHandle, message: ReplyMessage): void {
    const joined = message.code === Status.ok;
    if (joined && world.serverId === 0) {
      throw new Malformed('confirms a join that has no WorldInfo', 'Reply');
    }
    if (joined) {
      if (world.state === 'joining') this.setWorldState(world, 'joined');
    } else {
      world.reset();
      if (world.state !== 'left') this.setWorldState(world, 'refused');
      this.failUnsent(world, Status.not_joined, message.text);
      world.subscriptions.clear();
      world.updateFilter();
    }
    this.answerJoin(world, makeReply(message.code, message.text, message));
  }

  private findWorld(serverId: number): WorldHandle | undefined {
    for (const world of this.worlds) {
      if (world.serverId === serverId) return world;
    }
    return undefined;
  }

  private onPoseBatch(message: PoseBatch, nowS: number): void {
    const world = this.findWorld(message.world);
    if (world === undefined || world.skeleton === null || world.subscriptions.size === 0) return;
    this.clock.addSample(nowS, message.serverTimeS);
    this.followJitter(nowS);
    const mode = message.mode as BatchMode;
    // Stored in the batch, because recorded batches may outlive the world's current codecs.
    const codec = world.codecs[mode as keyof typeof world.codecs] ?? null;
    const batch = {...message, mode, codec};
    world.view.addBatch(batch, world.everyNTicks(mode));
    world.record.addBatch(batch, world.view.epoch);
  }

  private followJitter(nowS: number): void {
    const lateS = this.clock.lastLatenessS;
    this.jitterS += (lateS - this.jitterS) / 64;
    if (lateS >= this.worstJitterS || nowS - this.worstAtS > 4) {
      this.worstJitterS = lateS;
      this.worstAtS = nowS;
    }
  }

  /** Updates `interpolationDelayS` after poses of a world were sampled for `timeS`. */
  recordSample(world: WorldHandle, timeS: number): void {
    const newestS = world.view.newestTimeS;
    if (newestS === -Infinity) return;
    const behindS = newestS - timeS;
    this.interpolationDelayS += (behindS - this.interpolationDelayS) / 16;
  }

  private onEvents(message: Events): void {
    if (message.number !== 0n) {
      // Ignore events that were sent again after a resume.
      if (message.number <= this.lastEventsNumber) return;
      this.lastEventsNumber = message.number;
    }
    const world = this.findWorld(message.world);
    if (world === undefined) return;
    for (const event of message.events.map(eventOf)) {
      ++this.total.eventsReceived;
      this.followSpawned(world, event);
      world.record.addEvent(event);
      if (world.listeners.has('event')) {
        this.later(() => world.listeners.emit('event', event));
      }
    }
  }

  private followSpawned(world: WorldHandle, event: WorldEvent): void {
    switch (event.type) {
      case 'spawned':
      case 'finished':
      case 'idle': {
        const ours = world.spawned.get(event.avatar);
        if (ours !== undefined) {
          ours.positionM = event.basePositionM;
          ours.headingRad = event.baseHeadingRad;
        }
        break;
      }
      case 'removed':
        world.spawned.delete(event.avatar);
        world.view.remove(event.avatar);
        break;
      case 'left': world.view.leave(event.avatar, event.tick); break;
      default: break;
    }
  }

  private onLagging(message: Lagging): void {
    const world = this.findWorld(message.world);
    if (world === undefined) return;
    const {droppedBatches, droppedEvents} = message;
    this.total.batchesDropped += Math.max(0, droppedBatches - world.reportedDroppedBatches);
    this.total.eventsDropped += Math.max(0, droppedEvents - world.reportedDroppedEvents);
    world.reportedDroppedBatches = Math.max(world.reportedDroppedBatches, droppedBatches);
    world.reportedDroppedEvents = Math.max(world.reportedDroppedEvents, droppedEvents);
    this.later(() => world.listeners.emit('lagging', droppedBatches, droppedEvents));
  }

  private onTerrain(message: WorldTerrain): void {
    const world = this.findWorld(message.world);
    if (world !== undefined) world.terrain = terrainOf(message.terrain);
  }

  private onPong(message: Pong, nowS: number): void {
    this.clock.addSample(nowS, message.serverTimeS);
    if (this.rttsS.length === maxRtts) this.rttsS.shift();
    this.rttsS.push(Math.max(0, nowS - message.timeS));
  }

  private onAvatarState(message: AvatarStateMessage): void {
    const inspection = this.inspections.get(message.nonce);
    if (inspection === undefined) return;
    this.inspections.delete(message.nonce);
    const {code, text} = message;
    this.later(() => code === Status.ok ? inspection.resolve(avatarStateOf(message))
                                        : inspection.reject(new StridewireError(code, text)));
  }

  private onError(message: ErrorNotice, nowS: number): void {
    const {code, text} = message;
    if (!message.fatal) {
      this.later(() => this.listeners.emit('notice', code, text || statusText(code)));
      return;
    }
    const hundred = Math.floor(code / 100);
    if (hundred === 1 || hundred === 2 || code === Status.replaced) {
      return this.closeForGood(code, text);
    }
    this.breakOff(code, text, nowS);
  }

  private onGoodbye(message: Goodbye, nowS: number): void {
    this.resumeToken = new Uint8Array(0);  // The session has ended, so it cannot be resumed.
    if (message.code < 300 || message.code === Status.replaced) {
      return this.closeForGood(message.code, message.text);
    }
    this.breakOff(message.code, message.text, nowS);
  }

  // ---- Ends of connections.

  private breakOff(code: number, text: string, nowS: number): void {
    const sentence = text || statusText(code);
    this.lastErrorText = sentence;
    if (this.stateNow === 'ready') {
      if (nowS - this.readyS >= stableS) this.backoff.reset();
    } else {
      ++this.total.connectFailures;
    }
    this.dropConnection();
    this.nextAttemptS = nowS + this.backoff.next();
    this.setState('waiting');
    this.later(() => this.listeners.emit('error', code, sentence));
  }

  private closeForGood(code: number, text: string): void {
    const sentence = text || statusText(code);
    this.lastErrorText = sentence;
    if (this.stateNow !== 'ready') ++this.total.connectFailures;
    this.failAll(code, sentence);
    this.forgetSession();
    this.dropConnection();
    this.setState('closed');
    this.later(() => this.listeners.emit('error', code, sentence));
  }

  /** Detaches the session from its socket. */
  private dropConnection(): void {
    ++this.connection;
    this.clearOutput();
    for (const {reject} of this.inspections.values()) {
      this.later(() => reject(new StridewireError(Status.connection_lost, '')));
    }
    this.inspections.clear();
  }

  private forgetSession(): void {
    this.unanswered.clear();
    this.hadSession = false;
    this.resumeToken = new Uint8Array(0);
    this.nextSeq = 1n;
    this.resendFrom = 0n;
    this.lastEventsNumber = 0n;
    this.clock.reset();
    this.rttsS.length = 0;
    for (const world of [...this.worlds]) {
      if (world.state === 'left') {
        this.worlds.delete(world);
        continue;
      }
      if (world.state === 'refused') continue;
      world.reset();
      world.spawned.clear();
      for (const wanted of world.subscriptions.values()) wanted.unsent = false;
      this.setWorldState(world, 'pending');
      this.restoreWorld(world, new Map());
    }
  }

  private clearOutput(): void {
    this.output = [];
    this.outputBytes = 0;
  }

  // ---- Notifications.

  private setState(state: ClientState): void {
    if (this.stateNow === state) return;
    this.stateNow = state;
    this.later(() => this.listeners.emit('state', state));
  }

  private setWorldState(world: WorldHandle, state: WorldHandle['state']): void {
    if (world.state === state) return;
    world.state = state;
    this.later(() => world.listeners.emit('state', state));
  }

  private later(notification: () => void): void {
    this.notifications.push(notification);
  }

  /** Calls listeners and promises. Every public method ends with it. If a listener calls the
   * session again, notifications of that call follow after the current ones. */
  private notify(): void {
    if (this.notifying) return;
    this.notifying = true;
    for (const world of this.worlds) {
      if (world.view.version !== world.notifiedVersion) {
        world.notifiedVersion = world.view.version;
        this.later(() => world.listeners.emit('avatars', world.view.avatars()));
      }
      if (world.terrain !== world.notifiedTerrain) {
        world.notifiedTerrain = world.terrain;
        this.later(() => world.listeners.emit('terrain', world.terrain));
      }
    }
    for (let i = 0; i < this.notifications.length; ++i) this.notifications[i]!();
    this.notifications.length = 0;
    this.notifying = false;
    this.wake();
  }
}

function refusal(error: unknown): Reply {
  if (error instanceof StridewireError) return makeReply(error.code, error.message);
  if (error instanceof Malformed) return makeReply(Status.invalid_argument, error.message);
  return makeReply(Status.invalid_argument, error instanceof Error ? error.message : '');
}

function checkOptions(options: SessionOptions): void {
  try {
    checkName(options.clientName, maxNameBytes, 'clientName');
    checkText(options.authToken, maxAuthTokenBytes, 'authToken');
  } catch (error) {
    throw new TypeError(error instanceof Error ? error.message : '');
  }
  const range = (name: keyof SessionOptions, least: number, most: number): void => {
    const value = options[name];
    if (typeof value !== 'number' || !(value >= least && value <= most)) {
      throw new RangeError(`${name}: expected a number from ${least} to ${most}, got ${value}`);
    }
  };
  range('renderDelayS', 0, 60);
  range('maxCommands', 1, 1 << 20);
  range('poseHistory', 4, 4096);
  range('maxPoseBytes', 0, 2 ** 40);
  range('recordingS', 0, 3600);
  range('maxRecordingBytes', 0, 2 ** 40);
  range('maxRecordedEvents', 1, 2 ** 24);
  range('connectTimeoutS', 0.1, 600);
  range('pingIntervalS', 0.05, 600);
  range('seed', 0, 2 ** 32 - 1);
}
