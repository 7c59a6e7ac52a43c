import assert from 'node:assert/strict';
import {test} from 'node:test';
import {Session, defaultOptions, type SessionOptions} from '../src/session';
import {Status} from '../src/status';
import type {PoseDetail, Region, Reply, Terrain, WorldEvent} from '../src/types';
import {decodeFrame} from '../src/wire/decode';
import type {Message} from '../src/wire/messages';
import type {WorldHandle} from '../src/world';
import {createCrowdPose, createPose} from '../src/room';
import * as server from './support/server_frames';

/** A session with a socket and a clock made by hand. */
class Harness {
  readonly session: Session;
  nowS = 100;
  readonly errors: string[] = [];
  readonly notices: string[] = [];
  sessionsLost = 0;

  constructor(options: Partial<SessionOptions> = {}) {
    this.session = new Session({...defaultOptions, seed: 1, ...options}, () => 1000 * this.nowS);
    this.session.listeners.on('error', (code, text) => this.errors.push(`${code} ${text}`));
    this.session.listeners.on('notice', (code, text) => this.notices.push(`${code} ${text}`));
    this.session.listeners.on('sessionLost', () => void ++this.sessionsLost);
  }

  /** Connects and greets; what the client said after its greeting is left. */
  connect(fields: server.WelcomeFields = {}): Message {
    this.session.open(this.nowS);
    while (!this.session.connectDue(this.nowS)) this.nowS += 0.05;
    this.session.startConnecting(this.nowS);
    this.session.onConnected(this.nowS);
    const hello = this.sent();
    assert.equal(hello.length, 1);
    this.receive(server.welcome(fields));
    assert.equal(this.session.state, 'ready');
    return hello[0]!;
  }

  /** What the client has to say, without pings. */
  sent(): Message[] {
    return this.session.takeOutput().map((frame) => decodeFrame(frame, 'client'))
        .filter((message) => message.type !== 'Ping');
  }

  receive(...frames: ArrayBuffer[]): void {
    for (const frame of frames) this.session.onFrame(frame, this.nowS);
  }

  lose(): void {
    this.session.onLost(Status.connection_lost, '', this.nowS);
  }

