import assert from 'node:assert/strict';
import {test} from 'node:test';
import WebSocket from 'ws';
import {Client} from '../src/client';
import type {ClientOptions} from '../src/client_types';
import {createCrowdPose, createPose} from '../src/pose_buffers';
import type {PoseMode, WorldEvent} from '../src/types';
import {ServerProcess, programs, run, until} from './support/server_process';

const skip = programs === undefined &&
  'set STRIDEWIRE_BIN to a folder of built programs, for example build/release/bin';
if (skip) console.log(`server.test.ts is skipped: ${skip}`);

function makeClient(server: ServerProcess, options: Partial<ClientOptions> = {}): Client {
  return new Client({
    url: server.url, webSocket: WebSocket, clientName: 'web-test', seed: 1, ...options
  });
}

const steps = (avatar: number, count: number) => Array.from({length: count}, (_, i) => ({
  avatar, requestId: 100 + i, type: 'step' as const, lengthM: 0.5, turnRad: 0.1
}));

for (const mode of ['full', 'quantised', 'movement'] as PoseMode[]) {
  test(`poses are the same as in the C++ client, ${mode}`, {skip}, async () => {
    const server = await ServerProcess.start();
    const client = makeClient(server, {poseHistory: 4096});
    try {
      client.connect();
      const world = client.joinWorld('plaza');
      const spawned = await world.spawn(
          [{avatar: 7, positionM: [3, 0, -2], headingRad: 1},
           {positionM: [0, 0, 0], headingRad: 0}]);
      assert.deepEqual(spawned.items.map((item) => item.code), [0, 0]);
      assert.ok((await world.observe({mode}).reply).ok);
      assert.ok((await world.request(steps(7, 8))).ok);
      const lines = (await run('web_pose_dump', [
        '127.0.0.1', `${server.port}`, 'plaza', '7', '120', mode === 'quantised' ? mode : 'full'
      ])).trim().split('\n').map((line) => line.split(' ').map(Number));
      // Evaluated poses equal the server's to the bit. The recording stores them compressed.
      const source = mode === 'movement' ? world : world.recording;
      const newest = createPose();
      await until('the last pose has arrived', () =>
          world.sample(7, Infinity, newest) !== 'missing' && newest.tick >= lines.at(-1)![0]!);
      const crowd = createCrowdPose();
      const joints = world.skeleton!.jointCount;
      let compared = 0;
      let moved = 0;
      for (const [, timeS, ...numbers] of lines) {
        assert.equal(source.sampleAll(timeS!, crowd), 2);
        const place = crowd.avatars.indexOf(7);
        const ours = [
          ...crowd.rootsM.subarray(3 * place, 3 * place + 3),
          ...crowd.rotations.subarray(4 * joints * place, 4 * joints * (place + 1))
        ];
        assert.equal(ours.length, numbers.length);
        assert.equal(crowd.flags[place]! & 4, 0, 'the pose is not held');
        ours.forEach((number, i) => {
          const theirs = Math.fround(numbers[i]!);
          assert.ok(mode === 'quantised' ? Math.abs(number - theirs) < 1e-6 : number === theirs,
                    `number ${i} at ${timeS}: ${number}, ${theirs}`);
        });
        ++compared;
        moved = Math.max(moved, Math.hypot(ours[0]! - 3, ours[2]! + 2));
      }
      assert.equal(compared, 120);
      assert.ok(moved > 0.5, `moved ${moved} m`);
      console.log(`${mode}: ${compared} poses of ${joints} joints are equal`);
    } finally {
      client.close();
      await server.kill();
    }
  });
}

