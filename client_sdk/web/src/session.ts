import {Backoff} from './backoff';
import {ClockMap} from './clock_map';
import {StridewireError} from './error';
import {Listeners} from './listeners';
import {WorldRecording} from './recording';
import {Status, statusName, statusText} from './status';
import type {
  AvatarState, ClientListeners, ClientOptions, ClientState, Feature, Observation, Region, Reply, Role,
  Statistics, Subscription, WorldEvent
} from './types';
import * as check from './wire/check';
import {decodeFrame} from './wire/decode';
import {Encoder} from './wire/encode';
import {
  featureCompact, featureDetail, featureEventReplay, featureFootprints, featureInspect, featurePlanting, featureQuantised, featureRefusals, featureRegions, featureResume,
  featureLayers, featureTakeovers, featureTerrain, featureWalks, maxBulkBytes, maxControlBytes, maxItems, maxReplyMemory,
  maxAvatarNumber, maxNameBytes, maxAuthTokenBytes, protocolVersion
} from './wire/limits';
import {Malformed} from './wire/malformed';
import type {
  AvatarStateMessage, ClientMessage, CommandMessage, ErrorNotice, Events, Goodbye, Lagging, Pong,
  PoseBatch, ReplyMessage, ServerLimits, SpawnEntry, Welcome, WorldInfo, WorldTerrain
} from './wire/messages';
import {checkName, checkText} from './wire/text';
import {WorldHandle} from './world';
import {WorldView, type PoseBudget, type PoseCounts} from './world_view';

const featureBits: Record<Feature, bigint> = {
  inspect: featureInspect, terrain: featureTerrain, footprints: featureFootprints, walks: featureWalks,
  takeovers: featureTakeovers, layers: featureLayers, refusals: featureRefusals,
  planting: featurePlanting, regions: featureRegions, detail: featureDetail | featureCompact,
};

/** What the caller may set, filled in. */
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

/** Bytes waiting for the socket above which no further command is encoded. */
const maxOutputBytes = 1 << 20;
const maxWorlds = 256;
const maxSubscriptions = 256;  // Of one world.
const maxInspections = 64;
const maxRtts = 16;
/** A connection that was ready for this long starts the back-off afresh. */
const stableS = 2;
const goodbyeS = 1;
const inspectTimeoutS = 10;

export interface Command {
  readonly world: WorldHandle;
  readonly message: CommandMessage;
  /** Null: given by the session itself, after it was lost. */
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
 * The client's side of protocol/STATE_MACHINE.md, without socket, clock or timer: frames and times
 * are arguments, so tests replay any order of things.
 *
 *   idle --open--> waiting --startConnecting--> connecting --onConnected--> greeting
 *                    ^  ^                           |                          | Welcome
 *                    |  +---------- failed ---------+                          v
 *                    +------------ lost, or the server ends the session ----- ready --close-->
 *   closed: refused for good.                                              closing --> idle
 *
 * A command passes through three places: `unsent` of its world (until WorldInfo told the server's
 * number of that world, and while too much is under way), `unanswered` in order of seq, and its
 * answer. A lost session gives worlds and subscriptions their commands anew, ahead of what had not
 * been sent. Worlds and subscriptions outlive `close`, too: they are asked for at the next `open`.
 *
 * What listeners and promises are told waits until the session has done with what it was at.
 */
export class Session {
  readonly listeners = new Listeners<ClientListeners>();
  readonly clock = new ClockMap();
  /** Bytes that the socket has not sent yet. */
  socketBytes: () => number = () => 0;
  /** The network has something to do: output, or another state. */
  wake: () => void = () => {};

  private stateNow: ClientState = 'idle';
  private lastErrorText = '';
  private readonly backoff: Backoff;
  private readonly budget: PoseBudget;
  private readonly counts: PoseCounts =
      {batches: 0, poses: 0, refused: 0, missing: 0, starved: 0, decodeMs: 0};
  private readonly worlds = new Set<WorldHandle>();
  private nextSubscription = 1;
  private nextRequestId = 1n;
  private readonly unanswered = new Map<bigint, Command>();
  /** Unanswered ones from here on have to go out again; 0: none. */
  private resendFrom = 0n;
  private commandCount = 0;
  private readonly inspections = new Map<bigint, Inspection>();
  private nextNonce = 1n;

