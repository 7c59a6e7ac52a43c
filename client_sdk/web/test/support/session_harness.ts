import assert from 'node:assert/strict';
import {Session} from '../../src/session';
import {defaultOptions, type SessionOptions} from '../../src/session_options';
import {Status} from '../../src/status';
import type {Reply} from '../../src/types';
import {decodeMessage, type Message} from '../../src/testing';
import type {WorldHandle} from '../../src/world';
import * as server from './server_frames';

/** A session without a socket. The test sets its clock and passes frames to it. */
export class Harness {
  readonly session: Session;
  nowS = 100;
  readonly errors: string[] = [];
  readonly notices: string[] = [];
  lostSessions = 0;

  constructor(options: Partial<SessionOptions> = {}) {
    this.session = new Session({...defaultOptions, seed: 1, ...options}, () => 1000 * this.nowS);
    this.session.listeners.on('error', (code, text) => this.errors.push(`${code} ${text}`));
    this.session.listeners.on('notice', (code, text) => this.notices.push(`${code} ${text}`));
    this.session.listeners.on('sessionLost', () => void ++this.lostSessions);
  }

  /** Connects, completes the handshake and returns the client's Hello. */
  connect(fields: server.WelcomeFields = {}): Message {
    this.session.open(this.nowS);
    while (!this.session.network(this.nowS).connectDue) this.nowS += 0.05;
    this.session.startConnecting(this.nowS);
    this.session.onConnected(this.nowS);
    const hello = this.sent();
    assert.equal(hello.length, 1);
    this.receive(server.welcome(fields));
    assert.equal(this.session.state, 'ready');
    return hello[0]!;
  }

  /** Returns the messages that the client has sent since the last call, without pings. */
  sent(): Message[] {
    return this.session.takeOutput().map((frame) => decodeMessage(frame, 'client'))
        .filter((message) => message.type !== 'Ping');
  }

  /** Passes frames from the server to the session. */
  receive(...frames: ArrayBuffer[]): void {
    for (const frame of frames) this.session.onFrames(frame, this.nowS);
  }

  /** Breaks the connection. */
  lose(): void {
    this.session.onLost(Status.connection_lost, '', this.nowS);
  }

  /** Connects, joins world 3 as a controller and observes all avatars. */
  joined(fields: server.WelcomeFields = {}): WorldHandle {
    this.connect(fields);
    const world = this.session.joinWorld('plaza', 'controller');
    const [join] = this.sent();
    assert.ok(join?.type === 'JoinWorld');
    this.receive(server.worldInfo(join.seq, 3, 'plaza'), server.reply(join.seq));
    assert.equal(world.state, 'joined');
    world.observe({mode: 'full'});
    const [observe] = this.sent();
    assert.ok(observe?.type === 'Observe');
    this.receive(server.reply(observe.seq));
    return world;
  }
}

/** Returns type and seq of each message. */
export const summary = (messages: Message[]): string[] => messages.map(
    (message) => 'seq' in message ? `${message.type} ${message.seq}` : message.type);

/** Returns the result of a promise, or 'pending' if it is not settled yet. */
export async function settled<T>(promise: Promise<T>): Promise<T | 'pending'> {
  return Promise.race([promise, new Promise<'pending'>((resolve) => setImmediate(
      () => resolve('pending')))]);
}

export const statusOf = (reply: Reply | 'pending'): string =>
    reply === 'pending' ? reply : reply.status;