test('poses have the requested detail and rate', {skip}, async () => {
  const server = await ServerProcess.start();
  const client = makeClient(server);
  try {
    client.connect();
    const world = client.joinWorld('plaza');
    // Standing avatars cause no traffic other than poses.
    assert.ok((await world.spawn(Array.from({length: 50}, (_, i) => (
        {avatar: i + 1, positionM: [i, 0, 0] as const, headingRad: 0})))).ok);
    const pose = createPose();
    let bytes = Infinity;
    for (const [detail, everyNTicks] of [['all', 1], ['reduced', 2], ['root', 4]] as const) {
      const observed = world.observe({mode: 'quantised', detail, everyNTicks});
      assert.ok((await observed.reply).ok);
      await until(`a pose of detail ${detail} has arrived`, () => {
        world.sample(1, Infinity, pose);
        return pose.detail === detail;
      });
      const ticks: number[] = [];
      await until('ten poses have arrived', () => {
        const kind = world.sample(1, Infinity, pose);
        if (kind !== 'missing' && pose.tick !== ticks.at(-1)) ticks.push(pose.tick);
        return ticks.length === 10;
      });
      // Polling may miss some ticks.
      for (const tick of ticks) assert.equal(tick % everyNTicks, 0, `${detail} at tick ${tick}`);
      assert.equal(pose.jointCount, world.skeleton!.jointCount);
      for (let j = 0; j < 4 * pose.jointCount; j += 4) {
        assert.ok(Math.abs(Math.hypot(...pose.rotations.subarray(j, j + 4)) - 1) < 1e-5);
      }
      const before = client.statistics;
      await until('500 more poses have arrived',
                  () => client.statistics.posesReceived >= before.posesReceived + 500);
      const after = client.statistics;
      const aPose = (after.poseBytesReceived - before.poseBytesReceived) /
          (after.posesReceived - before.posesReceived);
      assert.ok(aPose < bytes, `${detail}: ${aPose} bytes after ${bytes}`);
      bytes = aPose;
      assert.ok((await observed.stop()).ok);
    }
  } finally {
    client.close();
    await server.kill();
  }
});

test('a region contains the avatars inside it and can be moved', {skip}, async () => {
  const server = await ServerProcess.start();
  const client = makeClient(server);
  try {
    client.connect();
    const world = client.joinWorld('plaza');
    const spawned = await world.spawn(Array.from({length: 30}, (_, i) => (
        {avatar: i + 1, positionM: [i + 1, 0, 0] as const, headingRad: 0})));
    assert.equal(spawned.accepted, 30);
    const inside = new Set<number>();
    world.on('event', (event: WorldEvent) => {
      if (event.type === 'entered') inside.add(event.avatar);
      if (event.type === 'left') inside.delete(event.avatar);
    });
    const bad = world.observe({mode: 'quantised', region: {x: 0, z: 0, radiusM: -1}});
    assert.equal((await bad.reply).ok, false);
    const watched = world.observe({
      mode: 'quantised', everyNTicks: 3,
      region: {
        x: 10, z: 0, radiusM: 4.4, leaveMarginM: 1, rings: [{outerRadiusM: 2, everyNTicks: 1}]
      }
    });
    assert.ok((await watched.reply).ok);
    const contains = (first: number, last: number) => {
      const all = Array.from({length: last - first + 1}, (_, i) => first + i);
      return until(`avatars ${first} to ${last} are inside`, () =>
          String([...inside].sort((a, b) => a - b)) === String(all) &&
          String([...world.avatars()]) === String(all));
    };
    await contains(6, 14);
    assert.ok((await watched.moveRegion({x: 11, z: 0, radiusM: 4.4, leaveMarginM: 1})).ok);
    await contains(6, 15);
    // Without a margin, the server's default of 8 m applies.
    assert.ok((await watched.moveRegion({x: 27, z: 0, radiusM: 2.4})).ok);
    await contains(25, 29);
    assert.equal((await world.observe({mode: 'full'}).reply).ok, false);
  } finally {
    client.close();
    await server.kill();
  }
});

