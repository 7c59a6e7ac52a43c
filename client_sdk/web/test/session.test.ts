import assert from 'node:assert/strict';
import {test} from 'node:test';
import {Status} from '../src/status';
import type {Reply, WorldEvent} from '../src/types';
import {decodeMessage} from '../src/testing';
import * as server from './support/server_frames';
import {Harness, settled, statusOf, summary} from './support/session_harness';

test('sends commands in order once the world is joined', async () => {
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

test('resends unanswered commands unchanged after a resume', async () => {
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
  // The server had already executed command 3, so it replies twice. The caller sees one reply.
  h.receive(server.reply(3n), server.reply(3n), server.reply(5n, 400, [], 'full'));
  assert.deepEqual((await Promise.all(replies)).map(statusOf), ['ok', 'ok', 'limit_reached']);
  assert.equal(await settled(late), 'pending');
  assert.equal(h.session.statistics().commandsResent, 2);
  assert.equal(h.session.statistics().resumes, 1);
  assert.equal(h.lostSessions, 0);
});

test('the server executes each command once, however often the connection breaks', async () => {
  const h = new Harness();
  const world = h.joined();
  const done = new Map<bigint, number>();
  let last = 2n;
  // Like the server: executes command last + 1, and only replies to older ones.
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

test('restores worlds, subscriptions and avatars after a lost session', async () => {
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
  assert.equal(h.lostSessions, 1);
  assert.equal(statusOf(await open), 'session_lost');
  assert.equal(world.state, 'joining');
  assert.equal(world.avatars().length, 0);
  assert.ok(Number.isNaN(world.recording.lastTimeS));
  assert.deepEqual(summary(h.sent()), ['JoinWorld 1']);
  h.receive(server.worldInfo(1n, 4, 'plaza'), server.reply(1n));
  const anew = h.sent();
  assert.deepEqual(summary(anew), ['Observe 2', 'Spawn 3', 'CancelQueue 4']);
  const spawn = anew[1]!;
  assert.ok(spawn.type === 'Spawn' && spawn.world === 4);
  assert.deepEqual(spawn.items, [
    {avatar: 41, positionM: [5, 0, 6], headingRad: 0, teleport: false}]);
  // The server lost the session but not the world, so the avatar may still exist.
  h.receive(server.reply(2n), server.reply(3n, 0, [{index: 0, avatar: 41, code: 109}]),
            server.reply(4n));
  assert.equal(statusOf(await waiting), 'ok');
  assert.deepEqual(h.notices, []);
  // Ticks of the new session may start again from a smaller number.
  h.receive(server.poseBatch({world: 4, tick: 3}, [{avatar: 41, x: 2}]));
  assert.deepEqual([...world.avatars()], [41]);
});

test('a reply is not ok if an item was refused', async () => {
  const h = new Harness({respawn: true});
  const world = h.joined();
  const place = {positionM: [1, 0, 2] as const, headingRad: 0};
  const spawned = world.spawn([{...place, avatar: 7}, {...place, avatar: 8}]);
  h.sent();
  h.receive(server.reply(3n, 0, [
    {index: 0, avatar: 7}, {index: 1, avatar: 8, code: 109}], '', 1));
  const reply = await spawned;
  assert.deepEqual([reply.ok, reply.status, reply.accepted], [false, 'avatar_exists', 1]);
  assert.notEqual(reply.text, '');
  // A teleport changes where the avatar is spawned again.
  void world.spawn([{avatar: 7, positionM: [9, 0, 8], headingRad: 1, teleport: true}]);
  const [sent] = h.sent();
  assert.ok(sent?.type === 'Spawn' && sent.items[0]!.teleport);
  h.receive(server.reply(4n, 0, [{index: 0, avatar: 7}], '', 1));
  h.lose();
  h.connect({resumed: false, token: 8});
  h.sent();
  h.receive(server.worldInfo(1n, 4, 'plaza'), server.reply(1n));
  const again = h.sent().find(({type}) => type === 'Spawn');
  assert.ok(again?.type === 'Spawn');
  assert.deepEqual(again.items, [
    {avatar: 7, positionM: [9, 0, 8], headingRad: 1, teleport: false}]);
});

test('reports repeated events only once', () => {
  const h = new Harness();
  const world = h.joined();
  const received: WorldEvent[] = [];
  world.on('event', (event) => received.push(event));
  h.receive(server.events(1n, [{type: 'started', avatar: 1, requestId: 7n, timeS: 1}]),
            server.events(2n, [{type: 'finished', avatar: 1, requestId: 7n, timeS: 2}]));
  h.lose();
  const hello = h.connect({resumed: true});
  assert.ok(hello.type === 'Hello' && hello.lastEventsNumber === 2n);
  h.receive(server.events(2n, [{type: 'finished', avatar: 1, requestId: 7n, timeS: 2}]),
            server.events(3n, [{type: 'idle', avatar: 1, timeS: 3}]));
  assert.deepEqual(received.map(({type}) => type), ['started', 'finished', 'idle']);
  assert.deepEqual(world.recording.events(1.5, 9).map(({type}) => type), ['finished', 'idle']);
});

test('reconnects after an invalid frame', () => {
  const wrong: [string, ArrayBuffer][] = [
    ['a second Welcome', server.welcome()],
    ['bytes that are not a frame', new ArrayBuffer(40)],
    ['the wrong number of joints', server.poseBatch({tick: 1, joints: 3}, [{avatar: 1, x: 0}])],
    ['an invalid pose', server.poseBatch({tick: 1}, [{avatar: 1, x: NaN}])],
    ['a WorldInfo for another command', server.worldInfo(3n, 3, 'plaza')],
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

test('closes or reconnects depending on the code of a fatal error', async () => {
  for (const [code, state] of [
    [100, 'closed'], [103, 'closed'], [104, 'closed'], [200, 'closed'], [300, 'waiting'],
    [301, 'waiting'], [400, 'waiting'], [402, 'waiting'], [404, 'closed'],
  ] as const) {
    const h = new Harness();
    const world = h.joined();
    const open = world.request([{avatar: 1, type: 'stand', seconds: 1}]);
    h.receive(server.error(code, true, 'reason'));
    assert.equal(h.session.state, state, `${code}`);
    assert.equal(h.session.lastError, 'reason');
    const reply = await settled(open);
    assert.equal(reply === 'pending' ? 0 : reply.code, state === 'closed' ? code : 0);
  }
  const h = new Harness();
  const world = h.joined();
  h.receive(server.error(400, false, 'for information'));
  assert.equal(h.session.state, 'ready');
  assert.deepEqual(h.notices, ['400 for information']);
  // Goodbye ends the session, so the next Hello has no resume token.
  h.receive(server.goodbye(402));
  assert.equal(h.session.state, 'waiting');
  const hello = h.connect();
  assert.ok(hello.type === 'Hello' && hello.resumeToken.length === 0);
  assert.equal(h.lostSessions, 1);
  assert.equal(world.state, 'joining');
});

test('doubles the reconnect delay up to a limit, with jitter', () => {
  const h = new Harness();
  h.session.open(h.nowS);
  const waits: number[] = [];
  for (let i = 0; i < 12; ++i) {
    assert.ok(h.session.network(h.nowS).connectDue);
    h.session.startConnecting(h.nowS);
    h.session.onLost(Status.connect_failed, '', h.nowS);
    const waitS = h.session.network().nextTimeS - h.nowS;
    const most = Math.min(0.1 * 2 ** i, 5);
    assert.ok(waitS >= most / 2 - 1e-9 && waitS <= most + 1e-9, `${i}: ${waitS}`);
    waits.push(waitS / most);
    assert.ok(!h.session.network(h.nowS + waitS - 0.001).connectDue);
    h.nowS += waitS + 0.001;
  }
  assert.equal(new Set(waits).size, waits.length);
  // A connection of less than 2 s does not reset the delay; a longer one does.
  h.connect();
  h.nowS += 1;
  h.lose();
  assert.ok(h.session.network().nextTimeS - h.nowS > 2);
  h.connect();
  h.nowS += 3;
  h.lose();
  assert.ok(h.session.network().nextTimeS - h.nowS <= 0.1);
});

test('times out if the server is silent, and pings before its idle timeout', () => {
  const h = new Harness({pingIntervalS: 20});
  h.session.open(h.nowS);
  h.session.startConnecting(h.nowS);
  h.nowS += 5.01;
  h.session.advanceTime(h.nowS);
  assert.equal(h.session.state, 'waiting');
  h.connect({idleTimeoutS: 6});
  const pings = (): number => h.session.takeOutput()
      .filter((frame) => decodeMessage(frame, 'client').type === 'Ping').length;
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

test('limits unanswered commands and waiting commands', async () => {
  const h = new Harness({maxCommands: 10});
  const world = h.joined({replyMemory: 4});
  const replies = Array.from({length: 12}, () => world.remove([1]));
  assert.equal(h.sent().length, 4);
  assert.equal(statusOf(await settled(replies[10]!)), 'commands_full');
  h.receive(server.reply(3n), server.reply(4n));
  assert.equal(h.sent().length, 2);
});

test('answers every command, even if very many end at once', async () => {
  const h = new Harness({maxCommands: 70_000});
  h.session.open(h.nowS);
  const world = h.session.joinWorld('plaza', 'controller');
  const counts = new Map<string, number>();
  for (let i = 0; i < 69_999; ++i) {
    void world.remove([1]).then(({status}) => counts.set(status, (counts.get(status) ?? 0) + 1));
  }
  h.session.close(h.nowS);
  await settled(world.joined);
  assert.deepEqual([...counts], [['cancelled', 69_999]]);
});

test('rejects a message above the size limit of the server without a gap in seq', async () => {
  const h = new Harness();
  const world = h.joined({maxBulkBytes: 4096});
  const big = world.remove(Array.from({length: 5000}, (_, i) => i + 1));
  const small = world.remove([1]);
  assert.deepEqual(summary(h.sent()), ['Remove 3']);
  assert.equal(statusOf(await big), 'limit_reached');
  assert.equal(await settled(small), 'pending');
});

test('fails the waiting commands of a refused world', async () => {
  const h = new Harness();
  h.connect();
  const world = h.session.joinWorld('nowhere', 'controller');
  const spawned = world.spawn([{positionM: [0, 0, 0], headingRad: 0}]);
  h.sent();
  h.receive(server.reply(1n, 107, [], 'no world of that name'));
  assert.equal(world.state, 'refused');
  assert.equal((await world.joined).text, 'no world of that name');
  assert.equal(statusOf(await spawned), 'not_joined');
  assert.equal(statusOf(await world.request([{avatar: 1, type: 'stand'}])), 'not_joined');
  assert.equal(h.session.joinWorld('nowhere', 'controller').state, 'joining');
});

test('only the command that a Reply answers gets its fields', async () => {
  const h = new Harness();
  const world = h.joined();
  h.lose();
  h.connect({resumed: false, token: 8});
  const waiting = world.spawn([{positionM: [0, 0, 0], headingRad: 0}]);
  assert.deepEqual(summary(h.sent()), ['JoinWorld 1']);
  // The session itself has joined the world again, so the command that waits for it is the only one
  // to be answered.
  h.receive(server.reply(1n, 107, [{index: 0, avatar: 41}], 'no world of that name', 1));
  const reply = await waiting;
  assert.equal(reply.status, 'not_joined');
  assert.equal(reply.accepted, 0);
  assert.deepEqual(reply.items, []);
});

test('leaves a world and can join it again', async () => {
  const h = new Harness();
  const world = h.joined();
  const left = world.leave();
  assert.deepEqual(summary(h.sent()), ['LeaveWorld 3']);
  h.receive(server.reply(3n));
  assert.equal(statusOf(await left), 'ok');
  assert.equal(world.state, 'left');
  assert.equal(statusOf(await world.remove([1])), 'not_joined');
  assert.equal(h.session.joinWorld('plaza', 'observer').state, 'joining');
});

test('leaves a world before the client is connected', async () => {
  const h = new Harness();
  h.session.open(h.nowS);
  const world = h.session.joinWorld('plaza', 'controller');
  const states: string[] = [];
  world.on('state', (state) => states.push(state));
  assert.equal(statusOf(await settled(world.leave())), 'ok');
  assert.equal(statusOf(await settled(world.joined)), 'not_joined');
  assert.equal(world.state, 'left');
  assert.deepEqual(states, ['left']);
  assert.equal(h.session.joinWorld('plaza', 'observer').state, 'pending');
});

test('a subscription can be stopped again if the command was refused', async () => {
  const h = new Harness({maxCommands: 2});
  const world = h.joined();
  const subscription = world.observe({mode: 'full'});
  const [observe] = h.sent();
  assert.ok(observe?.type === 'Observe');
  h.receive(server.reply(observe.seq));
  void world.remove([1]);
  void world.remove([2]);
  assert.equal(statusOf(await settled(subscription.stop())), 'commands_full');
  for (const message of h.sent()) {
    if ('seq' in message) h.receive(server.reply(message.seq));
  }
  const stopped = subscription.stop();
  assert.deepEqual(summary(h.sent()), ['StopObserving 6']);
  h.receive(server.reply(6n));
  assert.equal(statusOf(await settled(stopped)), 'ok');
});

test('close cancels commands, sends Goodbye and allows a new connection', async () => {
  const h = new Harness();
  const world = h.joined();
  const open = world.remove([1]);
  h.sent();
  h.session.close(h.nowS);
  assert.equal(statusOf(await open), 'cancelled');
  assert.equal(h.session.state, 'closing');
  assert.deepEqual(summary(h.sent()), ['Goodbye']);
  h.session.onOutputWritten();
  assert.equal(h.session.state, 'idle');
  assert.equal(statusOf(await world.remove([1])), 'closed');
  const hello = h.connect();
  assert.ok(hello.type === 'Hello' && hello.resumeToken.length === 0);
  assert.deepEqual(summary(h.sent()), ['JoinWorld 1']);
  h.receive(server.worldInfo(1n, 3, 'plaza'), server.reply(1n));
  assert.deepEqual(summary(h.sent()), ['Observe 2']);
  assert.equal(h.lostSessions, 0);
});

test('worlds and subscriptions change while the client is closed', async () => {
  const h = new Harness();
  const plaza = h.session.joinWorld('plaza', 'controller');
  const yard = h.session.joinWorld('yard', 'observer');
  assert.deepEqual([plaza.state, yard.state], ['pending', 'pending']);
  const kept = plaza.observe({mode: 'full'});
  const stopped = plaza.observe({mode: 'full'});
  assert.equal(statusOf(await settled(stopped.stop())), 'ok');
  assert.equal(statusOf(await settled(stopped.reply)), 'cancelled');
  assert.equal(statusOf(await settled(stopped.stop())), 'no_such_subscription');
  assert.equal(statusOf(await settled(yard.leave())), 'ok');
  assert.equal(yard.state, 'left');
  assert.equal(statusOf(await settled(yard.observe({mode: 'full'}).reply)), 'not_joined');
  assert.equal(await settled(kept.reply), 'pending');
  h.connect();
  assert.deepEqual(summary(h.sent()), ['JoinWorld 1']);
  h.receive(server.worldInfo(1n, 3, 'plaza'), server.reply(1n));
  const sent = h.sent();
  assert.deepEqual(sent.map((m) => m.type === 'Observe' && m.subscription), [kept.id]);
  h.receive(server.reply(2n));
  assert.equal(statusOf(await kept.reply), 'ok');
});

test('listeners may call the session, and their exceptions are reported as uncaught', () => {
  const h = new Harness();
  const world = h.joined();
  const uncaught: (() => void)[] = [];
  const {queueMicrotask} = globalThis;
  globalThis.queueMicrotask = (call) => void uncaught.push(call);
  let received = 0;
  world.on('event', () => {
    throw new Error('of the listener');
  });
  world.on('event', (event) => {
    ++received;
    void world.request([{avatar: event.avatar, type: 'jump', lengthM: 1}]);
    h.session.close(h.nowS);
  });
  h.receive(server.events(1n, [{type: 'idle', avatar: 1}, {type: 'idle', avatar: 2}]));
  globalThis.queueMicrotask = queueMicrotask;
  assert.equal(received, 2);
  assert.equal(h.session.state, 'closing');
  assert.deepEqual(summary(h.sent()), ['Request 3', 'Goodbye']);
  assert.equal(uncaught.length, 2);
  assert.throws(uncaught[0]!, /of the listener/);
});
