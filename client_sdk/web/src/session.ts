import type {ClientListeners, ClientState, Statistics} from './client_types';
import {StridewireError} from './error';
import {Listeners} from './listeners';
import {native, webNames} from './native';
import {makeReply, refusal} from './reply';
import {createClient, type SessionOptions} from './session_options';
import {Status, statusText} from './status';
import type {AvatarState, Observation, Reply, Role, Subscription, WorldState} from './types';
import {MessageType, type Events, type Message} from '../generated/messages';
import {NativeEvent, readStatistics} from '../generated/native';
import * as commands from './wire/commands';
import {avatarStateOf, eventOf} from './wire/convert';
import {
  frameHeaderBytes, readMessage, typeOfFrame, writeMessage, type Draft
} from './wire/frame';
import {WorldHandle} from './world';

const cacheTimeoutS = 5;

/** States of the module, in the order of their numbers. */
const states: readonly ClientState[] =
    ['idle', 'waiting', 'connecting', 'handshake', 'ready', 'closing', 'closed'];
const worldStates: readonly WorldState[] = ['pending', 'joining', 'joined', 'refused', 'left'];
/** Messages that the module processes only in part. `onMessage` processes the rest. */
const userMessages: readonly number[] = [MessageType.WorldInfo, MessageType.Events];

/** Called with the reply to a command or inspection, and with the message that describes it. */
type Answer = (reply: Reply, message?: Message) => void;

/**
 * A session of the web client. It wraps a session of the C++ client, which runs in the WebAssembly
 * module (client_sdk/src/session.h describes its states). The module stores worlds, commands and
 * poses, and maps local time to server time. This class resolves promises and calls listeners when
 * the module reports events.
 *
 * This class has no socket, and no timer except those that limit the time for loading a cached
 * library. Frames and the current time are arguments. It resolves promises and calls listeners only
 * after the module has finished processing.
 */
export class Session {
  readonly listeners = new Listeners<ClientListeners>();
  /** Returns the number of bytes that the socket has not sent yet. */
  socketBytes: () => number = () => 0;
  /** Called when there is output to send or the state has changed. */
  wake: () => void = () => {};
  /** Address of the client in the module. */
  readonly client: number;

  state: ClientState = 'idle';
  lastError = '';
  private readonly worlds = new Set<WorldHandle>();
  /** The next id for a request without an id. */
  nextRequestId = 1n;
  /** Unanswered commands and inspections, by their numbers. */
  private readonly pending = new Map<number, Answer>();
  private lastEventsNumber = 0n;
  /** The command that the last frame has answered, or 0. */
  private answered = 0;

  private readonly notifications: (() => void)[] = [];
  private notifying = false;
  private readonly total = {
    poseBytesReceived: 0, libraryBytesReceived: 0, framesReceived: 0, eventsDropped: 0,
    invalidFrames: 0,
  };
  private decodeMs = 0;
  private interpolationDelayS = 0;

  /**
   * @throws RangeError a number among the options is out of range
   * @throws TypeError a text among the options is invalid
   * @throws Error WebAssembly or its SIMD instructions are missing
   */
  constructor(private readonly options: SessionOptions,
              private readonly precisionNowMs: () => number) {
    this.client = createClient(options);
    finalizers.register(this, this.client);
  }

  // ---- Methods that the application calls.

  /** Starts to connect. Does nothing if already open. `addressIndex` of `network` is an index in
   * `urls`. */
  open(nowS: number, urls: readonly string[] = ['']): void {
    if (['waiting', 'connecting', 'handshake', 'ready'].includes(this.state)) return;
    this.lastError = '';
    this.run(() => {
      const bytes = native().setInputText(urls.map((url) => `${url}\n`).join(''));
      native().call.open(this.client, bytes, nowS);
    });
  }

  /** Ends the session with Goodbye. Unanswered commands fail with `cancelled`. */
  close(nowS: number): void {
    this.run(() => native().call.close(this.client, nowS));
  }

  joinWorld(name: string, role: Role): WorldHandle {
    const {recordingS, maxRecordedEvents} = this.options;
    const world = new WorldHandle(this, name, role, recordingS, maxRecordedEvents);
    world.joined = this.command(world, () => ({type: 'JoinWorld', name, role}), (handle) => {
      world.handle = handle;
      this.worlds.add(world);
    });
    if (world.handle === 0) world.state = 'refused';
    return world;
  }

  /**
   * Sends the command that `make` returns. `make` throws an error if an argument is invalid. Calls
   * `accept` with the number of the new world or subscription, unless the module refuses the
   * command.
   */
  command(world: WorldHandle, make: () => Draft,
          accept?: (number: number) => void): Promise<Reply> {
    return new Promise((resolve) => this.send(world, make, resolve, accept));
  }