  /** Joined as world 3, watching everyone. */
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

const ringed = (detail?: PoseDetail): Region => ({
  x: 1, z: 2, radiusM: 30, rings: [{toM: 8, everyNTicks: 1, ...(detail === undefined ? {} : {detail})},
                                   {toM: 20, everyNTicks: 2}],
});

const summary = (messages: Message[]): string[] => messages.map(
    (message) => 'seq' in message ? `${message.type} ${message.seq}` : message.type);

async function settled<T>(promise: Promise<T>): Promise<T | 'waiting'> {
  return Promise.race([promise, new Promise<'waiting'>((resolve) => setImmediate(
      () => resolve('waiting')))]);
}

const ok = (reply: Reply | 'waiting'): string => reply === 'waiting' ? reply : reply.status;

test('commands given early wait for the world and keep their order', async () => {
  const h = new Harness();
  h.session.open(h.nowS);
  const world = h.session.joinWorld('plaza', 'controller');
  const spawned = world.spawn([{positionM: [1, 0, 2], headingRad: 0.5}]);
  const requested = world.request([{avatar: 1, type: 'step', lengthM: 0.7}]);
  const observed = world.observe({mode: 'quantised', everyNTicks: 2});
  h.connect();
  const [join] = h.sent();
  assert.ok(join?.type === 'JoinWorld' && join.seq === 1n);
  assert.deepEqual(h.sent(), []);
  h.receive(server.worldInfo(1n, 9, 'plaza'), server.reply(1n));
  assert.deepEqual(summary(h.sent()), ['Spawn 2', 'Request 3', 'Observe 4']);
  assert.equal(world.skeleton?.jointCount, 2);
  h.receive(server.reply(3n, 0, [{index: 0, avatar: 1, requestId: 1n, code: 108}]),
            server.reply(2n, 0, [{index: 0, avatar: 41}], '', 1), server.reply(4n));
  assert.equal((await world.joined).ok, true);
  assert.equal((await spawned).items[0]!.avatar, 41);
  assert.equal((await requested).items[0]!.status, 'no_such_avatar');
  assert.equal((await observed.reply).ok, true);
  assert.equal(h.session.statistics().commandsWaiting, 0);
});

test('unanswered commands are sent again under their numbers, with their content', async () => {
  const h = new Harness();
  const world = h.joined();
  const replies = [0, 1, 2].map((i) => world.request(
      [{avatar: 1, requestId: 10 + i, type: 'jump', lengthM: 1 + i}]));
  const first = h.sent();
  assert.deepEqual(summary(first), ['Request 3', 'Request 4', 'Request 5']);
  h.receive(server.reply(4n));
  h.lose();
  assert.equal(h.session.state, 'waiting');
  const late = world.remove([5]);
  const hello = h.connect({resumed: true});
  assert.ok(hello.type === 'Hello' && hello.resumeToken.length === 16);
  const again = h.sent();
  assert.deepEqual(summary(again), ['Request 3', 'Request 5', 'Remove 6']);
  assert.deepEqual(again[0], first[0]);
  assert.deepEqual(again[1], first[2]);
  // The server had done 3 before: it answers twice, which the caller must not notice.
  h.receive(server.reply(3n), server.reply(3n), server.reply(5n, 400, [], 'full'));
  assert.deepEqual((await Promise.all(replies)).map(ok), ['ok', 'ok', 'limit_reached']);
  assert.equal(await settled(late), 'waiting');
  assert.equal(h.session.statistics().commandsResent, 2);
  assert.equal(h.session.statistics().resumes, 1);
  assert.equal(h.sessionsLost, 0);
});

test('each command is done once however often the connection breaks', async () => {
  const h = new Harness();
  const world = h.joined();
  const done = new Map<bigint, number>();
  let last = 2n;
  // As the server's table has it: takes n + 1, answers again what it did.
  const serve = (answer: boolean): void => {
    for (const message of h.sent()) {
      assert.ok(message.type === 'Request');
      assert.ok(message.seq <= last + 1n, `gap before ${message.seq}`);
      if (message.seq === last + 1n) {
        last = message.seq;
        const id = message.items[0]!.requestId;
        done.set(id, (done.get(id) ?? 0) + 1);
      }
      if (answer) h.receive(server.reply(message.seq));
    }
  };
  const replies: Promise<Reply>[] = [];
  for (let round = 0; round < 20; ++round) {
    for (let i = 0; i < 3; ++i) {
      replies.push(world.request([{avatar: 1, requestId: replies.length + 1, type: 'stand'}]));
    }
    serve(round % 3 === 0);
    h.lose();
    h.connect({resumed: true});
    serve(round % 2 === 0);
  }
  serve(true);
  h.lose();
  h.connect({resumed: true});
  serve(true);
  assert.ok((await Promise.all(replies)).every((reply) => reply.ok));
  assert.equal(done.size, replies.length);
  assert.ok([...done.values()].every((times) => times === 1));
});

test('a lost session is told, and what was wanted is asked for again', async () => {
  const h = new Harness({respawn: true});
  const world = h.joined();
  const spawned = world.spawn([{positionM: [1, 0, 2], headingRad: 0}]);
  h.sent();
  h.receive(server.reply(3n, 0, [{index: 0, avatar: 41}], '', 1));
  await spawned;
  h.receive(server.events(1n, [{type: 'finished', avatar: 41, base: [5, 0, 6]}]));
  h.receive(server.poseBatch({tick: 600}, [{avatar: 41, x: 1}]));
  assert.deepEqual([...world.avatars()], [41]);
  const open = world.request([{avatar: 41, type: 'jump'}]);
  h.sent();
  h.lose();
  const waiting = world.cancel([41]);
  h.connect({resumed: false, token: 8});
  assert.equal(h.sessionsLost, 1);
  assert.equal(ok(await open), 'session_lost');
  assert.equal(world.state, 'joining');
  assert.equal(world.avatars().length, 0);
  assert.ok(Number.isNaN(world.recording.lastTimeS));
  assert.deepEqual(summary(h.sent()), ['JoinWorld 1']);
  h.receive(server.worldInfo(1n, 4, 'plaza'), server.reply(1n));
  const anew = h.sent();
  assert.deepEqual(summary(anew), ['Observe 2', 'Spawn 3', 'CancelQueue 4']);
  const spawn = anew[1]!;
  assert.ok(spawn.type === 'Spawn' && spawn.world === 4);
  assert.deepEqual(spawn.items, [{avatar: 41, positionM: [5, 0, 6], headingRad: 0}]);
  // The server lost the session, not the world: our avatar may still be there.
  h.receive(server.reply(2n), server.reply(3n, 0, [{index: 0, avatar: 41, code: 109}]),
            server.reply(4n));
  assert.equal(ok(await waiting), 'ok');
  assert.deepEqual(h.notices, []);
  // Ticks of the new server begin anew, and are taken.
  h.receive(server.poseBatch({world: 4, tick: 3}, [{avatar: 41, x: 2}]));
  assert.deepEqual([...world.avatars()], [41]);
});

test('events sent again are heard once', () => {
  const h = new Harness();
  const world = h.joined();
  const heard: WorldEvent[] = [];
  world.on('event', (event) => heard.push(event));
  h.receive(server.events(1n, [{type: 'started', avatar: 1, requestId: 7n, timeS: 1}]),
            server.events(2n, [{type: 'finished', avatar: 1, requestId: 7n, timeS: 2}]));
  h.lose();
  const hello = h.connect({resumed: true});
  assert.ok(hello.type === 'Hello' && hello.lastEventsNumber === 2n);
  h.receive(server.events(2n, [{type: 'finished', avatar: 1, requestId: 7n, timeS: 2}]),
            server.events(3n, [{type: 'idle', avatar: 1, timeS: 3}]));
  assert.deepEqual(heard.map(({type}) => type), ['started', 'finished', 'idle']);
  assert.deepEqual(world.recording.events(1.5, 9).map(({type}) => type), ['finished', 'idle']);
});

test('poses are not interpolated across a resume or a discontinuity', () => {
  const h = new Harness();
  const world = h.joined();
  const pose = createPose();
  const crowd = createCrowdPose();
  const at = (tick: number, x: number, flags = 0): void =>
      h.receive(server.poseBatch({tick}, [{avatar: 1, x, flags}]));
  at(60, 0);
  at(61, 1);
  assert.equal(world.sample(1, 60.5 / 60, pose), 'interpolated');
  assert.ok(Math.abs(pose.rootM[0]! - 0.5) < 1e-6);
  at(62, 50, 1);
  assert.equal(world.sample(1, 61.5 / 60, pose), 'held');
  assert.equal(pose.rootM[0], 1);
  h.lose();
  h.connect({resumed: true});
  h.receive(server.worldInfo(0n, 3, 'plaza'));
  at(90, 100);
  assert.equal(world.sample(1, 70 / 60, pose), 'held');
  assert.equal(pose.rootM[0], 50);
  assert.ok(Math.abs(pose.heldS - 8 / 60) < 1e-9);
  assert.equal(world.recording.sampleAll(70 / 60, crowd), 1);
  assert.equal(crowd.rootsM[0], 50);
  assert.equal(crowd.flags[0], 4);
  assert.equal(world.sample(1, 0.5, pose), 'missing');
  assert.equal(world.sample(2, 70 / 60, pose), 'missing');
});

test('what was recorded is sampled as it was live, until it is too old or too much', () => {
  const h = new Harness({recordingS: 2, poseHistory: 512});
  const world = h.joined();
  for (let tick = 1; tick <= 240; ++tick) {
    const angleRad = Math.sin(tick / 9);
    // Two shards; the second moves an avatar to the first half way.
    h.receive(
        server.poseBatch({tick, shard: 0}, [
          {avatar: 9, x: tick * tick / 1000, angleRad},
          ...(tick >= 120 ? [{avatar: 5, x: tick / 60, angleRad}] : [])
        ]),
        server.poseBatch({tick, shard: 1}, tick < 120 ? [{avatar: 5, x: tick / 60, angleRad}] : []));
  }
  assert.ok(Math.abs(world.recording.lastTimeS - 4) < 1e-9);
  assert.ok(Math.abs(world.recording.firstTimeS - 2) < 1e-9);
  const live = createCrowdPose();
  const recorded = createCrowdPose();
  for (let timeS = 2.1; timeS < 3.9; timeS += 0.0123) {
    assert.equal(world.sampleAll(timeS, live), 2);
    assert.equal(world.recording.sampleAll(timeS, recorded), 2);
    assert.deepEqual([...recorded.avatars.subarray(0, 2)], [5, 9]);
    assert.deepEqual(recorded.rootsM.subarray(0, 6), live.rootsM.subarray(0, 6));
    assert.deepEqual(recorded.rotations.subarray(0, 16), live.rotations.subarray(0, 16));
  }
  assert.equal(world.recording.sampleAll(1.9, recorded), 0);
  const arrays = [recorded.avatars, recorded.rotations, recorded.rootsM, recorded.flags];
  world.recording.sampleAll(3, recorded);
  assert.deepEqual(arrays.map((array, i) => array === [
    recorded.avatars, recorded.rotations, recorded.rootsM, recorded.flags
  ][i]), [true, true, true, true]);

  const small = new Harness({maxRecordingBytes: 4096});
  const bounded = small.joined();
  for (let tick = 1; tick <= 100; ++tick) {
    small.receive(server.poseBatch({tick}, [{avatar: 1, x: 0}]));
    assert.ok(bounded.recording.bytes <= 4096);
  }
  assert.ok(bounded.recording.firstTimeS > 1);
});

test('avatars come, go and are told', () => {
  const h = new Harness();
  const world = h.joined();
  const told: string[] = [];
  world.on('avatars', (avatars) => told.push([...avatars].join(' ')));
  h.receive(server.poseBatch({tick: 1, parts: 2, part: 0}, [{avatar: 7, x: 0}]),
            server.poseBatch({tick: 1, parts: 2, part: 1}, [{avatar: 3, x: 0}]),
            server.poseBatch({tick: 2}, [{avatar: 7, x: 0}]),
            server.events(1n, [{type: 'removed', avatar: 7}]));
  assert.deepEqual(told, ['7', '3 7', '7', '']);
  // Whoever is gone is shown as long as there are poses of that time, and no longer.
  const crowd = createCrowdPose();
  assert.equal(world.sampleAll(1 / 60, crowd), 2);
  assert.equal(world.sampleAll(3 / 60, crowd), 0);
});

test('only what was asked for is kept', async () => {
  const h = new Harness();
  h.connect();
  const world = h.session.joinWorld('plaza', 'observer');
  h.sent();
  h.receive(server.worldInfo(1n, 3, 'plaza'), server.reply(1n));
  const some = world.observe({mode: 'full', avatars: [4, 5]});
  h.sent();
  h.receive(server.reply(2n));
  h.receive(server.poseBatch({tick: 1}, [{avatar: 4, x: 0}, {avatar: 6, x: 0}]));
  assert.deepEqual([...world.avatars()], [4]);
  const crowd = createCrowdPose();
  assert.equal(world.recording.sampleAll(1 / 60, crowd), 1);
  const stopped = some.stop();
  assert.deepEqual(summary(h.sent()), ['StopObserving 3']);
  h.receive(server.reply(3n, Status.no_such_subscription));
  assert.equal(ok(await stopped), 'ok');
  assert.equal(world.avatars().length, 0);
  h.receive(server.poseBatch({tick: 2}, [{avatar: 4, x: 0}]));
  assert.equal(world.avatars().length, 0);
});

test('what a server may not say breaks the connection and nothing else', () => {
  const wrong: [string, ArrayBuffer][] = [
    ['a second welcome', server.welcome()],
    ['no frame', new ArrayBuffer(40)],
    ['a figure of another size', server.poseBatch({tick: 1, joints: 3}, [{avatar: 1, x: 0}])],
    ['a pose that is none', server.poseBatch({tick: 1}, [{avatar: 1, x: NaN}])],
    ['a world in answer to another command', server.worldInfo(3n, 3, 'plaza')],
  ];
  for (const [what, frame] of wrong) {
    const h = new Harness();
    const world = h.joined();
    void world.request([{avatar: 1, type: 'stand', seconds: 1}]);
    h.sent();
    h.receive(frame);
    assert.equal(h.session.state, 'waiting', what);
    assert.equal(h.session.statistics().invalidFrames, 1, what);
    assert.match(h.errors[0]!, /^250 ./, what);
    h.connect({resumed: true});
    assert.deepEqual(summary(h.sent()), ['Request 3'], what);
  }
  const h = new Harness();
  h.session.open(h.nowS);
  h.session.startConnecting(h.nowS);
  h.session.onConnected(h.nowS);
  h.receive(server.poseBatch({tick: 1}, []));
  assert.equal(h.session.state, 'waiting');
});

test('gives up when refused for good and comes back otherwise', async () => {
  for (const [code, state] of [
    [100, 'closed'], [103, 'closed'], [104, 'closed'], [200, 'closed'], [300, 'waiting'],
    [301, 'waiting'], [400, 'waiting'], [402, 'waiting'], [404, 'closed'],
  ] as const) {
    const h = new Harness();
    const world = h.joined();
    const open = world.request([{avatar: 1, type: 'stand', seconds: 1}]);
    h.receive(server.error(code, true, 'as told'));
    assert.equal(h.session.state, state, `${code}`);
    assert.equal(h.session.lastError, 'as told');
    const reply = await settled(open);
    assert.equal(reply === 'waiting' ? 0 : reply.code, state === 'closed' ? code : 0);
  }
  const h = new Harness();
  const world = h.joined();
  h.receive(server.error(400, false, 'by the way'));
  assert.equal(h.session.state, 'ready');
  assert.deepEqual(h.notices, ['400 by the way']);
  // A goodbye ends the session: the next greeting has no token.
  h.receive(server.goodbye(402));
  assert.equal(h.session.state, 'waiting');
  const hello = h.connect();
  assert.ok(hello.type === 'Hello' && hello.resumeToken.length === 0);
  assert.equal(h.sessionsLost, 1);
  assert.equal(world.state, 'joining');
});

test('waits longer with every attempt, up to a limit, never the same', () => {
  const h = new Harness();
  h.session.open(h.nowS);
  const waits: number[] = [];
  for (let i = 0; i < 12; ++i) {
    assert.ok(h.session.connectDue(h.nowS));
    h.session.startConnecting(h.nowS);
    h.session.onLost(Status.connect_failed, '', h.nowS);
    const waitS = h.session.nextTimeS - h.nowS;
    const most = Math.min(0.1 * 2 ** i, 5);
    assert.ok(waitS >= most / 2 - 1e-9 && waitS <= most + 1e-9, `${i}: ${waitS}`);
    waits.push(waitS / most);
    assert.ok(!h.session.connectDue(h.nowS + waitS - 0.001));
    h.nowS += waitS + 0.001;
  }
  assert.equal(new Set(waits).size, waits.length);
  // A connection that lasted starts afresh; one that did not goes on.
  h.connect();
  h.nowS += 1;
  h.lose();
  assert.ok(h.session.nextTimeS - h.nowS > 2);
  h.connect();
  h.nowS += 3;
  h.lose();
  assert.ok(h.session.nextTimeS - h.nowS <= 0.1);
});

test('times out where peers fall silent, and pings in time', () => {
  const h = new Harness({pingIntervalS: 20});
  h.session.open(h.nowS);
  h.session.startConnecting(h.nowS);
  h.nowS += 5.01;
  h.session.advanceTime(h.nowS);
  assert.equal(h.session.state, 'waiting');
  h.connect({idleTimeoutS: 6});
  const pings = (): number => h.session.takeOutput()
      .filter((frame) => decodeFrame(frame, 'client').type === 'Ping').length;
  let count = pings();
  const startS = h.nowS;
  while (h.nowS < startS + 5.9) {
    h.nowS += 0.1;
    h.session.advanceTime(h.nowS);
    count += pings();
  }
  assert.ok(count >= 3, `${count} pings in 6 s`);
  assert.equal(h.session.state, 'ready');
  h.nowS += 0.2;
  h.session.advanceTime(h.nowS);
  assert.equal(h.session.state, 'waiting');
  assert.match(h.errors.at(-1)!, /^300/);
});

test('keeps no more unanswered than the server remembers, and no more than it may', async () => {
  const h = new Harness({maxCommands: 10});
  const world = h.joined({replyMemory: 4});
  const replies = Array.from({length: 12}, () => world.remove([1]));
  assert.equal(h.sent().length, 4);
  assert.equal(ok(await settled(replies[10]!)), 'commands_full');
  h.receive(server.reply(3n), server.reply(4n));
  assert.equal(h.sent().length, 2);
});

test('bad arguments are told at once and named', async () => {
  const h = new Harness();
  const world = h.joined();
  const bad: [Promise<Reply>, RegExp][] = [
    [world.spawn([]), /items: list is empty/],
    [world.spawn([{positionM: [0, NaN, 0], headingRad: 0}]), /positionM\[0\]: is not a finite/],
    [world.spawn([{avatar: -1, positionM: [0, 0, 0], headingRad: 0}]), /avatar\[0\]/],
    [world.remove([0]), /avatars\[0\]/],
    [world.remove([1.5]), /avatars\[0\]/],
    [world.request([{avatar: 1, type: 'fly' as 'jump'}]), /type\[0\]: is none of/],
    [world.request([{avatar: 1, type: 'step', lengthM: Infinity}]), /lengthM\[0\]/],
    [world.request([{avatar: 1, requestId: 2 ** 60, type: 'stand'}]), /requestId\[0\]/],
    [world.request([{avatar: 1, requestId: 0n, type: 'stand'}]), /requestId\[0\]/],
    [world.request(null as never), /items/],
    [world.observe({mode: 'movement' as 'full'}).reply, /mode/],
    [world.observe({mode: 'full', everyNTicks: 0}).reply, /everyNTicks/],
    [world.observe({mode: 'full', detail: 'root'}).reply, /detail/],
    [world.observe({mode: 'quantised', detail: 'some' as 'root'}).reply, /detail/],
    [world.observe({mode: 'full', region: ringed('all')}).reply, /rings.detail/],
    [world.observe({mode: 'quantised', region: ringed('some' as 'root')}).reply, /rings.detail\[0\]/],
  ];
  for (const [promise, why] of bad) {
    const reply = await promise;
    assert.equal(reply.status, 'invalid_argument');
    assert.match(reply.text, why);
  }
  assert.deepEqual(h.sent(), []);
  assert.equal(ok(await h.session.joinWorld('', 'observer').joined), 'invalid_argument');
  assert.equal(ok(await h.session.joinWorld('plaza', 'observer').joined), 'already_joined');
  assert.throws(() => new Session({...defaultOptions, seed: 1, clientName: ''}, () => 0), TypeError);
  assert.throws(() => new Session({...defaultOptions, seed: 1, poseHistory: 1}, () => 0), RangeError);
});

test('a message larger than the server takes is refused and leaves no gap', async () => {
  const h = new Harness();
  const world = h.joined({maxBulkBytes: 4096});
  const big = world.remove(Array.from({length: 5000}, (_, i) => i + 1));
  const small = world.remove([1]);
  assert.deepEqual(summary(h.sent()), ['Remove 3']);
  assert.equal(ok(await big), 'limit_reached');
  assert.equal(await settled(small), 'waiting');
});

test('a refused world ends what waited for it', async () => {
  const h = new Harness();
  h.connect();
  const world = h.session.joinWorld('nowhere', 'controller');
  const spawned = world.spawn([{positionM: [0, 0, 0], headingRad: 0}]);
  h.sent();
  h.receive(server.reply(1n, 107, [], 'no world of that name'));
  assert.equal(world.state, 'refused');
  assert.equal((await world.joined).text, 'no world of that name');
  assert.equal(ok(await spawned), 'not_joined');
  assert.equal(ok(await world.request([{avatar: 1, type: 'stand'}])), 'not_joined');
  assert.equal(h.session.joinWorld('nowhere', 'controller').state, 'joining');
});

test('leaves a world and forgets it', async () => {
  const h = new Harness();
  const world = h.joined();
  const left = world.leave();
  assert.deepEqual(summary(h.sent()), ['LeaveWorld 3']);
  h.receive(server.reply(3n));
  assert.equal(ok(await left), 'ok');
  assert.equal(world.state, 'left');
  assert.equal(ok(await world.remove([1])), 'not_joined');
  assert.equal(h.session.joinWorld('plaza', 'observer').state, 'joining');
});

test('closing answers what is open, says goodbye, and can begin again', async () => {
  const h = new Harness();
  const world = h.joined();
  const open = world.remove([1]);
  h.sent();
  h.session.close(h.nowS);
  assert.equal(ok(await open), 'cancelled');
  assert.equal(h.session.state, 'closing');
  assert.deepEqual(summary(h.sent()), ['Goodbye']);
  h.session.onOutputWritten();
  assert.equal(h.session.state, 'idle');
  assert.equal(ok(await world.remove([1])), 'closed');
  const hello = h.connect();
  assert.ok(hello.type === 'Hello' && hello.resumeToken.length === 0);
  assert.deepEqual(summary(h.sent()), ['JoinWorld 1']);
  h.receive(server.worldInfo(1n, 3, 'plaza'), server.reply(1n));
  assert.deepEqual(summary(h.sent()), ['Observe 2']);
  assert.equal(h.sessionsLost, 0);
});

test('counts what the server dropped and what did not come', () => {
  const h = new Harness();
  h.joined();
  h.receive(server.poseBatch({tick: 1}, [{avatar: 1, x: 0}]),
            server.poseBatch({tick: 5}, [{avatar: 1, x: 0}]), server.lagging(3, 1),
            server.lagging(4, 1));
  const counted = h.session.statistics();
  assert.equal(counted.batchesMissing, 3);
  assert.equal(counted.batchesDropped, 4);
  assert.equal(counted.eventsDropped, 1);
  assert.equal(counted.posesReceived, 2);
});

test('asks what an avatar does', async () => {
  const h = new Harness();
  const world = h.joined();
  const asked = world.inspect(41);
  const [question] = h.sent();
  assert.ok(question?.type === 'InspectAvatar' && question.avatar === 41 && question.world === 3);
  h.receive(server.avatarState(question.nonce, 41));
  assert.equal((await asked).movement, null);
  const none = world.inspect(42);
  const [second] = h.sent();
  assert.ok(second?.type === 'InspectAvatar');
  h.receive(server.avatarState(second.nonce, 42, 108));
  await assert.rejects(none, {code: 108, status: 'no_such_avatar'});
  const cut = world.inspect(41);
  h.lose();
  await assert.rejects(cut, {status: 'connection_lost'});
  await assert.rejects(world.inspect(41), {status: 'not_ready'});
  const old = new Harness();
  await assert.rejects(old.joined({features: 7n}).inspect(1), {status: 'unsupported'});
});

test('what a listener does inside its call is done, and what it throws is its own affair', () => {
  const h = new Harness();
  const world = h.joined();
  const uncaught: (() => void)[] = [];
  const {queueMicrotask} = globalThis;
  globalThis.queueMicrotask = (call) => void uncaught.push(call);
  let heard = 0;
  world.on('event', () => {
    throw new Error('of the listener');
  });
  world.on('event', (event) => {
    ++heard;
    void world.request([{avatar: event.avatar, type: 'jump', lengthM: 1}]);
    h.session.close(h.nowS);
  });
  h.receive(server.events(1n, [{type: 'idle', avatar: 1}, {type: 'idle', avatar: 2}]));
  globalThis.queueMicrotask = queueMicrotask;
  assert.equal(heard, 2);
  assert.equal(h.session.state, 'closing');
  assert.deepEqual(summary(h.sent()), ['Request 3', 'Goodbye']);
  assert.equal(uncaught.length, 2);
  assert.throws(uncaught[0]!, /of the listener/);
});

test('a world has the ground that the server told of last', () => {
  const h = new Harness();
  const world = h.joined();
  const told: (number[] | null)[] = [];
  world.on('terrain', (terrain) => told.push(terrain?.boxes.map((box) => box.heightM) ?? null));
  const ground = (): Terrain | null => world.terrain;
  assert.equal(ground(), null);
  h.receive(server.worldTerrain(null));  // As it was: nobody is told.
  h.receive(server.worldTerrain([0.5, 0.25]), server.worldTerrain([1], 4));
  assert.deepEqual(ground()?.boxes[1], {minM: [1, 0], maxM: [2, 1], heightM: 0.25});
  h.receive(server.worldTerrain([0.125]));
  h.receive(server.worldTerrain(null));
  h.receive(server.worldTerrain([2]));
  h.lose();
  assert.deepEqual(told, [[0.5, 0.25], [0.125], null, [2]]);
  h.connect();  // A new session: the server will tell of it anew.
  assert.equal(ground(), null);
  assert.deepEqual(told, [[0.5, 0.25], [0.125], null, [2], null]);
});

test('a ground and footprints are sent as given, to a server that knows them', async () => {
  const h = new Harness();
  const world = h.joined();
  const heightField = {
    originM: [-1, 2] as const, cellM: 0.5, columns: 2, rows: 2,
    heightsM: Float32Array.of(0, 0.5, 1, 1.5),
  };
  const boxes = [{minM: [0, 0] as const, maxM: [1, 2] as const, heightM: 0.25}];
  const set = world.setTerrain({heightField, boxes});
  heightField.heightsM[0] = 9;  // The caller's own again.
  const cleared = world.setTerrain(null);
  const stepped = world.request([
    {avatar: 1, type: 'step', foot: 'left', atM: [1, 0.25, -2], headingRad: 0, lengthM: 3},
    {avatar: 1, type: 'step', atM: [1, 0, 0]},
  ]);
  const [first, second, third] = h.sent();
  assert.ok(first?.type === 'SetTerrain' && second?.type === 'SetTerrain');
  assert.deepEqual(first.terrain, {
    heightField: {...heightField, heightsM: Float32Array.of(0, 0.5, 1, 1.5)}, boxes
  });
  assert.equal(second.terrain, null);
  assert.ok(third?.type === 'Request');
  assert.deepEqual(third.items.map(({atM, headingRad, lengthM}) => ({atM, headingRad, lengthM})), [
    {atM: [1, 0.25, -2], headingRad: 0, lengthM: 0},
    {atM: [1, 0, 0], headingRad: null, lengthM: 0},
  ]);
  h.receive(server.reply(3n), server.reply(4n), server.reply(5n));
  assert.deepEqual((await Promise.all([set, cleared, stepped])).map(ok), ['ok', 'ok', 'ok']);

  const bad = [
    {heightField: {...heightField, columns: 3}, boxes: []},
    {heightField: {...heightField, cellM: 0}, boxes: []},
    {heightField: {...heightField, heightsM: Float32Array.of(0, 1, 2, NaN)}, boxes: []},
    {heightField: null, boxes: [{minM: [0, 0] as const, maxM: [0, 1] as const, heightM: 0}]},
  ];
  for (const terrain of bad) {
    assert.equal((await world.setTerrain(terrain)).status, 'invalid_argument');
  }
  assert.equal((await world.request([{avatar: 1, type: 'step', atM: [1, 2, NaN]}])).status,
               'invalid_argument');
  assert.deepEqual(h.sent(), []);
});

test('a walk is sent as given, to a server that knows it', async () => {
  const h = new Harness();
  const world = h.joined();
  void world.request([
    {avatar: 1, type: 'walk', atM: [3, 0, -5], headingRad: 0, waypointsM: [[1, 0, -2]], speedMPerS: 1.25},
    {avatar: 2, type: 'walk', atM: [1, 0, 0], headingRad: 1, lengthM: 3},
  ]);
  const [sent] = h.sent();
  assert.ok(sent?.type === 'Request');
  assert.deepEqual(
    sent.items.map(({type, atM, headingRad, waypointsM, speedMPerS}) => [type, atM, headingRad, waypointsM, speedMPerS]),
    [['walk', [3, 0, -5], 0, [[1, 0, -2]], 1.25], ['walk', [1, 0, 0], 1, [], null]]);
  const goal = {avatar: 1, type: 'walk', atM: [0, 0, 1], headingRad: 0} as const;
  for (const bad of [
    {...goal, atM: undefined}, {...goal, headingRad: undefined}, {...goal, speedMPerS: NaN},
    {...goal, waypointsM: Array.from({length: 65}, () => [0, 0, 0] as const)},
  ]) {
    assert.equal((await world.request([bad as typeof goal])).status, 'invalid_argument');
  }
  const old = new Harness();
  assert.equal((await old.joined({features: 127n}).request([goal])).status, 'unsupported');
});

test('a movement takes over as it is asked to, of a server that knows of it', async () => {
  const h = new Harness();
  const world = h.joined();
  const step = {avatar: 1, type: 'step', lengthM: 0.5} as const;
  void world.request([{...step, takeover: 'now'}, {...step, takeover: 'afterMovement'}, step]);
  const [sent] = h.sent();
  assert.ok(sent?.type === 'Request');
  assert.deepEqual(sent.items.map(({takeover}) => takeover), ['now', 'afterMovement', 'none']);
  assert.equal((await world.request([{...step, takeover: 'soon'} as never])).status, 'invalid_argument');
  const old = new Harness();
  assert.equal((await old.joined({features: 255n}).request([{...step, takeover: 'now'}])).status, 'unsupported');
});

test('a footprint that must be met is told to a server that knows of it', async () => {
  const h = new Harness();
  const world = h.joined();
  const step = {avatar: 1, type: 'step', atM: [1, 0, 2], mustBeMet: true} as const;
  void world.request([step, {...step, mustBeMet: false}, {avatar: 1, type: 'step', atM: [1, 0, 2]}]);
  const [sent] = h.sent();
  assert.ok(sent?.type === 'Request');
  assert.deepEqual(sent.items.map(({mustBeMet}) => mustBeMet), [true, false, false]);
  for (const bad of [
    {...step, atM: undefined}, {...step, mustBeMet: 1}, {...step, type: 'walk', headingRad: 0},
    {...step, type: 'jump'},
  ]) {
    const reply = await world.request([bad as never]);
    assert.equal(reply.status, 'invalid_argument');
    assert.match(reply.text, /mustBeMet/);
  }
  const old = new Harness();
  const before = old.joined({features: 1023n});
  assert.equal((await before.request([step])).status, 'unsupported');
  void before.request([{...step, mustBeMet: false}]);
  assert.deepEqual(summary(old.sent()), ['Request 3']);
});

test('layers are sent as given, to a server that knows them', async () => {
  const h = new Harness();
  const world = h.joined();
  void world.setLayers([{avatar: 1, layer: 'wave'}, {avatar: 2, layer: 'carry', off: true, blendS: 0}]);
  const [sent] = h.sent();
  assert.ok(sent?.type === 'SetLayers');
  assert.deepEqual(sent.items, [
    {avatar: 1, layer: 'wave', off: false, weight: 1, blendS: 0.3, speed: 1},
    {avatar: 2, layer: 'carry', off: true, weight: 1, blendS: 0, speed: 1},
  ]);
  for (const wrong of [{avatar: 0, layer: 'wave'}, {avatar: 1, layer: ''}, {avatar: 1},
                       {avatar: 1, layer: 'wave', weight: NaN}]) {
    assert.equal((await world.setLayers([wrong as never])).status, 'invalid_argument');
  }
  const old = new Harness();
  const before = old.joined({features: 511n});
  assert.equal((await before.setLayers([{avatar: 1, layer: 'wave'}])).status, 'unsupported');
});

test('planting is switched for a list of avatars, on a server that knows it', async () => {
  const h = new Harness();
  const world = h.joined();
  void world.setPlanting([1, 7], false);
  void world.setPlanting([7], true);
  const sent = h.sent();
  assert.deepEqual(sent.map((m) => m.type === 'SetPlanting' && [[...m.avatars], m.off]),
                   [[[1, 7], true], [[7], false]]);
  for (const [avatars, on] of [[[], true], [[0], true], [[1], 1]]) {
    assert.equal((await world.setPlanting(avatars as never, on as never)).status, 'invalid_argument');
  }
  const old = new Harness();
  const before = old.joined({features: 2047n});
  assert.equal((await before.setPlanting([1], true)).status, 'unsupported');
});

test('levels of detail are asked of a server that knows them', async () => {
  const h = new Harness();
  const world = h.joined({features: 16_383n});
  void world.observe({mode: 'quantised', detail: 'fewer'});
  assert.deepEqual(h.sent().map((m) => m.type === 'Observe' && m.detail), ['fewer']);
  for (const features of [8191n, 16_383n - 4096n]) {
    const old = new Harness();
    const before = old.joined({features});
    assert.equal((await before.observe({mode: 'quantised', detail: 'root'}).reply).status, 'unsupported');
    assert.equal(old.sent().length, 0);
  }
});

test('rings of a region name their details, or have the observation\'s', async () => {
  const h = new Harness();
  h.connect({features: 32_767n});
  const world = h.session.joinWorld('plaza', 'observer');
  h.sent();
  h.receive(server.worldInfo(1n, 3, 'plaza'), server.reply(1n));
  const details = (): unknown => h.sent().map((m) => m.type === 'Observe' && [m.detail, m.region?.ringDetails]);
  const observed = world.observe({mode: 'quantised', detail: 'root', everyNTicks: 4, region: ringed('fewer')});
  assert.deepEqual(details(), [['root', ['fewer', 'root']]]);
  h.receive(server.reply(2n));
  // The rate of each detail, by the batches in which it comes.
  assert.deepEqual((['compact', 'compactFewer', 'compactRoot'] as const).map((mode) => world.everyNTicks(mode)),
                   [0, 1, 2]);
  void observed.moveRegion(ringed());
  assert.deepEqual(details(), [['root', []]]);
  void observed.moveRegion(ringed('all'));
  assert.deepEqual(details(), [['root', ['all', 'root']]]);
  assert.match((await observed.moveRegion(ringed('none' as 'all'))).text, /rings.detail\[0\]/);
  const old = new Harness();
  old.connect({features: 32_767n - 8192n});
  const before = old.session.joinWorld('plaza', 'observer');
  old.sent();
  old.receive(server.worldInfo(1n, 3, 'plaza'), server.reply(1n));
  assert.equal((await before.observe({mode: 'quantised', region: ringed('all')}).reply).status, 'unsupported');
  assert.equal(old.sent().length, 0);
});

test('who crosses a ring of a region goes on, live and recorded', () => {
  const h = new Harness({poseHistory: 64});
  const world = h.joined();
  const listed: number[] = [];
  world.on('avatars', (avatars) => listed.push(avatars.length));
  // Each tick a batch of each detail; 2 comes from the outer ring to the inner one, and then the outer one is empty.
  for (let tick = 60; tick < 80; ++tick) {
    const crossed = tick >= 70;
    h.receive(server.poseBatch({tick, partial: true},
                               [{avatar: 1, x: 1}, ...(crossed ? [{avatar: 2, x: tick}] : [])]));
    if (!crossed) {
      h.receive(server.poseBatch({tick, partial: true, quantised: true}, [{avatar: 2, x: tick}]));
    }
  }
  assert.deepEqual([...new Set(listed)], [1, 2]);
  const live = createCrowdPose();
  const recorded = createCrowdPose();
  for (const tick of [60, 65, 69, 70, 75, 79]) {
    for (const [source, out] of [[world, live], [world.recording, recorded]] as const) {
      assert.equal(source.sampleAll(tick / 60, out), 2);
      assert.deepEqual([...out.avatars.subarray(0, 2)], [1, 2]);
      assert.deepEqual([out.rootsM[0], out.rootsM[3]], [1, tick]);
    }
  }
});

test('a server of before is not asked for ground or footprints', async () => {
  const h = new Harness();
  const world = h.joined({features: 31n});
  assert.equal((await world.setTerrain(null)).status, 'unsupported');
  const step = {avatar: 1, type: 'step'} as const;
  assert.equal((await world.request([step, {...step, atM: [1, 0, 0]}])).status, 'unsupported');
  assert.deepEqual(h.sent(), []);
  void world.request([step]);
  assert.deepEqual(summary(h.sent()), ['Request 3']);
});