test('each ring of a region has its own detail', {skip}, async () => {
  const server = await ServerProcess.start();
  const client = makeClient(server);
  try {
    client.connect();
    const world = client.joinWorld('plaza');
    assert.ok((await world.spawn(Array.from({length: 30}, (_, i) => (
        {avatar: i + 1, positionM: [i + 1, 0, 0] as const, headingRad: 0})))).ok);
    const region = (x: number) => ({x, z: 0, radiusM: 100, rings: [
      {outerRadiusM: 10.5, everyNTicks: 1, detail: 'all' as const},
      {outerRadiusM: 20.5, everyNTicks: 2, detail: 'reduced' as const},
    ]});
    const watched = world.observe(
        {mode: 'quantised', detail: 'root', everyNTicks: 4, region: region(0)});
    assert.ok((await watched.reply).ok);
    const pose = createPose();
    const details = (all: number, reduced: number) => until(
        `${all} avatars have all joints and ${reduced - all} are reduced`, () => {
      for (let avatar = 1; avatar <= 30; ++avatar) {
        if (world.sample(avatar, Infinity, pose) === 'missing') return false;
        const expected = avatar <= all ? 'all' : avatar <= reduced ? 'reduced' : 'root';
        if (pose.detail !== expected) return false;
      }
      return true;
    });
    await details(10, 20);
    assert.ok((await watched.moveRegion(region(5))).ok);
    await details(15, 25);
    assert.equal(world.avatars().length, 30);
  } finally {
    client.close();
    await server.kill();
  }
});

test('requested steps start, land and finish, and can be inspected', {skip}, async () => {
  const server = await ServerProcess.start();
  const client = makeClient(server);
  try {
    client.connect();
    const world = client.joinWorld('plaza');
    const received: WorldEvent[] = [];
    world.on('event', (event) => received.push(event));
    await world.spawn([{avatar: 1, positionM: [0, 0, 0], headingRad: 0}]);
    void world.observe({mode: 'quantised'});
    const reply = await world.request(steps(1, 4));
    assert.equal(reply.accepted, 4);
    await until('a step has started', () => received.some(({type}) => type === 'started'));
    const state = await world.inspect(1);
    assert.ok(state.movement !== null);
    const {movement} = state;
    // Usually the first step; a later one if this process was slow.
    const place = Number(movement.requestId - 100n);
    assert.ok(place >= 0 && place < 3, `${movement.requestId}`);
    assert.equal(state.queueSize, 3 - place);
    assert.equal(state.queue[0]!.requestId, movement.requestId + 1n);
    assert.equal(state.queue[0]!.lengthM, 0.5);
    assert.ok(Math.abs(movement.weights.reduce((sum, w) => sum + w, 0) - 1) < 1e-3);
    assert.equal(movement.exampleParameters.length,
                 movement.weights.length * movement.parameterNames.length);
    assert.ok(state.timeS >= movement.startTimeS && state.timeS <= movement.endTimeS + 0.1);
    assert.ok(movement.keytimesS.length > 2);
    await assert.rejects(world.inspect(999), {status: 'no_such_avatar'});
    await until('the last step has finished', () => received.some(
        ({type, requestId}) => type === 'finished' && requestId === 103n));
    const finished =
        received.filter(({type, requestId}) => type === 'finished' && requestId !== 0n);
    assert.deepEqual(finished.map(({requestId}) => requestId), [100n, 101n, 102n, 103n]);
    assert.ok(received.some(({type, foot}) => type === 'footStrike' && foot !== null));
    const started = received.find(({type, requestId}) => type === 'started' && requestId === 100n)!;
    assert.ok(Math.abs(started.applied.turn! - 0.1) < 0.05, JSON.stringify(started.applied));
    // The delay adapts to the connection. A tick takes 17 ms.
    const renderS = client.renderTimeS()!;
    const delayS = client.serverTimeS()! - renderS;
    assert.ok(delayS > 0.01 && delayS < 1, `${delayS}`);
    assert.ok(Math.abs(client.statistics.renderDelayS - delayS) < 0.1);
    const crowd = createCrowdPose();
    assert.equal(world.sampleAll(renderS, crowd), 1);
    assert.equal((await world.spawn([{avatar: 1, positionM: [0, 0, 0], headingRad: 0}]))
                     .items[0]!.status, 'avatar_exists');
    assert.equal((await world.remove([1])).accepted, 1);
    await until('no avatar is left', () => world.avatars().length === 0);
    assert.equal(client.statistics.invalidFrames, 0);
  } finally {
    client.close();
    await server.kill();
  }
});