  /** If the command cannot be sent, the error becomes its answer. */
  private send(world: WorldHandle, make: () => Draft, answer: Answer,
               accept: (number: number) => void = () => {}): void {
    this.run(() => {
      try {
        const message = make();
        const bytes = native().setInput(writeMessage(message));
        const type = MessageType[message.type];
        const code = native().call.command(this.client, world.handle, type, bytes);
        if (code !== 0) throw new StridewireError(code, webNames(native().text));
        const [command, number] = native().results;
        this.pending.set(command!, answer);
        accept(number!);
      } catch (error) {
        answer(refusal(error));
      }
    });
  }

  observe(world: WorldHandle, observation: Observation): Subscription {
    const observed = {...observation};
    let id = 0;
    const reply = this.command(
        world, () => commands.observe(observation), (number) => id = number);
    return {
      id,
      reply,
      moveRegion: (region) => this.command(world, () => ({
        ...commands.observe({...observed, avatars: [], region}), subscription: id, replace: true
      })),
      stop: () => this.command(world, () => ({type: 'StopObserving', subscription: id})),
    };
  }

  inspect(world: WorldHandle, avatar: number): Promise<AvatarState> {
    return new Promise((resolve, reject) => this.send(
        world, () => ({type: 'InspectAvatar', nonce: 0n, avatar}), ({ok, code, text}, message) => {
          if (ok && message?.type === 'AvatarState') resolve(avatarStateOf(message));
          else reject(new StridewireError(code, text));
        }));
  }

  statistics(nowS = 0): Statistics {
    const address = native().call.statistics(this.client, nowS);
    const counts = readStatistics(new DataView(native().memoryBuffer, address));
    const {connects, posesReceived} = counts;
    let bufferedBytes = counts.bufferedBytes + this.socketBytes();
    for (const world of this.worlds) bufferedBytes += world.record.bytes;
    return {
      ...counts, ...this.total, bufferedBytes,
      reconnects: Math.max(0, connects - 1),
      interpolationDelayS: this.interpolationDelayS,
      decodeNsPerPose: posesReceived === 0 ? 0 : 1e6 * this.decodeMs / posesReceived,
    };
  }

  /** Updates `interpolationDelayS` when poses of a world are sampled for `timeS`. */
  recordSample(world: WorldHandle, timeS: number): void {
    const newestS = world.stateNumbers()?.[1] ?? -Infinity;
    if (newestS === -Infinity) return;
    this.interpolationDelayS += (newestS - timeS - this.interpolationDelayS) / 16;
  }

  // ---- Methods that the network calls. Times must not decrease.

  /**
   * Returns the state of the session for the network. Flags are 0 or 1. `nextTimeS`: time at which
   * to call `advanceTime` or this function; Infinity: never. `connectDue`: call `startConnecting`,
   * and connect to the address with the index `addressIndex`. `needsSocket`: if not, close the
   * socket. `connectionNumber` increases with every connection.
   */
  network(nowS = 0): {
    nextTimeS: number, connectDue: number, needsSocket: number, connectionNumber: number,
    outputBytes: number, addressIndex: number,
  } {
    native().call.state(this.client, nowS);
    const {results} = native();
    return {
      nextTimeS: results[0]!, connectDue: results[1]!, needsSocket: results[2]!,
      connectionNumber: results[3]!, outputBytes: results[4]!, addressIndex: results[5]!,
    };
  }

  startConnecting(nowS: number): void {
    this.run(() => native().call.start_connecting(this.client, nowS));
  }

  onConnected(nowS: number): void {
    this.run(() => native().call.on_connected(this.client, nowS));
  }

  /**
   * Processes a received message: one frame, or several frames with poses or movements. Never
   * throws, whatever the message contains.
   */
  onFrames(frame: ArrayBuffer, nowS: number): void {
    if (this.state !== 'handshake' && this.state !== 'ready') return;
    const type = typeOfFrame(frame);
    this.total.framesReceived += countFrames(frame);
    const hasPoses = type === MessageType.PoseBatch || type === MessageType.Movements;
    if (hasPoses) this.total.poseBytesReceived += frame.byteLength;
    if (type === MessageType.LibraryPiece) this.total.libraryBytesReceived += frame.byteLength;
    const startedMs = hasPoses ? this.precisionNowMs() : 0;
    this.run(() => {
      native().setInput(new Uint8Array(frame));
      this.answered = native().call.on_message(this.client, frame.byteLength, nowS);
      if (hasPoses) this.decodeMs += this.precisionNowMs() - startedMs;
    }, frame);
  }