  // The session as the server knows it.
  private hadSession = false;
  private resumeToken: Uint8Array = new Uint8Array(0);  // Empty once the server has ended the session.
  private nextSeq = 1n;
  private lastEventsNumber = 0n;
  private features = 0n;
  private limits: ServerLimits | null = null;
  private tickHzNow = 60;

  // The connection.
  private connection = 0;
  private nextAttemptS = 0;
  private deadlineS = 0;
  private readyS = 0;
  private heardS = 0;
  private nextPingS = 0;
  private encoder = new Encoder();
  private output: ArrayBuffer[] = [];
  private outputBytes = 0;

  private readonly told: (() => void)[] = [];
  private telling = false;
  private readonly rttsS: number[] = [];
  private readonly total = {
    bytesReceived: 0, poseBytesReceived: 0, bytesSent: 0, framesReceived: 0, batchesDropped: 0,
    eventsDropped: 0, eventsReceived: 0, invalidFrames: 0, commandsSent: 0, commandsResent: 0, connects: 0,
    resumes: 0, connectFailures: 0,
  };
  private jitterS = 0;
  private worstJitterS = 0;
  private worstAtS = 0;
  private interpolationDelayS = 0;

  /** @throws RangeError, TypeError: an option makes no sense. */
  constructor(private readonly options: SessionOptions,
              private readonly precisionNowMs: () => number) {
    checkOptions(options);
    this.backoff = new Backoff(options.seed);
    this.budget = {limitBytes: options.maxPoseBytes, usedBytes: 0};
  }

  // ---- the caller's side

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

  /** Nothing if it is open already. */
  open(nowS: number): void {
    if (this.isOpen()) return;
    this.dropConnection();
    this.backoff.reset();
    this.lastErrorText = '';
    this.nextAttemptS = nowS;
    this.setState('waiting');
    this.tell();
  }

  /** Says goodbye; commands without an answer are answered `cancelled`. */
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
    this.tell();
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
        // A refused world makes room for trying again.
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
    this.tell();
    return world;
  }

  /** A command; `make` checks what the caller passed. */
  command(world: WorldHandle, make: () => CommandMessage): Promise<Reply> {
    return new Promise((resolve) => {
      try {
        if (!this.isOpen()) throw new StridewireError(Status.closed, '');
        this.enqueue(world, make(), resolve);
        this.pump();
      } catch (error) {
        resolve(refusal(error));
      }
      this.tell();
    });
  }