test('resumes lost connections and executes every command once', {skip}, async () => {
  const server = await ServerProcess.start();
  const sockets: WebSocket[] = [];
  class Cut extends WebSocket {
    constructor(url: string) {
      super(url);
      sockets.push(this);
    }
  }
  const client = makeClient(server, {webSocket: Cut});
  try {
    client.connect();
    const world = client.joinWorld('plaza');
    const spawned: number[] = [];
    world.on('event', (event) => {
      if (event.type === 'spawned') spawned.push(event.avatar);
    });
    void world.observe({mode: 'quantised'});
    await world.joined;
    const replies = [];
    for (let avatar = 1; avatar <= 60; ++avatar) {
      replies.push(world.spawn([{avatar, positionM: [avatar, 0, 0], headingRad: 0}]));
      if (avatar % 20 === 10) sockets.at(-1)!.terminate();
      await new Promise((resolve) => setTimeout(resolve, 5));
    }
    for (const reply of await Promise.all(replies)) {
      assert.deepEqual(reply.items.map((item) => item.status), ['ok']);
    }
    await until('all spawned events have arrived', () => spawned.length >= 60);
    assert.deepEqual([...spawned].sort((a, b) => a - b), Array.from({length: 60}, (_, i) => i + 1));
    await until('poses of all avatars have arrived', () => world.avatars().length === 60);
    const {resumes, reconnects} = client.statistics;
    assert.ok(resumes >= 1 && resumes === reconnects, `${resumes} of ${reconnects}`);
  } finally {
    client.close();
    await server.kill();
  }
});

test('spawns avatars again after a server was killed and restarted', {skip}, async () => {
  let server = await ServerProcess.start();
  const client = makeClient(server, {respawn: true});
  try {
    client.connect();
    const world = client.joinWorld('plaza');
    let lost = 0;
    client.on('sessionLost', () => ++lost);
    await world.spawn([1, 2, 3].map(
        (avatar) => ({avatar, positionM: [avatar, 0, 0], headingRad: 0})));
    void world.observe({mode: 'quantised'});
    await until('poses of all avatars have arrived', () => world.avatars().length === 3);
    const {port, httpPort} = server;
    await server.kill('SIGKILL');
    await until('the client has noticed the loss', () => client.state !== 'ready');
    assert.notEqual(client.lastError, '');
    server = await ServerProcess.start(port, httpPort);
    await until('all avatars are back', () => client.state === 'ready' && lost === 1 &&
        world.avatars().length === 3);
    const crowd = createCrowdPose();
    await until('all avatars can be sampled',
                () => world.sampleAll(client.renderTimeS() ?? 0, crowd) === 3);
    assert.deepEqual([...crowd.rootsM].filter((_, i) => i % 3 === 0 && i < 9).map(Math.round),
                     [1, 2, 3]);
    assert.ok((await world.request(steps(2, 1))).ok);
  } finally {
    client.close();
    await server.kill();
  }
});

test('uses the next address if a server does not answer or shuts down', {skip}, async () => {
  const gone = await ServerProcess.start();
  await gone.kill();
  const first = await ServerProcess.start();
  const second = await ServerProcess.start();
  const client = makeClient(first, {url: [gone.url, first.url, second.url]});
  const errors: string[] = [];
  client.on('error', (_code, text) => errors.push(text));
  try {
    client.connect();
    const world = client.joinWorld('plaza');
    assert.ok((await world.joined).ok);
    assert.ok(errors[0]!.startsWith(`${gone.url}: `), errors[0]);
    assert.equal(errors.length, 1);
    // Servers that shut down announce it to their clients, which then move to the next address.
    await first.kill('SIGTERM');
    await until('the client has moved', () => client.state === 'ready' && errors.length === 2);
    assert.ok(errors[1]!.startsWith(`${first.url}: `), errors[1]);
    await until('the world is joined again', () => world.state === 'joined');
    assert.ok((await world.spawn([{positionM: [0, 0, 0], headingRad: 0}])).ok);
  } finally {
    client.close();
    await first.kill();
    await second.kill();
  }
});