  /** Call it if the server sent something other than a binary message. */
  onInvalid(text: string, nowS: number): void {
    if (this.state !== 'handshake' && this.state !== 'ready') return;
    this.onLost(Status.protocol_error, text, nowS);
  }

  /** Call it if the connection attempt failed or the connection was lost. */
  onLost(code: number, text: string, nowS: number): void {
    this.run(() => {
      const bytes = native().setInputText(text);
      native().call.on_lost(this.client, code, bytes, nowS);
    });
  }

  /** Handles timeouts and sends pings. */
  advanceTime(nowS: number): void {
    this.run(() => native().call.advance(this.client, nowS));
  }

  /** Returns the frames to send and removes them from the output. */
  takeOutput(): ArrayBuffer[] {
    const bytes = native().call.take_output(this.client);
    if (bytes === 0) return [];
    const {buffer} = native().bytes(native().results[0]!, bytes);
    const view = new DataView(buffer);
    const frames: ArrayBuffer[] = [];
    for (let at = 0; at < bytes;) {
      const end = at + frameHeaderBytes + view.getUint32(at + 8, true);
      frames.push(buffer.slice(at, end));
      at = end;
    }
    return frames;
  }

  /** Call it when all frames of takeOutput have been passed to the socket. */
  onOutputWritten(): void {
    this.run(() => native().call.on_output_written(this.client));
  }

  // ---- Events of the module.

  /**
   * Calls the module and handles its events. `frame` is the frame that the server has sent, if any.
   */
  private run(call: () => void, frame?: ArrayBuffer): void {
    try {
      call();
    } catch (error) {
      throw native().explain(error);
    }
    this.takeEvents(frame);
    this.takeLibraryRequests();
    this.synchronise();
    this.notify();
  }

  /**
   * Loads libraries from the cache and stores new ones. If this fails, the client only has to fetch
   * a library again.
   */
  private takeLibraryRequests(): void {
    const {libraryCache: cache} = this.options;
    if (cache === null) return;
    for (;;) {
      const request = native().call.take_library_request(this.client);
      if (request === 0) return;
      const hash = native().text;
      if (request === 1) {
        // The promises below also handle exceptions of the cache. The timeout consists of several
        // short timers, because a busy page cannot receive the cache's answer. However long the
        // page is busy, only one of the timers elapses meanwhile.
        let timer: ReturnType<typeof setTimeout>;
        const wait = (seconds: number): void => {
          if (seconds === 0) this.onLibrary(hash, null);
          else timer = setTimeout(() => wait(seconds - 1), 1000);
        };
        wait(cacheTimeoutS);
        const finish = (file: Uint8Array | null): void => {
          clearTimeout(timer);
          this.onLibrary(hash, file);
        };
        Promise.resolve(hash).then((key) => cache.load(key)).then(finish, () => finish(null));
      } else {
        const [at, bytes] = native().results;
        const file = native().bytes(at!, bytes!);
        Promise.resolve(hash).then((key) => cache.store(key, file)).catch(() => {});
      }
    }
  }

  private onLibrary(hash: string, file: Uint8Array | null): void {
    const key = new TextEncoder().encode(hash);
    const bytes = file instanceof Uint8Array ? file : new Uint8Array(0);
    this.run(() => {
      native().setInput(key, bytes);
      native().call.on_library(this.client, key.length, bytes.length);
    });
  }