  observe(world: WorldHandle, observation: Observation): Subscription {
    const id = this.nextSubscription++;
    const reply = new Promise<Reply>((resolve) => {
      try {
        if (world.subscriptions.size >= maxSubscriptions) {
          throw new StridewireError(Status.limit_reached, 'Too many subscriptions of one world.');
        }
        const message = {...check.observe(observation), subscription: id};
        this.enqueue(world, message, resolve);
        world.subscriptions.set(id, {message, unsent: true});
        world.updateFilter();
        this.pump();
      } catch (error) {
        resolve(refusal(error));
      }
      this.tell();
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
          throw new StridewireError(Status.no_such_subscription, 'No region has this number.');
        }
        const {mode, detail} = wanted.message;
        const entry = check.region(region, mode, detail);
        this.enqueue(world, {...wanted.message, seq: 0n, region: entry, replace: true}, resolve);
        wanted.message.region = entry;
        this.pump();
      } catch (error) {
        resolve(refusal(error));
      }
      this.tell();
    });
  }

  private stopObserving(world: WorldHandle, id: number): Promise<Reply> {
    return new Promise((resolve) => {
      try {
        const wanted = world.subscriptions.get(id);
        if (wanted === undefined) throw new StridewireError(Status.no_such_subscription, '');
        if (wanted.unsent) {
          // The server never heard of it: neither shall it.
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
      this.tell();
    });
  }

  leave(world: WorldHandle): Promise<Reply> {
    return new Promise((resolve) => {
      try {
        if (!this.worlds.has(world)) throw new StridewireError(Status.not_joined, '');
        if (world.serverId === 0 && world.state === 'wanted') {
          this.worlds.delete(world);
          this.failWorld(world, Status.not_joined, 'The world was left.');
          world.forget();
          this.later(() => resolve(makeReply(0, '')));
        } else {
          this.enqueue(world, {type: 'LeaveWorld', seq: 0n, world: 0}, resolve);
        }
        this.setWorldState(world, 'left');
        this.pump();
      } catch (error) {
        resolve(refusal(error));
      }
      this.tell();
    });
  }

  inspect(world: WorldHandle, avatar: number): Promise<AvatarState> {
    return new Promise((resolve, reject) => {
      const refuse = (code: number, text = ''): void => reject(new StridewireError(code, text));
      if (!Number.isInteger(avatar) || avatar < 1 || avatar > maxAvatarNumber) {
        return refuse(Status.invalid_argument, 'avatar: is not a whole number from 1 on');
      }
      if (this.stateNow !== 'ready' || world.serverId === 0) return refuse(Status.not_ready);
      if ((this.features & featureInspect) === 0n) {
        return refuse(Status.unsupported, 'This server does not tell what avatars do.');
      }
      if (this.inspections.size >= maxInspections) return refuse(Status.commands_full);
      const nonce = this.nextNonce++;
      const deadlineS = this.heardS + inspectTimeoutS;
      this.inspections.set(nonce, {resolve, reject, deadlineS});
      this.send({type: 'InspectAvatar', nonce, world: world.serverId, avatar});
      this.tell();
    });
  }

  statistics(): Statistics {
    const {decodeMs, batches, poses, refused, missing, starved} = this.counts;
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
      posesMissed: starved,
      decodeNsPerPose: poses === 0 ? 0 : 1e6 * decodeMs / poses,
      bufferedBytes: this.budget.usedBytes + recorded + this.outputBytes + this.socketBytes(),
    };
  }

  // ---- the network's side. Times do not go back.

  /** Whether an attempt is due; then call startConnecting. */
  connectDue(nowS: number): boolean {
    return this.stateNow === 'waiting' && nowS >= this.nextAttemptS;
  }

  /** Grows with every connection, so that late frames of an old one are told apart. */
  get connectionNumber(): number {
    return this.connection;
  }

  /** Whether a socket belongs to this state; if not any more, the network closes it. */
  get needsSocket(): boolean {
    return this.stateNow === 'connecting' || this.stateNow === 'greeting' ||
        this.stateNow === 'ready' || this.stateNow === 'closing';
  }

  /** When advanceTime or connectDue has something to do next; Infinity: never. */
  get nextTimeS(): number {
    switch (this.stateNow) {
      case 'waiting': return this.nextAttemptS;
      case 'ready': return Math.min(this.nextPingS, this.heardS + (this.idleTimeoutS || Infinity));
      case 'connecting':
      case 'greeting':
      case 'closing': return this.deadlineS;
      default: return Infinity;
    }
  }

  startConnecting(nowS: number): void {
    this.deadlineS = nowS + this.options.connectTimeoutS;
    ++this.connection;
    this.setState('connecting');
    this.tell();
  }

  onConnected(nowS: number): void {
    if (this.stateNow !== 'connecting') return;
    this.deadlineS = nowS + this.options.connectTimeoutS;
    this.heardS = nowS;
    this.encoder = new Encoder();
    this.clearOutput();
    this.setState('greeting');
    this.send({
      type: 'Hello',
      protocolMin: protocolVersion,
      protocolMax: protocolVersion,
      clientName: this.options.clientName,
      features: featureResume | featureEventReplay | featureQuantised | featureInspect |
          featureTerrain | featureFootprints | featureWalks | featureTakeovers | featureLayers |
          featureRefusals | featureRegions | featurePlanting | featureCompact | featureDetail,
      authToken: this.options.authToken,
      resumeToken: this.resumeToken,
      lastEventsNumber: this.resumeToken.length === 0 ? 0n : this.lastEventsNumber,
    });
    this.tell();
  }

  /** One message of the socket. Whatever it holds, nothing is thrown. */
  onFrame(frame: ArrayBuffer, nowS: number): void {
    if (this.stateNow !== 'greeting' && this.stateNow !== 'ready') return;
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
    this.tell();
  }

  /** The server sent what is no frame, such as text. */
  onInvalid(text: string, nowS: number): void {
    if (this.stateNow !== 'greeting' && this.stateNow !== 'ready') return;
    ++this.total.invalidFrames;
    this.breakOff(Status.protocol_error, text, nowS);
    this.tell();
  }

  /** The attempt failed or the connection broke. */
  onLost(code: number, text: string, nowS: number): void {
    if (this.stateNow === 'closing') {
      this.dropConnection();
      this.setState('idle');
    } else if (this.stateNow === 'connecting' || this.stateNow === 'greeting' ||
               this.stateNow === 'ready') {
      this.breakOff(code, text, nowS);
    }
    this.tell();
  }

  /** Time-outs and pings. */
  advanceTime(nowS: number): void {
    switch (this.stateNow) {
      case 'connecting':
        if (nowS >= this.deadlineS) {
          this.breakOff(Status.timeout, 'Connecting took too long.', nowS);
        }
        break;
      case 'greeting':
        if (nowS >= this.deadlineS) {
          this.breakOff(Status.timeout, 'The server did not answer the greeting in time.', nowS);
        }
        break;
      case 'ready':
        for (const [nonce, inspection] of this.inspections) {
          if (nowS < inspection.deadlineS) continue;
          this.inspections.delete(nonce);
          this.later(() => inspection.reject(new StridewireError(Status.timeout, '')));
        }
        if (this.idleTimeoutS > 0 && nowS - this.heardS > this.idleTimeoutS) {
          this.breakOff(Status.timeout, 'Nothing was heard from the server for too long.', nowS);
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
    this.tell();
  }

  /** Takes what is to be written. */
  takeOutput(): ArrayBuffer[] {
    this.pump();
    const output = this.output;
    this.total.bytesSent += this.outputBytes;
    this.clearOutput();
    return output;
  }

  /** All that was taken has left. */
  onOutputWritten(): void {
    if (this.stateNow === 'closing' && this.output.length === 0) {
      this.dropConnection();
      this.setState('idle');
      this.tell();
    }
  }

  // ---- commands

  private get idleTimeoutS(): number {
    return this.limits?.idleTimeoutS ?? 0;
  }

  private isOpen(): boolean {
    return this.stateNow === 'waiting' || this.stateNow === 'connecting' ||
        this.stateNow === 'greeting' || this.stateNow === 'ready';
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
    const memory = Math.min(Math.max(this.limits?.replyMemory ?? 1, 1), maxReplyMemory);
    return this.pending < maxOutputBytes && this.unanswered.size < memory;
  }

  /** Encodes what may go out now. */
  private pump(): void {
    if (this.stateNow !== 'ready') return;

    // First what the server may have heard already, in order.
    while (this.resendFrom !== 0n && this.pending < maxOutputBytes) {
      let next: Command | undefined;
      for (const [seq, command] of this.unanswered) {  // In order of seq.
        if (seq < this.resendFrom) continue;
        next = command;
        this.resendFrom = seq + 1n;
        break;
      }
      if (next === undefined) {
        this.resendFrom = 0n;
      } else if (this.send(next.message)) {
        // It could be encoded before; a server that has lowered its limits since gets a gap and
        // says so.
        ++this.total.commandsResent;
      }
    }
    if (this.resendFrom !== 0n) return;

    for (const world of this.worlds) {
      if (world.state === 'wanted' && this.maySend()) {
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
    if (!this.understands(message)) {
      if (message.type === 'Observe' && world.subscriptions.delete(message.subscription)) {
        world.updateFilter();
      }
      this.answer(command, Status.unsupported, '');
      return;
    }
    message.seq = this.nextSeq;
    if ('world' in message) message.world = world.serverId;
    if (!this.send(message)) {
      // Larger than this server takes: its number was not used.
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

  /** Of the connection that is ready; false while none is. */
  has(feature: Feature): boolean {
    return this.state === 'ready' && this.hasAll(featureBits[feature]);
  }

  private hasAll(bits: bigint): boolean {
    return (this.features & bits) === bits;
  }

  /** Whether this server knows what it is asked. */
  private understands(message: CommandMessage): boolean {
    switch (message.type) {
      case 'SetTerrain': return (this.features & featureTerrain) !== 0n;
      case 'SetLayers': return (this.features & featureLayers) !== 0n;
      case 'SetPlanting': return (this.features & featurePlanting) !== 0n;
      case 'Observe':
        return (message.region === null || this.hasAll(featureRegions)) &&
            ((message.detail === 'all' && (message.region?.ringDetails.length ?? 0) === 0) ||
             this.hasAll(featureBits.detail));
      case 'Request':
        return message.items.every((item) => (item.atM === null ||
            (this.features & (item.type === 'walk' ? featureWalks : featureFootprints)) !== 0n) &&
            (item.takeover === 'none' || (this.features & featureTakeovers) !== 0n) &&
            (!item.mustBeMet || (this.features & featureRefusals) !== 0n));
      default: return true;
    }
  }

  /** False: it is larger than the server takes; `lastError` says so. */
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

  /** Ends a command: its caller hears, and its place is free. */
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

  // ---- messages

  private handle(frame: ArrayBuffer, nowS: number): void {
    const message = decodeFrame(frame, 'server');
    if (message.type === 'Welcome') return this.onWelcome(message, nowS);
    if (message.type === 'Error') return this.onError(message, nowS);
    if (message.type === 'Goodbye') return this.onGoodbye(message, nowS);
    if (this.stateNow !== 'ready') throw new Malformed('came before the welcome', message.type);
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
      case 'LibraryPiece': throw new Malformed('was not agreed on', message.type);
      default: throw new Malformed("is a client's message", message.type);
    }
  }

  private onWelcome(message: Welcome, nowS: number): void {
    if (this.stateNow !== 'greeting') throw new Malformed('came twice', 'Welcome');
    if (message.resumed && this.resumeToken.length === 0) {
      throw new Malformed('resumes a session that was none', 'Welcome');
    }
    if (message.protocol !== protocolVersion) {
      return this.closeForGood(Status.version_mismatch, 'The server speaks another version.');
    }
    this.readyS = nowS;
    this.limits = message.limits;
    this.features = message.features;
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
      for (const world of this.worlds) world.view.breakOff();
    } else {
      const lost = this.hadSession;
      if (lost) this.later(() => this.listeners.emit('sessionLost'));
      this.startAnew();
    }
    this.hadSession = true;
    this.sendPing(nowS);
  }

  /** The server knows nothing of us: what is wanted gets its commands anew. */
  private startAnew(): void {
    this.nextSeq = 1n;
    this.resendFrom = 0n;
    this.lastEventsNumber = 0n;
    this.clock.reset();

    // Observe keeps the answer its caller waits for.
    const observing = new Map<number, Command>();
    const unanswered = [...this.unanswered.values()];
    this.unanswered.clear();
    for (const command of unanswered) {
      const {message, world} = command;
      switch (message.type) {
        case 'JoinWorld': break;
        case 'LeaveWorld':
        case 'StopObserving': this.answer(command, Status.ok, ''); break;  // Nothing to leave.
        case 'Observe':
          if (message.replace) {  // What is observed anew is there already.
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
        world.forget();
        this.worlds.delete(world);
        continue;
      }
      if (world.state === 'refused') continue;
      world.forget();
      this.setWorldState(world, 'wanted');
      this.wantAgain(world, observing);
    }
  }

  /** Puts the commands that a world's subscriptions and avatars need ahead of what waits. */
  private wantAgain(world: WorldHandle, observing: ReadonlyMap<number, Command>): void {
    const first: Command[] = [];
    for (const [id, wanted] of world.subscriptions) {
      if (wanted.unsent) continue;  // Still waiting in its place.
      wanted.unsent = true;
      const asked = observing.get(id);  // Its region may have moved since.
      first.push({world, message: {...wanted.message}, answer: asked?.answer ?? null});
    }
    // An own command that was still unsent when the session was lost again is among those anew.
    world.unsent = world.unsent.filter(
        (command) => command.answer !== null || command.message.type !== 'Spawn');
    if (this.options.respawn) {
      const most = Math.min(Math.max(this.limits?.maxItems || maxItems, 1), maxItems);
      const items = [...world.spawned.values()].map((item) => ({...item}));  // As sent.
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
        throw new Malformed('answers another command', 'WorldInfo');
      }
      world = command.world;
    } else {
      for (const candidate of this.worlds) {
        if (candidate.name === message.name && candidate.state !== 'refused') world = candidate;
      }
    }
    if (world === undefined) return;
    world.serverId = message.world;
    world.describe(message);
    const told = world;
    this.later(() => told.listeners.emit('state', told.state));
  }

  private onReply(message: ReplyMessage): void {
    const command = this.unanswered.get(message.seq);
    if (command === undefined) return;  // Answered twice, before and after a resume.
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
          // Poses that came before, if any, belong to a subscription that has ended; the server
          // cannot tell it in a batch that others get too.
          world.view.breakOff();
        }
        break;
      case 'StopObserving':
        // Not observing is what was wanted.
        if (code === Status.no_such_subscription) code = Status.ok;
        break;
      case 'LeaveWorld':
        this.worlds.delete(world);
        this.failWorld(world, Status.not_joined, 'The world was left.');
        world.forget();
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
        // What we spawn anew may still be there: the server lost the session, not the world.
        this.later(() => this.listeners.emit('notice', item.code,
                                             item.text || statusText(item.code)));
      }
    }
  }

  private onJoinReply(world: WorldHandle, message: ReplyMessage): void {
    const joined = message.code === Status.ok;
    if (joined && world.serverId === 0) {
      throw new Malformed('says that a world was joined, which was not described', 'Reply');
    }
    if (joined) {
      if (world.state === 'joining') this.setWorldState(world, 'joined');
    } else {
      world.forget();
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
    message.codec = world.codecs[message.mode] ?? null;  // Recorded with it: a later server may tell others.
    world.view.take(message, world.everyNTicks(message.mode));
    world.record.addBatch(message, world.view.epoch);
  }

  private followJitter(nowS: number): void {
    const lateS = this.clock.lastLatenessS;
    this.jitterS += (lateS - this.jitterS) / 64;
    if (lateS >= this.worstJitterS || nowS - this.worstAtS > 4) {
      this.worstJitterS = lateS;
      this.worstAtS = nowS;
    }
  }

  /** Poses of a world were sampled for `timeS`: how far behind the newest one is that? */
  noteSampled(world: WorldHandle, timeS: number): void {
    const newestS = world.view.newestTimeS;
    if (newestS === -Infinity) return;
    const behindS = newestS - timeS;
    this.interpolationDelayS += (behindS - this.interpolationDelayS) / 16;
  }

  private onEvents(message: Events): void {
    if (message.number !== 0n) {
      if (message.number <= this.lastEventsNumber) return;  // Sent again, and heard before.
      this.lastEventsNumber = message.number;
    }
    const world = this.findWorld(message.world);
    if (world === undefined) return;
    for (const event of message.events) {
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
    this.total.batchesDropped += Math.max(0, droppedBatches - world.toldDroppedBatches);
    this.total.eventsDropped += Math.max(0, droppedEvents - world.toldDroppedEvents);
    world.toldDroppedBatches = Math.max(world.toldDroppedBatches, droppedBatches);
    world.toldDroppedEvents = Math.max(world.toldDroppedEvents, droppedEvents);
    this.later(() => world.listeners.emit('lagging', droppedBatches, droppedEvents));
  }

  private onTerrain(message: WorldTerrain): void {
    const world = this.findWorld(message.world);
    if (world !== undefined) world.terrain = message.terrain;
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
    const {code, text, state} = message;
    this.later(() => code === Status.ok ? inspection.resolve(state)
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
    this.resumeToken = new Uint8Array(0);  // The session has ended.
    if (message.code < 300 || message.code === Status.replaced) {
      return this.closeForGood(message.code, message.text);
    }
    this.breakOff(message.code, message.text, nowS);
  }

  // ---- ends

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

  /** Whatever socket there is, it is no longer ours. */
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
      world.forget();
      world.spawned.clear();
      for (const wanted of world.subscriptions.values()) wanted.unsent = false;
      this.setWorldState(world, 'wanted');
      this.wantAgain(world, new Map());
    }
  }

  private clearOutput(): void {
    this.output = [];
    this.outputBytes = 0;
  }

  // ---- telling

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

  private later(tell: () => void): void {
    this.told.push(tell);
  }

  /** At the end of each call from outside. A listener's own calls are done when they are made, and
   * what they tell comes after. */
  private tell(): void {
    if (this.telling) return;
    this.telling = true;
    for (const world of this.worlds) {
      if (world.view.version !== world.toldVersion) {
        world.toldVersion = world.view.version;
        this.later(() => world.listeners.emit('avatars', world.view.avatars()));
      }
      if (world.terrain !== world.toldTerrain) {
        world.toldTerrain = world.terrain;
        this.later(() => world.listeners.emit('terrain', world.terrain));
      }
    }
    for (let i = 0; i < this.told.length; ++i) this.told[i]!();
    this.told.length = 0;
    this.telling = false;
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
      throw new RangeError(`${name}: is not a number from ${least} to ${most}`);
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