test('terrain is sent to all clients, and avatars walk on it', {skip}, async () => {
  const server = await ServerProcess.start();
  const builder = makeClient(server);
  const watcher = makeClient(server);
  try {
    builder.connect();
    watcher.connect();
    const mine = builder.joinWorld('plaza');
    const theirs = watcher.joinWorld('plaza', 'observer');
    assert.ok((await theirs.joined).ok);
    const terrain = {
      heightField: {
        originM: [-1, -1] as const, cellM: 0.5, columns: 2, rows: 3,
        heightsM: Float32Array.of(0, 0.25, 0.5, -0.25, 0, 1),
      },
      boxes: [{minM: [2, 2] as const, maxM: [3, 4] as const, heightM: 0.125}],
    };
    assert.ok((await mine.setTerrain(terrain)).ok);
    await until('both clients have the terrain',
                () => mine.terrain !== null && theirs.terrain !== null);
    assert.deepEqual(theirs.terrain, terrain);
    assert.equal((await theirs.setTerrain(null)).status, 'not_allowed');
    const high = {heightField: null, boxes: [{...terrain.boxes[0]!, heightM: 1e5}]};
    const refused = await mine.setTerrain(high);
    assert.equal(refused.status, 'out_of_range');
    assert.match(refused.text, /boxes\[0\]\.height_m/);
    assert.ok((await mine.setTerrain(null)).ok);
    await until('the terrain is flat again', () => theirs.terrain === null);

    await mine.spawn([{avatar: 1, positionM: [0, 0, 0], headingRad: 0}]);
    const strikes: (readonly number[])[] = [];
    mine.on('event', (event) => {
      if (event.type === 'footStrike') strikes.push(event.positionM);
    });
    const step =
        {avatar: 1, type: 'step', foot: 'left', atM: [0.1, 0, 0.45], headingRad: 0} as const;
    assert.deepEqual((await mine.request([step])).items, []);
    await until('the foot has landed', () => strikes.length > 0);
    assert.ok(Math.hypot(strikes[0]![0]! - 0.1, strikes[0]![2]! - 0.45) < 0.01, `${strikes[0]}`);

    const rejected: WorldEvent[] = [];
    const started: bigint[] = [];
    mine.on('event', (event) => {
      if (event.type === 'rejected') rejected.push(event);
      if (event.type === 'started') started.push(event.requestId);
    });
    const far = {avatar: 1, type: 'step', foot: 'right', lengthM: 2} as const;
    assert.deepEqual((await mine.request([
      {...far, requestId: 51}, {...far, requestId: 52, allowNearest: true},
    ])).items, []);
    await until('the second step has started', () => started.includes(52n));
    assert.equal(rejected.length, 1);
    const [{requestId, code, kind, foot, missedM, nearestLengthM}] = rejected as [WorldEvent];
    assert.deepEqual([requestId, code, kind, foot], [51n, 101, 'stepRight', 'right']);
    assert.ok(missedM > 0.2 && Math.abs(nearestLengthM + missedM - 2) < 1e-6, `${missedM}`);

    const arrived: (readonly number[])[] = [];
    mine.on('event', (event) => {
      if (event.type === 'finished' && event.kind === 'stand') arrived.push(event.basePositionM);
    });
    const walk = {
      avatar: 1, type: 'walk', atM: [0.8, 0, 1], headingRad: 0.5, waypointsM: [[0, 0, 0.9]]
    } as const;
    assert.deepEqual((await mine.request([walk])).items, []);
    await until('the walk has finished', () => arrived.length > 0);
    assert.ok(Math.hypot(arrived[0]![0]! - 0.8, arrived[0]![2]! - 1) < 0.01, `${arrived[0]}`);
  } finally {
    builder.close();
    watcher.close();
    await server.kill();
  }
});

test('reports in a readable sentence that there is no server', {skip}, async () => {
  const server = await ServerProcess.start();
  await server.kill();
  const client = makeClient(server);
  const errors: string[] = [];
  client.on('error', (code, text) => errors.push(`${code} ${text}`));
  client.connect();
  await until('two attempts have failed', () => errors.length >= 2);
  assert.equal(errors[0], '351 The connection failed.');
  assert.equal(client.lastError, 'The connection failed.');
  client.close();
  assert.equal(client.state, 'idle');
});