  private takeEvents(frame?: ArrayBuffer): void {
    // Each frame is read at most once, and only if it contains something for the application.
    let message: Message | null = null;
    const read = (): Message => message ??= readMessage(frame!);
    const type = frame === undefined ? 0 : typeOfFrame(frame);
    let accepted = frame !== undefined;
    for (;;) {
      const event = native().call.next_event(this.client);
      if (event < 0) break;
      const {text, results} = native();
      const [handle = 0, status = 0, command = 0, , resumed, dropped = 0, droppedEvents = 0] =
          results;
      const world = this.findWorld(handle);
      switch (event) {
        case NativeEvent.connected:
          if (resumed === 0) this.lastEventsNumber = 0n;
          this.later(() => this.listeners.emit('connected', resumed !== 0));
          break;
        case NativeEvent.connectFailed:
        case NativeEvent.connectionLost:
          accepted = false;
          if (status === Status.protocol_error) ++this.total.invalidFrames;
          this.onError(status, text);
          break;
        case NativeEvent.sessionLost:
          for (const each of this.worlds) each.reset();
          this.later(() => this.listeners.emit('sessionLost'));
          break;
        case NativeEvent.closed:
          accepted = false;
          if (status !== 0) this.onError(status, text);
          for (const each of this.worlds) each.reset();
          break;
        case NativeEvent.reply: {
          // A frame can cause replies to several commands, but describes only one of them.
          const message = frame !== undefined && command === this.answered ? read() : undefined;
          const answer = this.pending.get(command);
          this.pending.delete(command);
          const why = message !== undefined && 'text' in message ? message.text : webNames(text);
          const result = makeReply(status, why, message?.type === 'Reply' ? message : undefined);
          this.later(() => answer?.(result, message));
          break;
        }
        case NativeEvent.item:
        case NativeEvent.notice: this.notice(status, text); break;
        case NativeEvent.lagging: {
          if (world === undefined) break;
          this.total.eventsDropped += Math.max(0, droppedEvents - world.reportedDroppedEvents);
          world.reportedDroppedEvents = Math.max(world.reportedDroppedEvents, droppedEvents);
          this.later(() => world.listeners.emit('lagging', dropped, droppedEvents));
          break;
        }
        case NativeEvent.terrain: {
          if (world === undefined) break;
          const sent = type === MessageType.WorldTerrain ? read() : null;
          const terrain = sent?.type === 'WorldTerrain' ? sent.terrain : null;
          world.terrain = terrain;
          this.later(() => world.listeners.emit('terrain', terrain));
          break;
        }
        default: break;
      }
    }
    if (accepted && userMessages.includes(type)) this.onMessage(read());
  }

  /** Processes the parts of messages that the module does not process. */
  private onMessage(message: Message): void {
    if (message.type === 'Events') {
      this.onEvents(message);
    } else if (message.type === 'WorldInfo') {
      const world = this.findServerWorld(message.world);
      if (world === undefined) return;
      world.setInfo(message);
      this.later(() => world.listeners.emit('state', world.state));
    }
  }

  private onEvents(message: Events): void {
    if (message.number !== 0n) {
      // Ignores events that were sent again after a resume.
      if (message.number <= this.lastEventsNumber) return;
      this.lastEventsNumber = message.number;
    }
    const world = this.findServerWorld(message.world);
    if (world === undefined) return;
    for (const event of message.events.map(eventOf)) {
      world.record.addEvent(event);
      if (world.listeners.has('event')) {
        this.later(() => world.listeners.emit('event', event));
      }
    }
  }

  private findWorld(handle: number): WorldHandle | undefined {
    return handle === 0 ? undefined : [...this.worlds].find((world) => world.handle === handle);
  }

  private findServerWorld(id: number): WorldHandle | undefined {
    return this.findWorld(native().call.find_world(this.client, id));
  }

  private onError(status: number, text: string): void {
    const sentence = text || statusText(status);
    this.lastError = sentence;
    this.later(() => this.listeners.emit('error', status, sentence));
  }

  private notice(status: number, text: string): void {
    this.later(() => this.listeners.emit('notice', status, text || statusText(status)));
  }

  /** Reports changes of states and of lists of avatars. */
  private synchronise(): void {
    const state = states[native().call.state(this.client, 0)]!;
    if (state !== this.state) {
      this.state = state;
      this.later(() => this.listeners.emit('state', state));
    }
    for (const world of this.worlds) {
      const number = native().call.world_state(this.client, world.handle);
      const revision = native().results[0]!;
      this.setWorldState(world, worldStates[number] ?? 'left');
      if (number < 0 || world.state === 'refused') {
        this.worlds.delete(world);
        world.reset();
      } else if (revision !== world.revision) {
        world.revision = revision;
        this.later(() => world.listeners.emit('avatars', world.avatars()));
      }
    }
  }

  private setWorldState(world: WorldHandle, state: WorldState): void {
    if (world.state === state) return;
    world.state = state;
    this.later(() => world.listeners.emit('state', state));
  }

  private later(notification: () => void): void {
    this.notifications.push(notification);
  }

  /**
   * Calls listeners and resolves promises. If a listener calls the session, the notifications of
   * that call follow after the current ones.
   */
  private notify(): void {
    if (this.notifying) return;
    this.notifying = true;
    for (let i = 0; i < this.notifications.length; ++i) this.notifications[i]!();
    this.notifications.length = 0;
    this.notifying = false;
    this.wake();
  }
}

function countFrames(message: ArrayBuffer): number {
  const view = new DataView(message);
  let count = 0;
  for (let at = 0; at + frameHeaderBytes <= message.byteLength; ++count) {
    at += frameHeaderBytes + view.getUint32(at + 8, true);
  }
  return count;
}

/** Frees the memory of clients that are no longer used. */
const finalizers = new FinalizationRegistry<number>((client) => native().call.destroy(client));
